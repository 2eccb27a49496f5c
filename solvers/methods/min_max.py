"""Method "min-max": the least largest tension, by a linear program."""

from typing import Any

import numpy as np

from .method import Method, Proposal, StandardForm
from .numerics.linear_program import nearest, optimise


class MinMax(Method):
    """Minimise the largest tension.

    Existence: wherever the problem is feasible and the largest tension cannot fall for ever. Unique, by the distance to
    t_ref; continuous in w for a fixed wrench matrix, may jump as cables turn. Cables with equal limits do not count.
    Cost: one linear program and one quadratic one. Outside the feasible set: a certificate.
    """

    name = "min-max"
    guarantee = (
        "minimises the largest tension; of all such tensions, those nearest to t_ref; may jump as the directions of "
        "cables change"
    )
    source = "the infinity norm of C. Gosselin, M. Grenier, Meccanica 46(1), 2011, as a linear program"
    exact = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise theta subject to origin + unit s <= theta."""
        k = form.lower.size
        size = form.unit.max(initial=0.0) or 1.0
        start = form.origin[form.moving] / size
        per_unit = form.unit / size
        rows = np.column_stack([np.diag(per_unit), -np.ones(k)])
        program = optimise(form, np.r_[np.zeros(k), 1.0], rows, -start)
        if program.s is None or not k:
            return program
        largest = float((start + per_unit * program.s).max())
        return nearest(form, program, np.diag(per_unit), largest - start)
