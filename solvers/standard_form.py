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

from ..base.display import record
from ..base.tolerances import AT_LIMIT, DECISIVE, DOUBTFUL, OPTIMALITY, RANK, SLACK
from .box_least_squares import box_least_squares
from .problem import Array, TensionProblem


class StandardForm(NamedTuple):
    """A problem in orthonormal rows, for the k cables whose limits differ; its rank is r.

    Attributes:
        Q: Orthonormal basis of the row space, (r, k).
        N: Orthonormal basis of the null space, one row per dimension, (k - r, k): Q N^T = 0.
        b: Right-hand side, (r,).
        lower, upper: Limits of s, (k,).
        origin: Tensions at s = 0 [N], (m,): t_ref, or the common limit where the limits are equal.
        unit: Newtons per unit of s, (k,): smaller for larger weights.
        moving: Indices of the cables whose limits differ, (k,).
        sigma: Wrench error in newtons per unit of each row of Q s - b, up to one common factor, (r,).
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

    __repr__ = record

    def tensions(self, problem: TensionProblem, s: Array) -> Array:
        """Return the tensions [N] of s, shape (m,), moved inside the limits if rounding put them outside."""
        t = self.origin.copy()
        t[self.moving] += self.unit * s
        return np.minimum(np.maximum(t, problem.t_min), problem.t_max)

    @property
    def holds_reference(self) -> bool:
        """Return whether s = 0, tensions at t_ref, gives b inside the limits."""
        return not self.b.any() and bool((self.lower <= 0.0).all() and (self.upper >= 0.0).all())

    def is_optimal(self, tensions: Array) -> bool:
        r"""Return whether multipliers prove that tensions, (m,) [N], which give w inside the limits, are the optimum.

        At the point of least norm, multipliers of the active limits balance the part of the cost's gradient, s itself,
        that is in the null space of the equations:

        $$
        N s = N \mu, \qquad \mu_i \ge 0 \text{ at } lower_i, \quad \mu_i \le 0 \text{ at } upper_i, \quad
        \mu_i = 0 \text{ elsewhere}
        $$

        Such a $\mu$ is a proof, whatever method proposed s. It proves nothing if it is so large that a limit moved by
        rounding would change the cost.
        """
        s = (tensions - self.origin)[self.moving] / self.unit
        square = float(s @ s)
        gradient = self.N @ s
        if np.sqrt(gradient @ gradient) <= OPTIMALITY * np.sqrt(square):
            return True
        above, below = s - self.lower, self.upper - s
        near = AT_LIMIT * max(1.0, np.sqrt(square))
        held = (above <= near) | (below <= near)
        # A limit is known up to rounding relative to its own size, at most 1, the size of s.
        size = np.minimum(np.maximum(np.abs(self.lower), np.abs(self.upper)), 1.0)[held]
        most = DECISIVE / SLACK * square / np.maximum(size, SLACK)
        normals = self.N[:, held]
        low, high = np.where(below[held] <= near, -most, 0.0), np.where(above[held] <= near, most, 0.0)
        multipliers, _ = box_least_squares(normals, gradient, low, high)
        rest = gradient - normals @ multipliers
        distance = np.where(multipliers > 0.0, above[held], below[held])
        gap = np.abs(multipliers[multipliers != 0.0]) @ distance[multipliers != 0.0]
        return bool(np.sqrt(rest @ rest) <= OPTIMALITY * np.sqrt(square) and gap <= OPTIMALITY * square)


def standard_forms(problem: TensionProblem) -> list[StandardForm]:
    """Bring a problem to standard form, by singular value decomposition of its scaled wrench matrix.

    Returns the standard form, in which singular values below `RANK` of the largest are zero; before it, if some are
    below `DOUBTFUL`, the coarse form without those.
    """
    apart = problem.t_min < problem.t_max
    origin = np.where(apart, problem.t_ref, problem.t_min)
    moving = np.flatnonzero(apart)
    # In s_i = sqrt(omega_i) (t_i - t_ref_i) the cost is |s|^2.
    unit = np.sqrt(problem.weights.max() / problem.weights[moving])  # (k,)
    wrench = problem.scaled_w - problem.scaled_A @ origin
    lower = (problem.t_min[moving] - origin[moving]) / unit
    upper = (problem.t_max[moving] - origin[moving]) / unit
    farthest = float(np.abs(np.minimum(np.maximum(lower, 0.0), upper)).max(initial=0.0))

    U, sigma, Vt = np.linalg.svd(problem.scaled_A[:, moving] * unit)  # of (n, k)
    ranks = [int(np.count_nonzero(sigma > cut * sigma[0])) if sigma.size else 0 for cut in (DOUBTFUL, RANK)]
    forms = []
    for rank in sorted(set(ranks)):
        b = (U[:, :rank].T @ wrench) / sigma[:rank]
        # The least-norm s is at least as long as b and as its distance to the limits: no huge t_max spoils the scale.
        scale = max(float(np.sqrt(b @ b)), farthest) or 1.0
        basis, null = Vt[:rank], Vt[rank:]
        scaled = (basis, null, b / scale, lower / scale, upper / scale, origin, unit * scale, moving, sigma[:rank])
        forms.append(StandardForm(*scaled))
    return forms
