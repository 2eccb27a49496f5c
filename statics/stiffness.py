"""Natural frequencies of a robot with elastic cables."""

import numpy as np
from numpy.typing import ArrayLike

from ..models.dynamics import dynamics_of
from ..models.elasticity import frequency, whitening
from ..models.files import AnyRobot, as_robot

__all__ = ["natural_frequencies"]


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
    pose = np.asarray(pose, dtype=float)
    C = whitening(robot, pose)
    if not robot.dof_mask.all():
        rows = np.flatnonzero(robot.dof_mask)
        K = K[..., rows[:, None], rows]
    # LAPACK reads one triangle; at an equilibrium K is symmetric but for rounding and residual wrenches.
    squares = C @ ((K + K.swapaxes(-1, -2)) / 2) @ C.swapaxes(-1, -2)
    real = np.asarray(np.isfinite(squares).all(axis=(-1, -2)))
    found = frequency(np.linalg.eigvalsh(np.where(real[..., None, None], squares, 0.0)))
    return np.where(real[..., None], found, np.nan)
