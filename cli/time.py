"""`towline time`: the fastest time law along a task's path."""

from pathlib import Path

import typer

from ..base.inputs import check_ending
from .options import JsonOption, ReportOption, RobotArgument, parameters, usual_file
from .outputs import Outputs, check_outputs


@parameters("""
    TASK: A task file (YAML).
    --out: Task file to write; default: ROBOT-TASK-timed.yaml in this folder, from the `name` keys of both files. An
        existing file is overwritten.
    --grid: Initial number of intervals of the path; refined if necessary.
""")
def time(
    robot: RobotArgument,
    task: Path,
    out: Path | None = None,
    grid: int = 200,
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Find the fastest motion along a task's path with every tension inside its limits.

    It uses these keys of the task: `path`, `base` (hold or given), `margin`, and in `limits` the speeds of platform
    (also zone_speed), cables and carriers, their accelerations, winch_power and platform_lateral_acceleration.
    `duration` is ignored, except for circles. `wind: [0, 0, 0]` includes the drag of still air; without `wind`
    there are no aerodynamic forces. Any other wind or limit, a tube, a free base, `phases`, `initial`, `final`,
    `robust` or `stop_within` is an error.

    The motion is audited like every plan. The result is a task file that contains the time law, and `towline plan`
    reads it like any other task. The exit code is 1 if no motion is found.
    """
    from ..models import load
    from ..ocp import read_task, time_along

    loaded, read = load(robot), read_task(task)
    target = out if out is not None else usual_file(loaded.name, read.name, "timed.yaml")
    check_outputs({"--out": check_ending("--out", target, ".yaml", ".yml"), "--report": report})
    found = time_along(loaded, read, grid=grid)
    written = {}
    if found.feasible:
        written["file"] = found.scenario.task.model_copy(update={"name": f"{read.name[:54]}-timed"}).save(target)
    outputs = Outputs(as_json, report=report)
    outputs.show(found, written, outputs.write(found, written), file=None)
    if not found.feasible:
        raise typer.Exit(1)
