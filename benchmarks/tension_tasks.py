"""The tasks of the hot-loop benchmark: sets of random tension problems of one kind and one number of cables.

Kinds: "feasible"; "infeasible", a wrench beyond the available wrench set by 0.001 to 0.3 of the largest tension;
"rank-deficient", six equations of rank five, feasible; "soft", an infeasible one of which some wrench may be missing,
as the variables (t, e) with A t + e = w. The largest tension is 1, the unit.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.errors import SolverError
from ..solvers import TensionProblem
from .qp_solver import as_qp, multipliers

Array = NDArray[np.float64]

KINDS = ("feasible", "infeasible", "rank-deficient", "soft")
T_MIN = 0.01
STIFFNESS = 1e3  # Cost of a missing wrench in soft problems, relative to the same tension.


class Task(NamedTuple):
    """Problems of one kind, each as a tension problem and as a QP."""

    kind: str  # one of `KINDS`
    m: int  # number of cables
    problems: list[TensionProblem]  # soft ones have m + 6 variables, t and e
    qps: list[dict[str, Any]]  # the same as P, q, A, b, lb, ub
    optima: list[Array] | None  # of each, (variables,), proven by its multipliers; None if the task is infeasible

    @property
    def name(self) -> str:
        """Return kind and number of cables, for tables."""
        return f"{self.kind}, m = {self.m}"


def make_task(kind: str, m: int, count: int) -> Task:
    """Make `count` problems of a kind, m cables; the same ones each time."""
    rng = np.random.default_rng([0, m, KINDS.index(kind)])
    problems = [_problem(rng, kind, m) for _ in range(count)]
    qps = [as_qp(problem) for problem in problems]
    return Task(kind, m, problems, qps, None if kind == "infeasible" else [_optimum(qp) for qp in qps])


def _problem(rng: np.random.Generator, kind: str, m: int) -> TensionProblem:
    A = _wrench_matrix(rng, m, axis=kind == "rank-deficient")
    if kind in ("feasible", "rank-deficient"):
        return TensionProblem(A, A @ rng.uniform(T_MIN, 1.0, m), T_MIN, 1.0)
    d = rng.normal(size=6)
    d /= np.linalg.norm(d)
    corner = np.where(d @ A > 0, 1.0, T_MIN)
    w = A @ corner + d * 10.0 ** rng.uniform(-3.0, -0.5)
    if kind == "infeasible":
        return TensionProblem(A, w, T_MIN, 1.0)
    free = np.full(6, np.inf)
    weights = np.r_[np.ones(m), np.full(6, STIFFNESS)]
    matrix = np.hstack([A, np.eye(6)])
    return TensionProblem(matrix, w, np.r_[np.full(m, T_MIN), -free], np.r_[np.ones(m), free], weights=weights)


def _wrench_matrix(rng: np.random.Generator, m: int, axis: bool) -> Array:
    """Return the wrench matrix (6, m) of random directions at attachments within a metre, or on one axis: rank five."""
    u = rng.normal(size=(3, m))
    u /= np.linalg.norm(u, axis=0)
    r = rng.uniform(-1.0, 1.0, size=(3, m))
    if axis:
        # About a point off the axis, so that no row is zero and a solver has to find the dependence itself.
        r = rng.uniform(-1.0, 1.0, size=(3, 1)) + np.outer(rng.normal(size=3), rng.uniform(-1.0, 1.0, size=m))
    return np.concatenate([u, np.asarray(np.cross(r, u, axis=0), dtype=np.float64)])


def _optimum(qp: dict[str, Any]) -> Array:
    """Return the optimum of a QP with diagonal cost, proven by multipliers.

    DAQP finds which limits are met; the rest is least squares, and the multipliers are the proof.
    """
    import daqp

    P, q, A, b, lower, upper = (qp[key] for key in ("P", "q", "A", "b", "lb", "ub"))
    sense = np.zeros(b.size + q.size, dtype=np.int32)
    sense[q.size :] = 5
    x, _, _, _ = daqp.solve(P, q, A, np.r_[upper, b], np.r_[lower, b], sense, primal_tol=1e-11)
    weights = np.diagonal(P)
    x = np.where(x <= lower + 1e-8, lower, np.where(x >= upper - 1e-8, upper, x))
    inside = (x > lower) & (x < upper)
    root = 1.0 / np.sqrt(weights[inside])
    wish = -q[inside] / weights[inside]
    left = b - A[:, ~inside] @ x[~inside] - A[:, inside] @ wish
    x[inside] = wish + root * np.linalg.lstsq(A[:, inside] * root, left, rcond=1e-11)[0]
    y, z = multipliers(weights * x + q, A, b, x, lower, upper)
    wrong = max(
        np.abs(A @ x - b).max(), np.abs(weights * x + q + y @ A + z).max(), (lower - x).max(), (x - upper).max()
    )
    if not wrong < 1e-10:
        raise SolverError(f"the reference of the benchmark must be exact to 1e-10, got an error of {wrong:.1e}")
    return x
