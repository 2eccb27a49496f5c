"""`towline simulate`: fly a plan, step by step, in wind, with sensors and faults."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..base.errors import InputError
from ..base.inputs import check_ending, one_of, printable, shown
from ..base.processors import one_thread_each
from .options import (
    FPS,
    SPEED,
    FormatOption,
    FpsOption,
    JsonOption,
    RobotArgument,
    SpeedOption,
    check_unused,
    numbers,
    print_json,
    print_written,
)
from .outputs import check_outputs
from .resuming import checkpoint_of, checkpoint_option, resumable, resume_option, scheduler_option
from .stopping import add_to_message
from .watching import COMPILING, counting, watching

if TYPE_CHECKING:
    import xarray as xr

    from ..simulation import Execution, Simulation

_MANY = "With --runs: "
CONTROLLERS = ("computed-torque", "predictive", "open-loop")


def simulate(
    robot: RobotArgument,
    plan: Annotated[
        Path,
        typer.Argument(metavar="PLAN", help="A plan of this robot: a file that `towline plan` wrote (NetCDF)."),
    ],
    controller: Annotated[
        str, typer.Option(help=f"The controller: {', '.join(CONTROLLERS)}; Python accepts controllers of your own.")
    ] = CONTROLLERS[0],
    wind: Annotated[
        str | None,
        typer.Option(
            metavar="'X Y Z'",
            help="Velocity of the air [m/s], for robots with platform.aero; default: no air, and so no drag.",
        ),
    ] = None,
    gusts: Annotated[
        float, typer.Option(metavar="SIGMA", help="With --wind: intensity of turbulence (Dryden) about it [m/s].")
    ] = 0.0,
    noise: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Errors and delay of the sensors (YAML), such as {position: 0.001, delay: 0.002}."
        ),
    ] = None,
    event: Annotated[
        list[str] | None,
        typer.Option(
            "--event",
            "--fault",
            metavar="EVENT",
            help="What happens: 'cut 3 at 2.5' (cable 3 tears at 2.5 s), 'stick 2 at 1' (the winch of cable 2 stops), "
            "'lose quad1 at 2' (the carrier's actuators stop), 'miss 0.05 at 1.2' (no command for 0.05 s). Repeat the "
            "option for more.",
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(help="Time of the flight [s]; default: that of the plan, at whose end the robot rests."),
    ] = None,
    tolerance: Annotated[float, typer.Option(help="Largest error of the position of a flight that passes [m].")] = 0.05,
    seed: Annotated[int, typer.Option(help="Seed of gusts and noise; the same seed gives the same flight.")] = 0,
    runs: Annotated[
        int | None,
        typer.Option(help="Number of flights, with the seeds from --seed on. Writes one table instead of one flight."),
    ] = None,
    workers: Annotated[int, typer.Option(help="With --runs: number of processes on this machine.")] = 1,
    scheduler: Annotated[str | None, scheduler_option(_MANY)] = None,
    checkpoint: Annotated[Path | None, checkpoint_option(_MANY)] = None,
    resume: Annotated[Path | None, resume_option(_MANY)] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="NetCDF file to write; default: PLAN-flight.nc in this folder, with --runs PLAN-flights.nc. An "
            "existing file is overwritten.",
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures", help="Folder to draw in: error, tensions and answers; with --runs: errors of all flights."
        ),
    ] = None,
    form: FormatOption = "png",
    animate: Annotated[
        Path | None, typer.Option("--animate", help="Film of the flight to write: .gif, or .mp4 with ffmpeg.")
    ] = None,
    speed: SpeedOption = SPEED,
    fps: FpsOption = FPS,
    as_json: JsonOption = False,
) -> None:
    """Fly a plan with a controller, in wind, with slack cables, sensors and faults.

    A flight passes if it lasts, its error stays within --tolerance, no tension exceeds t_max by more than 0.1 % of the
    cable's range, and no cable whose t_min is above zero goes slack.
    The exit code is 0 if the flight passes, with --runs if all of them do, and else 1.
    """
    from ..figures.style import FORMATS

    one_of("--controller", controller, CONTROLLERS)
    one_of("--format", form, FORMATS)
    if animate is None:
        check_unused(speed, fps)
    many = {"--workers": workers != 1, "--scheduler": scheduler, "--checkpoint": checkpoint, "--resume": resume}
    for name, given in many.items():
        if given and runs is None:
            raise InputError(f"{name} must be left out without --runs: it is an option of many flights")
    stored = checkpoint_of(checkpoint, resume)
    if runs is not None and animate is not None:
        raise InputError(f"--animate must be left out with --runs, got {animate}")
    # Before libraries load: the processes of --workers share the processors.
    with one_thread_each():
        from ..control import ComputedTorque, OpenLoop, Predictive
        from ..models import load
        from ..models.parsing import read_yaml
        from ..simulation import Conditions, Execution, Noise, simulate

        loaded = load(robot)
        if not os.path.isfile(plan):  # `Path.is_file` raises where the name is too long
            raise InputError(f"{printable(str(plan))}: no such file")
        target = out if out is not None else Path(f"{plan.stem}-flight{'' if runs is None else 's'}.nc")
        check_ending("--out", target, ".nc")
        if animate is not None:
            from ..figures.animation import check_film

            check_film(animate, speed, fps)
        outputs = {"the checkpoint": stored, "--out": target, "--animate": animate}
        outputs["--figures"] = figures and figures / f"error.{form}"
        check_outputs(outputs, {"the plan": plan, "--noise": noise})
        pilot = {"predictive": Predictive, "open-loop": OpenLoop}.get(controller, ComputedTorque)(loaded)
        conditions = Conditions(
            wind=None if wind is None else numbers("--wind", wind, 3),
            gusts=gusts,
            noise=None if noise is None else read_yaml(noise, Noise),
            events=event or (),
            duration=duration,
            tolerance=tolerance,
        )
        run = partial(simulate, loaded, plan, pilot, seed=seed, conditions=conditions)
        try:
            if runs is None:
                film = None if animate is None else (animate, speed, fps)
                passed = _once(run, plan.stem, target, (figures, form), film, as_json)
            else:
                where = Execution(workers, scheduler, stored, resume is not None)
                passed = _often(partial(run, runs=runs), plan.stem, where, target, (figures, form), as_json)
        except InputError as error:
            raise _of_option(error, event or []) from None
    if not passed:
        raise typer.Exit(1)


def _of_option(error: InputError, events: list[str]) -> InputError:
    """Return the error with the option --event named in place of an item of the argument `events`."""
    return InputError(re.sub(r"^events\[(\d+)\]", lambda item: f"--event {shown(events[int(item[1])])}", str(error)))


def _once(
    run: Callable[[], Simulation],
    plan: str,
    target: Path,
    drawn: tuple[Path | None, str],
    film: tuple[Path, float, float] | None,
    as_json: bool,
) -> bool:
    """Simulate once, save, draw and print; return whether the run passed."""
    figures, form = drawn
    with watching(f"flying {plan} {COMPILING}", quiet=as_json) as watch:
        flight = run()
        written = {"file": flight.save(target)}
        watch.now("drawing")
        pictures = [] if figures is None else flight.plot(figures, form)
        if film is not None:
            written["animation"] = flight.animate(*film)
    if as_json:
        print_json({**flight.to_dict(), **written, "figures": pictures})
    else:
        typer.echo(flight.report())
        print_written((*written.values(), *pictures))
    return flight.passed


def _often(
    run: Callable[..., xr.Dataset],
    plan: str,
    where: Execution,
    target: Path,
    drawn: tuple[Path | None, str],
    as_json: bool,
) -> bool:
    """Simulate with many seeds, save, draw and print; return whether all runs passed."""
    from ..figures import flight as figure
    from ..figures import style
    from ..simulation.flights import report, save, summary

    figures, form = drawn
    with counting(f"flying {plan}", "passed", quiet=as_json) as show:
        flights = run(execution=replace(where, progress=resumable(show, where.checkpoint, "flights")))
    add_to_message("")
    file = save(flights, target)
    pictures = [] if figures is None else [style.save(figure.errors(flights), figures / f"errors.{form}")]
    if as_json:
        print_json({**summary(flights), "file": file, "figures": pictures})
    else:
        typer.echo(report(flights).text())
        print_written((file, *pictures))
    return bool(flights["passed"].all())
