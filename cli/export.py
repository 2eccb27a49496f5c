"""`towline export`: a robot for other programs."""

from pathlib import Path
from typing import Annotated

import typer

from ..base.inputs import check_ending
from .options import JsonOption, RobotArgument, print_result
from .outputs import check_outputs


def export(
    robot: RobotArgument,
    mjcf: Annotated[bool, typer.Option("--mjcf", help="Write a MuJoCo model.")] = False,
    c_code: Annotated[
        bool, typer.Option("--c", help="Write the functions of the dynamics as C code without dependencies.")
    ] = False,
    step: Annotated[
        Path | None,
        typer.Option(
            "--step", metavar="DIR", help="Write a control step as C, from state to tensions, into this new folder."
        ),
    ] = None,
    single: Annotated[bool, typer.Option("--float", help="With --step: compute in float instead of double.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help="File to write; default: ROBOT.xml or ROBOT.c in this folder, from the robot's `name`.",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Export a robot as a MuJoCo model (--mjcf), its dynamics as C code (--c), or a control step as C code (--step)."""
    from ..base.errors import InputError
    from ..base.writing import whole_file
    from ..models import load

    if mjcf + c_code + (step is not None) != 1:
        raise InputError("export requires exactly one of --mjcf, --c and --step")
    if single and step is None:
        raise InputError("--float must be left out without --step")
    if out is not None and step is not None:
        raise InputError("--out must be left out with --step, which names the folder")
    loaded = load(robot)
    if step is not None:
        from ..export.step import export_step

        folder = export_step(loaded, step, "float" if single else "double")
        files = {"folder": folder, "files": sorted(folder.iterdir())}
        print_result(as_json, {"robot": loaded.name, **files}, lambda: str(folder))
        return
    ending = ".xml" if mjcf else ".c"
    path = out if out is not None else Path(f"{loaded.name}{ending}")
    check_outputs({"--out": check_ending("--out", path, ending)})
    if mjcf:
        from ..export.mjcf import to_mjcf

        text = to_mjcf(loaded)
    else:
        from ..models.c_code import to_c

        text = to_c(loaded)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print_result(as_json, {"robot": loaded.name, "file": path}, lambda: str(path))
