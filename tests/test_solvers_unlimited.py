"""Cables without limits and many spare cables: every method answers rightly, in milliseconds, or reports why not.

A wrench that may be missed is such a problem: the missing part is six cables without limits and with a high price.
"""

import re
import statistics
import time

import numpy as np
import pytest
from scipy.optimize import linprog

from towline.benchmarks.tension_tasks import make_task
from towline.solvers import TensionProblem, methods, solve

from .problems import geometric_matrix
from .references import optimality_error

# What a method may report instead of tensions, by its docstring.
REFUSALS = {
    "closed-form": "leaves the limits of cable",
    "improved-closed-form": "no redundancy left",
    "centroid": "unbounded|m - rank is [0-9]+, and a centroid is costly beyond 5",
    "analytic-centre": "the feasible tensions are unbounded",
    "least-sum": "no limit bounds what is optimised",
    "largest-margin": "no limit bounds what is optimised",
    "min-max": "no limit bounds what is optimised",
}
LEAST_SQUARES = ("active-set", "daqp", "qp", "min-norm", "2-norm", "dykstra", "soft-wrench")
SLOW = 0.05  # s; ten times what the slowest takes in the median


def unlimited_problem(seed):
    """Return a robot of 6 to 16 cables, three or six equations, some without a limit or two, w well inside."""
    rng = np.random.default_rng(seed)
    m = int(rng.integers(6, 17))
    A = geometric_matrix(rng, m)[: rng.choice([3, 6])]
    low, high = np.full(m, 0.5), np.full(m, 60.0)
    high[rng.random(m) < rng.choice([0.0, 0.3, 1.0])] = np.inf
    low[rng.random(m) < rng.choice([0.0, 0.3])] = -np.inf
    weights = 10.0 ** rng.uniform(-1.5, 1.5, m) if seed % 2 else np.ones(m)
    return TensionProblem(A, A @ rng.uniform(5, 55, m), low, high, weights=weights)


PROBLEMS = [
    *make_task("soft", 8, 8).problems,
    *make_task("soft", 4, 5).problems,
    *(unlimited_problem(seed) for seed in range(14)),
]


def linear_optimum(problem, cost, rows=None, right=None):
    """Return the least cost . (t, extra), or None if there is no bound."""
    extras = len(cost) - problem.m
    bounds = [*zip(problem.t_min, problem.t_max, strict=True), *[(None, None)] * extras]
    finite = slice(None) if right is None else np.isfinite(right)
    answer = linprog(
        cost,
        A_eq=np.hstack([problem.A, np.zeros((problem.n, extras))]),
        b_eq=problem.w,
        A_ub=None if rows is None else rows[finite],
        b_ub=None if right is None else right[finite],
        bounds=bounds,
        method="highs",
    )
    return answer.fun if answer.status == 0 else None


def optimum_is_missed_by(problem, method, t):
    """Return how far t is from what the method promises, relative to the sizes at hand."""
    m, identity, one = problem.m, np.eye(problem.m), np.ones((problem.m, 1))
    size = np.abs(t).max()
    if method in LEAST_SQUARES:
        return optimality_error(problem, t)
    if method in ("log-barrier", "analytic-centre"):
        assert (t > problem.t_min).all()
        assert (t < problem.t_max).all()
        ranges = problem.t_max - problem.t_min
        narrowest = ranges[np.isfinite(ranges)].min(initial=np.inf)
        mu = (0.01 * (narrowest if np.isfinite(narrowest) else 1.0)) ** 2
        up, down = mu / (problem.t_max - t), mu / (t - problem.t_min)
        square = problem.weights / problem.weights.max() * t if method == "log-barrier" else np.zeros(m)
        null = np.linalg.svd(problem.A)[2][np.linalg.matrix_rank(problem.A) :]
        return np.abs(null @ (square + up - down)).max(initial=0.0) / (np.abs(square) + up + down).max()
    if method == "p-norm":
        apart = np.sqrt(problem.weights) * t
        part = apart / np.abs(apart).max()
        gradient = np.sqrt(problem.weights) * np.sign(part) * np.abs(part) ** 3
        best = linear_optimum(problem, gradient)
        # At the optimum no feasible direction goes down.
        return (gradient @ t - best) / (np.abs(gradient) @ np.abs(t)) if best is not None else 0.0
    if method == "least-sum":
        best = linear_optimum(problem, np.ones(m))
        return abs(t.sum() - best) / (m * size)
    if method == "1-norm":
        rows = np.block([[identity, -identity], [-identity, -identity]])
        best = linear_optimum(problem, np.r_[np.zeros(m), np.ones(m)], rows, np.zeros(2 * m))
        return abs(np.abs(t).sum() - best) / (m * size)
    last = np.r_[np.zeros(m), 1.0]
    if method == "min-max":
        return abs(t.max() - linear_optimum(problem, last, np.hstack([identity, -one]), np.zeros(m))) / size
    if method == "largest-margin":
        rows = np.block([[identity, one], [-identity, one]])
        best = linear_optimum(problem, -last, rows, np.r_[problem.t_max, -problem.t_min])
        return abs(min((t - problem.t_min).min(), (problem.t_max - t).min()) + best) / size
    assert method in ("closed-form", "improved-closed-form", "centroid")
    return 0.0


@pytest.mark.parametrize("method", methods())
def test_answers_are_right_and_refusals_are_told(method):
    times, refused = [], 0
    for problem in PROBLEMS:
        start = time.process_time()
        solution = solve(problem, method)
        times.append(time.process_time() - start)
        if not solution.feasible:
            refused += 1
            assert solution.status == "failed"
            assert solution.certificate is None
            assert re.search(REFUSALS[method], solution.detail), solution.detail
            continue
        t = solution.tensions
        assert solution.residual <= problem.tolerance(t)
        assert (t >= problem.t_min).all()
        assert (t <= problem.t_max).all()
        assert optimum_is_missed_by(problem, method, t) <= 1e-6
    print(f"{method}: median {1e3 * statistics.median(times):.2f} ms, slowest {1e3 * max(times[1:]):.1f} ms, {refused}")
    assert statistics.median(times) < SLOW
    if method not in REFUSALS:
        assert refused == 0


def test_refusals_are_right():
    """Detect an unbounded set, or no bound on what is optimised, by linear programs of their own."""
    for problem in PROBLEMS:
        one = np.eye(problem.m)  # only where a tension has no limit can it be unbounded
        ways = [*one[np.isinf(problem.t_min)], *-one[np.isinf(problem.t_max)]]
        unbounded = any(linear_optimum(problem, way) is None for way in ways)
        assert (not solve(problem, "analytic-centre").feasible) is unbounded
        freedom = problem.m - np.linalg.matrix_rank(problem.A)
        assert (not solve(problem, "centroid").feasible) is bool(unbounded or freedom > 5)
        assert (not solve(problem, "least-sum").feasible) is (linear_optimum(problem, np.ones(problem.m)) is None)


def test_the_centres_of_a_wrench_that_may_be_missed_are_the_middle_of_the_limits():
    for problem in make_task("soft", 4, 5).problems:
        middle = 0.5 * (problem.t_min[:4] + problem.t_max[:4])
        for method in ("centroid", "analytic-centre"):
            np.testing.assert_allclose(solve(problem, method).tensions[:4], middle, rtol=0, atol=1e-9)


def test_a_wrench_out_of_reach_is_told_by_a_certificate_whatever_the_method_refuses():
    A = np.abs(geometric_matrix(np.random.default_rng(3), 14))
    problem = TensionProblem(A, -np.ones(6), 0.0, np.inf)
    for method in methods():
        solution = solve(problem, method)
        assert solution.certificate is not None, method
        assert solution.certificate.verify(problem)


@pytest.mark.parametrize("cables", [4, 5, 6])
@pytest.mark.parametrize("length", [1.0, 0.058])
def test_the_rounding_of_a_robot_file_does_not_choose_the_tensions(cables, length):
    """Check a load below the centre of a regular polygon, in twelve digits: the tensions are equal by symmetry.

    Cable lines meet in one point but for rounding, which makes singular values of 1e-12 instead of 0.
    """
    angles = 2 * np.pi * np.arange(cables) / cables + 0.3
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(cables)])
    r, top = np.round(0.057735026919 * ring, 12), np.round(1.08 * ring + [[0.0], [0.0], [0.8]], 12)
    u = (top - r) / np.linalg.norm(top - r, axis=0)
    weight = [0, 0, 98.1, 0, 0, 0]
    problem = TensionProblem(np.vstack([u, np.cross(r, u, axis=0)]), weight, 0, 500, length=length)
    for name in methods():
        if name in ("least-sum", "1-norm"):
            continue  # many tensions have the same sum
        tensions = solve(problem, name).tensions
        np.testing.assert_allclose(tensions, 98.1 / u[2].sum(), rtol=1e-7, err_msg=name)


@pytest.mark.parametrize("seed", range(12))
def test_the_analytic_centre_with_unlimited_cables_is_stationary(seed):
    """No step that keeps A t changes the sum of the logarithms of the distances to the limits that there are."""
    rng = np.random.default_rng(seed)
    m, n = int(rng.integers(7, 12)), 6
    A = geometric_matrix(rng, m)[:n]
    low, high = np.full(m, 1.0), np.full(m, 50.0)
    free = rng.choice(m, size=int(rng.integers(1, 5)), replace=False)
    low[free], high[free] = -np.inf, np.inf
    low[np.setdiff1d(np.arange(m), free)[0]] = -np.inf  # one with an upper limit only
    answer = solve(TensionProblem(A, A @ rng.uniform(5, 45, m), low, high), "analytic-centre")
    if answer.tensions is None:
        assert re.search(REFUSALS["analytic-centre"], answer.detail)
        return
    t = answer.tensions
    slope = np.where(np.isfinite(low), 1 / (t - np.where(np.isfinite(low), low, 0)), 0.0)
    slope -= np.where(np.isfinite(high), 1 / (np.where(np.isfinite(high), high, 0) - t), 0.0)
    multipliers = np.linalg.lstsq(A.T, slope, rcond=None)[0]
    assert np.abs(slope - A.T @ multipliers).max() < 1e-6 * max(np.abs(slope).max(), 1e-3)
