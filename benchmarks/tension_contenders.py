"""Define the contenders of the hot-loop benchmark: each has a name, a tolerance as text, and a function for a task.

What is prepared is not timed: arrays in the layout that a solver wants, and for solvers that keep their memory between
problems (native, reuse) one instance. What is timed begins with such arrays, a new wrench matrix included, and ends
with the tensions. All are set to 1e-9 absolute, nothing relative, and are bounded in iterations, since some loop for
ever on infeasible problems.
"""

import warnings
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from ..core import solve_packed
from ..solvers import TensionProblem, methods, solve, solve_batch
from .tension_tasks import KINDS, STIFFNESS, Task

Array = NDArray[np.float64]
Single = Callable[[int], Array | None]
Batch = Callable[[int], tuple[Array, NDArray[np.bool_]]]

REFERENCE = "daqp.solve"
EPS = 1e-9
BATCH = 10_000  # Problems of a batch, at least: the task's, over and over.

_EQUALITY = 5  # DAQP's constraint type: always active

# Methods that end at the least norm, as the QP does; the others are right to answer something else.
_LEAST_NORM = {"active-set", "qp", "min-norm", "dykstra"}

_QPSOLVERS: dict[str, dict[str, Any]] = {
    "clarabel": {"tol_gap_abs": EPS, "tol_gap_rel": 0.0, "tol_feas": EPS},
    "daqp": {"primal_tol": EPS, "dual_tol": EPS},
    "highs": {"primal_feasibility_tolerance": EPS, "dual_feasibility_tolerance": EPS, "time_limit": 0.1},
    "osqp": {"eps_abs": EPS, "eps_rel": 0.0, "max_iter": 4000},
    "piqp": {"eps_abs": EPS, "eps_rel": 0.0, "max_iter": 250},
    "proxqp": {"eps_abs": EPS, "eps_rel": 0.0, "max_iter": 100},
    "quadprog": {},
    "scs": {"eps_abs": EPS, "eps_rel": 0.0, "max_iters": 10_000},
}


class Contender(NamedTuple):
    """A solver as it takes part.

    `prepare` makes of a task a function of the problem's index that returns x, (variables,), or None; for a batch, of 0
    alone: it returns x of all, (batch, variables), and which of them are results.
    """

    name: str  # for tables
    tolerance: str  # the accuracy that it was set to
    prepare: Callable[[Task], Any]
    batch: bool = False  # whether it takes all problems at once
    same_aim: bool = True  # False if it minimises something else than the QP, so that its tensions may differ
    kinds: tuple[str, ...] = KINDS  # of tasks that it can take part in


def contenders() -> list[Contender]:
    """Return every contender that is installed, the reference first."""
    required = f"{EPS:g} absolute"
    entries = [Contender(REFERENCE, required, _daqp)]
    for name in methods():
        entries.append(
            Contender(f"towline {name}", "its own, 1e-9", partial(_towline, method=name), same_aim=name in _LEAST_NORM)
        )
    entries.append(Contender("towline core alone", "its own, 1e-9", _towline_core))
    entries.append(Contender("towline solve_batch", "its own, 1e-9", _towline_batch, batch=True))
    soft = partial(_towline_batch, rho=STIFFNESS)
    entries.append(Contender("towline solve_batch, rho", "its own, 3e-14", soft, batch=True, kinds=("soft",)))
    native = {
        "daqp": ("daqp Model, reuse", partial(_daqp, reuse=True)),
        "osqp": ("osqp, reuse", _osqp),
        "clarabel": ("clarabel, reuse", _clarabel),
        "piqp": ("piqp, reuse", _piqp),
        "proxsuite": ("proxqp, reuse", _proxqp),
        "quadprog": ("quadprog, native", _quadprog),
    }
    for module, (name, prepare) in native.items():
        if find_spec(module) is not None:
            entries.append(Contender(name, "exact" if module == "quadprog" else required, prepare))
    if find_spec("moreau") is not None:
        entries.append(Contender("moreau batch", required, _moreau_batch, batch=True))
    import qpsolvers

    for name in sorted(set(_QPSOLVERS) & set(qpsolvers.available_solvers)):
        tolerance = "exact" if name == "quadprog" else required
        entries.append(Contender(f"qpsolvers {name}", tolerance, partial(_through_qpsolvers, name=name)))
    return entries


def _one_sided(qp: dict[str, Any]) -> tuple[Array, Array]:
    """Return C and d of C x <= d, the equations first, then the finite limits."""
    n = qp["q"].size
    up, low = np.isfinite(qp["ub"]), np.isfinite(qp["lb"])
    return np.vstack([qp["A"], np.eye(n)[up], -np.eye(n)[low]]), np.r_[qp["b"], qp["ub"][up], -qp["lb"][low]]


def _pattern(C: Array, equations: int) -> NDArray[np.bool_]:
    """Return where C may have entries: anywhere in the rows of the equations, and below where it has."""
    pattern = C != 0.0
    pattern[:equations] = True
    return pattern


def _columns(matrices: list[Array], equations: int) -> tuple[csc_matrix, list[Array]]:
    """Return the first of the matrices, compressed by columns, and the entries of each in that order."""
    pattern = _pattern(matrices[0], equations)
    first, entries = csc_matrix(pattern, dtype=float), [C.T[pattern.T] for C in matrices]
    first.data[:] = entries[0]
    return first, entries


def _towline(task: Task, method: str) -> Single:
    # Problems remember what was computed from them: each run gets new ones, as in a control loop.
    problems = [TensionProblem(p.A, p.w, p.t_min, p.t_max, p.t_ref, p.weights, p.length) for p in task.problems]

    def run(i: int) -> Array | None:
        answer = solve(problems[i], method=method)
        return answer.tensions if answer.feasible else None

    return run


def _towline_batch(task: Task, rho: float | None = None) -> Batch:
    """Prepare `solve_batch`; with `rho` the tensions are the only variables."""
    m = task.problems[0].m if rho is None else task.m
    A, t_min, t_max, weights = (
        _over_and_over(np.array([getattr(problem, name)[..., :m] for problem in task.problems]))
        for name in ("A", "t_min", "t_max", "weights")
    )
    w = _over_and_over(np.array([problem.w for problem in task.problems]))

    def run(_: int) -> tuple[Array, NDArray[np.bool_]]:
        answer = solve_batch(A, w, t_min, t_max, weights=weights, rho=rho, threads=1)
        return answer.tensions, answer.feasible if rho is None else np.isfinite(answer.residual)

    return run


def _towline_core(task: Task) -> Single:
    packed = [problem.packed for problem in task.problems]
    size = task.problems[0].m

    def run(i: int) -> Array | None:
        tensions = np.empty(size)
        return tensions if solve_packed(packed[i], tensions) == 0 else None

    return run


def _over_and_over(rows: Array) -> Array:
    """Repeat the rows of an array until there are enough for a batch."""
    return np.tile(rows, (-(-BATCH // len(rows)),) + (1,) * (rows.ndim - 1))


def _daqp(task: Task, reuse: bool = False) -> Single:
    """Prepare DAQP; `reuse` one model, whose memory is updated."""
    import daqp

    arguments = []
    for qp in task.qps:
        sense = np.r_[np.zeros(qp["q"].size, dtype=np.int32), np.full(qp["b"].size, _EQUALITY, dtype=np.int32)]
        upper, lower = np.r_[qp["ub"], qp["b"]], np.r_[qp["lb"], qp["b"]]
        arguments.append((qp["P"], qp["q"], np.ascontiguousarray(qp["A"]), upper, lower, sense))
    model = daqp.Model()
    model.settings = {"primal_tol": EPS}

    def run(i: int) -> Array | None:
        x, _, flag, _ = daqp.solve(*arguments[i], primal_tol=EPS)
        return x if flag > 0 else None

    def again(i: int) -> Array | None:
        _, _, A, upper, lower, sense = arguments[i]
        model.update(A=A, bupper=upper, blower=lower, sense=sense)
        x, _, flag, _ = model.solve()
        return x if flag > 0 else None

    if not reuse:
        return run
    model.setup(*arguments[0])
    return again


def _osqp(task: Task) -> Single:
    import osqp

    # Rows, lower and upper limits of lower <= C x <= upper: the equations, then x itself.
    limits = [(np.r_[qp["b"], qp["lb"]], np.r_[qp["b"], qp["ub"]]) for qp in task.qps]
    first, values = _columns([np.vstack([qp["A"], np.eye(qp["q"].size)]) for qp in task.qps], task.qps[0]["b"].size)
    solver, P = osqp.OSQP(), csc_matrix(task.qps[0]["P"])
    settings = {"eps_abs": EPS, "eps_rel": 0.0, "max_iter": 4000, "verbose": False}
    solver.setup(P, task.qps[0]["q"], first, *limits[0], **settings)

    def run(i: int) -> Array | None:
        solver.update(Ax=values[i], l=limits[i][0], u=limits[i][1])
        answer = solver.solve(raise_error=False)
        return answer.x if answer.info.status == "solved" else None

    return run


def _clarabel(task: Task) -> Single:
    clarabel: Any = import_module("clarabel")  # a compiled module without types

    stacked, equations = [_one_sided(qp) for qp in task.qps], task.qps[0]["b"].size
    first, values = _columns([C for C, _ in stacked], equations)
    cones = [clarabel.ZeroConeT(equations), clarabel.NonnegativeConeT(stacked[0][1].size - equations)]
    settings = clarabel.DefaultSettings()
    settings.verbose = settings.presolve_enable = False  # without presolve the data can be changed
    settings.tol_gap_abs = settings.tol_feas = EPS
    settings.tol_gap_rel = 0.0
    P = csc_matrix(task.qps[0]["P"])
    solver = clarabel.DefaultSolver(P, task.qps[0]["q"], first, stacked[0][1], cones, settings)

    def run(i: int) -> Array | None:
        solver.update(A=values[i], b=stacked[i][1])
        answer = solver.solve()
        return np.array(answer.x) if answer.status == clarabel.SolverStatus.Solved else None

    return run


def _piqp(task: Task) -> Single:
    import piqp

    first = task.qps[0]
    matrices = [np.asfortranarray(qp["A"]) for qp in task.qps]
    solver = piqp.DenseSolver()
    solver.settings.eps_abs, solver.settings.eps_rel = EPS, 0.0
    solver.settings.verbose = False
    P = np.asfortranarray(first["P"])
    solver.setup(P, first["q"], matrices[0], first["b"], x_l=first["lb"], x_u=first["ub"])

    def run(i: int) -> Array | None:
        qp = task.qps[i]
        solver.update(A=matrices[i], b=qp["b"], x_l=qp["lb"], x_u=qp["ub"])
        return solver.result.x.copy() if solver.solve() == piqp.PIQP_SOLVED else None

    return run


def _proxqp(task: Task) -> Single:
    from proxsuite import proxqp

    first = task.qps[0]
    n, equations = first["q"].size, first["b"].size
    limits = [(np.maximum(qp["lb"], -1e20), np.minimum(qp["ub"], 1e20)) for qp in task.qps]
    solver = proxqp.dense.QP(n, equations, 0, True)
    solver.settings.eps_abs, solver.settings.eps_rel = EPS, 0.0
    solver.settings.max_iter = solver.settings.max_iter_in = 100
    # Warm started, or with the preconditioner of another matrix, it is faster and wrong for some of 100 problems.
    solver.settings.initial_guess = proxqp.InitialGuess.EQUALITY_CONSTRAINED_INITIAL_GUESS
    low, high = limits[0]
    solver.init(first["P"], first["q"], first["A"], first["b"], None, None, None, low, high)

    def run(i: int) -> Array | None:
        qp = task.qps[i]
        low, high = limits[i]
        solver.update(A=qp["A"], b=qp["b"], l_box=low, u_box=high, update_preconditioner=True)
        solver.solve()
        solved = solver.results.info.status == proxqp.QPSolverOutput.PROXQP_SOLVED
        return solver.results.x.copy() if solved else None

    return run


def _quadprog(task: Task) -> Single:
    import quadprog

    stacked = [_one_sided(qp) for qp in task.qps]
    arguments = [
        (qp["P"], -qp["q"], np.ascontiguousarray(-C.T), -d) for qp, (C, d) in zip(task.qps, stacked, strict=True)
    ]
    equations = task.qps[0]["b"].size

    def run(i: int) -> Array | None:
        try:
            return quadprog.solve_qp(*arguments[i], equations)[0]
        except ValueError:  # raised where the constraints are inconsistent
            return None

    return run


def _moreau_batch(task: Task) -> Batch:
    import moreau

    stacked = [_one_sided(qp) for qp in task.qps]
    equations, n = task.qps[0]["b"].size, task.qps[0]["q"].size
    pattern = _pattern(stacked[0][0], equations)
    P = _over_and_over(np.array([np.diagonal(qp["P"]) for qp in task.qps]))
    A = _over_and_over(np.array([C[pattern] for C, _ in stacked]))
    q, b = _over_and_over(np.array([qp["q"] for qp in task.qps])), _over_and_over(np.array([d for _, d in stacked]))
    settings = moreau.Settings(
        device="cpu",
        solver="active_set",
        batch_size=len(P),
        active_set_settings=moreau.ActiveSetSettings(primal_tol=EPS),
    )
    solver: Any = moreau.CompiledSolver(
        n=n,
        m=pattern.shape[0],
        P_row_offsets=np.arange(n + 1),
        P_col_indices=np.arange(n),
        A_row_offsets=np.r_[0, np.cumsum(pattern.sum(axis=1))],
        A_col_indices=np.nonzero(pattern)[1],
        cones=moreau.Cones(num_zero_cones=equations, num_nonneg_cones=pattern.shape[0] - equations),
        settings=settings,
    )

    def run(_: int) -> tuple[Array, NDArray[np.bool_]]:
        solver.setup(P, A)
        answer = solver.solve(q, b)
        return answer.x, np.array([status == moreau.SolverStatus.Solved for status in solver.info.status])

    return run


def _through_qpsolvers(task: Task, name: str) -> Single:
    import qpsolvers

    dense = name in qpsolvers.dense_solvers
    problems = []
    for qp in task.qps:
        P, A = (qp["P"], qp["A"]) if dense else (csc_matrix(qp["P"]), csc_matrix(qp["A"]))
        problems.append(qpsolvers.Problem(P, qp["q"], A=A, b=qp["b"], lb=qp["lb"], ub=qp["ub"]))

    def run(i: int) -> Array | None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = qpsolvers.solve_problem(problems[i], solver=name, **_QPSOLVERS[name])
        return answer.x if answer.found else None

    return run
