r"""The form in which every method gets the problem, whatever its units, scales and rank.

$$
\min_s |s|^2 \quad \text{s.t.} \quad Q s = b, \; lower \le s \le upper
$$

The rows of Q are orthonormal and s is of order one, so that a tolerance means the same for a toy and for a harbour
crane. Cables with equal limits are gone: they are constants, and interior-point methods need space between limits. The
part of w outside the range of A is gone too: callers must check the residual of the tensions.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tolerances import RANK
from .problem import TensionProblem

__all__ = ["StandardForm", "standard_form"]

Array = NDArray[np.float64]


class StandardForm(NamedTuple):
    """A problem in orthonormal rows; k cables with a choice, rank r.

    Attributes
    ----------
    Q :
        Orthonormal basis of the row space, (r, k).
    N :
        Orthonormal basis of the null space, one row per dimension, (k - r, k): Q N^T = 0.
    b :
        Right-hand side, (r,).
    lower, upper :
        Limits of s, (k,).
    origin :
        Tensions at s = 0 [N], (m,): t_ref, or the common limit where the limits are equal.
    unit :
        Newtons per unit of s, (k,): smaller for larger weights.
    moving :
        Indices of the cables with a choice, (k,).
    sigma :
        What each row of Q s - b counts as a wrench error in newtons, up to one common factor, (r,).
    """

    Q: Array
    N: Array
    b: Array
    lower: Array
    upper: Array
    origin: Array
    unit: Array
    moving: NDArray[np.intp]
    sigma: Array

    def tensions(self, problem: TensionProblem, s: Array) -> Array:
        """Return the tensions [N] of s, shape (m,), moved inside the limits if rounding put them outside."""
        t = self.origin.copy()
        t[self.moving] += self.unit * s
        return np.minimum(np.maximum(t, problem.t_min), problem.t_max)


def standard_form(problem: TensionProblem, cut: float = RANK) -> StandardForm:
    """Bring a problem to standard form, by singular value decomposition of its scaled wrench matrix.

    Parameters
    ----------
    problem :
        The problem.
    cut :
        Singular values below this part of the largest count as zero.
    """
    apart = problem.t_min < problem.t_max
    origin = np.where(apart, problem.t_ref, problem.t_min)
    moving = np.flatnonzero(apart)
    # In s_i = sqrt(omega_i) (t_i - t_ref_i) the cost is |s|^2.
    unit = np.sqrt(problem.weights.max() / problem.weights[moving])  # (k,)
    matrix = problem.scaled_A[:, moving] * unit  # (n, k)
    wrench = problem.scaled_w - problem.scaled_A @ origin

    U, sigma, Vt = np.linalg.svd(matrix)
    rank = int(np.count_nonzero(sigma > cut * sigma[0])) if sigma.size else 0
    b = (U[:, :rank].T @ wrench) / sigma[:rank]

    lower = (problem.t_min[moving] - origin[moving]) / unit
    upper = (problem.t_max[moving] - origin[moving]) / unit
    # The least-norm s is at least as long as b, and as its distance to the limits: a scale that no huge t_max spoils.
    nearest_to_zero = np.minimum(np.maximum(lower, 0.0), upper)
    scale = max(float(np.sqrt(b @ b)), float(np.abs(nearest_to_zero).max(initial=0.0))) or 1.0
    return StandardForm(
        Q=Vt[:rank],
        N=Vt[rank:],
        b=b / scale,
        lower=lower / scale,
        upper=upper / scale,
        origin=origin,
        unit=unit * scale,
        moving=moving,
        sigma=sigma[:rank],
    )
