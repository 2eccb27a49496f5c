"""Equilibria near given poses, many at once, and their derivatives by lengths and wrenches.

Near a rest Newton's method on the conditions of optimality in `equilibria` takes a few steps of

    [ K  -A ; -A^T  0 ] (delta ; t) = (m g ; L - l(q))

with the stiffness K at constant tensions, over the cables that pull. A cable that would have to push is slack from the
next step on, and one that would be too long pulls again. The same matrix gives the derivative of the pose by the
lengths.
"""

from dataclasses import replace

import numpy as np

from ..models.dynamics import Dynamics, dynamics_of
from ..models.elasticity import frequency, whitened, whitening
from ..models.robot import Robot
from .equilibria import UNSTABLE, Equilibrium, descend, displaced, judge

NEWTON = 60  # most steps
SETTLED = 1e-6  # robot lengths: after shorter steps, errors of tensions and lengths are far below `ROUNDING`
ROUNDING = 1e-9  # of the weight and the length
SLACK = 1e-3  # of the weight: a cable that would pull less at the start is slack there


def rest_near(robot: Robot, lengths: np.ndarray, start: np.ndarray, carriers: np.ndarray) -> Equilibrium | None:
    """Return a stable equilibrium near a pose, or None; arguments as for `rests_near`, for one pose."""
    rests, found = rests_near(robot, lengths[None], start[None], carriers[None])
    return rests.only(0) if found[0] else None


def rests_near(
    robot: Robot, lengths: np.ndarray, starts: np.ndarray, carriers: np.ndarray
) -> tuple[Equilibrium, np.ndarray]:
    """Return stable equilibria near poses, and which of them were found, (N,); others have no meaning.

    The cables have `lengths` (N, m) [m]; the poses are `starts` (N, 6) and those of the carriers (N, c, 6), in {G}.
    If Newton's method finds none, a descent of the potential energy is tried.
    """
    rests, found = _newton(robot, lengths, starts, carriers)
    for row in np.flatnonzero(~found):
        rest = descend(robot, starts[row], carriers[row], lengths[row])
        if rest is not None:
            rests.put(row, rest)
            found[row] = True
    return rests, found


def sensitivity(robot: Robot, rests: Equilibrium, carriers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives of CoM and rotation vector in {G} by lengths and by a wrench at N equilibria.

    Carriers, (N, c, 6), are fixed, and slack cables have no effect. The derivatives are (N, 6, m) [-, rad/m] and
    (N, 6, 6) [m/N, rad/N, m/(N m), rad/(N m)], of a wrench about the CoM. Also return neutral, that is, undetermined
    motions of CoM and rotation vector, (N, 6, k), of which some are zero.
    """
    rows = np.flatnonzero(robot.dof_mask)
    count, n, m, scale = len(rests.pose), len(rows), robot.m, robot.wrench_scale[rows, None]
    system = _system(robot, dynamics_of(robot), rests.pose, rests.tensions, carriers, rests.taut)
    values, V = np.linalg.eigh(system)
    sizes = np.abs(values)
    regular = sizes > 1e-9 * sizes.max(axis=1, keepdims=True)
    inverse = (V / np.where(regular, values, np.inf)[:, None]) @ V.swapaxes(1, 2)
    moves, compliance = np.zeros((count, 6, m)), np.zeros((count, 6, 6))
    moves[:, rows] = inverse[:, :n, n:] * rests.taut[:, None] * scale
    compliance[:, rows[:, None], rows] = inverse[:, :n, :n] * scale * scale.T / _unit(robot)
    neutral = np.zeros((count, 6, max(n + m, 6)))
    neutral[:, rows, : n + m] = V[:, :n] * ~regular[:, None] * scale
    lost = rests.neutral & (np.abs(neutral).max(axis=(1, 2)) <= 1e-6)
    neutral[lost, :, :6] = np.diag(robot.dof_mask)
    return moves, compliance, neutral


def _newton(
    robot: Robot, lengths: np.ndarray, starts: np.ndarray, carriers: np.ndarray
) -> tuple[Equilibrium, np.ndarray]:
    """Return the equilibria that Newton's method reaches, and which of them are stable, (N,)."""
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    n, unit, com = len(rows), _unit(robot), np.array(robot.platform.com)
    weight = (robot.platform.mass * np.array([*robot.gravity, 0.0, 0.0, 0.0]) * robot.wrench_scale)[rows] / unit
    pose = starts.copy()
    A = (dynamics.wrench_matrix(pose, carriers) * robot.wrench_scale[:, None])[:, rows]
    tensions = -np.linalg.pinv(np.nan_to_num(A), 1e-9) @ weight * unit
    taut = tensions > SLACK * robot.weight  # as it would be if it rested at the start
    taut |= not weight.any()  # where nothing pulls, poses at which the cables are just straight come nearest to a rest
    left = np.arange(len(lengths))
    for _ in range(NEWTON):
        system = _system(robot, dynamics, pose[left], tensions[left], carriers[left], taut[left])
        beyond = dynamics.cable_lengths(pose[left], carriers[left]) - lengths[left]
        missing = np.hstack([np.tile(weight, (len(left), 1)), np.where(taut[left], -beyond, 0.0)])
        usable = np.isfinite(system).all(axis=(1, 2)) & np.isfinite(missing).all(axis=1)
        left, system, beyond, missing = left[usable], system[usable], beyond[usable], missing[usable]
        if not left.size:
            break
        # A neutral motion leaves the system singular.
        step = (np.linalg.pinv(system, 1e-12, hermitian=True) @ missing[..., None])[..., 0]
        size = np.linalg.norm(step[:, :n], axis=1) / robot.length
        twist = np.zeros((len(left), 6))
        twist[:, rows] = step[:, :n] * robot.wrench_scale[rows] * np.minimum(1.0, 0.3 / np.maximum(size, 0.3))[:, None]
        pose[left] = displaced(pose[left], twist, com)
        pulls = step[:, n:] * unit
        far = size > 1e-3
        tensions[left] = np.where(far[:, None], np.maximum(pulls, 0.0), pulls)
        pushing = (pulls < -ROUNDING * robot.weight) & (pulls == pulls.min(axis=1, keepdims=True))
        longer = ~taut[left] & (beyond > (2.0 * size[:, None] + ROUNDING) * robot.length)
        changed = np.where((size <= SETTLED)[:, None], pushing | longer, False)
        taut[left] ^= changed
        left = left[(size > 1e-12) | changed.any(axis=1)]
    reached = judge(robot, dynamics, pose, carriers, tensions)
    off = np.where(taut, np.abs(reached.lengths - lengths), reached.lengths - lengths).max(axis=1)
    found = off <= ROUNDING * np.maximum(robot.length, lengths.max(axis=1))
    found &= (reached.residual <= ROUNDING * robot.weight) & (tensions.min(axis=1) >= -ROUNDING * robot.weight)
    lowest, nearest = np.zeros(len(found)), np.zeros(len(found))
    lowest[found], nearest[found] = _frequencies(robot, dynamics, pose[found], tensions[found], carriers[found])
    return replace(reached, neutral=nearest < UNSTABLE), found & (lowest >= -UNSTABLE)


def _frequencies(
    robot: Robot, dynamics: Dynamics, pose: np.ndarray, tensions: np.ndarray, carriers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest natural frequency of N equilibria, negative if unstable, and the one nearest to zero [Hz].

    Both refer to motions that taut cables of constant lengths permit; large numbers if there are none.
    """
    rows = np.flatnonzero(robot.dof_mask)
    C = whitening(robot, pose)
    K = whitened(robot, dynamics.stiffness(pose, np.maximum(tensions, 0.0), carriers, elastic=False), C)
    taut = tensions > ROUNDING * np.maximum(tensions.max(axis=1, keepdims=True), 1e-300)
    A = C @ (dynamics.wrench_matrix(pose, carriers) * taut[:, None])[:, rows]
    held = A @ np.linalg.pinv(A, 1e-9)
    free = np.eye(len(rows)) - held
    above = 1.0 + np.abs(K).sum(axis=(1, 2))  # of all squares
    squares = np.linalg.eigvalsh(free @ K @ free + above[:, None, None] * held)
    found = frequency(squares)
    return found[:, 0], np.abs(found).min(axis=1)


def _system(
    robot: Robot, dynamics: Dynamics, pose: np.ndarray, tensions: np.ndarray, carriers: np.ndarray, taut: np.ndarray
) -> np.ndarray:
    """Return the matrices of Newton's step, (N, n + m, n + m), in the n coordinates that move.

    Rotations are multiplied by `Robot.length`, forces divided by the weight over that; a slack cable has the tension 0.
    """
    rows, scale = np.flatnonzero(robot.dof_mask), robot.wrench_scale
    n, m = len(rows), robot.m
    A = (dynamics.wrench_matrix(pose, carriers) * scale[:, None])[:, rows]
    K = dynamics.stiffness(pose, tensions, carriers, elastic=False) * np.outer(scale, scale) / _unit(robot)
    system = np.zeros((len(pose), n + m, n + m))
    system[:, :n, :n] = ((K + K.swapaxes(1, 2)) / 2)[:, rows[:, None], rows]
    system[:, :n, n:] = -A * taut[:, None]
    system[:, n:, :n] = system[:, :n, n:].swapaxes(1, 2)
    system[:, range(n, n + m), range(n, n + m)] = ~taut
    return system


def _unit(robot: Robot) -> float:
    """Return the force over a length that makes stiffness comparable to cosines [N/m]."""
    return max(robot.weight, 1e-300) / robot.length
