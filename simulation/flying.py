"""Close the loop of plant, sensors and controller, for one run or many in parallel: `fly`."""

from collections.abc import Callable, Sequence
from math import ceil, isfinite
from time import perf_counter
from typing import Any

import numpy as np

from ..base.inputs import InputError, shown
from ..control import ANSWERS, Command, Controller, Reference, State
from ..control.controller import HOLD
from ..core import sense
from ..models.robot import Robot
from ..models.trajectory import moved_on
from ..plant import Plant
from ..plant.steps import Periods
from .command_conversion import Orders
from .conditions import Experiment
from .data import Period
from .events.event import Event, Running
from .sensors import Reading, Sensors

BEYOND = 1e100  # [m, m/s, rad/s]: its square is finite
ROUNDING = 1e-6  # of a period
FEW = 1000  # numbers that BLAS adds with one thread
# Pose and velocity of the platform, and of the carriers, in motions (..., 1 + c, 12).
_PARTS = [(..., body, part) for body in (0, slice(1, None)) for part in (slice(0, 6), slice(6, 12))]


class Pilot:
    """The controllers of all runs: one that accepts batches, or one for each."""

    def __init__(self, controllers: Sequence[Controller], flights: int, conditions: Experiment):
        self._controllers, self._alone = controllers, flights == 1
        self._together = controllers[0].batches
        for each in self._controllers:
            each.reset()
            each.follow(conditions.references, conditions.period)
        self.seconds: list[float] = []

    def step(self, time: float, reading: Reading, reference: Reference) -> Command:
        """Return the command of the only run, or of all, and record the computing time per run."""
        start, (motions, tensions, seen) = perf_counter(), reading
        if self._alone:
            command = self._controllers[0].step(time, _state(motions[0], tensions[0], seen), reference)
        elif self._together:
            command = self._controllers[0].step(time, _state(motions, tensions, seen), reference)
        else:
            rows = zip(self._controllers, motions, tensions, strict=True)
            single = [each.step(time, _state(row, pulls, seen), reference) for each, row, pulls in rows]
            command = _stacked(single)
        self.seconds.append((perf_counter() - start) / len(motions))
        return command


def _state(motions: np.ndarray, tensions: np.ndarray, seen: float | None) -> State:
    """Return a state with arrays of its own, which a controller may keep."""
    motions = motions.copy()
    pose, velocity, carrier_pose, carrier_velocity = (motions[part] for part in _PARTS)
    return State(pose, velocity, carrier_pose, carrier_velocity, tensions, seen)


def _stacked(commands: list[Command]) -> Command:
    """Return the commands of all runs as one, or the first invalid one."""
    for command in commands:
        if not isinstance(command, Command):
            return command
    parts: list[Any] = [None if part[0] is None else np.stack(part) for part in zip(*commands, strict=True)]
    return Command(*parts)


def fly(
    plant: Plant,
    controllers: Sequence[Controller],
    conditions: Experiment,
    seeds: Sequence[int],
    take: Callable[[Period], None],
) -> tuple[np.ndarray, list[float]]:
    """Simulate one run per seed from the beginning of the reference, with a controller for each or one for all.

    Each `Period` that runs live is given to `take`.

    Returns the number of simulated periods of each run, (N,), smaller than the number of references if it diverged (at
    least 1); and the computing times of the controller's steps [s].

    Raises `InputError` if the controller returns an invalid command.
    """
    robot, m, flights, period = plant.robot, plant.robot.m, len(seeds), conditions.period
    first = conditions.references[0]
    motion = (first.pose, first.velocity, first.carrier_pose, first.carrier_velocity)
    start = np.zeros(m) if first.tensions is None else np.maximum(first.tensions, 0.0)
    parts = conditions.windings
    periods = Periods(plant, period / parts, ceil(conditions.substeps / parts))
    fixed = plant.fixed_lengths(start)  # which plans meet to some nm
    state = plant.start(*motion, tensions=start if fixed is None else None, lengths=fixed)
    running = Running(plant, periods, np.tile(state, (flights, 1)))
    motions, lengths = np.zeros((flights, 1 + len(robot.carriers), 12)), np.zeros((flights, 2, m))
    history, tensions = np.zeros((flights, 2, plant.size)), np.zeros((flights, 2, m))
    end, numbers = history[:, 1], history.reshape(-1)
    between, pulls = motions.copy(), np.tile(start, (flights, 1))  # pulls: means of the last period
    own = pulls.copy()
    sensors, pilot = Sensors(conditions.noise, seeds, period, m), Pilot(controllers, flights, conditions)
    orders = Orders(plant, conditions, seeds, periods.record)
    lasted, alive, going = np.zeros(flights, dtype=int), np.ones(flights, dtype=bool), True
    coming, pushing, command, expected = list(conditions.events), list[tuple[float, Event]](), None, None
    for k, reference in enumerate(conditions.references):
        time = k * period
        while coming and coming[0].at <= time + 1e-9 * period:
            event = coming.pop(0)
            event.begin(running)
            pushing += [(time, event)] if type(event).wrench is not Event.wrench else []
        states = running.states
        sense(periods.record, states, motions, lengths)
        reported = sensors.report(k, motions, pulls)
        if command is None or time >= running.silent_until:
            command = pilot.step(time, reported, reference)
        else:
            command = _held(command, period)
        # Only shapes are compared in each period, since all checks take longer than a step: NumPy broadcasts silently.
        shapes = _shapes_of(command)
        if shapes is None or shapes != expected:
            check_command(command, robot, flights, time)
            expected = shapes
        if command.released is not None:
            periods.release(states, command.released)
        for part in range(parts):
            if part:
                alive &= (np.abs(end) < BEYOND).all(axis=1)
                states[alive] = end[alive]
                sense(periods.record, states, between, lengths)
            if pushing:
                begins = time + part * periods.period
                orders.push(_wrench(pushing, begins, periods.period, between if part else motions))
            try:
                row = orders.rows(k, command, lengths, states, part)
            except (TypeError, ValueError):
                check_command(command, robot, flights, time)
                raise
            periods.run(states, row, history, tensions, own)
            pulls = pulls + own if part else own.copy()
        pulls /= parts
        if not isfinite(_square(numbers)):
            check_command(command, robot, flights, time)
            alive &= (np.abs(end) < BEYOND).all(axis=1)
            end[~alive] = states[~alive]
            going = bool(alive.any())
        if k == 0 or going:
            lived = alive if k else np.ones(flights, dtype=bool)
            try:
                take(Period(k, lived, motions, lengths, pulls, command))
            except (IndexError, TypeError, ValueError):
                check_command(command, robot, flights, time)
                raise
        if not going:
            break
        lasted += alive
        states[:] = end
    return np.maximum(lasted, 1), pilot.seconds


def _wrench(begun: Sequence[tuple[float, Event]], time: float, step: float, motions: np.ndarray) -> np.ndarray:
    """Return what events exert on platform and carriers on average in the step from `time` on, (N, 1 + c, 6).

    An event begins with the first period after its time, and its last step counts in part, for the right impulse.
    """
    total = np.zeros((*motions.shape[:2], 6))
    for begins, event in begun:
        share = min((begins + event.until - event.at - time) / step, 1.0)
        if share > ROUNDING and (exerted := event.wrench(time, motions)) is not None:
            total += share * check_wrench(event, exerted, total.shape, time)
    return total


def _held(command: Command, period: float) -> Command:
    """Return the command for a period in which the controller does not respond.

    It holds the tensions and continues the velocities of the carriers. Repeating the reference instead would move the
    carriers back to their last pose.
    """
    pose, velocity, acceleration = (np.asarray(part, dtype=float) for part in command[1:4])
    pose, velocity, _ = moved_on((pose, velocity, acceleration), period)
    return command._replace(
        carrier_pose=pose,
        carrier_velocity=velocity,
        carrier_acceleration=np.zeros_like(acceleration),
        answered=np.full(np.shape(command.answered), HOLD, dtype=np.int8),
    )


def _shapes_of(command: Any) -> list[Any] | None:
    """Return the shape of each part of a command, None for a missing one; None if it is no command."""
    if not isinstance(command, Command):
        return None
    try:
        return [None if part is None else part.shape for part in command]
    except AttributeError:
        return [None if part is None else np.shape(part) for part in command]


def _square(values: np.ndarray) -> float:
    """Return the sum of squares, without BLAS for large arrays, since its threads would wait for each other."""
    return float(np.vdot(values, values) if values.size < FEW else np.einsum("i,i->", values, values))


def check_command(command: Any, robot: Robot, flights: int, time: float) -> None:
    """Check a command of all runs, or of a single one.

    Raises `InputError` if it is no `Command`, or has wrong shapes, numbers that are not finite or an unknown
    status.
    """

    def wrong(wanted: str, got: object) -> InputError:
        return InputError(f"controller must return {wanted}, got {got} at t = {time:g} s")

    if not isinstance(command, Command):
        raise wrong("a Command from step", shown(command))
    count, lead = len(robot.carriers), () if flights == 1 else (flights,)
    shapes: dict[str, tuple[int, ...]] = {"tensions": (robot.m,), "answered": ()}
    shapes |= {f"carrier_{part}": (count, 6) for part in ("pose", "velocity", "acceleration")}
    if command.actuation is not None:
        shapes["actuation"] = (count, max(len(carrier.actuators) for carrier in robot.carriers))
    shapes |= {name: (robot.m,) for name in ("lengths", "released") if getattr(command, name) is not None}
    for name, core in shapes.items():
        values = np.asarray(getattr(command, name))
        if values.shape != (*lead, *core):
            raise wrong(f"{name} of shape {(*lead, *core)}", f"shape {values.shape}")
        if values.dtype.kind not in "fiub" or not np.isfinite(values).all():
            raise wrong(f"finite {name}", "others")
    answered = np.asarray(command.answered)
    if answered.dtype.kind == "f":
        raise wrong("an integer as answered", answered.flat[0])
    for name, core in (("direction", (6,)), ("shortfall", ()), ("unexplained", ())):  # nan where there is none
        values = np.asarray(getattr(command, name))
        if values.dtype.kind not in "fiub" or values.shape not in ((*lead, *core), core):
            raise wrong(f"{name} of shape {(*lead, *core)}", shown(getattr(command, name)))
    if not ((answered >= 0) & (answered < len(ANSWERS))).all():
        raise wrong(f"answered from 0 to {len(ANSWERS) - 1}", answered.max())


def check_wrench(event: Event, wrench: Any, shape: tuple[int, ...], time: float) -> np.ndarray:
    """Return the wrenches of an event on platform and carriers of all runs, of `shape` (N, 1 + c, 6).

    Those of one run or for the platform alone are extended. Raises `InputError` if they have another shape, or numbers
    that are not finite.
    """
    try:
        given = np.asarray(wrench, dtype=float)
        values = np.full(shape, np.nan if given.shape[-1:] != (6,) else 0.0)
        values[:, 0 if given.ndim < 3 else slice(None)] = given
    except (TypeError, ValueError):
        values = np.full(shape, np.nan)
    if not np.isfinite(values).all():
        raise InputError(
            f"events must exert wrenches of six finite numbers, got {shown(wrench)} of {type(event).__name__} "
            f"at t = {time:g} s"
        )
    return values
