"""Methods "1-norm" and "2-norm": the corner, or the point, of the feasible polygon with the least norm."""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .direct_daqp import bounded_least_norm
from .feasible_polytope import inside, meet
from .linear_programs import optimise
from .method import Method, Proposal
from .standard_form import StandardForm

__all__ = ["OneNorm", "TwoNorm"]

Array = NDArray[np.float64]

_SOURCE = "M. Gouttefarde, J. Lamaury, C. Reichert, T. Bruckmann, IEEE Trans. Robotics 31(6), 2015"
_EMPTY = "the lines of the limits enclose nothing"

# Corners whose norms differ by less, relative to the largest tension among them, count as equally good.
_TIE = 1e-10


class OneNorm(Method):
    """Least sum of absolute tensions, by comparing the corners of the feasible polygon.

    Existence: wherever the problem is feasible. Not continuous: as the cables turn, the best corner changes; of equally
    good corners it takes the mean. Cost: pairs of lines for m - rank <= 2, a linear program beyond. Outside the
    feasible set: a certificate. t_ref and weights play no part. Without negative limits it agrees with "least-sum".
    """

    name: ClassVar[str] = "1-norm"
    guarantee: ClassVar[str] = (
        "the least sum of absolute tensions, at a corner; may jump as cables turn; certificate if there are none"
    )
    source: ClassVar[str] = _SOURCE
    exact: ClassVar[bool] = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Compare the corners of the polygon, cut along the lines of zero tension."""
        base = form.b @ form.Q
        slack_at = -form.origin[form.moving] / form.unit
        if form.N.shape[0] > 2:
            return _one_norm_program(form, slack_at)
        far = 1e8 * (1.0 + np.abs(slack_at).max(initial=0.0))
        low, high = np.maximum(form.lower, -far), np.minimum(form.upper, far)
        points = meet(form.N, low - base, high - base, slack_at - base)
        if points.shape[0] == 0:
            return Proposal(None, detail=_EMPTY)
        sums = np.abs(points @ form.N + base - slack_at) @ form.unit
        best = sums <= sums.min() + _TIE * (np.abs(sums.min()) + form.unit.sum())
        return Proposal(base + points[best].mean(axis=0) @ form.N, points.shape[0])


class TwoNorm(Method):
    """Nearest to t_ref, by comparing the corners of the feasible polygon with the nearest points of its edges.

    The same tensions as "active-set" and "min-norm", from a fixed number of steps. Existence, continuity and what
    happens outside the feasible set are theirs. Cost: pairs of lines for m - rank <= 2; beyond, the active set.
    """

    name: ClassVar[str] = "2-norm"
    guarantee: ClassVar[str] = (
        "the unique optimum without iteration up to m - rank = 2, continuous; certificate if there are none"
    )
    source: ClassVar[str] = _SOURCE
    exact: ClassVar[bool] = True
    continuous: ClassVar[bool] = True
    least_squares: ClassVar[bool] = True
    seeks_reference: ClassVar[bool] = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Take the shortest lambda among 0, the feet on the lines and the corners."""
        base = form.b @ form.Q
        low, high = form.lower - base, form.upper - base
        if form.N.shape[0] > 2:
            answer = bounded_least_norm(high, low, np.ascontiguousarray(form.N.T), equalities=0)
            return answer if answer.s is None else Proposal(base + answer.s @ form.N, answer.iterations)
        far = 1e8
        low, high = np.maximum(low, -far), np.minimum(high, far)
        squares = np.einsum("ij,ij->j", form.N, form.N)
        moves = squares > 1e-26
        feet = [(limit[moves] / squares[moves])[:, None] * form.N[:, moves].T for limit in (low, high)]
        feet = np.concatenate([np.zeros((1, form.N.shape[0])), *feet])
        points = np.concatenate([feet[inside(feet @ form.N, low, high)], meet(form.N, low, high)])
        if points.shape[0] == 0:
            return Proposal(None, detail=_EMPTY)
        return Proposal(base + points[np.argmin(np.einsum("ij,ij->i", points, points))] @ form.N, points.shape[0])


def _one_norm_program(form: StandardForm, slack_at: Array) -> Proposal:
    """Minimise the sum of absolute tensions by a linear program in (s, size)."""
    k = form.lower.size
    rows = np.block([[np.eye(k), -np.eye(k)], [-np.eye(k), -np.eye(k)]])
    return optimise(form, np.r_[np.zeros(k), form.unit], rows, np.r_[slack_at, -slack_at])
