"""Method "analytic-centre": the tensions with the largest product of distances to all limits."""

from typing import Any, ClassVar

import numpy as np

from .barrier_newton import barrier_point
from .log_barrier import start_in_form
from .method import Method, Proposal
from .standard_form import StandardForm

__all__ = ["AnalyticCentre"]


class AnalyticCentre(Method):
    """Analytic centre of the feasible tensions.

    Existence: wherever the feasible tensions have an interior and are bounded; where they have no interior (w on the
    very boundary), the nearest to t_ref; failed if they are unbounded. A smooth function of A (of constant rank), w and
    the limits; t_ref and weights play no part. Like "centroid" without its geometry: any m - rank costs the same, tens
    of Newton steps, few from the last answer (`start`). Outside the feasible set: a certificate.
    """

    name: ClassVar[str] = "analytic-centre"
    guarantee: ClassVar[str] = (
        "unique, strictly inside the limits, continuously differentiable; failed if unbounded, certificate if none"
    )
    source: ClassVar[str] = "S. Boyd, L. Vandenberghe, Convex Optimization, 2004, section 8.5.3"
    exact: ClassVar[bool] = True
    continuous: ClassVar[bool] = True
    options: ClassVar[dict[str, str] | None] = {
        "start": "tensions to start from [N], shape (m,), say the last answer; they need not give w"
    }

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise the logarithms alone."""
        start = start_in_form(form, options.get("start"))
        if (np.isinf(form.lower) & np.isinf(form.upper)).any():
            return Proposal(None, detail="a cable without limits has no centre", final=True)
        return barrier_point(form, 0.0, 1.0, start)
