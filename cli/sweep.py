"""The sweeps of `towline plan --vary`: many plans, one table and one figure."""

from pathlib import Path
from typing import Any

import typer

from ..base.errors import InputError
from ..base.inputs import check_ending
from ..base.processors import one_thread_each
from .options import print_result, usual_file
from .outputs import Outputs, check_outputs
from .resuming import resumable
from .stopping import add_to_message
from .watching import counting


@one_thread_each()  # before libraries load: a plan must not depend on the number of threads, nor on that of processes
def sweep(robot: str, task: Path, vary: list[str], where: dict[str, Any], out: Path | None, outputs: Outputs) -> None:
    """Plan all combinations, save, draw and print the table; the exit code is 1 if no plan is feasible.

    `where` has options of `ocp.sweep`: the workers, the checkpoint, and the folder of plans to keep.
    """
    from ..models import load
    from ..ocp import read_task
    from ..ocp import sweep as sweep_plans
    from ..ocp.sweeps.axis import check_figure, read_axes, read_option

    loaded, read, picture = load(robot), read_task(task), outputs.picture("sweep")
    varied = read_option(vary)
    target = out if out is not None else usual_file(loaded.name, read.name, "sweep.nc")
    if target.suffix == ".csv":
        raise InputError(f"--out must be a NetCDF file (.nc), got {target}")
    check_ending("--out", target, ".nc")
    if picture is not None:
        check_figure(read_axes(varied))
    table = {"--out": target, "the CSV file of --out": target.with_suffix(".csv")}
    check_outputs({"the checkpoint": where["checkpoint"], **table, "--figures": picture})
    with counting(f"planning {read.name}", "feasible", quiet=outputs.as_json) as show:
        result = sweep_plans(loaded, read, varied, **where, progress=resumable(show, where["checkpoint"], "plans"))
    add_to_message("")
    files = list(result.save(target))
    written = {"file": files[0], "csv": files[1], "figure": picture, "plans_in": where["keep"]}
    if picture is not None:
        from ..figures import style

        files.append(style.save(result.figure(), picture))
    data, folder = {**result.to_dict(), **written}, where["keep"]
    print_result(outputs.as_json, data, result.report, [*files, *([folder] if folder else [])])
    if not result.feasible:
        raise typer.Exit(1)
