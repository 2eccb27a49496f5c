"""Method "largest-margin": as far from all limits as possible, by a linear program."""

from typing import Any

import numpy as np

from .method import Method, Proposal, StandardForm
from .numerics.linear_program import TIE, deepest, nearest


class LargestMargin(Method):
    """Maximise the smallest distance of a tension to its limits, in newtons ("optimally safe").

    Existence: wherever the problem is feasible; failed if
    nothing limits the margin (infinite limits). The largest margin itself is continuous; the tensions are unique, by
    the distance to t_ref, continuous in w for a fixed wrench matrix, and may jump as cables turn. Cables with equal
    limits do not count. Cost: one linear program and one quadratic one. Outside the feasible set: a certificate.
    """

    name = "largest-margin"
    guarantee = "the largest distance to the limits; of all tensions with that distance, those nearest to t_ref"
    source = (
        "P. Borgstrom et al., 'Rapid computation of optimally safe tension distributions', "
        "IEEE Trans. Robotics 25(6), 2009"
    )
    exact = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Maximise delta subject to lower + delta / unit <= s <= upper - delta / unit."""
        per_unit = form.unit.min(initial=np.inf) / form.unit
        program, margin = deepest(form, per_unit)
        if program.s is None:
            return program
        inset = max(0.0, margin - TIE * (1.0 + abs(margin))) * per_unit
        return nearest(form, program, np.zeros((0, per_unit.size)), np.zeros(0), inset)
