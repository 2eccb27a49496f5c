r"""Methods "least-sum", "largest-margin" and "min-max": linear programs, by HiGHS.

A linear program often has many solutions and a solver returns any of them. Here the one nearest to t_ref is taken,
which makes the answer unique and, for a fixed wrench matrix, continuous in w. It is not continuous as the cables turn:
where an edge of the feasible tensions turns past the cost's direction, all linear programs jump.
"""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .direct_daqp import bounded_least_norm
from .method import Method, Proposal
from .standard_form import StandardForm

__all__ = ["LargestMargin", "LeastSum", "MinMax", "optimise"]

Array = NDArray[np.float64]

# HiGHS is content with 1e-7; what is left after 1e-10, its least, `_nearest` takes away.
_OPTIONS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}

# HiGHS's status: unbounded, or presolve cannot decide whether unbounded or infeasible. A certificate decides.
_UNBOUNDED = (3, 4)

# By how much the optimum may be missed in the choice among equally good tensions, relative to its size.
_TIE = 1e-10


class LeastSum(Method):
    """Least sum of the tensions.

    Existence: wherever the problem is feasible and some limit keeps the sum from falling for ever. Unique, by the
    distance to t_ref; continuous in w for a fixed wrench matrix, may jump as cables turn. Cost: one linear program and
    one quadratic one. Outside the feasible set: a certificate. Tensions tend to be at their lower limits.
    """

    name: ClassVar[str] = "least-sum"
    guarantee: ClassVar[str] = "the least sum of tensions, of these the nearest to t_ref; may jump as cables turn"
    source: ClassVar[str] = (
        "S. Fang et al., IEEE/ASME Trans. Mechatronics 9(3), 2004; "
        "HiGHS: Q. Huangfu, J. Hall, Math. Prog. Comp. 10, 2018"
    )
    exact: ClassVar[bool] = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Minimise unit . s."""
        if not form.unit.size:
            return Proposal(np.zeros(0))
        program = optimise(form, form.unit)
        if program.s is None:
            return program
        row = form.unit / np.abs(form.unit).max()
        return _nearest(form, program, row[None], [row @ program.s])


class LargestMargin(Method):
    """As far from all limits as possible, in newtons ("optimally safe").

    Maximises the smallest distance of a tension to its limits. Existence: wherever the problem is feasible; failed if
    nothing limits the margin (infinite limits). The largest margin itself is continuous; the tensions are unique, by
    the distance to t_ref, continuous in w for a fixed wrench matrix, and may jump as cables turn. Cables with equal
    limits do not count. Cost: one linear program and one quadratic one. Outside the feasible set: a certificate.
    """

    name: ClassVar[str] = "largest-margin"
    guarantee: ClassVar[str] = (
        "the largest distance to the limits, of these the nearest to t_ref; certificate if there are none"
    )
    source: ClassVar[str] = (
        "P. Borgstrom et al., 'Rapid computation of optimally safe tension distributions', "
        "IEEE Trans. Robotics 25(6), 2009"
    )
    exact: ClassVar[bool] = True

    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Maximise delta subject to lower + delta / unit <= s <= upper - delta / unit."""
        k = form.lower.size
        per_unit = form.unit.min(initial=np.inf) / form.unit
        rows = np.block([[-np.eye(k), per_unit[:, None]], [np.eye(k), per_unit[:, None]]])
        program = optimise(form, np.r_[np.zeros(k), -1.0], rows, np.r_[-form.lower, form.upper], nonnegative=True)
        if program.s is None:
            return program
        both = np.minimum((program.s - form.lower) / per_unit, (form.upper - program.s) / per_unit)
        margin = both.min(initial=np.inf) if k else 0.0
        margin = max(0.0, margin - _TIE * (1.0 + abs(margin)))
        return _nearest(form, program, np.zeros((0, k)), [], margin * per_unit)


class MinMax(Method):
    """Least largest tension.

    Existence: wherever the problem is feasible and the largest tension cannot fall for ever. Unique, by the distance to
    t_ref; continuous in w for a fixed wrench matrix, may jump as cables turn. Cables with equal limits do not count.
    Cost: one linear program and one quadratic one. Outside the feasible set: a certificate.
    """

    name: ClassVar[str] = "min-max"
    guarantee: ClassVar[str] = "the least largest tension, of these the nearest to t_ref; may jump as cables turn"
    source: ClassVar[str] = "the infinity norm of C. Gosselin, M. Grenier, Meccanica 46(1), 2011, as a linear program"
    exact: ClassVar[bool] = True

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
        return _nearest(form, program, np.diag(per_unit), largest - start)


def optimise(
    form: StandardForm,
    cost: Array,
    rows: Array | None = None,
    limits: Array | None = None,
    nonnegative: bool = False,
    most: float = np.inf,
) -> Proposal:
    """Minimise cost . (s, extra) subject to Q s = b, the limits of s, and rows (s, extra) <= limits.

    Parameters
    ----------
    form :
        The problem.
    cost :
        Shape (k + extras,).
    rows, limits :
        Shape (rows, k + extras) and (rows,); infinite limits are no limits.
    nonnegative :
        True if the extra variables are not negative.
    most :
        What the extra variables may be at most.
    """
    from scipy.optimize import linprog

    k, extras = form.lower.size, cost.size - form.lower.size
    if not k:
        return Proposal(np.zeros(0))
    bounds = np.column_stack([np.r_[form.lower, np.full(extras, -np.inf)], np.r_[form.upper, np.full(extras, most)]])
    bounds[k:, 0] = 0.0 if nonnegative else -np.inf
    inequalities = {}
    if rows is not None and limits is not None:
        finite = np.isfinite(limits)
        inequalities = {"A_ub": rows[finite], "b_ub": limits[finite]}
    equations = np.hstack([form.Q, np.zeros((form.b.size, extras))])
    answer = linprog(
        cost / np.abs(cost).max(),
        A_eq=equations,
        b_eq=form.b,
        bounds=bounds,
        method="highs",
        options=_OPTIONS,
        **inequalities,
    )
    if answer.x is None or answer.status != 0:
        unbounded = answer.status in _UNBOUNDED
        detail = "no limit bounds what is optimised" if unbounded else f"highs: {answer.message}"
        return Proposal(None, detail=detail, final=unbounded)
    return Proposal(_on_the_equations(form, answer.x[:k]), int(answer.nit))


def _on_the_equations(form: StandardForm, s: Array) -> Array:
    """Remove the solver's error in Q s = b by moving the tensions that are not at a limit."""
    s = np.minimum(np.maximum(s, form.lower), form.upper)
    free = (s > form.lower + _TIE) & (s < form.upper - _TIE)
    s[free] += np.linalg.lstsq(form.Q[:, free], form.b - form.Q @ s, rcond=1e-9)[0]
    return s


def _nearest(
    form: StandardForm, program: Proposal, rows: Array, limits: ArrayLike, inset: Array | float = 0.0
) -> Proposal:
    """Return the s nearest to t_ref with rows s <= limits and the limits of s moved in, or the program's own s."""
    most = np.asarray(limits, dtype=np.float64)
    most = most + _TIE * (1.0 + np.abs(most))
    upper = np.concatenate([form.upper - inset, most, form.b])
    lower = np.concatenate([form.lower + inset, np.full(most.size, -np.inf), form.b])
    answer = bounded_least_norm(upper, lower, np.vstack([rows, form.Q]), equalities=form.b.size)
    return program if answer.s is None else Proposal(answer.s, program.iterations)
