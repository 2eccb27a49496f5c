"""Method "improved-closed-form": the closed form, repeated with the worst cable held at its limit."""

from typing import Any

import numpy as np

from ...base.tolerances import FEASIBILITY, RANK, ROUNDING
from .closed_form import middle, outside
from .method import Method, Proposal, StandardForm


class ImprovedClosedForm(Method):
    """Closed form in which cables beyond their limits are held there, one after the other.

    Existence: better than the closed form, still not guaranteed: a cable that was held is never released (status failed
    then, `detail` reports where it stopped). Continuous as long as the same cables are held; where the choice of the
    worst cable changes it may jump. Cost: at most m - rank + 1 pseudo-inverses. Outside the feasible set: a
    certificate. With weights the worst cable is the one with the largest weighted excess.
    """

    name = "improved-closed-form"
    guarantee = "at most m - rank + 1 pseudo-inverses; solves most feasible problems, and fails on the others"
    source = (
        "A. Pott, 'An improved force distribution algorithm for over-constrained cable-driven parallel robots', "
        "Computational Kinematics (CK 2013), 2014"
    )
    exact = False

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Hold the cable farthest outside its limits and distribute the rest again, until all are inside."""
        s = middle(form)
        free = np.ones(s.size, dtype=bool)
        near = ROUNDING * (1.0 + np.abs(s).max(initial=0.0))  # of the numbers that results are differences of
        for reduction in range(s.size + 1):
            left = form.b - form.Q @ s
            s[free] += np.linalg.pinv(form.Q[:, free], rcond=RANK) @ left
            error = form.b - form.Q @ s
            if np.sqrt(error @ error) > FEASIBILITY * (1.0 + np.abs(s).max(initial=0.0)):
                return Proposal(None, reduction + 1, f"no redundancy left after {reduction} cables were held")
            if not outside(form, s):
                # Up to rounding this is at a limit: a problem that requires no wrench has no tolerance.
                s = np.where(np.abs(s - form.lower) < near, form.lower, s)
                return Proposal(np.where(np.abs(s - form.upper) < near, form.upper, s), reduction + 1)
            beyond = np.where(free, np.maximum(form.lower - s, s - form.upper), -np.inf)
            worst = int(np.argmax(beyond))
            s[worst] = form.lower[worst] if s[worst] < form.lower[worst] else form.upper[worst]
            free[worst] = False
            # The others start again from their middle, of which the next pseudo-inverse keeps nearest.
            s = np.where(free, middle(form), s)
        return Proposal(None, s.size, "every cable is held at a limit")
