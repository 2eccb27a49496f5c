"""`has_zeros`, `is_askew`: whether a log shows constant errors of load cells (zeros), or an orientation sensor askew.

One step of the fit with these errors as further parameters shows how large they are, and whether the log determines
them. Where anchors and the CoM are nearly right, gravity and lengths show how a sensor is mounted better than one can
align it by eye.
"""

import numpy as np

from ..logs.load_cells import unreadable
from ..logs.measurements import Measurements, measured
from ..pose.estimate import largest_cost
from .considered import from_thrusts
from .parameters import GROUPS
from .solving import Solved, inflation_of, one_step

USUAL = 0.1  # of the mean tension, standard deviation of zeros
USUAL_MOUNT = 0.05  # [rad], standard deviation of the mount of a sensor about each axis
CERTAIN = 1e-6  # probability that random errors look like zeros, or like a sensor askew
SMALLEST = 1e-3  # of the mean tension: smaller zeros are not estimated
DECIDED = 0.3  # of the prior standard deviation of zeros: with a smaller one a log determines them


def with_zeros(
    measurements: Measurements, groups: tuple[str, ...], prior: dict[str, float]
) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return parameters and standard deviations about the file's values with the zeros of load cells."""
    assert measurements.tensions is not None
    return (*groups, "zeros"), prior | {"zeros": USUAL * float(np.abs(measurements.tensions).mean())}


def has_zeros(solved: Solved) -> bool:
    """Return whether a fit of tensions should estimate the zeros of their load cells.

    It should if the log shows zeros. It also should if poses are measured and the log does not determine zeros, because
    standard deviations then include them. It should not if accelerations are unknown, because these may look
    like zeros, or if tensions follow from thrusts.
    """
    of = solved.model
    given, groups, forces = of.measurements, of.parameters.groups, of.balanced
    if forces is None or given.tensions is None or not groups or "zeros" in groups:
        return False
    unknown = of.has_unknown_poses
    if from_thrusts(of.robot) or (unknown and not forces.at_rest):
        return False
    groups, prior = with_zeros(given, groups, of.prior)
    zeros, covariance = one_step(solved, "zeros", groups, prior)
    squares = float(zeros @ np.linalg.solve(covariance, zeros)) / inflation_of(solved.noise)
    size = np.sqrt((zeros**2).mean()) / float(np.abs(given.tensions).mean())
    if squares > largest_cost(len(zeros), CERTAIN) and size > SMALLEST:
        return True
    open_ = np.sqrt(np.diag(covariance)) > DECIDED * prior["zeros"]
    return not unknown and bool((open_ & ~unreadable(given.tensions, given.lengths).all(axis=0)).any())


def with_mount(groups: tuple[str, ...], prior: dict[str, float]) -> tuple[tuple[str, ...], dict[str, float]]:
    """Return parameters and standard deviations about the file's values with the mount of the sensor."""
    return tuple(name for name in GROUPS if name in (*groups, "body")), prior | {"body": USUAL_MOUNT}


def is_askew(solved: Solved) -> bool:
    """Return whether a fit of orientations without positions should estimate how their sensor is mounted."""
    of = solved.model
    groups, known = of.parameters.groups, measured(of.measurements)
    if not groups or "body" in groups or known[:, :3].any() or not (known.any() and of.robot.dof_mask[3:].all()):
        return False
    turned, covariance = one_step(solved, "body", *with_mount(groups, of.prior))
    squares = float(turned @ np.linalg.solve(covariance, turned)) / inflation_of(solved.noise)
    return squares > largest_cost(3, CERTAIN)
