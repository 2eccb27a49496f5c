"""Method "2-norm": the point of the feasible polygon nearest to t_ref."""

from typing import Any

import numpy as np

from .method import Method, Proposal, StandardForm
from .numerics.feasible_polytope import EMPTY, FAR, inside, meet
from .numerics.least_norm import least_norm_in_null_space
from .one_norm import OneNorm


class TwoNorm(Method):
    """Nearest to t_ref, by comparing the corners of the feasible polygon with the nearest points of its edges.

    The same tensions as "active-set" and "min-norm", from a fixed number of steps. It exists where theirs do, is as
    continuous, and behaves in the same way outside the feasible set. Cost: pairs of lines for m - rank <= 2; beyond,
    the active set.
    """

    name = "2-norm"
    guarantee = "the unique optimum, without iteration up to m - rank = 2; continuous in w"
    source = OneNorm.source
    exact = True
    continuous = True
    least_squares = True
    seeks_reference = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Take the shortest lambda among 0, the feet on the lines and the corners."""
        base = form.b @ form.Q
        low, high = form.lower - base, form.upper - base
        if form.N.shape[0] > 2:
            return least_norm_in_null_space(form)
        low, high = np.maximum(low, -FAR), np.minimum(high, FAR)
        squares = np.einsum("ij,ij->j", form.N, form.N)
        moves = squares > 1e-26
        feet = [(limit[moves] / squares[moves])[:, None] * form.N[:, moves].T for limit in (low, high)]
        feet = np.concatenate([np.zeros((1, form.N.shape[0])), *feet])
        points = np.concatenate([feet[inside(feet @ form.N, low, high)], meet(form.N, low, high)])
        if points.shape[0] == 0:
            return Proposal(None, detail=EMPTY)
        return Proposal(base + points[np.argmin(np.einsum("ij,ij->i", points, points))] @ form.N, points.shape[0])
