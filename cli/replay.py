"""Replay a recording, for `towline simulate ROBOT LOG`."""

from pathlib import Path
from typing import Any

import typer

from ..base.errors import InputError
from ..base.inputs import check_ending
from .outputs import Outputs, check_outputs


def replay_log(
    robot: Any, log: Path, options: dict[str, Any], out: Path | None, fit: Path | None, outputs: Outputs
) -> None:
    """Replay, save, draw and print; the exit code is 1 if the replay fails, or the fitted robot is not written."""
    from ..models import load
    from ..simulation import replay

    loaded, target = load(robot), check_ending("--out", out or Path(f"{log.stem}-replay.nc"), ".nc")
    if fit is not None:
        check_ending("--fit", fit, ".yaml", ".yml")
    files = {"--out": target, "--fit": fit, "--report": outputs.report, "--figures": outputs.picture("replay")}
    check_outputs(files, {"the log": log, "--poses": options["poses"]})
    try:
        result = replay(loaded, log, fit=fit is not None, **options)
    except InputError as error:
        option = "--" * str(error).startswith(("drive ", "delay ", "window ", "tolerance "))
        raise InputError(f"{option}{error}") from None
    written = {"file": result.save(target)}
    if fit is not None and not result.refused:
        written["robot_file"] = result.save_robot(fit)
    outputs.show(result, written, outputs.write(result, written))
    if fit is not None and result.refused:
        typer.echo(f"towline: {fit} is not written: {result.refused}", err=True)
    if not result.passed or (fit is not None and result.refused):
        raise typer.Exit(1)
