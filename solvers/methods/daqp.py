"""Method "daqp": the bounded quadratic program by a dual active-set method, the daqp package."""

from typing import Any

from .method import Method, Proposal, StandardForm
from .numerics.least_norm import least_norm


class Daqp(Method):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method."""

    name = "daqp"
    guarantee = (
        "the unique optimum, exact up to rounding, continuous in w; no tensions and a certificate if there are none"
    )
    source = "DAQP: D. Arnström, A. Bemporad, D. Axehill, IEEE Trans. Autom. Control 67(8), 2022"
    exact = True
    continuous = True
    least_squares = True
    seeks_reference = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise |s|^2 with Q s = b as equality rows and the limits as simple bounds."""
        return least_norm(form)
