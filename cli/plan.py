"""`towline plan`: a trajectory for a robot and a task file, and sweeps of many with `--vary`."""

from pathlib import Path
from typing import Annotated, Any

import typer

from ..base.inputs import InputError, check_ending, shown
from ..base.processors import one_thread_each
from . import options
from .outputs import Outputs, check_outputs
from .stopping import add_to_message
from .watching import checkpoint_of, counting, long_run, resumable, watching


@options.parameters(f"""
    TASK: A task file (YAML).
    --out: NetCDF (.nc) or MCAP (.mcap) file to write; default: ROBOT-TASK.nc in this folder, from the `name` keys of
        both files, and ROBOT-TASK-infeasible.nc or ROBOT-TASK-not-found.nc if the plan is not feasible. An existing
        file is overwritten.
    --figures: Folder for figures: views.png, tensions.png and, if applicable, path.png, base.png (carriers), limits.png
        and convergence.png.
    --animate: File for a film of the motion: .gif, or .mp4 with ffmpeg.
    --robust SHARE: The tension limits must hold for this fraction, such as 0.95, of all robots within the
        uncertainty of the robot file; default: the task's value.
    --vary KEY=VALUES: Plan once per value of a field: 'margin=0:20:5' (start:stop:step), 'duration=4,6,8',
        'scheme=linear,hermite'. KEY is a dotted key of the task, such as tube.position, or of the robot, such as
        robot.platform.mass. 'robot.cables[2].t_max=5000,cut' plans with the third cable and without it.
        'robot=cogiro,my.yaml' and 'task=a.yaml,b.yaml' vary the whole robot or task. Repeat the option to plan all
        combinations. Writes one table instead of one plan: --out names its NetCDF file, and a CSV file of the same name
        is written too (default: ROBOT-TASK-sweep.nc). --figures draws sweep.png with feasibility, cost and margin. The
        exit code is 1 if no plan is feasible.
{long_run("With --vary: ")}
    --keep FOLDER: With --vary: folder in which to save every plan (NetCDF).
""")
def plan(
    robot: options.RobotArgument,
    task: Path,
    out: Path | None = None,
    figures: Path | None = None,
    form: options.FormatOption = "png",
    report: options.ReportOption = None,
    animate: Path | None = None,
    speed: options.SpeedOption = options.SPEED,
    fps: options.FpsOption = options.FPS,
    robust: float | None = None,
    vary: list[str] | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    checkpoint: Path | None = None,
    resume: Path | None = None,
    keep: Path | None = None,
    as_json: options.JsonOption = False,
    schema: Annotated[bool, options.schema_option("task files", "ocp", "Task")] = False,
) -> None:
    """Plan a motion that keeps every tension inside its limits, or report why none exists.

    With --vary it plans once per combination of the given values, and writes a table.
    """
    options.check_animation(animate, speed, fps)
    outputs = Outputs(as_json, figures, form, report, animate, speed, fps)
    if vary:
        for name, value in (("--report", report), ("--animate", animate), ("--robust", robust)):
            if value is not None:
                instead = (
                    "the task's key robust applies to all plans" if name == "--robust" else "--keep saves the plans"
                )
                raise InputError(f"{name} must be left out with --vary, got {shown(str(value))}; {instead}")
        where = {"workers": workers, "scheduler": scheduler, "checkpoint": checkpoint_of(checkpoint, resume)}
        where |= {"resume": resume is not None, "keep": keep}
        sweep(robot, task, vary, where, out, outputs)
        return
    many = {"--workers": workers != 1, "--scheduler": scheduler, "--checkpoint": checkpoint}
    when = "without --vary: it is an option for many plans"
    options.left_out({**many, "--resume": resume, "--keep": keep}, when, got=False)
    from ..models import load
    from ..ocp import plan as plan_motion, read_task

    loaded, read = load(robot), read_task(task)
    target = check_ending("--out", out or options.usual_file(loaded.name, f"{read.name}.nc"), ".nc", ".mcap")
    check_outputs({"--out": target, "--report": report, "--animate": animate, "--figures": outputs.picture("path")})
    with watching(f"planning {read.name}", quiet=as_json) as watch:
        planned = plan_motion(loaded, read, watch, robust=robust)
        if out is None and not planned.feasible:  # it replaces no plan that is
            target = options.usual_file(loaded.name, read.name, f"{planned.status}.nc")
        written = {"file": planned.save(target)}
        if not planned.feasible:
            watch.now("searching for feasible tasks near this one")
            _ = planned.relaxations
        watch.now("drawing")
        pictures = outputs.write(planned, written)
    outputs.show(planned, written, pictures)
    if not planned.feasible:
        raise typer.Exit(1)


@one_thread_each()  # before libraries load: a plan must not depend on the number of threads or processes
def sweep(robot: str, task: Path, vary: list[str], where: dict[str, Any], out: Path | None, outputs: Outputs) -> None:
    """Plan all combinations, save, draw and print the table; the exit code is 1 if no plan is feasible.

    `where` has options of `ocp.sweep`: the workers, the checkpoint, and the folder of plans to keep.
    """
    from ..models import load
    from ..ocp import read_task, sweep as sweep_plans
    from ..ocp.sweeps.axis import check_figure, read_axes, read_option

    loaded, read, picture = load(robot), read_task(task), outputs.picture("sweep")
    varied = read_option(vary)
    target = out if out is not None else options.usual_file(loaded.name, read.name, "sweep.nc")
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
    options.print_result(outputs.as_json, data, result.report, [*files, *([folder] if folder else [])])
    if not result.feasible:
        raise typer.Exit(1)
