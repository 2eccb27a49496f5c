"""`end_tensions`: the tensions at both ends of a phase on the ground, where all that moves is given.

While platform and carriers rest, A and w are constant. Tensions that change linearly from those at the start to those
at the end then balance with support forces that do the same: A t + S n = w holds for every mean of two solutions. So a
phase on the ground is possible if its ends are, and a load is picked up and put down at a constant rate.

Where a phase without ground comes before or after, the end has its tensions. At the start and end of
the task, and between two phases on the ground, the cables carry as little as they can.
"""

import numpy as np

from ...solvers import TensionProblem, solve
from ...statics.distribution import wrench_problem
from .phases import LaidPhase
from .scenario import Scenario

FREE = 1e-6  # weight of support forces beside tensions: cables carry only what the ground cannot
BALANCED = 1e-9  # of the force scale: what the ground misses of a wrench that it bears


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
