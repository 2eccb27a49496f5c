"""The QP of a predictive controller: towline's stages against condensing and other solvers, in one run.

    python -m towline.benchmarks.horizon [--steps 40] [--turns 3] [--check COUNT]

Each task is a closed loop of `--steps` problems, which every contender solves one after the other, alternating; the
loop's states are those of exact solutions. A ratio is to condensing and `daqp.solve`, condensing included, in the same
turn. `--check` solves random problems instead, and prints how many converged, by kind; the exit code is 1 if a bound is
broken, or if less than 99.9 % of those that are not unstable converged.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import casadi as ca
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..solvers import Horizon, StageProblem
from .horizon_problems import KINDS, TASKS, Check, check
from .machine import machine

__all__ = ["CONTENDERS", "Dense", "run"]

Array = NDArray[np.float64]
Call = Callable[[Array], Array]  # from the state at the start to the first controls


class Dense:
    """Hold a problem as one matrix, for the controls alone (condensed) and for controls and states (sparse)."""

    def __init__(self, problem: StageProblem):
        N, n, m = problem.N, problem.n, problem.m
        self.problem = problem
        self.kept: dict[bytes, tuple[Array, Array]] = {}  # condensed before
        # z = (u_0, x_1, u_1, ..., x_N); the state at the start comes in by the first rows.
        size = N * (m + n)
        self.H, self.h = np.zeros((size, size)), np.zeros(size)
        self.G, self.g = np.zeros((N * n, size)), np.zeros(N * n)
        for k in range(N):
            u, x = slice(k * (m + n), k * (m + n) + m), slice(k * (m + n) + m, (k + 1) * (m + n))
            before, rows = slice(k * (m + n) - n, k * (m + n)), slice(k * n, k * n + n)
            self.H[u, u], self.h[u] = problem.R[k], problem.r[k]
            self.H[x, x], self.h[x] = problem.Q[k + 1], problem.q[k + 1]
            self.G[rows, u], self.G[rows, x], self.g[rows] = problem.B[k], -np.eye(n), -problem.c[k]
            if k > 0:
                self.G[rows, before] = problem.A[k]
        places = np.arange(size).reshape(N, m + n)
        self.controls = places[:, :m].ravel()
        self.low, self.high = problem.u_min.ravel(), problem.u_max.ravel()

    def condensed(self, start: Array) -> tuple[Array, Array]:
        """Return matrix (N m, N m) and vector of the cost of the controls alone, by products stage after stage."""
        problem = self.problem
        N, n, m = problem.N, problem.n, problem.m
        effect, state = np.zeros((n, N * m)), start
        cost, slope = np.zeros((N * m, N * m)), problem.r.ravel().copy()
        for k in range(N):
            u = slice(k * m, k * m + m)
            cost[u, u] += problem.R[k]
            effect = problem.A[k] @ effect
            effect[:, u] = problem.B[k]
            state = problem.A[k] @ state + problem.c[k]
            used = effect[:, : k * m + m]
            weighed = problem.Q[k + 1] @ used
            cost[: k * m + m, : k * m + m] += used.T @ weighed
            slope[: k * m + m] += weighed.T @ state + used.T @ problem.q[k + 1]
        return cost, slope


def _stages(shifted: bool) -> Callable[[Dense], Call]:
    def prepare(dense: Dense) -> Call:
        problem = dense.problem
        horizon = Horizon(problem.N, problem.n, problem.m)
        for name in ("A", "B", "Q", "R", "c", "q", "r", "u_min", "u_max"):
            getattr(horizon, name)[...] = getattr(problem, name)
        count = 0

        def call(start: Array) -> Array:
            nonlocal count
            horizon.start[:] = start
            horizon.solve(shifted=shifted and count > 0)
            count += 1
            return horizon.controls[0]

        return call

    return prepare


def _daqp(included: bool) -> Callable[[Dense], Call]:
    def prepare(dense: Dense) -> Call:
        import daqp

        none = np.zeros((0, len(dense.low)))
        kinds = np.zeros(len(dense.low), dtype=np.int32)

        def condense(start: Array) -> tuple[Array, Array]:
            key = start.tobytes()
            if included or key not in dense.kept:
                dense.kept[key] = dense.condensed(start)
            return dense.kept[key]

        def call(start: Array) -> Array:
            cost, slope = condense(start)
            return daqp.solve(cost, slope, none, dense.high, dense.low, kinds)[0][: dense.problem.m]

        return call

    return prepare


def _osqp(dense: Dense) -> Call:
    import osqp

    first, n = dense.problem.A[0], dense.problem.n
    pick = sp.csc_matrix(np.eye(len(dense.h))[dense.controls])
    rows, b = sp.vstack([sp.csc_matrix(dense.G), pick], format="csc"), dense.g.copy()
    solver = osqp.OSQP()
    low, high = np.concatenate([b, dense.low]), np.concatenate([b, dense.high])
    matrix = sp.triu(sp.csc_matrix(dense.H), format="csc")
    options = {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 20_000, "verbose": False}
    solver.setup(matrix, dense.h, rows, low, high, **options)

    def call(start: Array) -> Array:
        low[:n] = high[:n] = b[:n] - first @ start
        solver.update(l=low, u=high)
        return solver.solve(raise_error=False).x[: dense.problem.m]

    return call


def _clarabel(dense: Dense) -> Call:
    clarabel: Any = import_module("clarabel")

    first, n = dense.problem.A[0], dense.problem.n
    pick = sp.csc_matrix(np.eye(len(dense.h))[dense.controls])
    rows, b = sp.vstack([sp.csc_matrix(dense.G), -pick, pick], format="csc"), dense.g.copy()
    matrix = sp.triu(sp.csc_matrix(dense.H), format="csc")
    options = clarabel.DefaultSettings()
    options.verbose = False
    cones = [clarabel.ZeroConeT(len(b)), clarabel.NonnegativeConeT(2 * len(dense.low))]

    def call(start: Array) -> Array:
        right = np.concatenate([b, -dense.low, dense.high])
        right[:n] -= first @ start
        found = clarabel.DefaultSolver(matrix, dense.h, rows, right, cones, options).solve()
        return np.array(found.x[: dense.problem.m])

    return call


def _hpipm(dense: Dense) -> Call:
    problem = dense.problem
    N, n, m = problem.N, problem.n, problem.m
    size = N * (n + m) + n  # (x_0, u_0, x_1, ..., x_N)
    H, h = np.zeros((size, size)), np.zeros(size)
    H[:n, :n], H[n:, n:], h[n:] = problem.Q[0], dense.H, dense.h
    G = np.zeros((N * n, size))
    G[:, n:], G[:n, :n] = dense.G, problem.A[0]
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    low[n + dense.controls], high[n + dense.controls] = dense.low, dense.high
    options: dict[str, Any] = {
        "N": N,
        "nx": [n] * (N + 1),
        "nu": [m] * N + [0],
        "ng": [0] * (N + 1),
        "error_on_fail": False,
        "print_time": False,
        "inf": 1e4,  # what infinite bounds become: with the default, 1e8, it does not converge
        "hpipm": {"mode": "speed_abs", "iter_max": 100},
    }
    shapes = {"h": ca.DM(H).sparsity(), "a": ca.sparsify(ca.DM(G)).sparsity()}
    shapes["h"] = ca.sparsify(ca.DM(H)).sparsity()
    solver = ca.conic("stages", "hpipm", shapes, options)
    H_, G_ = ca.sparsify(ca.DM(H)), ca.sparsify(ca.DM(G))

    def call(start: Array) -> Array:
        low[:n] = high[:n] = start
        found = solver(h=H_, g=h, a=G_, lba=dense.g, uba=dense.g, lbx=low, ubx=high)
        return np.array(found["x"]).ravel()[n : n + m]

    return call


REFERENCE = "condensed, daqp"
CONTENDERS: dict[str, Callable[[Dense], Call]] = {
    "towline, cold": _stages(False),
    "towline, shifted": _stages(True),
    REFERENCE: _daqp(True),
    "daqp alone": _daqp(False),
    "osqp, sparse, warm": _osqp,
    "clarabel, sparse": _clarabel,
    "casadi hpipm": _hpipm,
}


def run(task: str, steps: int, turns: int) -> list[tuple[str, float, float, float, float]]:
    """Return name, median and 99th percentile [us], ratio and largest error of controls for each contender."""
    problem, follow = TASKS[task]()
    dense, starts, expected = Dense(problem), [problem.start.copy()], []
    rng = np.random.default_rng(0)
    reach = np.abs(problem.start).max()
    exact = Horizon(problem.N, problem.n, problem.m)
    exact.tolerance = 1e-11
    for name in ("A", "B", "Q", "R", "c", "q", "r", "u_min", "u_max"):
        getattr(exact, name)[...] = getattr(problem, name)
    for _ in range(steps):
        exact.start[:] = starts[-1]
        exact.solve()
        expected.append(exact.controls[0].copy())
        starts.append(follow(starts[-1], expected[-1]) + 0.01 * reach * rng.normal(size=problem.n))
    times: dict[str, list[list[float]]] = {}
    errors: dict[str, float] = {}
    for turn in range(turns + 1):
        for name, prepare in CONTENDERS.items():
            try:
                call = prepare(dense)
                block, worst = [], 0.0
                for start, known in zip(starts, expected, strict=False):
                    begin = time.perf_counter_ns()
                    controls = call(start)
                    block.append((time.perf_counter_ns() - begin) / 1e3)
                    worst = max(worst, float(np.abs(controls - known).max()))
            except Exception as error:  # a contender that breaks is a result
                print(f"{name}: {type(error).__name__}: {str(error).splitlines()[0]}", file=sys.stderr)
                continue
            errors[name] = worst
            if turn > 0:
                times.setdefault(name, []).append(block)
    rows = []
    for name, blocks in times.items():
        ratios = [np.median(a) / np.median(b) for a, b in zip(blocks, times[REFERENCE], strict=True)]
        each = np.concatenate(blocks)
        spread = (float(np.median(each)), float(np.percentile(each, 99)))
        rows.append((name, *spread, float(np.median(ratios)), errors[name]))
    return sorted(rows, key=lambda row: row[3])


def main() -> None:
    """Print one table for each task, or the counts of `--check`."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=40, help="problems of a loop (default: 40)")
    parser.add_argument("--turns", type=int, default=3, help="turns that count (default: 3)")
    parser.add_argument("--check", type=int, default=0, help="random problems to check instead (default: none)")
    parser.add_argument("--seed", type=int, default=0, help="of the random problems (default: 0)")
    options = parser.parse_args()
    print(machine(("daqp", "osqp", "clarabel", "casadi", "numpy", "numba")))
    if options.check > 0:
        counts = check(options.check, options.seed)
        for kind in KINDS:
            print(counts[kind].line(kind))
        sys.exit(any(_fails(kind, counts[kind]) for kind in KINDS))
    for task in TASKS:
        print(f"\n{task}\n\n| contender | median us | p99 us | ratio | error |\n|---|---:|---:|---:|---:|")
        for name, median, p99, ratio, error in run(task, options.steps, options.turns):
            print(f"| {name} | {median:.0f} | {p99:.0f} | {ratio:.2f} | {error:.0e} |")


def _fails(kind: str, count: Check) -> bool:
    return count.broken > 0 or ("unstable" not in kind and count.converged < 0.999 * count.solved)


if __name__ == "__main__":
    main()
