"""`weak_formation`: where freely moving carriers come to places from which their cables hold the platform poorly."""

import numpy as np

from ...base.text import quantity
from ...base.tolerances import INDEPENDENT
from ...solvers.certificate import direction_text
from .instants import Instants

WEAK = 0.05  # of the smallest singular value at home
LEAST = 1e-4  # smaller shares are reported as less than this
SMALLER = 0.3  # of the formation, as advice


def weak_formation(seen: Instants, formation: float | None = None) -> list[str]:
    """Return a sentence if the wrench matrix comes close to losing rank, in comparison with home.

    Moments are divided by the robot's length. Singular values that are near zero at home do not count, unless they are
    so in the motion, too. `formation` is the objective's [m]; default: the mean length of the cables.
    """
    robot = seen.robot
    rows = np.flatnonzero(robot.dof_mask)
    scale = np.repeat([1.0, 1.0 / robot.length], 3)[rows, None]
    at_home = np.linalg.svd(scale * seen.dynamics.wrench_matrix(robot.home)[rows], compute_uv=False)
    rank = int((at_home > INDEPENDENT * at_home[0]).sum())
    U, values, _ = np.linalg.svd(scale * seen.dynamics.wrench_matrix(seen.pose, seen.carriers)[:, rows])
    lost = rank < len(rows) <= robot.m and values[:, -1].min() <= INDEPENDENT * at_home[0]
    last = values.shape[1] - 1 if lost else rank - 1
    k, direction = int(values[:, last].argmin()), np.zeros(6)
    direction[rows], share = U[k, :, last], values[k, last] / at_home[last]
    if lost:
        return [
            f"at t = {seen.times[k]:.3f} s, as at home, the cables cannot pull along {direction_text(direction)}, "
            "because the wrench matrix is singular; other homes of the carriers could change that"
        ]
    if share > WEAK:
        return []
    of_home = quantity(100 * share, "%", 2) if share >= LEAST else f"less than {100 * LEAST:g} %"
    smaller = quantity(SMALLER * (formation or float(seen.dynamics.cable_lengths(robot.home).mean())), "m", 2)
    return [
        f"from where the carriers are at t = {seen.times[k]:.3f} s, the cables pull along {direction_text(direction)} "
        f"with {of_home} of their effect at home; a smaller objective.formation, such as "
        f"{smaller}, keeps carriers closer to their formation at home"
    ]
