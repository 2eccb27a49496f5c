r"""Method "min-norm": pseudo-inverse plus null space, Eq. 16 and 17 of Wang, Zhao, Li, Ji (m robots towing one object).

The paper prints $T = J^T (J J^T)^{-1} w + N \lambda$ with a scalar $\lambda \in (0, 1)$. That inverse does
not exist for fewer than six cables and one scalar cannot move along a null space of several dimensions, so here the
pseudo-inverse comes from the singular value decomposition and $\lambda \in R^{m - rank}$ is the shortest one that
brings the tensions inside their limits. T' and N lambda are orthogonal: the result is the least norm of all.
"""

from typing import Any

import numpy as np

from .method import Array, Method, Proposal, StandardForm
from .numerics.least_norm import least_norm_in_null_space

_SLACK = 1e-12  # How far s, of order one, may pass a limit; `solve` moves it back.


class MinNorm(Method):
    """Pseudo-inverse solution, moved along the null space as little as the limits require."""

    name = "min-norm"
    guarantee = "the unique optimum, in closed form up to m - rank = 1; no tensions and a certificate if there are none"
    source = "Wang, Zhao, Li, Ji, cable-driven multi-robot towing system, Eq. 16-17, corrected"
    exact = True
    continuous = True
    least_squares = True
    seeks_reference = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Take s' = Q^T b, and s' + N^T lambda if that is outside the limits."""
        s = form.b @ form.Q  # (k,)
        low, high = form.lower - s, form.upper - s
        if low.max(initial=-np.inf) <= _SLACK and high.min(initial=np.inf) >= -_SLACK:
            return Proposal(s)
        freedom = form.N.shape[0]
        if freedom == 0:
            return Proposal(None, detail="the only tensions that give w are outside the limits")
        if freedom == 1:
            shift = _shortest_shift(form.N[0], low, high)
            if shift is None:
                return Proposal(None, detail="no multiple of the null-space vector lies inside the limits")
            return Proposal(s + shift * form.N[0])
        return least_norm_in_null_space(form)


def _shortest_shift(null: Array, low: Array, high: Array) -> float | None:
    """Return the lambda nearest to 0 with low <= lambda null <= high, or None; all of shape (k,)."""
    moves = np.abs(null) > _SLACK
    still = ~moves
    if (low[still] > _SLACK).any() or (high[still] < -_SLACK).any():
        return None
    at_low, at_high = low[moves] / null[moves], high[moves] / null[moves]
    first = float(np.minimum(at_low, at_high).max())
    last = float(np.maximum(at_low, at_high).min())
    if first > last + _SLACK:
        return None
    return min(max(0.0, first), last)
