r"""Linear programs of the tensions, by HiGHS, and the tensions nearest to t_ref among their solutions.

A linear program often has many solutions and a solver returns any of them. Here the one nearest to t_ref is taken,
which makes the solution unique and, for a fixed wrench matrix, continuous in w. It is not continuous as the cables
turn: where an edge of the feasible tensions turns past the cost's direction, all linear programs jump.
"""

import numpy as np

from ..method import Array, Proposal, StandardForm
from .least_norm import bounded_least_norm

# HiGHS is content with 1e-7; what is left after 1e-10, its least, `nearest` takes away.
_OPTIONS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}

# HiGHS's status: unbounded, or presolve cannot decide whether unbounded or infeasible. A certificate decides.
_UNBOUNDED = (3, 4)

# By how much the optimum may be missed in the choice among equally good tensions, relative to its size.
TIE = 1e-10


def optimise(
    form: StandardForm,
    cost: Array,
    rows: Array | None = None,
    limits: Array | None = None,
    nonnegative: bool = False,
    most: float = np.inf,
) -> Proposal:
    """Minimise cost . (s, extra) subject to Q s = b, the limits of s, and rows (s, extra) <= limits.

    - `form`: the problem.
    - `cost`: shape (k + extras,).
    - `rows`, `limits`: shape (rows, k + extras) and (rows,); infinite limits are no limits.
    - `nonnegative`: True if the extra variables are not negative.
    - `most`: what the extra variables may be at most.
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


def deepest(form: StandardForm, widths: Array, most: float = np.inf) -> tuple[Proposal, float]:
    """Return the s with the largest distance to the limits, in units of the widths (k,), up to `most`, and that."""
    k = form.lower.size
    rows = np.block([[-np.eye(k), widths[:, None]], [np.eye(k), widths[:, None]]])
    limits = np.r_[-form.lower, form.upper]
    program = optimise(form, np.r_[np.zeros(k), -1.0], rows, limits, nonnegative=True, most=most)
    if program.s is None:
        return program, 0.0
    return program, float((np.minimum(program.s - form.lower, form.upper - program.s) / widths).min(initial=np.inf))


def _on_the_equations(form: StandardForm, s: Array) -> Array:
    """Remove the solver's error in Q s = b by moving the tensions that are not at a limit."""
    s = np.minimum(np.maximum(s, form.lower), form.upper)
    free = (s > form.lower + TIE) & (s < form.upper - TIE)
    s[free] += np.linalg.lstsq(form.Q[:, free], form.b - form.Q @ s, rcond=1e-9)[0]
    return s


def nearest(form: StandardForm, program: Proposal, rows: Array, limits: Array, inset: Array | float = 0.0) -> Proposal:
    """Return the s nearest to t_ref with rows s <= limits and the limits of s moved in, or the program's own s."""
    most = limits + TIE * (1.0 + np.abs(limits))
    upper = np.concatenate([form.upper - inset, most, form.b])
    lower = np.concatenate([form.lower + inset, np.full(most.size, -np.inf), form.b])
    answer = bounded_least_norm(upper, lower, np.vstack([rows, form.Q]), equalities=form.b.size)
    return program if answer.s is None else Proposal(answer.s, program.iterations)
