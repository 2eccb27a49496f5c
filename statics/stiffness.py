"""Natural frequencies of a robot with elastic cables, and the tensions with which they are largest."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..base.display import Displayed
from ..base.inputs import InputError, finite_array
from ..models.dynamics import dynamics_of
from ..models.elasticity import frequency, whitened, whitening
from ..models.files import AnyRobot, as_robot
from ..models.robot import Robot
from ..solvers.methods.stiffest import Stiffest
from ..solvers.solution import TensionSolution
from ..solvers.solve import solve
from .distribution import pose_problem, wrench_problem

__all__ = ["StiffestTensions", "natural_frequencies", "stiffest"]


def natural_frequencies(
    robot: AnyRobot, pose: ArrayLike, tensions: ArrayLike, carrier_pose: ArrayLike | None = None
) -> np.ndarray:
    """Return the natural frequencies of small undamped motions about equilibria, ascending, (..., k) [Hz].

    The cables are elastic and their unstrained lengths constant. There are as many frequencies as coordinates that can
    move; they are negative where the motion is unstable, and nan where a cable has no direction.
    `Dynamics.natural_frequencies` has the modes of one equilibrium, also of inextensible cables.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file. Every cable has a `stiffness`.
        pose: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6).
        tensions: (..., m) [N]; cables with zero tension are slack and have no stiffness.
        carrier_pose: Pose of each carrier's frame, (..., c, 6); default: at home.

    Raises:
        InputError: If an argument has a wrong shape or value, or a cable has no stiffness.
    """
    robot = as_robot(robot)
    K = dynamics_of(robot).stiffness(pose, tensions, carrier_pose)
    return frequencies_of(robot, K, np.asarray(pose, dtype=float))


def frequencies_of(robot: Robot, K: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return the natural frequencies (..., k) [Hz] of a platform with stiffnesses (..., 6, 6) at poses (..., 6)."""
    squares = whitened(robot, K, whitening(robot, pose))
    real = np.asarray(np.isfinite(squares).all(axis=(-1, -2)))
    found = frequency(np.linalg.eigvalsh(np.where(real[..., None, None], squares, 0.0)))
    return np.where(real[..., None], found, np.nan)


@dataclass(frozen=True)
class StiffestTensions(Displayed):
    """The result of `stiffest`.

    Attributes:
        solution: The tensions, or a certificate that none exist.
        frequency: Lowest natural frequency with them [Hz]: negative if the pose is unstable, nan without tensions.
        bound: Frequency that no tensions inside the limits exceed [Hz].
    """

    solution: TensionSolution
    frequency: float
    bound: float


def stiffest(
    robot: AnyRobot, pose: ArrayLike, carrier_pose: ArrayLike | None = None, w: ArrayLike | None = None
) -> StiffestTensions:
    """Compute the tensions inside their limits that give w and maximise the lowest natural frequency.

    The frequency is for small motions with fixed unstrained lengths, see `natural_frequencies`.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file. Every cable has a `stiffness` and
            a `t_min` above zero: without tension a cable has no stiffness, so that the frequency would jump.
        pose: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (6,).
        carrier_pose: The same of each carrier, (c, 6); default: at home.
        w: Required wrench about the CoM in {G} [N, N m], (6,); default: for the platform at rest.

    Raises:
        InputError: If an argument has a wrong shape or value, or a cable has no stiffness or no t_min above zero.
    """
    robot = as_robot(robot)
    slack = np.flatnonzero(robot.t_min <= 0)
    if slack.size:
        raise InputError(
            f"cables[{slack[0]}].t_min must be above 0 N, as a cable without tension has no stiffness, got 0 N in "
            f"robot {robot.name!r}"
        )
    dynamics = dynamics_of(robot)
    problem = pose_problem(dynamics, pose, carrier_pose=carrier_pose)
    if w is not None:
        problem = wrench_problem(robot, dynamics.wrench_matrix(pose, carrier_pose), finite_array("w", w, (6,)))
    # K is affine in the tensions as long as all are above zero: its values at some, and at others that differ in one.
    step = robot.t_max
    K = dynamics.stiffness(pose, robot.t_min + np.vstack([np.zeros(robot.m), np.diag(step)]), carrier_pose)
    K = whitened(robot, K, whitening(robot, np.asarray(pose, dtype=float)))
    by_tension = (K[1:] - K[0]) / step[:, None, None]
    method = Stiffest(K[0] - np.tensordot(robot.t_min, by_tension, 1), by_tension)
    solution = solve(problem, method)
    if solution.tensions is None:
        return StiffestTensions(solution, np.nan, np.nan)
    return StiffestTensions(solution, float(frequency(method.value)), float(frequency(method.bound)))
