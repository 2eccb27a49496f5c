"""`towline design`: anchors, attachments and tension limits that meet requirements."""

from pathlib import Path
from typing import Annotated

import typer

from ..base.inputs import InputError, check_ending
from .options import FormatOption, JsonOption, ReportOption, RobotArgument, parameters, schema_option, usual_file
from .outputs import Outputs, check_outputs
from .stopping import requested, unlisten
from .watching import progress_bar


@parameters("""
    REQUIREMENTS: A requirement file (YAML): what is free, poses and wrenches.
    --out FILE.yaml: Robot file to write, if the requirements are met; default: ROBOT-REQUIREMENTS.yaml in this folder,
        from the `name` keys of both files. An existing file is overwritten.
    --seconds: Time of the search [s]; default: `time_limit` of the requirements, or 10.
    --seed: Seed of the random numbers; default: `seed` of the requirements, or 0.
    --figures FOLDER: Folder for figures of the robot: before.png and after.png.
""")
def design(
    robot: RobotArgument,
    requirements: Path,
    out: Path | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    figures: Path | None = None,
    form: FormatOption = "png",
    report: ReportOption = None,
    as_json: JsonOption = False,
    schema: Annotated[bool, schema_option("requirement files", "layout", "Requirements")] = False,
) -> None:
    """Find the best anchors, attachments and tension limits, and report what limits them.

    The best layout has the largest capacity margin, unless the requirements name another objective: the weakest
    winches, the lowest cost, the largest volume or the highest natural frequency.

    The exit code is 1 if no layout that meets the requirements was found, or if none exists, which is then proven.
    Ctrl-C ends the search with the best layout so far.
    """
    from ..layout import Requirements, design as find, read_requirements
    from ..models import load
    from ..models.parsing import validate

    loaded, read = load(robot), read_requirements(requirements)
    given = {"time_limit": seconds, "seed": seed}
    changed = {key: value for key, value in given.items() if value is not None}
    if changed:
        read = validate(read.model_dump() | changed, Requirements, "--seconds or --seed")
    target = out if out is not None else usual_file(loaded.name, f"{read.name}.yaml")
    check_ending("--out", target, ".yaml", ".yml")
    outputs = Outputs(as_json, figures, form, report)
    check_outputs({"--out": target, "--report": report, "--figures": outputs.picture("before")})
    unlisten()  # an interrupt ends the search, not the command
    with progress_bar(f"design of {read.name}", quiet=as_json) as move:

        def progress(what: str, share: float, best: float) -> None:
            known = f"best margin {best:.4g} N" if best > -1e30 else ""
            move(what, round(100 * share), 100, known)

        try:
            found = find(loaded, requirements=read, progress=progress)
        except InputError as error:  # what does not fit the robot
            raise InputError(f"{requirements}: {error}") from None
    if requested():  # SIGTERM, which ends the command
        raise KeyboardInterrupt
    written = {"file": found.robot.save(target)} if found.feasible else {}
    outputs.show(found, written, outputs.write(found, written), file=None)
    if not found.feasible:
        raise typer.Exit(1)
