"""Method "analytic-centre": the tensions with the largest product of distances to all limits."""

from typing import Any, ClassVar

import numpy as np

from ...base.tolerances import RANK
from .log_barrier import start_in_form
from .method import Method, Proposal, StandardForm
from .numerics.barrier_newton import barrier_point


class AnalyticCentre(Method):
    """Analytic centre of the feasible tensions.

    Existence: wherever the problem is feasible and the feasible tensions are bounded; failed if they are unbounded.
    With w on the very boundary it is the centre for the cables whose tensions w does not determine. Cables without any
    limit have no influence. A smooth function of A (of constant rank), w and the limits; t_ref and weights play no
    part. Like "centroid" without its geometry: any m - rank costs the same, about ten Newton steps, few from the last
    solution (`start`). Outside the feasible set: a certificate.
    """

    name = "analytic-centre"
    guarantee = (
        "unique, strictly inside the limits, continuously differentiable; fails if the feasible tensions are unbounded"
    )
    source = "S. Boyd, L. Vandenberghe, Convex Optimization, 2004, section 8.5.3"
    exact = True
    continuous = True
    options: ClassVar[dict[str, str] | None] = {
        "start": "tensions to start from [N], shape (m,), for example the last solution; they need not give w"
    }

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise the logarithms alone."""
        start = start_in_form(form, options.get("start"))
        limited = np.isfinite(form.lower) | np.isfinite(form.upper)
        if limited.all():
            return barrier_point(form, 0.0, 1.0, start)
        # Cables without limits do not affect the centre: they give what the others leave, in one way if it is bounded.
        unlimited = form.Q[:, ~limited]
        U, sigma, _ = np.linalg.svd(unlimited)
        if sigma.size < unlimited.shape[1] or sigma.min(initial=1.0) <= RANK:
            return Proposal(None, detail="the feasible tensions are unbounded: no centre", final=True)
        rest = U[:, sigma.size :].T
        V, size, Wt = np.linalg.svd(rest @ form.Q[:, limited])
        rank = int(np.count_nonzero(size > RANK))
        reduced = form._replace(
            Q=Wt[:rank],
            N=Wt[rank:],
            b=(V[:, :rank].T @ (rest @ form.b)) / size[:rank],
            lower=form.lower[limited],
            upper=form.upper[limited],
        )
        centre = barrier_point(reduced, 0.0, 1.0, None if start is None else start[limited])
        if centre.s is None:
            return centre
        s = np.zeros(form.lower.size)
        s[limited] = centre.s
        s[~limited] = np.linalg.lstsq(unlimited, form.b - form.Q @ s, rcond=RANK)[0]
        return centre._replace(s=s)
