r"""Method "soft-wrench": tensions for any wrench whatever, the required one if it is available.

$$
\min_t \; \sum_i \frac{\omega_i}{\omega_{max}} (t_i - t_{ref,i})^2 + \rho |S (A t - w)|^2
\quad \text{s.t.} \quad t_{min} \le t \le t_{max}
$$

For $\rho \to \infty$ this is: project w on the available wrench set, then take the least squares to t_ref that
give the projection.
"""

from typing import Any, ClassVar

import numpy as np

from ...base.inputs import number
from ..box_least_squares import box_least_squares
from .method import Method, Proposal, StandardForm
from .numerics.least_norm import least_norm

# How much the limits may move outwards, in units of s, until least squares on the boundary of the available wrench set
# has a solution despite rounding.
_SLACKS = (0.0, 1e-13, 1e-12, 1e-11, 1e-10)


class SoftWrench(Method):
    """Tensions inside the limits whose wrench is w or, where that is out of reach, as near to it as can be.

    Existence: always. Without `rho`: where w is available the tensions are those of "active-set" and the status is
    optimal; elsewhere their wrench is the available one nearest to w (moments divided by the problem's length), the
    status is inaccurate, `residual` is the distance and the certificate is there. Lipschitz in w everywhere, also
    across the boundary, because projections and least squares inside limits are. With `rho` the wrench gives way before
    the limits force it to, by about the cost's gradient / rho: smoother, and the status is inaccurate nearly
    everywhere, with a certificate only where w is out of reach. Lipschitz in w, and in the wrench matrix too. Cost: two
    active-set solves, one with `rho`.
    """

    name = "soft-wrench"
    guarantee = (
        "always gives tensions, Lipschitz in w: the optimum if w is available, else those of the nearest wrench and a "
        "certificate"
    )
    source = (
        "A. F. Côté, P. Cardou, C. Gosselin, 'A tension distribution algorithm for cable-driven parallel robots "
        "operating beyond their wrench-feasible workspace', ICCAS 2016, slack form"
    )
    exact = True
    continuous = True
    least_squares = True
    always_answers = True
    options: ClassVar[dict[str, str] | None] = {
        "rho": "weight of the squared wrench error relative to the squared tensions, 1e-12 to 1e12; infinite if not "
        "given"
    }

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise over the box; without rho, first the wrench error, then the distance to t_ref."""
        rho = options.get("rho")
        if rho is None:
            return _nearest_wrench(form)
        root = np.sqrt(number("rho", rho, 1e-12, 1e12, ", or None for infinite")) * form.sigma
        k = form.lower.size
        s, _ = box_least_squares(
            np.vstack([root[:, None] * form.Q, np.eye(k)]), np.r_[root * form.b, np.zeros(k)], form.lower, form.upper
        )
        return Proposal(s, final=True)


def _nearest_wrench(form: StandardForm) -> Proposal:
    """Give b if that can be, else the available b nearest to it in newtons, with the least norm."""
    exact = least_norm(form)
    if exact.s is not None:
        return exact
    nearest, _ = box_least_squares(form.sigma[:, None] * form.Q, form.sigma * form.b, form.lower, form.upper)
    for slack in _SLACKS:
        solution = least_norm(form, form.Q @ nearest, slack)
        if solution.s is not None:
            return solution
    return Proposal(nearest)
