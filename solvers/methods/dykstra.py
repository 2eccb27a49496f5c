r"""Method "dykstra": alternating projections on the equations and on the limits.

$$
y = x + Q^T (b - Q x), \qquad x^+ = P_{box}(y + p), \qquad p^+ = y + p - x^+
$$

Without the correction p the iterates reach some feasible point; with it, the one nearest to where they start. Where p
is not 0 a limit holds the cable: as soon as those cables are the right ones, the rest is one least-squares problem, and
the optimality conditions hold. The iterations alone would take thousands more where the two sets meet at
a small angle.
"""

from typing import Any, ClassVar

import numpy as np

from ...base.inputs import whole_number
from ...base.tolerances import RANK
from .method import Array, Method, Proposal, StandardForm

# Stop when the projection on the equations moves s, of order one, by no more than this: then x is in both sets, and
# stays. The change of p is that same distance (Birgin and Raydan 2005), so a standstill of x alone does not stop it.
_STEP = 1e-11

# How often to check whether the cables at their limits are the right ones, and whether the gap between the two sets has
# become a proof that they do not meet.
_CHECK = 50

# Rounding of s, and of the multipliers, in that question.
_ROUNDING = 1e-12


class Dykstra(Method):
    """Projection of t_ref on the feasible tensions by alternating projections.

    Existence: wherever the problem is feasible, in the limit. Converges to the same unique tensions as "active-set",
    hence continuous; it ends once the cables at their limits are known, but it may stand still for long before. Stops
    when those cables fulfil the optimality conditions, when the two projections agree to 1e-11 of the size of the
    tensions, when they prove that no tensions exist, or after `max_iter`: then the status is inaccurate and `residual`
    reports how far it came. Cost: two matrix products an iteration, tens to thousands of iterations. Outside the
    feasible set: a certificate.
    """

    name = "dykstra"
    guarantee = (
        "converges to the unique optimum, at no known rate; the status is inaccurate if max_iter iterations do not "
        "suffice"
    )
    source = "M. Hassan, A. Khajepour, IEEE Trans. Robotics 24(3), 2008; R. Dykstra, JASA 78, 1983"
    exact = False
    continuous = True
    least_squares = True
    seeks_reference = True
    options: ClassVar[dict[str, str] | None] = {
        "max_iter": "iterations at most, a number from 1 up; 50000 if not given"
    }

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Project in turn from s = 0."""
        max_iter = whole_number("max_iter", options.get("max_iter", 50_000), 1, 10**9)
        Q, b, lower, upper = form.Q, form.b, form.lower, form.upper
        x = np.minimum(np.maximum(lower, 0.0), upper)
        p = -x
        for iteration in range(1, max_iter + 1):
            error = b - Q @ x
            step = error @ Q
            if step @ step <= _STEP**2:
                return Proposal(x, iteration)
            if iteration % _CHECK == 0:
                if (point := _optimum_held_by(form, p)) is not None:
                    return Proposal(point, iteration)
                if _apart(form, error):
                    return Proposal(None, iteration, "the limits and the equations do not meet")
            p += x + step
            x = np.minimum(np.maximum(p, lower), upper)
            p -= x
        return Proposal(x, max_iter, f"not converged in {max_iter} iterations")


def _optimum_held_by(form: StandardForm, p: Array) -> Array | None:
    """Return the optimum, shape (k,), if it is at just those limits that p, shape (k,), presses against."""
    low, high, free = p < 0.0, p > 0.0, p == 0.0
    s = np.where(low, form.lower, np.where(high, form.upper, 0.0))
    rows = form.Q[:, free]
    s[free] = np.linalg.lstsq(rows, form.b - form.Q @ s, rcond=RANK)[0]
    error, slack = form.b - form.Q @ s, _ROUNDING * (1.0 + np.abs(s).max(initial=0.0))
    if error @ error > slack**2 or (s < form.lower - slack).any() or (s > form.upper + slack).any():
        return None
    # The cost's gradient s is what the equations' multipliers y leave to the limits to hold.
    y = np.linalg.lstsq(rows.T, s[free], rcond=RANK)[0]
    held = s - y @ form.Q
    right = (held[low] >= -slack).all() and (held[high] <= slack).all() and (np.abs(held[free]) <= slack).all()
    return s if right else None


def _apart(form: StandardForm, direction: Array) -> bool:
    """Return whether no s inside the limits reaches b along a direction, shape (r,)."""
    pull = direction @ form.Q
    pulling = np.abs(pull) > 1e-11 * np.abs(pull).max()
    far = np.where(pull > 0.0, form.upper, form.lower)[pulling] @ pull[pulling]
    return bool(direction @ form.b - far > 1e-8 * np.sqrt(direction @ direction))
