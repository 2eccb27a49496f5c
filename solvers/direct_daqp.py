"""Method "daqp": the bounded quadratic program by a dual active-set method, the daqp package."""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .method import Method, Proposal
from .standard_form import StandardForm

__all__ = ["Daqp", "bounded_least_norm"]

Array = NDArray[np.float64]

_EQUALITY = 5  # DAQP's constraint type: always active

# In standard form s is of order one; DAQP's own defaults (1e-6) would leave visible errors.
_SETTINGS: dict[str, Any] = {"primal_tol": 1e-11, "eq_reduction": -1}

_EXIT = {-1: "infeasible", -2: "cycling", -3: "unbounded", -4: "iteration limit", -6: "overdetermined start"}


class Daqp(Method):
    """Weighted least squares to t_ref inside the limits, by a dual active-set method."""

    name: ClassVar[str] = "daqp"
    guarantee: ClassVar[str] = (
        "the unique optimum, exact up to rounding, continuous in w; no tensions and a certificate if there are none"
    )
    source: ClassVar[str] = "DAQP: D. Arnström, A. Bemporad, D. Axehill, IEEE Trans. Autom. Control 67(8), 2022"
    exact: ClassVar[bool] = True
    continuous: ClassVar[bool] = True
    least_squares: ClassVar[bool] = True
    seeks_reference: ClassVar[bool] = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise |s|^2 with Q s = b as equality rows and the limits as simple bounds."""
        return bounded_least_norm(
            np.concatenate([form.upper, form.b]), np.concatenate([form.lower, form.b]), form.Q, equalities=form.b.size
        )


def bounded_least_norm(upper: Array, lower: Array, rows: Array, equalities: int) -> Proposal:
    """Minimise |x|^2 subject to lower <= (x, rows x) <= upper; the last `equalities` rows are equations.

    Parameters
    ----------
    upper, lower :
        Limits of x, as far as they go beyond the rows, followed by those of the rows.
    rows :
        Shape (rows, x).
    equalities :
        How many of the last rows have equal limits.
    """
    import daqp

    x_size = rows.shape[1]
    sense = np.zeros(upper.size, dtype=np.int32)
    sense[upper.size - equalities :] = _EQUALITY
    x, _, flag, info = daqp.solve(np.eye(x_size), np.zeros(x_size), rows, upper, lower, sense, **_SETTINGS)
    if flag < 1:
        return Proposal(None, info["iterations"], f"daqp: {_EXIT.get(flag, f'exit flag {flag}')}")
    return Proposal(x, info["iterations"])
