"""The point of least norm inside limits that solves equations, by the daqp package."""

from typing import Any

import numpy as np

from ..method import Array, Proposal, StandardForm

_EQUALITY = 5  # DAQP's constraint type: always active

# In standard form s is of order one; DAQP's own defaults (1e-6) would leave visible errors.
_SETTINGS: dict[str, Any] = {"primal_tol": 1e-11, "eq_reduction": -1}

_EXIT = {-1: "infeasible", -2: "cycling", -3: "unbounded", -4: "iteration limit", -6: "overdetermined start"}


def least_norm(form: StandardForm, b: Array | None = None, slack: float = 0.0) -> Proposal:
    """Minimise |s|^2 with Q s = b and limits moved outwards by `slack`; b, (r,), is by default the form's."""
    b = form.b if b is None else b
    return bounded_least_norm(np.append(form.upper + slack, b), np.append(form.lower - slack, b), form.Q, b.size)


def least_norm_in_null_space(form: StandardForm) -> Proposal:
    """Minimise |s|^2 as `least_norm` does, in coordinates of the null space: s = Q^T b + N^T lambda."""
    base = form.b @ form.Q  # (k,)
    rows = np.ascontiguousarray(form.N.T)
    answer = bounded_least_norm(form.upper - base, form.lower - base, rows, equalities=0)
    return answer if answer.s is None else Proposal(base + answer.s @ form.N, answer.iterations)


def bounded_least_norm(upper: Array, lower: Array, rows: Array, equalities: int) -> Proposal:
    """Minimise |x|^2 subject to lower <= (x, rows x) <= upper; the last `equalities` rows are equations.

    - `upper`, `lower`: limits of x, as far as they go beyond the rows, followed by the limits of the rows.
    - `rows`: shape (rows, x).
    - `equalities`: how many of the last rows have equal limits.
    """
    import daqp

    x_size = rows.shape[1]
    sense = np.zeros(upper.size, dtype=np.int32)
    sense[upper.size - equalities :] = _EQUALITY
    x, _, flag, info = daqp.solve(np.eye(x_size), np.zeros(x_size), rows, upper, lower, sense, **_SETTINGS)
    if flag < 1:
        return Proposal(None, info["iterations"], f"daqp: {_EXIT.get(flag, f'exit flag {flag}')}")
    return Proposal(x, info["iterations"])
