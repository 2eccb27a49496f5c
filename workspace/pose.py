"""One pose and motion of a robot as a tension problem: where models and solvers meet."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..models import Dynamics
from ..solvers import TensionProblem, solve
from .region import surrounding_box


def pose_problem(
    dynamics: Dynamics,
    pose: ArrayLike,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    carrier_pose: ArrayLike | None = None,
    wind: ArrayLike | None = None,
    t_ref: ArrayLike | None = None,
) -> TensionProblem:
    """The tension problem of one pose and motion; wrench rows of coordinates that cannot move are zero.

    Parameters
    ----------
    pose, velocity, acceleration
        (x, y, z, roll, pitch, yaw) of the platform frame in {G} and its time derivatives, (6,); None: zero.
    carrier_pose
        (c, 6) in {G}; None: at home.
    wind
        Velocity of the air in {G} [m/s], (3,); None: no air at all.
    t_ref
        Tensions to stay near [N]; None: 0.

    Raises
    ------
    InputError
        If an argument has a wrong shape or value.
    """
    robot = dynamics.robot
    rate = np.zeros(6) if velocity is None else velocity
    rate_rate = np.zeros(6) if acceleration is None else acceleration
    short = np.flatnonzero(~(dynamics.cable_lengths(pose, carrier_pose) > 1e-9))
    if short.size:
        raise InputError(
            f"pose: anchor and attachment of cable {short[0] + 1} coincide there; accepted: poses at which every cable "
            "has a length"
        )
    A = dynamics.wrench_matrix(pose, carrier_pose)
    w = dynamics.required_wrench(pose, rate, rate_rate, wind=wind)
    return masked_problem(dynamics, A, w, robot.t_min, robot.t_max, t_ref)


def masked_problem(
    dynamics: Dynamics,
    A: np.ndarray,
    w: np.ndarray,
    t_min: np.ndarray,
    t_max: np.ndarray,
    t_ref: ArrayLike | None = None,
) -> TensionProblem:
    """The tension problem of a wrench matrix (6, m) and a required wrench (6,) that are known already."""
    mask, length = dynamics.robot.dof_mask, dynamics.robot.length
    return TensionProblem(A * mask[:, None], w * mask, t_min, t_max, t_ref=t_ref, length=length)


def hints(dynamics: Dynamics, count: int = 400, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A first look at the workspace: random positions about home and whether the robot can rest there.

    The positions fill the box of home, anchors and carriers at random, by `seed`, at the attitude of home. For the
    workspace itself, with volumes and conditions, this is no substitute.

    Returns
    -------
    Positions (count, 3) [m] and flags (count,).
    """
    robot = dynamics.robot
    low, high = surrounding_box(robot, {})
    poses = np.tile(robot.home, (count, 1))
    poses[:, :3] = low + np.random.default_rng(seed).uniform(size=(count, 3)) * (high - low)
    feasible = np.array([solve(pose_problem(dynamics, pose)).feasible for pose in poses])
    return poses[:, :3], feasible
