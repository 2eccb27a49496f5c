"""`uncontrolled`: wrench directions that neither tensions nor carriers can change."""

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from ..statics.distribution import tensions

STEP = 1e-6  # [m, rad], of a difference quotient
NONE = 1e-6  # of the largest singular value


def uncontrolled(robot: Robot, reach: np.ndarray) -> np.ndarray:
    """Return the wrench directions that a robot at rest at home cannot change, (k, 6), moments over its length [N].

    To first order the wrench changes with the tensions, and, at constant tensions, with the coordinates of carriers
    whose `reach`, (c, 6) [m, rad], is not zero. A towed load swings along the returned directions, and no controller
    damps it.
    """
    dynamics, home = dynamics_of(robot), robot.carrier_home
    found = tensions(robot, robot.home, method="soft-wrench").tensions
    scale = np.repeat([1.0, 1 / robot.length], 3) * robot.dof_mask
    A = dynamics.wrench_matrix(robot.home, home)
    columns = [A * robot.force_scale]
    for index, far in enumerate(reach):
        for coordinate in np.flatnonzero(far):
            moved = home.copy()
            moved[index, coordinate] += STEP
            change = (dynamics.wrench_matrix(robot.home, moved) - A) @ found / STEP
            columns.append(far[coordinate] * change[:, None])
    U, sizes, _ = np.linalg.svd(scale[:, None] * np.hstack(columns))
    rank = int((sizes > NONE * sizes[0]).sum())
    beyond = U[:, rank:].T
    return beyond[np.abs(beyond @ np.diag(robot.dof_mask.astype(float))).max(axis=1) > NONE]
