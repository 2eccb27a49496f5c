"""`towline calibrate`: geometric calibration from a log of cable lengths."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import typer

from ..base.inputs import InputError, check_ending
from .log import FieldsOption, FixOption
from .options import FormatOption, JsonOption, ReportOption, RobotArgument, parameters
from .outputs import Outputs, check_outputs


@parameters("""
    LOG: Log of lengths and, if known, poses, tensions and times: NetCDF, MCAP, a ROS bag, or CSV with a header such as
        't [s], l0 [m], l1 [m], x [mm], y [mm], z [mm], roll [deg], pitch [deg], yaw [deg]'. Several logs
        of one motion are accepted, such as one for each computer; the log of a carrier is named after it, as quad1.csv.
    --poses LOG: Log of the poses, if they are in another file; its clock is aligned by comparing cable speeds.
    --free NAMES: Parameters to estimate, separated by commas: anchors, attachments, offsets, scales, radii, build-up,
        clock, frame and body (of measured poses), com, elasticity; with tensions also mass, stiffness, capstan,
        friction, gains, zeros; or auto. Default: anchors, offsets, and clock if the log records times and poses of a
        motion.
    --prior NAME=SIGMA,...: Standard deviations of the file's values, in their units, such as
        'anchors=0.02,offsets=0.05'; default: unobservable directions stay as close to the file as possible.
    --sigma SIGMA|NAME=SIGMA,...: Standard deviation of the lengths [m], or of lengths [m], position [m], rotation
        [rad], tensions (relative), directions [rad] and clocks of carriers [s], such as 'lengths=0.001,tensions=0.05';
        default: those in the log; without them, lengths=0.001,tensions=0.02,directions=0.02 and exact poses.
    --outliers/--no-outliers: Detect outliers and slipped winches.
    --out FILE.yaml: Robot file to write; default: ROBOT-calibrated.yaml in this folder.
    --figures FOLDER: Folder for figures of residuals, anchors and standard deviations.
""")
def calibrate(
    robot: RobotArgument,
    logs: list[Path],
    poses: Path | None = None,
    fields: FieldsOption = None,
    free: str | None = None,
    prior: str | None = None,
    sigma: str | None = None,
    outliers: bool = True,
    fix: FixOption = False,
    out: Path | None = None,
    figures: Path | None = None,
    form: FormatOption = "png",
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Estimate anchors, offsets and more from measured cable lengths, and write a calibrated robot file.

    The file includes the covariance of its new parameters. Carriers are taken to be at their recorded poses, or at
    home if the log has none. A result that should not be used is not written, and the exit code is then 1: for example,
    if the log probably has an input error (order of cables, units, conventions of angles, frames), the fit did not
    converge, or validation samples fit worse than with the robot's file. --fix corrects input errors of the log.
    """
    from ..estimation.calibration import calibrate as find
    from ..estimation.calibration.correction import corrected_log
    from ..estimation.calibration.enough import usual
    from ..estimation.logs import read_log
    from ..models import load

    names = None if free is None else [name.strip() for name in free.split(",")]
    stated = None if sigma is None else _sigma(sigma)
    known = None if prior is None else by_name("--prior", prior)
    loaded = given = load(robot)
    target = out if out is not None else Path(f"{loaded.name}-calibrated.yaml")
    outputs = Outputs(as_json, figures, form, report)
    files = {"--out": target, "--report": report, "--figures": outputs.picture("residuals")}
    check_outputs(files, {**{f"the log {log}": log for log in logs}, "--poses": poses})
    check_ending("--out", target, ".yaml", ".yml")
    read = read_log(logs, stated, poses, loaded, fields)
    if fix:
        read, correction = corrected_log(loaded, read)
        loaded = correction.robot
        if correction.counted and names is None:
            names = [*usual(loaded, read.measurements), "scales"]
    measurements, notes = read.measurements, read.notes
    del read  # with the files
    if not as_json:
        for note in notes:
            typer.echo(f"  {note}")
    result = find(loaded, measurements, "auto" if names == ["auto"] else names, known, outliers)
    result.report()  # computes what it needs, before anything is written
    # The encoders of the corrected robot are right, whether or not other parameters improve it.
    kept = bool(result.refused) and result.means_something and loaded.cables != given.cables
    refused = None if kept else result.refused
    written = {} if refused else {"file": loaded.save(target) if kept else result.save(target)}
    outputs.show(result, written, outputs.write(result, written), notes=notes, file=None)
    if kept:
        typer.echo("towline: only the encoders of the file are corrected: other parameters do not improve it", err=True)
    if refused:
        hint = "; --fix corrects it" if result.doubt and result.mistake and result.mistake.corrected else ""
        typer.echo(f"towline: {target} is not written: {refused}{hint}", err=True)
        raise typer.Exit(1)


def _sigma(text: str) -> Any:
    if "=" in text:
        from ..estimation.logs import Sigma

        return by_name("--sigma", text, Sigma._fields)
    try:
        return float(text)
    except ValueError:
        raise InputError(
            f"--sigma must be a number [m], or NAME=NUMBER of lengths, position, rotation, tensions, directions, "
            f"clocks, got {text!r}"
        ) from None


def by_name(option: str, text: str, known: Collection[str] = ()) -> dict[str, float]:
    """Read "anchors=0.02,offsets=0.05" as a mapping; its names must be `known` if any are.

    Raises `InputError` if the text is anything else.
    """
    result: dict[str, float] = {}
    for part in text.split(","):
        name, _, value = part.partition("=")
        if name.strip() in result:
            value = ""
        try:
            result[name.strip()] = float(value)
        except ValueError:
            accepted = "NAME=NUMBER, separated by commas, each name once"
            raise InputError(f"{option} must be {accepted}, got {text!r}") from None
    if known and (others := [name for name in result if name not in known]):
        raise InputError(f"{option} must name some of {', '.join(known)}, got {others[0]!r}")
    return result
