"""Check that random problems of every awkward kind get the right status and the optimal tensions.

    python -m towline.benchmarks.exactness [--count 1000000] [--start 0]

Each problem is named by its seed. `solve_batch` answers, by its lanes and by the C core: each problem counts twice
where towline was installed with that. The references are a linear program (HiGHS) for the status and the optimality
conditions for the tensions. Where both sides differ, both are shown, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..solvers import BatchSolution, Status, TensionProblem, certify, compiled, solve_batch
from ..solvers.core import CABLES

Array = NDArray[np.float64]

KINDS = (
    "plain",
    "geometric",
    "twins",
    "nearly parallel",
    "rank deficient",
    "fixed",
    "unlimited",
    "huge limits",
    "corner",
    "weighted",
    "wished",
)
OPTIMAL = 1e-7  # error of the optimality conditions, relative to the gradient
PROVING = 1e10  # larger multipliers prove nothing: w moved by rounding changes the cost by a part in a million
BLOCK = 2000


def main() -> None:
    """Run and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=1_000_000)
    parser.add_argument("--start", type=int, default=0, help="the first seed")
    options = parser.parse_args()
    if options.count < 1 or options.start < 0:
        parser.error(f"--count must be at least 1 and --start at least 0, got {options.count} and {options.start}")
    compiled.load()
    report = Report(Counter(), [], 0.0)
    for first in range(options.start, options.start + options.count, BLOCK):
        report = report.plus(check(range(first, min(first + BLOCK, options.start + options.count))))
        print(report.line(), end="\r", file=sys.stderr)
    print(report.line())
    for disagreement in report.disagreements:
        print(disagreement)
    sys.exit(bool(report.disagreements))


class Disagreement(NamedTuple):
    """Two answers to the problem of one seed."""

    seed: int
    ours: str
    reference: str


class Report(NamedTuple):
    """Counts of each status, the disagreements, and the largest violation of optimality."""

    statuses: Counter[str]
    disagreements: list[Disagreement]
    worst: float

    def plus(self, other: Report) -> Report:
        """Return both together."""
        return Report(
            self.statuses + other.statuses, self.disagreements + other.disagreements, max(self.worst, other.worst)
        )

    def line(self) -> str:
        """Return the figures in one line."""
        counts = ", ".join(f"{count} {status}" for status, count in sorted(self.statuses.items()))
        return f"{counts}; {len(self.disagreements)} disagreements, largest error of optimality {self.worst:.1e}"


def check(seeds: range) -> Report:
    """Solve the problems of these seeds, in batches of one shape, and compare."""
    shapes: dict[tuple[int, ...], list[int]] = {}
    problems = {seed: awkward_problem(seed) for seed in seeds}
    for seed, (A, *_) in problems.items():
        shapes.setdefault(A.shape, []).append(seed)
    report = Report(Counter(), [], 0.0)
    for members in shapes.values():
        arrays = [np.array(column) for column in zip(*(problems[seed] for seed in members), strict=True)]
        for backend in ("lanes", "c") if CABLES else ("lanes",):
            answer = solve_batch(*arrays, threads=1, backend=backend)
            report.statuses.update(answer.status.tolist())
            for row, seed in enumerate(members):
                report = report.plus(_compare(seed, problems[seed], answer, row))
    return report


def _compare(seed: int, data: tuple[Array, ...], answer: BatchSolution, row: int) -> Report:
    """Compare one row with the references."""
    A, w, low, high, wish, weights = data
    problem = TensionProblem(A, w, low, high, wish, weights)
    status = str(answer.status[row])
    if answer.feasible[row]:
        error = optimality_error(problem, answer.tensions[row])
        if error < OPTIMAL:
            return Report(Counter(), [], error)
        return Report(Counter(), [Disagreement(seed, status, f"optimality missed by {error:.1e}")], error)
    certificate = certify(problem)
    if certificate is not None and certificate.verify(problem) and _excludes(answer.direction[row], problem):
        proven = Status.SINGULAR if certificate.singular else Status.INFEASIBLE
        if status == proven:
            return Report(Counter(), [], 0.0)
    return Report(Counter(), [Disagreement(seed, status, linear_program_status(problem))], 0.0)


def _excludes(d: Array, problem: TensionProblem) -> bool:
    """Return whether d . w is more than tensions inside the limits can give along d, from the data alone."""
    pulls = d @ problem.A
    counts = np.abs(pulls) > 1e-11 * np.linalg.norm(d) * np.linalg.norm(problem.A, axis=0).max()
    limits = np.where(pulls > 0.0, problem.t_max, problem.t_min)
    return bool(d @ problem.w > (pulls[counts] * limits[counts]).sum())


def optimality_error(problem: TensionProblem, t: Array) -> float:
    """Return by how much tensions miss the optimality conditions, relative to their gradient; inf if beyond a limit.

    The gradient omega (t - t_ref) is A^T y but for a part at the limits, of the sign that pushes against them.
    """
    from scipy.optimize import lsq_linear, nnls

    if (t < problem.t_min).any() or (t > problem.t_max).any() or not np.isfinite(t).all():
        return np.inf
    if not np.linalg.norm(problem.scaled_A @ t - problem.scaled_w) <= problem.tolerance(t):
        return np.inf
    size = np.abs(t).max(initial=1e-300)
    low, high = t - problem.t_min <= 1e-9 * size, problem.t_max - t <= 1e-9 * size
    identity = np.eye(problem.m)
    rows = problem.scaled_A.T / np.maximum(np.linalg.norm(problem.scaled_A, axis=1), 1e-300)
    columns = np.hstack([rows, -rows, identity[:, low], -identity[:, high]])
    gradient = problem.weights * (t - problem.t_ref)
    largest = np.abs(gradient).max()
    if largest == 0.0:
        return 0.0
    multipliers = nnls(columns, gradient / largest)[0].astype(np.longdouble)
    if multipliers.max() > PROVING:
        multipliers = lsq_linear(columns, gradient / largest, (0.0, PROVING), method="bvls", tol=1e-15).x
    rest = gradient / largest - columns @ multipliers
    if multipliers.max() * np.finfo(np.float64).eps > 1e-2 * OPTIMAL:  # their own rounding is in the rest: refine them
        counts = multipliers > 0.0
        multipliers[counts] += np.linalg.lstsq(columns[:, counts], rest.astype(np.float64), rcond=None)[0]
        rest = gradient / largest - columns @ np.maximum(multipliers, 0.0)
    return float(np.linalg.norm(rest.astype(np.float64)))


def linear_program_status(problem: TensionProblem) -> str:
    """Return the answer of HiGHS: "optimal", else "infeasible", or "singular" if no limits make it so."""
    from scipy.optimize import linprog

    size = max(float(np.linalg.norm(problem.scaled_w)), 1e-300)
    unit = max(float(np.abs(problem.scaled_A).max()), 1e-300)

    def available(bounds: list[tuple[float, float]] | tuple[None, None]) -> bool:
        equations = {"A_eq": problem.scaled_A / unit, "b_eq": problem.scaled_w / size}
        return linprog(np.zeros(problem.m), **equations, bounds=bounds, method="highs").status == 0

    if available(
        [(low * unit / size, high * unit / size) for low, high in zip(problem.t_min, problem.t_max, strict=True)]
    ):
        return "optimal"
    return "infeasible" if available((None, None)) else "singular"


def awkward_problem(seed: int, m: int | None = None, n: int | None = None) -> tuple[Array, ...]:
    """Return A, w, t_min, t_max, t_ref, weights of a random problem, m 1 to 12 cables and a rank from 1 to 6.

    Two kinds of trouble at a time, w inside, at a corner of, or outside the available wrench set, any units.
    """
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 13)) if m is None else m
    n = int(rng.integers(1, 7)) if n is None else n
    kinds = set(rng.choice(KINDS, 2))
    A = rng.normal(size=(n, m))
    if "geometric" in kinds and n == 6:
        A[:3] /= np.linalg.norm(A[:3], axis=0)
        A[3:] = np.cross(rng.uniform(-1, 1, (3, m)), A[:3], axis=0)
    if "twins" in kinds:
        A[:, rng.integers(m)] = A[:, 0] * rng.choice([-1.0, 1.0, 0.5])
    if "nearly parallel" in kinds:
        A[:, rng.integers(m)] = A[:, 0] + 10.0 ** rng.uniform(-6, -2) * rng.normal(size=n)
    if "rank deficient" in kinds:
        rank = int(rng.integers(1, n + 1))
        A[rank:] = rng.integers(-2, 3, size=(n - rank, rank)) @ A[:rank]
    low = rng.uniform(-1.0, 1.0, m)
    high = low + rng.uniform(0.1, 2.0, m)
    if "fixed" in kinds:
        some = rng.random(m) < 0.3
        high[some] = low[some]
    span = high - low
    if "unlimited" in kinds:
        high[rng.random(m) < 0.3] = np.inf
        low[rng.random(m) < 0.2] = -np.inf
    if "huge limits" in kinds:
        high[rng.random(m) < 0.3] = 10.0 ** rng.uniform(3, 9)
    t = np.where(np.isfinite(low), low, high - span)
    t = np.where(np.isfinite(t), t, 0.0) + span * np.clip(rng.uniform(-0.3, 1.3, m), 0.0, 1.0)
    t = np.minimum(np.maximum(t, low), high)
    if "corner" in kinds:
        d = rng.normal(size=n) @ A
        at = np.where(d > 0, high, low)
        t = np.where(np.isfinite(at), at, t)
    w = A @ t
    where = rng.random()
    if where < 0.25:
        w = w + 10.0 ** rng.uniform(-3, 1) * np.abs(t).max() * (A @ rng.normal(size=m))
    elif where < 0.35:
        w = w + rng.normal(size=n)
    unit, load = 10.0 ** rng.uniform(-6, 6, 2)
    wish = load * rng.normal(size=m) * 3.0 if "wished" in kinds else np.zeros(m)
    weights = 10.0 ** rng.uniform(-4, 4, m) if "weighted" in kinds else np.ones(m)
    return A * unit, w * unit * load, low * load, high * load, wish, weights


if __name__ == "__main__":
    main()
