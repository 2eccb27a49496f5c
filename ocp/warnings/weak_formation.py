"""`weak_formation`: where freely moving carriers come to places from which their cables hold the platform poorly."""

import numpy as np

from ...base.text import quantity
from ...solvers.certificate import direction_text
from .instants import Instants

WEAK = 0.05  # of the smallest singular value at home
LEAST = 1e-4  # a smaller share is not told
NONE = 1e-3  # of the largest one at home; a smaller one does not count


def weak_formation(seen: Instants) -> list[str]:
    """Return a sentence if the wrench matrix comes close to losing rank, in comparison with home.

    Moments are divided by the robot's length. Only those singular values count that the robot has at home.
    """
    robot = seen.robot
    rows = np.flatnonzero(robot.dof_mask)
    scale = np.repeat([1.0, 1.0 / robot.length], 3)[rows, None]
    at_home = np.linalg.svd(scale * seen.dynamics.wrench_matrix(robot.home)[rows], compute_uv=False)
    rank = int((at_home > NONE * at_home[0]).sum())
    U, values, _ = np.linalg.svd(scale * seen.dynamics.wrench_matrix(seen.pose, seen.carriers)[:, rows])
    k = int(values[:, rank - 1].argmin())
    share = values[k, rank - 1] / at_home[rank - 1]
    if share > WEAK:
        return []
    of_home = quantity(100 * share, "%", 2) if share >= LEAST else f"less than {100 * LEAST:g} %"
    direction = np.zeros(6)
    direction[rows] = U[k, :, rank - 1]
    return [
        f"from where the carriers are at t = {seen.times[k]:.3f} s, the cables pull along {direction_text(direction)} "
        f"with {of_home} of their effect at home; a smaller objective.formation, such as "
        "0.3 m, keeps carriers closer to their formation at home"
    ]
