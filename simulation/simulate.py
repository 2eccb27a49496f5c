"""Simulate a reference motion in closed loop, once or many times: `simulate`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from math import ceil, isfinite
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias, cast, overload
from warnings import warn

import numpy as np
from typing_extensions import Unpack

from ..base.execution import Execution, ExecutionOptions
from ..base.inputs import InputError, required, shown, whole_number, with_fields
from ..control import ComputedTorque, Controller, LengthControl, Reference
from ..control.deviation import tolerance_of
from ..control.noise import Noise
from ..control.planned_references import references_at
from ..control.trajectory import read_trajectory
from ..estimation.logs.opening import is_recording
from ..models.files import AnyRobot, as_robot
from ..models.parsing import validate
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from ..models.trajectory import ROUNDING, Trajectory
from ..plant import Plant
from ..plant.steps import default_drive, steps_in, windings_in
from .command_conversion import Orders
from .conditions import Conditions, Experiment, read_wind
from .data import Record
from .events.event import Event, read_events
from .events.faults import Stick
from .events.loads import Carry
from .flights import copies, flights, plant_of, summary
from .flying import fly
from .log_replay import replay
from .mismatch import Mismatch
from .runs import fly_many
from .simulation import Simulation

if TYPE_CHECKING:
    import xarray as xr

LONGEST = 1e6  # periods of one flight
MOST_RUNS = 10_000_000
MOST_PARTS = 1000  # of a period


AnyNoise: TypeAlias = Noise | dict[str, Any] | None


class Options(ExecutionOptions, total=False):
    """The fields of `Conditions` and of `Execution` that are no parameters of `simulate`, by their names."""

    gusts: float
    disturbance: Any
    period: float
    substeps: int | None
    mismatch: Mismatch | dict[str, Any] | None
    drive: str | None
    tolerance: float
    faults: Sequence[Any]


@overload
def simulate(
    robot: AnyRobot,
    reference: Any,
    controller: Controller | None = None,
    wind: Any = None,
    noise: AnyNoise = None,
    events: Sequence[Any] = (),
    duration: float | None = None,
    seed: int = 0,
    *,
    runs: None = None,
    conditions: Conditions | None = None,
    execution: Execution | None = None,
    **options: Unpack[Options],
) -> Simulation: ...
@overload
def simulate(
    robot: AnyRobot,
    reference: Any,
    controller: Controller | None = None,
    wind: Any = None,
    noise: AnyNoise = None,
    events: Sequence[Any] = (),
    duration: float | None = None,
    seed: int = 0,
    *,
    runs: int,
    conditions: Conditions | None = None,
    execution: Execution | None = None,
    **options: Unpack[Options],
) -> xr.Dataset: ...
def simulate(
    robot: AnyRobot,
    reference: Any,
    controller: Controller | None = None,
    wind: Any = None,
    noise: AnyNoise = None,
    events: Sequence[Any] = (),
    duration: float | None = None,
    seed: int = 0,
    *,
    runs: int | None = None,
    conditions: Conditions | None = None,
    execution: Execution | None = None,
    **options: Unpack[Options],
) -> Simulation | xr.Dataset:
    """Simulate a reference motion in closed loop, with wind, sensor noise and events.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        reference: A plan, the NetCDF file of one, a path (also as a mapping, as in a task), or a pose (6,) to hold. Or
            the file of a recording (CSV, MCAP, a bag, NetCDF without a plan), which `replay` repeats: all other
            arguments must then be omitted, and the result is a `Replay`.
        controller: Controller (default: `ComputedTorque(robot)`). A single run calls its `reset` and uses the object
            itself. Many runs use copies, unless it accepts batches.
        wind, noise, events, duration: As in `Conditions`.
        seed: Seed of wind and noise. The same seed gives the same run.
        runs: Number of runs, with the seeds from `seed` on (default: one).
        conditions: `Conditions`; arguments given by name replace its fields.
        execution: Workers and checkpoint of many runs, see `Execution`.
        options: Other fields of `Conditions` and `Execution`, by their names. `faults` is the former name of `events`.

    Returns:
        Simulation or xarray.Dataset: With `runs`, a dataset with the statistics of each run.

    Raises:
        InputError: If an argument has a wrong value, the reference belongs to another robot, the checkpoint cannot be
            written, is damaged or belongs to other runs, or the scheduler does not exist.
        SolverError: If workers end before their work is done, or the extra `cluster` is not installed.
    """
    given: dict[str, Any] = dict(options)
    if isinstance(reference, str | os.PathLike) and is_recording(reference):
        others = controller, wind, noise, duration, runs, conditions, execution, events or None, seed or None
        if given or any(one is not None for one in others):
            raise InputError(
                f"reference must be a plan if simulate has other arguments, got the log {shown(reference)}"
            )
        return cast(Any, replay(robot, reference))
    if (former := given.pop("faults", None)) is not None:
        if events:
            raise InputError(f"faults must be left out with events, whose former name it is, got {shown(former)}")
        warn("faults is called events now; the former name is removed in the next release", DeprecationWarning, 2)
        events = former
    happening = None if isinstance(events, tuple) and not events else events
    named = {"wind": wind, "noise": noise, "events": happening, "duration": duration}
    given |= {name: value for name, value in named.items() if value is not None}
    meets = required("conditions", Conditions() if conditions is None else conditions, Conditions)
    where = required("execution", Execution() if execution is None else execution, Execution)
    meets, where = with_fields("simulate", given, meets, where)
    the_robot = as_robot(robot)
    if controller is not None and not isinstance(controller, Controller):
        raise InputError(f"controller must be a Controller, got {shown(controller)}")
    pilot = ComputedTorque(the_robot) if controller is None else controller
    _check_model(the_robot, pilot)
    meets = replace(meets, drive=meets.drive or pilot.drive or default_drive(the_robot))
    plant, experiment = _laid_out(the_robot, reference, meets, "events" if former is None else "faults")
    first, error = whole_number("seed", seed, 0, 2**63 - 1), tolerance_of(the_robot, meets.tolerance)
    if runs is None:
        where.check_alone()
        return _one(plant, pilot, experiment, first, error)
    seeds = range(first, first + whole_number("runs", runs, 1, MOST_RUNS))
    of = fly_many(plant, pilot, experiment, seeds, error, where)
    table = flights(the_robot, experiment, seeds, error, of)
    if not table["passed"].all():
        worst = summary(table)["worst_seed"]
        again = _one(plant, copies(pilot, 1)[0], experiment, worst, error)
        table.attrs["worst"] = again.cause()  # all from the seed alone
    return table


def _check_model(robot: Robot, controller: Controller) -> None:
    """Check that a controller is for as many cables, carriers and actuators, and for lengths that cables can have.

    Values may differ, but lengths that are commanded for elastic cables are wrong for cables that do not stretch.
    """
    inner = getattr(controller, "controller", controller)
    model = getattr(inner, "robot", None)
    if not isinstance(model, Robot):
        return
    has, wants = ((one.m, [len(carrier.actuators) for carrier in one.carriers]) for one in (model, robot))
    if has != wants:
        kind = type(controller).__name__
        raise InputError(f"controller must be for robot {robot.name!r}, got {kind} for {model.name!r}")
    if isinstance(inner, LengthControl):
        undamped = [i for i, cable in enumerate(robot.cables) if cable.stiffness and not cable.damping]
        if undamped and inner.corrects:
            warn(
                f"cables[{undamped[0]}].damping is missing in the robot file of {robot.name!r}: the corrections of "
                "LengthControl make oscillations on cables without damping grow (with damping=0 it does not correct)",
                stacklevel=3,
            )
        for i, (cable, taken) in enumerate(zip(robot.cables, inner.stiffness.tolist(), strict=True)):
            if not cable.stiffness and isfinite(taken):
                raise InputError(
                    f"cables[{i}].stiffness must be in the robot file of {robot.name!r}, because LengthControl takes "
                    f"it to be {taken:g} N, got none, so that the cable does not stretch"
                )


def _laid_out(robot: Robot, reference: Any, meets: Conditions, events: str) -> tuple[Plant, Experiment]:
    """Return the plant, and the conditions along the reference; `events` is their name in error messages."""
    if isinstance(reference, dict):
        from ..ocp import Task

        reference = validate({"path": reference}, Task, "reference").path
    trajectory, period = read_trajectory(robot, reference, meets.duration), meets.period
    drive = meets.drive or default_drive(robot)
    named = read_events(robot, meets.events, events)
    happening = tuple(event for _, event in named)
    parts = _in_turn(robot, trajectory, happening)
    happening = tuple(sorted((*_loads(parts), *happening), key=lambda event: event.at))
    ends = [begins + part.duration for begins, part in parts if part.duration is not None]
    if meets.duration is None and not ends:
        raise InputError("duration must be the simulated time [s] if the reference is a pose, got None")
    lasting = max(ends) if meets.duration is None else meets.duration
    if period > lasting * (1 + ROUNDING):
        raise InputError(f"period must be at most the simulated time of {lasting:g} s, got {period:g} s")
    periods = ceil(lasting / period - ROUNDING)  # to the end, or beyond it by less than one
    if periods > LONGEST:
        raise InputError(f"duration must be at most {LONGEST:g} periods of {period:g} s, got {lasting:g} s")
    for where, event in named:
        if event.at >= periods * period:
            raise InputError(f"{where} must begin before the end at {periods * period:g} s, got {event.at:g} s")
        if not (step := event.longest_step(robot)) * MOST_PARTS >= period:
            raise InputError(
                f"{where} must change so slowly that it may be held for {period / MOST_PARTS:g} s, 1/{MOST_PARTS} of "
                f"the period, got {step:.3g} s: {event.describe(robot)}"
            )
        if isinstance(event, Stick):
            _check_winches(robot, drive, where)
    mismatch = required("mismatch", meets.mismatch, Mismatch)
    mismatch.check(robot)
    plant, stiffest = Plant(robot, drive=drive), Plant(mismatch.stiffest.robot(robot, 0), drive=drive)
    return plant, Experiment(
        period=period,
        substeps=meets.substeps or steps_in(period, stiffest),
        references=_references(robot, parts, period * np.arange(periods)),
        wind=read_wind(robot, meets.wind, meets.gusts),
        disturbance=meets.disturbance,
        noise=required("noise", meets.noise, Noise),
        events=happening,
        keep_out=next((part.keep_out for _, part in parts if part.keep_out), ()),
        doubt="; ".join(dict.fromkeys(part.doubt for _, part in parts if part.doubt)),
        mismatch=mismatch,
        windings=max([windings_in(period, stiffest), *(ceil(period / each.longest_step(robot)) for each in happening)]),
    )


def _check_winches(robot: Robot, drive: str, where: str) -> None:
    """Check that a winch that sticks changes the motion: in the drive "tensions" it would only seem to."""
    if robot.fixed_lengths is not None:
        raise InputError(f"{where} must be left out for robot {robot.name!r}, which has no winches")
    if drive == "tensions":
        others = f"for another drive, every cable of {robot.name!r} needs a stiffness or a winch in the robot file"
        raise InputError(f"{where} must be left out with drive 'tensions', in which winches hold no length; {others}")


def _in_turn(robot: Robot, first: Trajectory, events: Sequence[Event]) -> list[tuple[float, Trajectory]]:
    """Return the references that follow each other, each with the time from which it is followed [s]."""
    parts = [(0.0, first)]
    for event in events:
        begins, current = parts[-1]
        if (new := event.follow(robot, current, event.at - begins)) is not None:
            parts.append((event.at, required(f"the reference of {type(event).__name__}", new, Trajectory)))
    return parts


def _loads(parts: Sequence[tuple[float, Trajectory]]) -> list[Event]:
    """Return the changes of the loads that plans carry, each at the beginning of its phase, as events."""
    ends, events = [begins for begins, _ in parts[1:]] + [np.inf], list[Event]()
    carried: RigidLoad | None = None
    for (begins, part), end in zip(parts, ends, strict=True):
        for time, load in part.loads:
            if begins + time < end and load != carried:
                fields = {"mass": 0.0} if load is None else load.model_dump()
                events.append(Carry.model_validate({"at": begins + time, **fields}))
                carried = load
    return events


def _references(robot: Robot, parts: Sequence[tuple[float, Trajectory]], times: np.ndarray) -> list[Reference]:
    """Return the reference at each of the times (n,) [s]."""
    which = np.searchsorted([begins for begins, _ in parts], times + ROUNDING, side="right") - 1
    result = [
        reference
        for number, (begins, part) in enumerate(parts)
        for reference in references_at(robot, part, np.maximum(times[which == number] - begins, 0.0))
    ]
    for reference in result:
        for part in reference:
            if isinstance(part, np.ndarray):
                part.flags.writeable = False  # a controller that changes it would change what errors are measured from
    return result


def _one(plant: Plant, controller: Controller, experiment: Experiment, seed: int, tolerance: float) -> Simulation:
    robot, periods = plant.robot, len(experiment.references)
    record = Record(robot, periods)
    start = perf_counter()
    lasted, seconds = fly(plant_of(plant, experiment, seed), [controller], experiment, [seed], record.take)
    wall = perf_counter() - start
    air = Orders(plant, experiment, [seed]).wind
    wind, timing = None if air is None else air[:, 0], (np.array(seconds), wall)
    return Simulation(robot, experiment, seed, record, int(lasted[0]), tolerance, wind, *timing)
