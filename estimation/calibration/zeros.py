"""`has_zeros`: whether load cells have constant errors (zeros) that the other parameters depend on.

One step of the fit with zeros as further parameters shows how large they are, and whether the log determines them.
"""

import numpy as np

from ..logs.load_cells import unreadable
from ..logs.measurements import Measurements
from ..pose.estimate import largest_cost
from .considered import from_thrusts
from .solving import Solved, inflation_of, one_step

USUAL = 0.1  # of the mean tension, standard deviation of zeros
CERTAIN = 1e-6  # probability that random errors of the tensions look like zeros
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
    measured, groups, forces = of.measurements, of.parameters.groups, of.balanced
    if forces is None or measured.tensions is None or not groups or "zeros" in groups:
        return False
    unknown = of.has_unknown_poses
    if from_thrusts(of.robot) or (unknown and not forces.at_rest):
        return False
    groups, prior = with_zeros(measured, groups, of.prior)
    zeros, covariance = one_step(solved, "zeros", groups, prior)
    squares = float(zeros @ np.linalg.solve(covariance, zeros)) / inflation_of(solved.noise)
    size = np.sqrt((zeros**2).mean()) / float(np.abs(measured.tensions).mean())
    if squares > largest_cost(len(zeros), CERTAIN) and size > SMALLEST:
        return True
    open_ = np.sqrt(np.diag(covariance)) > DECIDED * prior["zeros"]
    return not unknown and bool((open_ & ~unreadable(measured.tensions, measured.lengths).all(axis=0)).any())
