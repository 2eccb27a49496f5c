r"""Method "min-norm": pseudo-inverse plus null space, Eq. 16 and 17 of Wang, Zhao, Li, Ji (m robots towing one object).

The paper prints $T = J^T (J J^T)^{-1} w + N \lambda$ with a scalar $\lambda \in (0, 1)$. That inverse does
not exist for fewer than six cables and one scalar cannot move along a null space of several dimensions, so here the
pseudo-inverse comes from the singular value decomposition and $\lambda \in R^{m - rank}$ is the shortest one that
brings the tensions inside their limits. T' and N lambda are orthogonal: the result is the least norm of all.
"""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .direct_daqp import bounded_least_norm
from .method import Method, Proposal
from .standard_form import StandardForm

__all__ = ["MinNorm"]

_SLACK = 1e-12  # How far s, of order one, may pass a limit; `solve` moves it back.


class MinNorm(Method):
    """Pseudo-inverse solution, moved along the null space as little as the limits require."""

    name: ClassVar[str] = "min-norm"
    guarantee: ClassVar[str] = (
        "the unique optimum, in closed form up to m - rank = 1; no tensions and a certificate if there are none"
    )
    source: ClassVar[str] = "Wang, Zhao, Li, Ji, cable-driven multi-robot towing system, Eq. 16-17, corrected"
    exact: ClassVar[bool] = True
    continuous: ClassVar[bool] = True
    least_squares: ClassVar[bool] = True
    seeks_reference: ClassVar[bool] = True

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
        answer = bounded_least_norm(high, low, np.ascontiguousarray(form.N.T), equalities=0)
        if answer.s is None:
            return answer
        return Proposal(s + answer.s @ form.N, answer.iterations)


def _shortest_shift(null: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]) -> float | None:
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
