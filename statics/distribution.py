"""Build and solve the tension problem of a robot at one instant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.inputs import InputError, real_array
from ..models.files import AnyRobot
from ..models.part import LARGEST
from ..models.robot import Robot
from ..solvers.problem import TensionProblem
from ..solvers.solution import TensionSolution

if TYPE_CHECKING:
    from ..models.dynamics import Dynamics
    from ..solvers.methods.method import Method

COINCIDENT = 1e-9  # [m]: a shorter cable has no direction


def tensions(
    robot: AnyRobot,
    pose: ArrayLike,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    carrier_pose: ArrayLike | None = None,
    carrier_velocity: ArrayLike | None = None,
    carrier_acceleration: ArrayLike | None = None,
    wind: ArrayLike | None = None,
    t_ref: ArrayLike | None = None,
    method: str | Method = "active-set",
    backend: str | None = None,
    **options: Any,
) -> TensionSolution:
    """Compute the tensions of a robot at one instant, or prove that none exist.

    The robot defines the degrees of freedom, the characteristic length that scales moments, and the tension limits.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        pose, velocity, acceleration: (x, y, z, roll, pitch, yaw) of the platform frame in {G} and its time derivatives,
            (6,); default: at rest.
        carrier_pose, carrier_velocity, carrier_acceleration: Pose of each carrier's frame in {G} and its time
            derivatives, (c, 6); default: at home, at rest.
        wind: Velocity of the air in {G} [m/s], (3,); default: no aerodynamic drag.
        t_ref: Preferred tensions [N], a number or (m,) (default: 0).
        method, backend, **options: As for `towline.solve`.

    Raises:
        InputError: If an argument has a wrong type, shape or value.
    """
    from ..models.dynamics import dynamics_of
    from ..models.files import as_robot
    from ..solvers.solve import solve

    motion = (pose, velocity, acceleration, carrier_pose, carrier_velocity, carrier_acceleration)
    problem = pose_problem(dynamics_of(as_robot(robot)), *motion, wind=wind, t_ref=t_ref)
    return solve(problem, method, backend, **options)


def pose_problem(
    dynamics: Dynamics,
    pose: ArrayLike,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    carrier_pose: ArrayLike | None = None,
    carrier_velocity: ArrayLike | None = None,
    carrier_acceleration: ArrayLike | None = None,
    wind: ArrayLike | None = None,
    t_ref: ArrayLike | None = None,
) -> TensionProblem:
    """Build the tension problem of one instant, with the arguments of `tensions`.

    Raises `InputError` if an argument has a wrong type, shape or value, or a cable has no direction.
    """
    from ..models.arrays import Motion

    motion = Motion(pose, velocity, acceleration, carrier_pose, carrier_velocity, carrier_acceleration)
    for name, value in {**motion._asdict(), "wind": wind}.items():
        if value is None:
            continue
        array = real_array(name, value).astype(float, copy=False)
        if array.ndim > (2 if name.startswith("carrier") else 1):
            raise InputError(f"{name} must belong to one instant, got an array of shape {array.shape}")
        if np.isfinite(array).all() and np.abs(array).max(initial=0.0) > LARGEST:
            raise InputError(f"{name} must be numbers up to {LARGEST:g}, got {np.abs(array).max():g}")
    lengths, A = dynamics.cable_lengths(pose, carrier_pose), dynamics.wrench_matrix(pose, carrier_pose)
    for cable in np.flatnonzero(~(lengths > COINCIDENT) | np.isnan(A).any(axis=0)):
        kept, lost = "the ends of every cable apart", f"the ends of cable {cable + 1} coincide"
        if dynamics.robot.pulley_radii[cable]:
            kept, lost = "every cable off the axis and outside the sheave of its pulley", f"cable {cable + 1} is not"
        raise InputError(f"pose must keep {kept}, got one at which {lost}")
    still = {name: np.zeros(6) for name in ("velocity", "acceleration") if getattr(motion, name) is None}
    w = dynamics.required_wrench(*motion._replace(**still), wind=wind)
    return wrench_problem(dynamics.robot, A, w, t_ref=t_ref)


def wrench_problem(
    robot: Robot,
    A: np.ndarray,
    w: np.ndarray,
    t_min: np.ndarray | None = None,
    t_max: np.ndarray | None = None,
    t_ref: ArrayLike | None = None,
) -> TensionProblem:
    """Build the tension problem of a wrench matrix and a required wrench, in the robot's degrees of freedom and scale.

    Wrench rows of locked coordinates become zero.

    Args:
        robot: Defines degrees of freedom, characteristic length and limits.
        A: (6, m), about the platform's CoM.
        w: (6,) [N, N m].
        t_min, t_max: (m,) [N]; default: the robot's.
        t_ref: [N]; default: 0.
    """
    mask = robot.dof_mask
    low = robot.t_min if t_min is None else t_min
    high = robot.t_max if t_max is None else t_max
    return TensionProblem(A * mask[:, None], w * mask, low, high, t_ref=t_ref, length=robot.length)
