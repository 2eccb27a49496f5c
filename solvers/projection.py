"""The tensions inside their limits whose wrench is nearest to the required one."""

import numpy as np
from numpy.typing import NDArray

from ..tolerances import RANK
from .box_least_squares import box_least_squares
from .problem import TensionProblem

__all__ = ["project"]

Array = NDArray[np.float64]

_STILL = 1e-5


def project(problem: TensionProblem) -> tuple[Array, Array]:
    """Project w on the available wrench set, in newtons (moments divided by the problem's length).

    Returns
    -------
    closest :
        Tensions inside the limits whose wrench is nearest to w [N], shape (m,). The wrench is unique, they need not be.
    residual :
        What they leave open, S (w - A closest) [N], shape (n,), orthogonal to the last digit to every cable that is not
        at a limit. It has that accuracy relative to its own length, however short it is beside w.
    """
    M, residual = problem.scaled_A, problem.scaled_w
    closest = np.zeros(problem.m)
    # Rounding is relative to w, and a short residual has lost the digits that make its direction. Projecting what is
    # left, from where we stand, brings them back.
    for _ in range(4):
        given = residual
        step, _ = box_least_squares(M, given, problem.t_min - closest, problem.t_max - closest)
        closest = np.minimum(np.maximum(closest + step, problem.t_min), problem.t_max)
        residual = given - M @ step
        if residual @ residual > 1e-2 * (given @ given):
            break
    # A cable that is not at a limit has no part along the residual, but for rounding. One that has is at its limit, and
    # only rounding puts it inside.
    still = np.abs(residual @ M) <= _STILL * problem.column_norms * np.sqrt(residual @ residual)
    inside = (closest > problem.t_min) & (closest < problem.t_max) & still
    return closest, _orthogonal_part(residual, M[:, inside])


def _orthogonal_part(vector: Array, columns: Array) -> Array:
    """Remove from `vector` its parts in the range of `columns`; twice, since once is not enough if little is left."""
    U, sigma, _ = np.linalg.svd(columns, full_matrices=False)
    U = U[:, sigma > RANK * sigma.max(initial=0.0)]
    for _ in range(2):
        vector = vector - U @ (U.T @ vector)
    return vector
