"""`fixed_cables`: where elastic cables of fixed length would go slack, although their planned tensions are positive."""

import numpy as np

from ...base.text import quantity
from .instants import Instants

RANK = 1e-6  # of a matrix


def fixed_cables(seen: Instants, tensions: np.ndarray) -> list[str]:
    """Return a sentence if the lengths of cables of fixed length do not keep the planned tensions, (n, m) [N].

    Lengths are such that the first tensions are as planned. From then on cables in a motion as planned have the
    tensions t that give the required wrench with the least elastic energy of their changes:

        min  (t - t_0)' diag(l / EA) (t - t_0)    s.t.  A t = A t_plan
    """
    robot = seen.robot
    stiffness = np.array([cable.stiffness or 0.0 for cable in robot.cables])
    if robot.fixed_lengths is None or not stiffness.all() or not np.isfinite(tensions).all():
        return []
    root = np.sqrt(robot.fixed_lengths / stiffness)
    A = robot.wrench_scale[:, None] * seen.dynamics.wrench_matrix(seen.pose, seen.carriers) / root
    A = A[:, np.flatnonzero(robot.dof_mask)]
    change = np.linalg.pinv(A, RANK) @ (A @ (root * (tensions - tensions[0]))[..., None])
    kept = tensions[0] + change[..., 0] / root
    row, cable = np.unravel_index(int(kept.argmin()), kept.shape)
    if kept[row, cable] >= 0:
        return []
    planned = quantity(tensions[row, cable], "N", 2)
    return [
        f"cable {cable + 1} can go slack at t = {seen.times[row]:.3f} s, where {planned} are planned: the lengths of "
        "cables of fixed length determine how they share the load; a larger margin could keep them taut"
    ]
