r"""Method "closed-form": the pseudo-inverse about the middle of the limits.

$$
t = t_m + A^+ (w - A t_m), \qquad t_m = (t_{min} + t_{max}) / 2
$$

With weights the pseudo-inverse is the weighted one. Of all tensions that give w, limits or not, these are the nearest
to the middle; if they leave the limits although others would not, that is the method's known gap.
"""

from typing import Any

import numpy as np

from .method import Array, Method, Proposal, StandardForm

_SLACK = 1e-12  # How far s, of order one, may pass a limit; `solve` moves it back.


class ClosedForm(Method):
    """Pseudo-inverse solution nearest to the middle of the limits.

    Existence: not guaranteed; the tensions may leave the limits though the problem is feasible (status failed, `detail`
    names the cable). Continuous and even smooth in w wherever it returns tensions. Cost: one product with the
    pseudo-inverse. Outside the feasible set: a certificate. A cable without two limits has t_ref, moved inside the
    limits, for a middle; t_ref plays no other part.
    """

    name = "closed-form"
    guarantee = (
        "one matrix product, smooth in w; fails if the tensions leave the limits, which may happen though the problem "
        "is feasible"
    )
    source = (
        "A. Pott, T. Bruckmann, L. Mikelsons, 'Closed-form force distribution for parallel wire robots', "
        "Computational Kinematics 2009"
    )
    exact = False

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Project the middle of the limits on Q s = b."""
        s = middle(form)
        s = s + (form.b - form.Q @ s) @ form.Q
        detail = outside(form, s)
        return Proposal(None, detail=f"the closed form {detail}") if detail else Proposal(s)


def middle(form: StandardForm) -> Array:
    """Return the middle of the limits, shape (k,); with one limit or none, the point inside nearest to t_ref."""
    both = np.isfinite(form.lower) & np.isfinite(form.upper)
    nearest = np.minimum(np.maximum(form.lower, 0.0), form.upper)
    return np.where(both, 0.5 * np.where(both, form.lower, 0.0) + 0.5 * np.where(both, form.upper, 0.0), nearest)


def outside(form: StandardForm, s: Array) -> str:
    """Describe which cable is farthest outside its limits; empty if none is."""
    beyond = np.maximum(form.lower - s, s - form.upper) * form.unit
    if not (beyond > _SLACK * form.unit).any():
        return ""
    worst = int(np.argmax(beyond))
    return f"leaves the limits of cable {form.moving[worst]} by {beyond[worst]:.3g} N"
