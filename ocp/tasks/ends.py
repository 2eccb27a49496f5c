"""Decide how platform and carriers start and end, and which values this fixes: `fixed_values`."""

from collections.abc import Iterator
from math import remainder
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from ...models import Robot
from . import bernstein
from .deviation import Deviation
from .paths import AnyPath, LinePath, RestPath, SequencePath, WaypointPath
from .scenario import POSITION, Scenario
from .task import FreeBase, GivenBase, Task

AT_REST = 1e-9  # [m/s, rad/s] and per second: rounding at the end of a path

Word: TypeAlias = Literal["free", "rest", "periodic", "exact"]


class FixedValue(NamedTuple):
    """A value that the deviation of one free coordinate has at an end."""

    end: int  # 0 for the start, -1 for the end
    column: int  # the free coordinate
    order: int  # 0 for its value [m, rad], 1 and 2 for the time derivatives
    value: float  # what it is, less the reference's value


def platform_ends(task: Task) -> Word:
    """Return how the platform starts and ends: as the task requires, or else at rest if its path goes to rest."""
    if task.tube.ends is not None:
        return task.tube.ends
    if isinstance(task.base, GivenBase) or isinstance(task.path, RestPath):
        return "free"
    _, velocity, acceleration = task.path.at(np.array([0.0, task.seconds]), task.seconds)
    return "rest" if max(np.abs(velocity).max(), np.abs(acceleration).max()) <= AT_REST else "free"


def carrier_ends(task: Task) -> Word:
    """Return how free carriers start and end: as the task requires, or else at rest or periodic as the platform."""
    if not isinstance(task.base, FreeBase):
        return "free"
    of_platform = platform_ends(task)
    return task.base.ends or (of_platform if of_platform in ("rest", "periodic") else "free")


def fixed_values(scenario: Scenario) -> Iterator[FixedValue]:
    """Yield what the task fixes of the free coordinates at start and end."""
    task = scenario.task
    platform, carriers = scenario.references(np.array([0.0, scenario.duration]))
    words = platform_ends(task), carrier_ends(task)
    rests = [phase.rests for phase in scenario.phases.all]
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        word, reference = (words[0], platform) if owner is None else (words[1], carriers[owner])
        orders = [0] * (word == "exact" or (word == "rest" and owner is None and coordinate in POSITION))
        orders += [1] * (word in ("exact", "rest"))
        orders += [2] * (word == "rest" and at_rest_without_acceleration(scenario.robot, owner, coordinate))
        through = word == "periodic" and owner is None and task.tube.waypoints == "exact"
        if through and isinstance(task.path, WaypointPath):  # the first point; the last one is the same
            off = task.path.points[0][coordinate] - platform.pose[0, coordinate]
            yield FixedValue(0, column, 0, remainder(off, 2 * np.pi) if coordinate not in POSITION else float(off))
        for end, state in ((0, task.initial), (-1, task.final)):
            given = [] if state is None else list(state.of(owner))
            for order, value in given:
                off = value[coordinate] - float(reference[order][end, coordinate])
                turns = order == 0 and coordinate not in POSITION
                yield FixedValue(end, column, order, remainder(off, 2 * np.pi) if turns else off)
            halts = owner is None and end == -1 and task.final is not None and task.final.rests_anywhere
            if halts and at_rest_without_acceleration(scenario.robot, owner, coordinate):
                yield FixedValue(end, column, 2, -float(reference[2][end, coordinate]))
            if given:
                continue
            if owner is None and rests and rests[end]:
                continue  # on the ground, where the platform rests on its path from node to node
            for order in orders:
                # The deviation of what rests undoes the motion of its reference.
                undone = word == "rest" and order > 0
                yield FixedValue(end, column, order, -float(reference[order][end, coordinate]) if undone else 0.0)


def between_fixed_values(scenario: Scenario) -> Deviation | None:
    """Return a motion that starts and ends as the task fixes it; None if the references do.

    Quintic polynomials join the ends: this is the motion that is shown where no motion is possible.
    """
    fixed = [value for value in fixed_values(scenario) if abs(value.value) > AT_REST]
    if not fixed:
        return None
    ends = np.zeros((2, 3, scenario.count))
    for end, column, order, value in fixed:
        ends[end, order, column] = value
    lasts, nodes = scenario.duration, np.linspace(0.0, scenario.duration, scenario.task.steps + 1)
    points = [*_from_end(lasts, *ends[0]), *reversed(_from_end(-lasts, *ends[1]))]
    speeds = bernstein.derivative(lasts, points)
    each = points, speeds, bernstein.derivative(lasts, speeds)
    q, v, a = (bernstein.basis(len(its) - 1, nodes / lasts) @ np.stack(its) for its in each)
    return Deviation(nodes, q, v, a, np.zeros((len(nodes), scenario.robot.m)))


def _from_end(h: float, value: np.ndarray, speed: np.ndarray, acceleration: np.ndarray) -> list[np.ndarray]:
    """Return the three Bernstein points of a quintic polynomial next to an end, h seconds from the other one."""
    return [value, value + h / 5 * speed, value + 2 * h / 5 * speed + h**2 / 20 * acceleration]


def at_rest_without_acceleration(robot: Robot, owner: int | None, coordinate: int) -> bool:
    """Return whether rest excludes an acceleration of a coordinate of the platform (None) or of a carrier.

    Angular accelerations of carriers stay free, since they affect only the carriers' own actuators. With fixed cable
    lengths, or with fewer cables than degrees of freedom, lengths and balance determine the other coordinates at the
    nodes, and the polynomial between nodes cannot meet another condition at its end; rest then sets only the
    acceleration of the platform's position to zero.
    """
    if robot.fixed_lengths is not None or robot.m < len(robot.platform.dof):
        return owner is None and coordinate in POSITION
    return owner is None or coordinate in POSITION


def with_timing(robot: Robot, task: Task) -> Task:
    """Return a task whose lines and legs without a timing are smoother, where balance determines a team's motion.

    A team rests at the ends of a line only then. Along legs of waypoints, and from one part of a sequence to the next,
    the usual law's snap jumps, and with it the accelerations of the quadrotors, which their thrusts cannot follow.
    """
    path = task.path
    exact = task.tube.radius == task.tube.turn == 0 and isinstance(task.base, FreeBase)
    team = robot.m < len(robot.platform.dof) and any(carrier.efforts for carrier in robot.carriers)
    if not (exact and team) or (isinstance(path, LinePath) and carrier_ends(task) != "rest"):
        return task
    if not isinstance(path, SequencePath):
        return task.model_copy(update={"path": _smoother(path)})
    parts = tuple(part.model_copy(update={"path": _smoother(part.path)}) for part in path.parts)
    phases = task.phases and tuple(phase.model_copy(update={"path": _smoother(phase.path)}) for phase in task.phases)
    return task.model_copy(update={"path": path.model_copy(update={"parts": parts}), "phases": phases})


def _smoother(path: AnyPath | None) -> AnyPath | None:
    """Return a line or legs without a timing as smoother ones, and other paths as they are."""
    if not isinstance(path, LinePath | WaypointPath) or path.timing is not None:
        return path
    if isinstance(path, WaypointPath) and path.shape == "spline":
        return path
    return path.model_copy(update={"timing": "smoother"})
