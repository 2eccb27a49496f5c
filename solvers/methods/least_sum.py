"""Method "least-sum": the least sum of the tensions, by a linear program."""

from typing import Any

import numpy as np

from .method import Method, Proposal, StandardForm
from .numerics.linear_program import nearest, optimise


class LeastSum(Method):
    """Least sum of the tensions.

    Existence: wherever the problem is feasible and some limit keeps the sum from falling for ever. Unique, by the
    distance to t_ref; continuous in w for a fixed wrench matrix, may jump as cables turn. Cost: one linear program and
    one quadratic one. Outside the feasible set: a certificate. Tensions tend to be at their lower limits.
    """

    name = "least-sum"
    guarantee = (
        "the least sum of tensions; of all such tensions, those nearest to t_ref; may jump as the directions of cables "
        "change"
    )
    source = (
        "S. Fang et al., IEEE/ASME Trans. Mechatronics 9(3), 2004; "
        "HiGHS: Q. Huangfu, J. Hall, Math. Prog. Comp. 10, 2018"
    )
    exact = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise unit . s."""
        if not form.unit.size:
            return Proposal(np.zeros(0))
        program = optimise(form, form.unit)
        if program.s is None:
            return program
        row = form.unit / np.abs(form.unit).max()
        return nearest(form, program, row[None], np.array([row @ program.s]))
