"""`uncontrolled`: wrench directions that neither tensions nor carriers change; `is_underactuated`, `needs_carriers`."""

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from ..statics.distribution import tensions

STEP = 1e-6  # [m, rad], of a difference quotient
NONE = 1e-6  # of the largest singular value
WEAK = 0.05  # likewise: cables that hardly turn the platform cannot hold it against disturbances and noise


def is_underactuated(robot: Robot) -> bool:
    """Return whether the tensions at home control fewer directions of the wrench than the platform has freedoms.

    This is so with fewer cables, and for a load below six flying carriers whose cables all point to its axis: nothing
    turns it about this axis unless carriers move. Cables with winches are taken to control as many as there are cables.
    """
    few = robot.m < len(robot.platform.dof)
    return few or (robot.fixed_lengths is not None and needs_carriers(robot))


def needs_carriers(robot: Robot) -> bool:
    """Return whether the platform has freedoms at home that tensions hardly control, but carriers that move do."""
    count = len(robot.platform.dof)
    if robot.m < count or not any(carrier.moves for carrier in robot.carriers):
        return robot.m < count
    scale = robot.wrench_scale * robot.dof_mask
    sizes = np.linalg.svd(scale[:, None] * dynamics_of(robot).wrench_matrix(robot.home, robot.carrier_home))[1]
    return bool(sizes[count - 1] <= WEAK * sizes[0])


def uncontrolled(robot: Robot, reach: np.ndarray) -> np.ndarray:
    """Return the wrench directions that a robot at rest at home cannot change, (k, 6), moments over its length [N].

    To first order the wrench changes with the tensions, and, at constant tensions, with the coordinates of carriers
    whose `reach`, (c, 6) [m, rad], is not zero. A towed load swings along the returned directions, and no controller
    damps it.
    """
    dynamics, home = dynamics_of(robot), robot.carrier_home
    found = tensions(robot, robot.home, method="soft-wrench").tensions
    scale = robot.wrench_scale * robot.dof_mask
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
