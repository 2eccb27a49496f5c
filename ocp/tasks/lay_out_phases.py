"""`lay_out_phases`: check phases for a robot and lay them out; `end_tensions`: those of phases on the ground.

While platform and carriers rest, A and w are constant. Tensions that change linearly from those at the start to those
at the end then balance with support forces that do the same: A t + S n = w holds for every mean of two solutions. So a
phase on the ground is possible if its ends are, and a load is picked up and put down at a constant rate.

Where a phase without ground comes before or after, the end has its tensions. At the start and end of
the task, and between two phases on the ground, the cables carry as little as they can.
"""

import numpy as np

from ...base.errors import InputError
from ...models import Robot
from ...models.points import rotations
from ...solvers import TensionProblem, solve
from ...statics.distribution import wrench_problem
from .paths import SequencePath
from .phase import Ground, LaidPhase, Load, Phases
from .scenario import AUDIT_RATE, Scenario
from .scheme import SCHEMES
from .task import Task
from .wind_set import WindBox, WindDisc

FREE = 1e-6  # weight of support forces beside tensions: cables carry only what the ground cannot
LEAST_STEPS = 4  # of a phase
LEAST_INSTANTS = 10  # of the audit, in a phase
BALANCED = 1e-9  # of the wrench: what supports miss of it


def end_tensions(scenario: Scenario, phase: LaidPhase, end: int) -> np.ndarray | None:
    """Return the tensions at the start (0) or end (1) of a phase on the ground, (m,) [N]; None if there are none."""
    phases, robot = scenario.phases.all, scenario.robot
    beside = phases.index(phase) + (1 if end else -1)
    other = phases[beside] if 0 <= beside < len(phases) else None
    time = np.array([phase.end if end else phase.start])
    platform, carriers = scenario.motion(time, None)
    A = scenario.dynamics.wrench_matrix(platform.pose, carriers.pose)[0]
    w = scenario.dynamics.required_wrench(*platform, wind=scenario.wind)[0]
    load = phase.load if other is None or other.rests else other.load
    w = w + scenario.dynamics.carried_wrench(*platform, load)[0]
    if other is not None and not other.rests:
        return solve(wrench_problem(robot, A, w, *scenario.bounds_in(other))).tensions
    low, high = (bound[0] for bound in scenario.bounds_at(time))
    least = (phase.at_end if end else phase.at_start)[0]
    _, missed = support_forces(scenario, phase.columns, (w - A @ low - phase.columns @ least)[None])
    if missed[0] <= BALANCED * robot.force_scale:
        return low
    S, m = phase.columns, robot.m
    most = largest_support(scenario, w, high) + least
    mask = robot.dof_mask[:, None]
    weights = np.append(np.ones(m), np.full(S.shape[1], FREE))
    limits = np.append(low, least), np.append(high, most)
    whole = TensionProblem(np.hstack([A, S]) * mask, w * mask[:, 0], *limits, weights=weights, length=robot.length)
    tensions = solve(whole).tensions
    return None if tensions is None else tensions[:m]


def known_tensions(scenario: Scenario, phase: LaidPhase, end: int) -> np.ndarray | None:
    """Return the tensions with which a task starts (0) or ends (-1) on the ground, (m,) [N].

    They are None if the planner chooses them. Where carriers may be anywhere they are known only of slack cables: none
    has to pull if the ground bears it all.
    """
    if not scenario.carrier_free:
        return end_tensions(scenario, phase, -end)
    low, _ = scenario.bounds_in(phase)
    if low.any():
        return None
    time = np.array([phase.end if end else phase.start])
    w = scenario.required_wrench(time, *scenario.motion(time, None), scenario.wind)
    _, missed = support_forces(scenario, phase.columns, w)
    return low if missed[0] <= BALANCED * scenario.robot.force_scale else None


def largest_support(scenario: Scenario, w: np.ndarray, high: np.ndarray) -> float:
    """Return a force [N] that no support exceeds, for wrenches w (..., 6) of tensions up to `high`: all forces' sum."""
    return float(np.linalg.norm(np.atleast_2d(w)[:, :3], axis=1).max() + high.sum())


def support_forces(scenario: Scenario, columns: np.ndarray, wrenches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return support forces n >= 0, (k, s) [N], whose wrenches S n are nearest to `wrenches` (k, 6), and the distances.

    The distances, (k,) [N], have moments over `Robot.length`. Of several the forces have the least norm, where no
    force of that is negative.
    """
    scale = scenario.robot.dof_mask * scenario.robot.wrench_scale
    S, targets = columns * scale[:, None], wrenches * scale
    forces = targets @ np.linalg.pinv(S, rcond=1e-10).T
    if (negative := np.flatnonzero((forces < 0).any(axis=1))).size:
        from scipy.optimize import nnls  # loads for longer than many plans take

        for row in negative:
            forces[row] = nnls(S, targets[row])[0]
    return forces, np.linalg.norm(targets - forces @ S.T, axis=1)


def lay_out_phases(scenario: Scenario) -> Phases:
    """Check that the phases of a scenario's task fit its robot, and lay them out.

    Raises `InputError` naming the field of the task that does not fit, its value and what would.
    """
    robot, task, where = scenario.robot, scenario.task, f"task {scenario.task.name!r}"
    if task.phases is None or not isinstance(task.path, SequencePath):
        return Phases()
    boundaries = task.path.boundaries
    poses = [task.path.at(boundaries[:-1][[index]], boundaries[-1]).pose[0] for index in range(len(task.phases))]
    grounds = [phase.ground for phase in task.phases]
    if any(grounds):
        _check_ground(robot, task, where)
    _check_tolerances(task, where)
    loads = [np.zeros(10) if phase.load is None else phase.load.numbers for phase in task.phases]
    columns = [_columns(robot, ground, pose) for ground, pose in zip(grounds, poses, strict=True)]
    laid = []
    for index, phase in enumerate(task.phases):
        free = np.stack([np.zeros(columns[index].shape[1]), np.full(columns[index].shape[1], np.inf)])
        ends = [free, free]
        for side, other in enumerate((index - 1, index + 1)):
            if not 0 <= other < len(loads) or phase.ground is None:
                continue
            named = f"{where}: phases[{index}]", f"phases[{other}]"
            if grounds[other] is None:
                needed = _at_rest(scenario, poses[index], loads[index]) - _at_rest(scenario, poses[index], loads[other])
                ends[side] = np.tile(_supported(scenario, columns[index], needed, named), (2, 1))
                for own, its in _extreme_loads(phase.load, task.phases[other].load):
                    needed = _at_rest(scenario, poses[index], own) - _at_rest(scenario, poses[index], its)
                    _supported(scenario, columns[index], needed, named)
                continue
            if not np.array_equal(columns[index], columns[other]):
                raise InputError(f"{named[0]}.ground.support must be the same as in {named[1]}, also on the ground")
            own, its, *_ = (
                _supported(scenario, columns[index], _at_rest(scenario, poses[index], load), named)
                for load in (loads[index], loads[other], *([] if phase.load is None else phase.load.extremes))
            )
            ends[side] = np.stack([np.maximum(own - its, 0.0), free[1]])
        slack = phase.ground is not None and phase.ground.slack
        times = float(boundaries[index]), float(boundaries[index + 1])
        extremes = np.zeros((0, 10)) if phase.load is None or phase.ground is not None else phase.load.extremes
        laid.append(LaidPhase(phase.name, *times, loads[index], columns[index], slack, ends[0], ends[1], extremes))
    phases = Phases(tuple(laid))
    _check_program(scenario, phases, where)
    _check_jumps(scenario, phases, where)
    return phases


def _check_ground(robot: Robot, task: Task, where: str) -> None:
    """Refuse ground where there is no down, where wind is not one wind, and where the platform's frame moves."""
    if not np.linalg.norm(robot.gravity) > 0:
        raise InputError(f"{where}: phases.ground must be left out for robot {robot.name!r}, which has no gravity")
    if task.path.frame != "world":
        raise InputError(f"{where}: phases.path.frame must be 'world' on the ground, got {task.path.frame!r}")
    if isinstance(task.wind, WindBox | WindDisc):
        raise InputError(f"{where}: wind must be one velocity (x, y, z) [m/s] with a phase on the ground, got a range")


def _check_tolerances(task: Task, where: str) -> None:
    """Refuse tolerances of loads together with a range of winds or with the key `robust`."""
    for index, phase in enumerate(task.phases or ()):
        if phase.load is None or not len(phase.load.extremes):
            continue
        key = "mass_tolerance" if phase.load.mass_tolerance else "com_tolerance"
        for other, what in ((isinstance(task.wind, WindBox | WindDisc), "a range of winds"), (task.robust, "robust")):
            if other:
                raise InputError(f"{where}: phases[{index}].load.{key} must be left out with {what}")


def _extreme_loads(own: Load | None, its: Load | None) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return pairs of extreme loads of a phase on the ground and its neighbour; the ground must bear their difference.

    If it does, tensions exist for every load throughout the phase on the ground: interpolated tensions with
    interpolated support forces keep the balance, which is linear in both at rest.
    """
    if own == its:
        return []
    extremes = [[np.zeros(10)] if load is None else [*load.extremes] or [load.numbers] for load in (own, its)]
    return [(first, second) for first in extremes[0] for second in extremes[1]]


def _columns(robot: Robot, ground: Ground | None, pose: np.ndarray) -> np.ndarray:
    """Return the wrenches of unit forces against gravity at the support points of a platform at `pose`, (6, s)."""
    if ground is None:
        return np.zeros((6, 0))
    if ground.support is None:
        attachments = robot.attachments
        points = np.unique(np.column_stack([attachments[:, :2], np.full(robot.m, attachments[:, 2].min())]), axis=0)
    else:
        points = np.array(ground.support)
    up = -np.array(robot.gravity) / np.linalg.norm(robot.gravity)
    arms = (points - np.array(robot.platform.com)) @ rotations(pose[3:]).T
    return np.vstack([np.tile(up[:, None], len(points)), np.cross(arms, up).T])


def _at_rest(scenario: Scenario, pose: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return the wrench that a load needs while it rests at `pose`, (6,)."""
    return scenario.dynamics.carried_wrench(pose, np.zeros(6), np.zeros(6), load)


def _supported(scenario: Scenario, columns: np.ndarray, needed: np.ndarray, named: tuple[str, str]) -> np.ndarray:
    """Return support forces (s,) [N] that give a wrench (6,), or raise InputError if none do.

    `named` are the phase on the ground and its neighbour, for the error.
    """
    robot = scenario.robot
    forces, missed = support_forces(scenario, columns, needed[None])
    size = float(np.linalg.norm(needed * robot.dof_mask * robot.wrench_scale))
    if missed[0] <= BALANCED * max(size, robot.force_scale):
        return forces[0]
    up = -np.array(robot.gravity) / np.linalg.norm(robot.gravity)
    if up @ needed[:3] < 0:
        raise InputError(
            f"{named[0]}.load must weigh at least as much as that of {named[1]}, so that the ground can bear the "
            f"difference, got {-up @ needed[:3]:.6g} N less"
        )
    raise InputError(
        f"{named[0]}.ground.support must have points on all sides of the CoM of the weight on the ground, got "
        f"points that leave {missed[0]:.3g} N of {size:.3g} N (moments included) unsupported where it meets {named[1]}"
    )


def _check_program(scenario: Scenario, phases: Phases, where: str) -> None:
    """Refuse what a program with phases cannot do."""
    task = scenario.task
    for index, phase in enumerate(phases.all):
        if phase.end - phase.start < (1 - 1e-6) * LEAST_INSTANTS / AUDIT_RATE:
            raise InputError(
                f"{where}: phases[{index}] must last at least {LEAST_INSTANTS / AUDIT_RATE:g} s, in which the audit "
                f"evaluates {LEAST_INSTANTS} instants, got {phase.end - phase.start:g} s"
            )
    least = LEAST_STEPS * len(phases.all)
    if task.steps < least:
        raise InputError(f"{where}: steps must be at least {LEAST_STEPS} for each phase, {least}, got {task.steps}")
    if task.tube.waypoints == "exact":
        raise InputError(f"{where}: tube.waypoints must be free with phases, got exact")
    if scenario.count and scenario.scheme.smooth:
        accepted = ", ".join(scheme.name for scheme in SCHEMES.values() if not scheme.smooth)
        raise InputError(f"{where}: scheme must be one of {accepted} with phases, got {task.scheme}")
    if not phases.rest:
        return
    if any(phase.slack for phase in phases.all) and (task.objective.margin is not None or "margin" in task.limits.soft):
        raise InputError(f"{where}: phases.ground.slack must be false with a margin to choose, got true")
    if task.initial is not None and phases.all[0].rests:
        raise InputError(f"{where}: initial must be left out if the first phase is on the ground, where it is given")


def _check_jumps(scenario: Scenario, phases: Phases, where: str) -> None:
    """Refuse a load that changes in the air where the tensions must not jump."""
    task = scenario.task
    if not phases.jumps:
        return
    change = f"because tensions jump where the load changes off the ground, at {phases.jumps[0]:g} s"
    if task.limits.tension_rate is not None:
        raise InputError(
            f"{where}: limits.tension_rate must be left out {change}, got {task.limits.tension_rate:g} N/s"
        )
    if scenario.count:
        raise InputError(f"{where}: tube and base must fix the motion {change}, got one with free coordinates")
