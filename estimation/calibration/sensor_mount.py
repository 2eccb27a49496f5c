"""`is_askew`: whether the sensor that measured orientations without positions is mounted askew on the platform.

Where anchors and the CoM are nearly right, gravity and lengths show that better than one can align a sensor by eye.
"""

import numpy as np

from ..logs.measurements import measured
from ..pose.estimate import largest_cost
from .parameters import GROUPS
from .solving import Solved, inflation_of, one_step

USUAL = 0.05  # [rad], standard deviation of the mount about each axis
CERTAIN = 1e-6  # probability that random errors look like a sensor askew


def with_mount(groups: tuple[str, ...], prior: dict[str, float]) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return parameters and standard deviations about the file's values with the mount of the sensor."""
    return tuple(name for name in GROUPS if name in (*groups, "body")), prior | {"body": USUAL}


def is_askew(solved: Solved) -> bool:
    """Return whether a fit of orientations without positions should estimate how their sensor is mounted."""
    of = solved.model
    groups, known = of.parameters.groups, measured(of.measurements)
    if not groups or "body" in groups or known[:, :3].any() or not (known.any() and of.robot.dof_mask[3:].all()):
        return False
    turned, covariance = one_step(solved, "body", *with_mount(groups, of.prior))
    squares = float(turned @ np.linalg.solve(covariance, turned)) / inflation_of(solved.noise)
    return squares > largest_cost(3, CERTAIN)
