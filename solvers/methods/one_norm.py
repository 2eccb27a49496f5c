"""Method "1-norm": the corner of the feasible polygon with the least sum of absolute tensions."""

from typing import Any

import numpy as np

from .method import Method, Proposal, StandardForm
from .numerics.feasible_polytope import EMPTY, FAR, meet
from .numerics.linear_program import optimise

# Corners whose norms differ by less, relative to the largest tension among them, count as equally good.
_TIE = 1e-10


class OneNorm(Method):
    """Least sum of absolute tensions, by comparing the corners of the feasible polygon.

    Existence: wherever the problem is feasible. Not continuous: as the cables turn, the best corner changes; of equally
    good corners it takes the mean. Cost: pairs of lines for m - rank <= 2, a linear program beyond. Outside the
    feasible set: a certificate. t_ref and weights play no part. Without negative limits it agrees with "least-sum".
    """

    name = "1-norm"
    guarantee = (
        "the least sum of absolute tensions, at a corner of the feasible set; may jump as the directions of cables "
        "change"
    )
    source = "M. Gouttefarde, J. Lamaury, C. Reichert, T. Bruckmann, IEEE Trans. Robotics 31(6), 2015"
    exact = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Compare the corners of the polygon, cut along the lines of zero tension."""
        base = form.b @ form.Q
        slack_at = -form.origin[form.moving] / form.unit
        if form.N.shape[0] > 2:
            k = slack_at.size  # a linear program in (s, size)
            rows = np.block([[np.eye(k), -np.eye(k)], [-np.eye(k), -np.eye(k)]])
            return optimise(form, np.r_[np.zeros(k), form.unit], rows, np.r_[slack_at, -slack_at])
        far = FAR * (1.0 + np.abs(slack_at).max(initial=0.0))
        low, high = np.maximum(form.lower, -far), np.minimum(form.upper, far)
        points = meet(form.N, low - base, high - base, slack_at - base)
        if points.shape[0] == 0:
            return Proposal(None, detail=EMPTY)
        sums = np.abs(points @ form.N + base - slack_at) @ form.unit
        best = sums <= sums.min() + _TIE * (np.abs(sums.min()) + form.unit.sum())
        return Proposal(base + points[best].mean(axis=0) @ form.N, points.shape[0])
