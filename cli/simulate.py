"""`towline simulate`: simulate a plan in closed loop, with wind, sensor noise and events, or replay a recording."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..base.inputs import InputError, check_ending, one_of, printable, shown
from ..base.processors import one_thread_each
from . import options
from .log import FieldsOption, FixOption
from .outputs import Outputs, check_outputs
from .stopping import add_to_message
from .watching import checkpoint_of, counting, long_run, resumable, watching

if TYPE_CHECKING:
    import xarray as xr

    from ..simulation import Execution, Simulation

WINDOW = 0.5  # [s]
CONTROLLERS: tuple[str, ...] = ("computed-torque", "predictive", "lengths", "open-loop", "fault-tolerant")


@options.parameters(f"""
    PLAN|LOG: A plan of this robot: a file that `towline plan` or `towline simulate` wrote (NetCDF). Or a recording to
        replay: CSV, NetCDF, MCAP or a ROS bag.
    --controller: The controller: {", ".join(CONTROLLERS)}; Python accepts controllers of your own.
    --wind 'X Y Z': Velocity of the air [m/s], for robots with platform.aero; default: no aerodynamic forces.
    --gusts SIGMA: With --wind: intensity of Dryden turbulence, added to the wind [m/s].
    --noise FILE: Errors and delay of the sensors (YAML), such as {{position: 0.001, delay: 0.002}}.
    --mismatch FILE: How the simulated robot and its drives differ from the file (YAML), such as {{mass: [0.9, 1.1],
        winch_lag: 0.02}}; each run draws a random number from each range.
    --event, --fault EVENT: Event: 'cut 3 at 2.5' (cable 3 breaks at 2.5 s), 'stick 2 at 1' (the winch of cable 2
        stops), 'lose quad1 at 2' (the carrier's actuators stop), 'miss 0.05 at 1.2' (no command for 0.05 s), 'carry 2.5
        at 1' (the platform carries a load of 2.5 kg; 0: none), 'stop at 3' (the reference stops on its path), 'follow
        next.nc at 3' (another plan becomes the reference), 'push 20 0 0 at 1 for 0.5' (a force on the platform [N]), or
        a YAML file with the list `events`. Repeat the option for more.
    --duration: Simulated time [s]; default: the plan's. After the end of the plan the robot holds the final pose.
    --tolerance: Largest position error allowed for a pass [m]; default: 0.05 m, or 5 % of the mean cable length at home
        if that is less.
    --seed: Seed of gusts and noise; the same seed gives the same run.
    --runs: Number of runs, with the seeds --seed, --seed + 1, ... Writes one table instead of one motion.
{long_run("With --runs: ")}
    --out: NetCDF file (.nc) to write, or MCAP (.mcap) without --runs; default, in this folder: PLAN-simulation.nc,
        PLAN-runs.nc with --runs, or LOG-replay.nc for a recording. An existing file is overwritten.
    --figures: Folder for figures of error, tensions and controller status; with --runs: errors of all runs and their
        envelopes over time.
    --animate: File for a film of the simulation: .gif, or .mp4 with ffmpeg.
    --replay: Replay PLAN as a recording, even if it is the file of a simulation.
    --poses LOG: With a recording: log of the poses, if they are in another file.
    --drive: With a recording: commands of the plant: lengths, tensions or forces (default: depends on the log).
    --delay: With a recording: known delay from a recorded command to the response of the robot [s].
    --window: With a recording: duration of a window, a part replayed from its recorded state [s].
    --fit FILE.yaml: With a recording: robot file to write, with parameters fitted to half of the windows; written only
        if they reduce the residuals of the other half.
""")
def simulate(
    robot: options.RobotArgument,
    plan: Path,
    controller: str = CONTROLLERS[0],
    wind: str | None = None,
    gusts: float = 0.0,
    noise: Path | None = None,
    mismatch: Path | None = None,
    event: list[str] | None = None,
    duration: float | None = None,
    tolerance: float | None = None,
    seed: int = 0,
    runs: int | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    checkpoint: Path | None = None,
    resume: Path | None = None,
    out: Path | None = None,
    figures: Path | None = None,
    form: options.FormatOption = "png",
    animate: Path | None = None,
    speed: options.SpeedOption = options.SPEED,
    fps: options.FpsOption = options.FPS,
    report: options.ReportOption = None,
    replay: bool = False,
    poses: Path | None = None,
    fields: FieldsOption = None,
    fix: FixOption = False,
    drive: str | None = None,
    delay: float = 0.0,
    window: float = WINDOW,
    fit: Path | None = None,
    as_json: options.JsonOption = False,
) -> None:
    """Simulate a plan in closed loop, with wind, sensor noise and events, or replay a recording.

    A run passes if it does not diverge, its position error stays within --tolerance, no tension exceeds t_max by more
    than 0.1 % of t_max - t_min, no cable with t_min above zero goes slack, and the platform stays above the floor
    and inside the workspace_box of the robot file. A recording is replayed with its commands, in windows that each
    start from the recorded state; it passes if 95 % of the position residuals are within --tolerance. The exit code is
    1 if a run or a recording does not pass.
    """
    one_of("--controller", controller, CONTROLLERS)
    options.check_animation(animate, speed, fps)
    if runs is None:
        many = {"--workers": workers != 1, "--scheduler": scheduler, "--checkpoint": checkpoint, "--resume": resume}
        options.left_out(many, "without --runs: it is an option for many runs", got=False)
    of_log = {"--replay": replay, "--poses": poses, "--fields": fields, "--fix": fix}
    of_log |= {"--drive": drive, "--fit": fit, "--delay": delay, "--window": window != WINDOW}
    from ..estimation.logs.opening import is_recording

    if replay or is_recording(plan):
        of_plan = {"--controller": controller != CONTROLLERS[0] and controller, "--wind": wind, "--gusts": gusts}
        of_plan |= {"--noise": noise, "--mismatch": mismatch, "--event": event, "--duration": duration}
        of_plan |= {"--seed": seed, "--runs": runs, "--animate": animate}
        options.left_out(of_plan, "with a recording")
        given = {"poses": poses, "fields": fields, "fix": fix, "drive": drive, "delay": delay, "window": window}
        replay_log(robot, plan, given | {"tolerance": tolerance}, out, fit, Outputs(as_json, figures, form, report))
        return
    options.left_out(of_log, "without a recording")
    stored = checkpoint_of(checkpoint, resume)
    if runs is not None:
        options.left_out({"--animate": animate, "--report": report}, "with --runs")
    # Before libraries load: the processes of --workers share the processors.
    with one_thread_each(), _named(event or []):
        from ..control import ComputedTorque, FaultTolerant, LengthControl, OpenLoop, Predictive
        from ..models import load
        from ..models.parsing import read_yaml
        from ..simulation import Conditions, Execution, Mismatch, Noise, simulate

        loaded = load(robot)
        if not os.path.isfile(plan):  # `Path.is_file` raises where the name is too long
            raise InputError(f"{printable(str(plan))}: no such file")
        what, figure = ("simulation", "simulation") if runs is None else ("runs", "errors")
        target = check_ending("--out", out or Path(f"{plan.stem}-{what}.nc"), *((".nc",) if runs else (".nc", ".mcap")))
        outputs = Outputs(as_json, figures, form, report, animate, speed, fps)
        files = {"the checkpoint": stored, "--out": target, "--animate": animate, "--report": report}
        files["--figures"] = outputs.picture(figure)
        check_outputs(files, {"the plan": plan, "--noise": noise, "--mismatch": mismatch})
        kinds = (ComputedTorque, Predictive, LengthControl, OpenLoop, FaultTolerant)
        sensors = None if noise is None else read_yaml(noise, Noise)
        kind = dict(zip(CONTROLLERS, kinds, strict=True))[controller]
        known: dict[str, Any] = {} if kind is OpenLoop else {"sensors": sensors}
        pilot = kind(loaded, **known)
        air = None if wind is None else options.numbers("--wind", wind, 3)
        differs = None if mismatch is None else read_yaml(mismatch, Mismatch)
        conditions = Conditions(
            air, gusts, sensors, events=event or (), duration=duration, tolerance=tolerance, mismatch=differs
        )
        run = partial(simulate, loaded, plan, pilot, seed=seed, conditions=conditions)
        if runs is None:
            passed = _once(run, plan.stem, target, outputs)
        else:
            where = Execution(workers, scheduler, stored, resume is not None)
            passed = _often(partial(run, runs=runs), plan.stem, where, target, outputs)
    if not passed:
        raise typer.Exit(1)


@contextmanager
def _named(events: list[str]) -> Iterator[None]:
    """Let errors name --event and PLAN in place of an item of the argument `events` and of `reference`."""
    try:
        yield
    except InputError as error:
        text = str(error).replace("reference must be a plan", "PLAN must be a plan", 1)
        text = re.sub(r"^events\[(\d+)\]", lambda item: f"--event {shown(events[int(item[1])])}", text)
        raise InputError(text) from None


def _once(run: Callable[[], Simulation], plan: str, target: Path, outputs: Outputs) -> bool:
    """Simulate once, save, draw and print; return whether the run passed."""
    with watching(f"simulating {plan}", quiet=outputs.as_json) as watch:
        flight = run()
        written = {"file": flight.save(target)}
        watch.now("drawing")
        pictures = outputs.write(flight, written)
    outputs.show(flight, written, pictures)
    return flight.passed


def _often(run: Callable[..., xr.Dataset], plan: str, where: Execution, target: Path, outputs: Outputs) -> bool:
    """Simulate with many seeds, save, draw and print; return whether all runs passed."""
    from ..figures import flight as figure, style
    from ..simulation.flights import report, save, summary

    with counting(f"simulating {plan}", "passed", quiet=outputs.as_json) as show:
        flights = run(execution=replace(where, progress=resumable(show, where.checkpoint, "runs")))
    add_to_message("")
    file = save(flights, target)
    pictures = []
    if outputs.figures is not None:
        drawings = {"errors": figure.errors(flights), "envelopes": figure.envelopes(flights)}
        pictures = style.save_all(lambda: drawings, outputs.figures, outputs.form)
    data = {**summary(flights), "file": file, "figures": pictures}
    options.print_result(outputs.as_json, data, lambda: report(flights).text(), (file, *pictures))
    return bool(flights["passed"].all())


def replay_log(
    robot: Any, log: Path, given: dict[str, Any], out: Path | None, fit: Path | None, outputs: Outputs
) -> None:
    """Replay, save, draw and print; the exit code is 1 if the replay fails, or the fitted robot is not written."""
    from ..models import load
    from ..simulation import replay

    loaded, target = load(robot), check_ending("--out", out or Path(f"{log.stem}-replay.nc"), ".nc")
    if fit is not None:
        check_ending("--fit", fit, ".yaml", ".yml")
    files = {"--out": target, "--fit": fit, "--report": outputs.report, "--figures": outputs.picture("replay")}
    check_outputs(files, {"the log": log, "--poses": given["poses"]})
    try:
        result = replay(loaded, log, fit=fit is not None, **given)
    except InputError as error:
        option = "--" * str(error).startswith(("fix ", "drive ", "delay ", "window ", "tolerance "))
        raise InputError(f"{option}{error}") from None
    written = {"file": result.save(target)}
    if fit is not None and not result.refused:
        written["robot_file"] = result.save_robot(fit)
    outputs.show(result, written, outputs.write(result, written))
    if fit is not None and result.refused:
        typer.echo(f"towline: {fit} is not written: {result.refused}", err=True)
    if not result.passed or (fit is not None and result.refused):
        raise typer.Exit(1)
