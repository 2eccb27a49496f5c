r"""Method "log-barrier": least squares to t_ref plus logarithms that keep the tensions off their limits.

$$
\min_t \; \frac12 \sum_i \frac{\omega_i}{\omega_{max}} (t_i - t_{ref,i})^2
- \mu \sum_i \big( \log (t_i - t_{min,i}) + \log (t_{max,i} - t_i) \big)
\quad \text{s.t.} \quad A t = w
$$
"""

from typing import Any, ClassVar

import numpy as np

from ...base.inputs import finite_array, number
from .method import Method, Proposal, StandardForm
from .numerics.barrier_newton import barrier_point


class LogBarrier(Method):
    """Continuously differentiable distribution, strictly inside the limits.

    Existence: wherever the problem is feasible; with w on the very boundary only the cables whose tensions w does not
    determine stay off their limits. The tensions are a smooth function of A (of constant rank), w, t_ref and the
    limits: no kink where a cable comes to its limit, which is what a controller that differentiates tensions needs. The
    price is a distance of about mu / (gradient of the cost) to the optimum of "active-set"; with a smaller `barrier`
    the bends are sharper. Cost: about ten Newton steps from the middle of the limits, one to six from the last solution
    (`start`). Outside the feasible set: a certificate.
    """

    name = "log-barrier"
    guarantee = "unique, strictly inside the limits, continuously differentiable"
    source = (
        "in the spirit of E. Ueland, T. Sauder, R. Skjetne, 'Optimal force allocation for overconstrained cable-driven "
        "parallel robots: continuously differentiable solutions', IEEE Trans. Robotics 37(2), 2021"
    )
    exact = True
    continuous = True
    options: ClassVar[dict[str, str] | None] = {
        "barrier": "square root of mu in units of the narrowest range t_max - t_min (of 1 N if there is none); 0.01 if "
        "not given",
        "start": "tensions to start from [N], shape (m,), for example the last solution; they need not give w",
    }

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise by Newton's method."""
        barrier = number("barrier", options.get("barrier", 0.01), 1e-6, 1e6)
        ranges = (form.upper - form.lower) * form.unit
        # Taken from the limits alone: with anything that depends on w the tensions would not be smooth in it.
        narrowest = float(ranges[np.isfinite(ranges)].min(initial=np.inf))
        root = barrier * (narrowest if np.isfinite(narrowest) else 1.0) / form.unit.min(initial=np.inf)
        return barrier_point(form, 1.0, root**2, start_in_form(form, options.get("start")))


def start_in_form(form: StandardForm, start: Any) -> Any:
    """Return the tensions to start from as a point s, shape (k,), or None if there are none."""
    if start is None:
        return None
    t = finite_array("start", start, form.origin.shape)
    return (t[form.moving] - form.origin[form.moving]) / form.unit
