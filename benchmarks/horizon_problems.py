"""Problems for `benchmarks.horizon`: a chain of masses, random plants in closed loop, random problems of any size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from ..solvers import Horizon, StageProblem

__all__ = ["KINDS", "TASKS", "Check", "check"]

Array = NDArray[np.float64]
Follow = Callable[[Array, Array], Array]  # the next state

KINDS = ("sane", "scaled", "unstable", "unstable scaled")
EACH = 60  # random problems of one size


@dataclass
class Check:
    """Hold counts over random problems of a kind: solved, converged, with broken bounds; iterations."""

    solved: int = 0
    converged: int = 0
    broken: int = 0
    iterations: int = 0
    worst: float = 0.0

    def line(self, kind: str) -> str:
        """Return the counts as one line."""
        share, mean = self.converged / max(self.solved, 1), self.iterations / max(self.solved, 1)
        return (
            f"{kind}: {self.solved} problems, {100 * share:.4f} % converged, largest residual {self.worst:.1e}, "
            f"{self.broken} with broken bounds, {mean:.1f} iterations in the mean"
        )


def chain(N: int = 20, masses: int = 9) -> tuple[StageProblem, Follow]:
    """Return masses in a row with springs between them, each with a limited force, steps of 50 ms."""
    n, m = 2 * masses, masses
    stiff = 2 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1)
    motion = np.block([[np.zeros((m, m)), np.eye(m)], [-20 * stiff, -0.2 * np.eye(m)]])
    forces = np.vstack([np.zeros((m, m)), np.eye(m)])
    whole: Array = np.asarray(
        scipy.linalg.expm(0.05 * np.block([[motion, forces], [np.zeros((m, n + m))]])), dtype=np.float64
    )
    start = np.concatenate([np.random.default_rng(1).normal(size=m), np.zeros(m)])
    return _constant(whole[:n, :n], whole[:n, n:], start, N, np.diag([10.0] * m + [1.0] * m), 0.1 * np.eye(m), 1.5)


def plant(N: int = 20, n: int = 18, m: int = 9, seed: int = 2) -> tuple[StageProblem, Follow]:
    """Return a random plant, slightly unstable, with narrow bounds."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    A *= 1.02 / np.abs(np.linalg.eigvals(A)).max()
    return _constant(A, rng.normal(size=(n, m)), rng.normal(size=n), N, np.eye(n), 0.1 * np.eye(m), 0.25)


def _constant(
    A: Array, B: Array, start: Array, N: int, Q: Array, R: Array, bound: float
) -> tuple[StageProblem, Follow]:
    last = scipy.linalg.solve_discrete_are(A, B, Q, R)
    costs = np.concatenate([np.repeat(Q[None], N, axis=0), last[None]])
    repeated = [np.repeat(matrix[None], N, axis=0) for matrix in (A, B, R)]
    problem = StageProblem(repeated[0], repeated[1], start, costs, repeated[2], u_min=-bound, u_max=bound)
    return problem, lambda state, controls: A @ state + B @ controls


TASKS: dict[str, Callable[[], tuple[StageProblem, Follow]]] = {
    "chain of 9 masses, N = 20, 18 states, 9 controls": chain,
    "random plant, N = 20, 18 states, 9 controls": plant,
    "random plant, N = 40, 28 states, 12 controls": lambda: plant(40, 28, 12),
}


def write_random(horizon: Horizon, kind: str, rng: np.random.Generator) -> None:
    """Write a random problem into the arrays: bounds of any width, absent and equal ones, costs of any rank."""
    h = horizon
    N, m, n = h.S.shape
    p = h.d.shape[1]
    radius = rng.uniform(1.1, 2.0) if "unstable" in kind else rng.uniform(0.5, 1.1)
    A = rng.normal(size=(n, n))
    A *= radius / max(np.abs(np.linalg.eigvals(A)).max(), 1e-9)
    h.A[:] = A + 0.05 / np.sqrt(n) * rng.normal(size=(N, n, n))
    h.B[:] = rng.normal(size=(n, m)) + 0.1 * rng.normal(size=(N, n, m))
    h.c[:] = rng.normal(size=(N, n)) * rng.choice([0, 0.1, 1])
    part = rng.normal(size=(n, rng.integers(1, n + 1)))
    h.Q[:] = part @ part.T / n
    h.Q[N] += np.eye(n) * rng.choice([0, 1, 10])
    part = rng.normal(size=(m, m))
    h.R[:], h.S[:] = (part @ part.T / m + 0.01 * np.eye(m)) * 10 ** rng.uniform(-3, 1), 0.0
    if rng.random() < 0.3:
        part = rng.normal(size=(n + m, n + m))
        part = part @ part.T / (n + m)
        h.R[:], h.S[:], h.Q[:N] = part[:m, :m], part[:m, m:], part[m:, m:]
    h.q[:], h.r[:] = rng.normal(size=(N + 1, n)) * rng.choice([0, 1]), rng.normal(size=(N, m)) * rng.choice([0, 1])
    h.start[:] = rng.normal(size=n) * 10 ** rng.uniform(-1, 1)
    width = 10 ** rng.uniform(-1, 1)
    h.u_min[:], h.u_max[:] = -width * rng.uniform(size=(N, m)), width * rng.uniform(size=(N, m))
    draw = rng.random((N, m))
    if rng.random() < 0.3:
        h.u_min[draw < 0.2], h.u_max[draw > 0.8] = -np.inf, np.inf
    if rng.random() < 0.2:
        equal = rng.random((N, m)) < 0.1
        h.u_max[equal] = h.u_min[equal] = np.where(np.isfinite(h.u_min[equal]), h.u_min[equal], 0.0)
    h.C[:], h.D[:], h.d[:] = rng.normal(size=(N, p, n)), rng.normal(size=(N, p, m)), rng.normal(size=(N, p)) + 1
    h.penalty[:], h.square[:] = 10 ** rng.uniform(-2, 4, (N, p)), rng.choice([0, 1, 10.0], size=(N, p))
    if "scaled" in kind:
        _rescale(h, rng)


def _rescale(h: Horizon, rng: np.random.Generator) -> None:
    """Write the same problem in units that are up to 1e6 apart, for states, controls and rows, and of any cost."""
    _, m, n = h.S.shape
    x, u = 10 ** rng.uniform(-3, 3, n), 10 ** rng.uniform(-3, 3, m)
    row, cost = 10 ** rng.uniform(-3, 3, h.d.shape[1]), 10 ** rng.uniform(-6, 6)
    h.A[:], h.B[:] = x[:, None] * h.A / x, x[:, None] * h.B / u
    h.Q[:], h.R[:], h.S[:] = cost * h.Q / x / x[:, None], cost * h.R / u / u[:, None], cost * h.S / u[:, None] / x
    h.C[:], h.D[:] = row[:, None] * h.C / x, row[:, None] * h.D / u
    for array, factor in (
        *((h.c, x), (h.start, x), (h.q, cost / x), (h.r, cost / u), (h.u_min, u), (h.u_max, u)),
        *((h.d, row), (h.penalty, cost / row), (h.square, cost / row**2)),
    ):
        array *= factor


def check(count: int, seed: int) -> dict[str, Check]:
    """Solve random problems of 1 to 40 stages, 28 states and 12 controls, most of them small, and count by kind."""
    rng, counts = np.random.default_rng(seed), {kind: Check() for kind in KINDS}
    horizon = Horizon(1, 1, 1)
    for number in range(count):
        if number % EACH == 0:
            N = rng.integers(1, 41) if rng.random() < 0.15 else rng.integers(1, 9)
            n = rng.integers(1, 29) if rng.random() < 0.3 else rng.integers(1, 9)
            m = rng.integers(1, 13) if rng.random() < 0.3 else rng.integers(1, 6)
            horizon = Horizon(int(N), int(n), int(m), int(rng.choice([0, 0, 1, 4])))
        kind = KINDS[rng.integers(len(KINDS))]
        write_random(horizon, kind, rng)
        row, converged = counts[kind], horizon.solve()
        row.solved, row.converged = row.solved + 1, row.converged + converged
        row.iterations += horizon.iterations
        inside = (horizon.controls >= horizon.u_min) & (horizon.controls <= horizon.u_max)
        row.broken += not inside.all()
        if converged:
            row.worst = max(row.worst, *horizon.residuals)
    return counts
