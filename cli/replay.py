"""Replay a recording, for `towline simulate ROBOT LOG`."""

from pathlib import Path
from typing import Any

import typer

from ..base.errors import InputError
from ..base.inputs import check_ending
from .options import print_result
from .outputs import check_outputs


def replay_log(
    robot: Any,
    log: Path,
    options: dict[str, Any],
    files: dict[str, Path | None],
    figures: Path | None,
    form: str,
    as_json: bool,
) -> None:
    """Replay, save, draw and print; the exit code is 1 if the replay fails, or the fitted robot is not written."""
    from ..models import load
    from ..simulation import replay

    loaded, fit, page = load(robot), files["--fit"], files["--report"]
    target = check_ending("--out", files["--out"] or Path(f"{log.stem}-replay.nc"), ".nc")
    if fit is not None:
        check_ending("--fit", fit, ".yaml", ".yml")
    outputs = {**files, "--out": target, "--figures": figures and figures / f"replay.{form}"}
    check_outputs(outputs, {"the log": log, "--poses": options["poses"]})
    try:
        result = replay(loaded, log, fit=fit is not None, **options)
    except InputError as error:
        option = "--" * str(error).startswith(("drive ", "delay ", "window ", "tolerance "))
        raise InputError(f"{option}{error}") from None
    written = {"file": result.save(target)}
    if page is not None:
        written["report"] = result.save_report(page)
    if fit is not None and not result.refused:
        written["robot_file"] = result.save_robot(fit)
    pictures = [] if figures is None else result.plot(figures, form)
    data = {**result.to_dict(), **written, "figures": pictures}
    print_result(as_json, data, result.report, (*written.values(), *pictures))
    if fit is not None and result.refused:
        typer.echo(f"towline: {fit} is not written: {result.refused}", err=True)
    if not result.passed or (fit is not None and result.refused):
        raise typer.Exit(1)
