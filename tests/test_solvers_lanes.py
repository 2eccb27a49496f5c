"""Lanes answer as single problems do, whatever the company of a row."""

import sys
from functools import partial

import numpy as np
import pytest

from towline.base.errors import InputError
from towline.solvers import Status, TensionProblem, solve, solve_batch as solve_problems

from .problems import random_feasible, random_infeasible

solve_batch = partial(solve_problems, backend="lanes")


def mixture(rng, m, count):
    """Return feasible and infeasible problems of one shape, with weights, references and lengths of their own."""
    rows = [(random_feasible, random_infeasible)[k % 2](rng, m) for k in range(count)]
    return [
        TensionProblem(
            p.A,
            p.w,
            p.t_min,
            p.t_max,
            t_ref=rng.uniform(p.t_min, p.t_max),
            weights=10.0 ** rng.uniform(-1, 1, p.m),
            length=10.0 ** rng.uniform(-1, 1),
        )
        for p in rows
    ]


def stacked(problems):
    names = ("A", "w", "t_min", "t_max", "t_ref", "weights", "length")
    return {name: np.array([getattr(problem, name) for problem in problems]) for name in names}


def shortfall_along(problem, d):
    """Return from the data alone d . w - h(d), and the norm of d that is to be one."""
    pulls = d @ problem.A
    support = np.where(pulls > 0, pulls * problem.t_max, pulls * problem.t_min).sum()
    return d @ problem.w - support, np.linalg.norm(d / np.repeat([1.0, 1.0 / problem.length], 3))


@pytest.mark.parametrize("m", [6, 7, 8, 9, 12, 16])
def test_lanes_answer_as_single_problems_do(m):
    problems = mixture(np.random.default_rng(m), m, 203)  # no multiple of eight
    batch = solve_batch(**stacked(problems), threads=1)
    for row, problem in enumerate(problems):
        if (single := solve(problem)).feasible:
            assert batch.feasible[row]
            np.testing.assert_allclose(batch.tensions[row], single.tensions, rtol=0, atol=1e-9 * problem.t_max.max())
            assert np.isnan(batch.direction[row]).all()
        else:
            assert batch.status[row] == Status.INFEASIBLE
            shortfall, norm = shortfall_along(problem, batch.direction[row])
            assert shortfall > 0
            assert shortfall == pytest.approx(batch.shortfall[row], rel=1e-6)
            assert norm == pytest.approx(1.0)
            assert shortfall <= single.certificate.shortfall * (1 + 1e-9)
            assert np.isnan(batch.tensions[row]).all()
    assert 50 < batch.feasible.sum() < 150


@pytest.mark.skipif(sys.platform == "win32", reason="the compiler has no vectors: all rows are solved one by one")
@pytest.mark.parametrize("m", [6, 7, 8, 12])
def test_lanes_solve_nearly_all_rows_themselves(m):
    """Most of what they solve has other last digits than the solver of one problem, to which they leave the others."""
    given = stacked(mixture(np.random.default_rng(m), m, 400))
    lanes, one_by_one = solve_batch(**given), solve_problems(**given, backend="c")
    for name in ("tensions", "direction"):
        there = np.isfinite(getattr(lanes, name)).all(axis=1)
        other = (getattr(lanes, name) != getattr(one_by_one, name)).any(axis=1)
        assert there.sum() > 100
        assert np.mean(other[there]) > 0.8, name


@pytest.mark.parametrize("m", [3, 6, 8, 12])
@pytest.mark.parametrize("rho", [1e-3, 1.0, 1e3, 1e6])
def test_a_soft_batch_minimises_what_soft_wrench_does(m, rho):
    problems = mixture(np.random.default_rng(m), m, 37)
    batch = solve_batch(**stacked(problems), rho=rho)
    assert np.isfinite(batch.tensions).all()
    for row, problem in enumerate(problems):
        t = batch.tensions[row]
        assert (t >= problem.t_min).all()
        assert (t <= problem.t_max).all()
        margin = 1e-9 * problem.t_max.max()
        # The gradient vanishes between the limits and pushes against them at the limits.
        weights = problem.weights / problem.weights.max()
        error = problem.scaled_A @ t - problem.scaled_w
        gradient = weights * (t - problem.t_ref) + rho * problem.scaled_A.T @ error
        size = 1e-9 * (
            np.abs(weights * (t - problem.t_ref)).max() + rho * np.abs(problem.scaled_A.T).max() * problem.t_max.max()
        )
        assert (gradient[t < problem.t_max - margin] > -size).all()
        assert (gradient[t > problem.t_min + margin] < size).all()
        assert batch.residual[row] == pytest.approx(np.linalg.norm(error), rel=1e-6, abs=1e-12)
        single = solve(problem, method="soft-wrench", rho=rho)
        np.testing.assert_allclose(t, single.tensions, rtol=0, atol=1e-6 * problem.t_max.max())
        assert batch.status[row] == single.status
        if np.isfinite(batch.shortfall[row]):
            assert single.certificate is not None
            shortfall, _ = shortfall_along(problem, batch.direction[row])
            assert shortfall > 0
            if not single.certificate.singular:  # then it is the distance to what is available
                assert shortfall <= single.certificate.shortfall * (1 + 1e-9)


def test_a_soft_batch_goes_through_every_path():
    """Solve rank-deficient, fixed, unlimited, invalid: everything but the invalid has tensions."""
    rng = np.random.default_rng(1)
    A, w, low, high = rng.normal(size=(40, 6, 8)), rng.normal(size=(40, 6)), np.zeros((40, 8)), np.ones((40, 8))
    A[:10, 5] = A[:10, 4]
    low[10:20, 3] = high[10:20, 3]
    high[20:30, :4], low[20:30, :2] = np.inf, -np.inf
    w[30, 0] = np.nan
    batch = solve_batch(A, w, low, high, rho=1e10)
    assert batch.status[30] == Status.INVALID
    assert np.isnan(batch.tensions[30]).all()
    for row in set(range(40)) - {30}:
        single = solve(TensionProblem(A[row], w[row], low[row], high[row]), method="soft-wrench", rho=1e10)
        assert batch.status[row] == single.status
        assert batch.residual[row] == pytest.approx(single.residual, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("m", [5, 6, 7, 8, 11])
def test_a_shared_matrix_changes_nothing(m):
    rng = np.random.default_rng(m)
    A = rng.normal(size=(5, m))
    w = rng.uniform(-0.2, 1.2, size=(100, m)) @ A.T
    shared = solve_batch(A, w, 0.0, 1.0, weights=np.arange(1.0, m + 1.0))
    apart = solve_batch(
        np.broadcast_to(A, (100, 5, m)), w, 0.0, 1.0, weights=np.tile(np.arange(1.0, m + 1.0), (100, 1))
    )
    np.testing.assert_array_equal(shared.tensions, apart.tensions)
    np.testing.assert_array_equal(shared.direction, apart.direction)
    np.testing.assert_array_equal(shared.code, apart.code)
    assert shared.feasible.any()
    assert not shared.feasible.all()


@pytest.mark.parametrize("rho", ["stiff", 0.0, -1.0, np.nan, np.inf, True, 1e13])
def test_rho_is_a_number_in_its_range(rho):
    with pytest.raises(InputError, match=r"^rho must be a number from 1e-12 to 1e\+12, or None, got "):
        solve_batch(np.eye(2), np.ones(2), 0.0, 1.0, rho=rho)


@pytest.mark.parametrize("index", [None, "spam", 7, (0, 0), 1.5, slice(None), [0, 1]])
def test_an_index_picks_one_row(index):
    batch = solve_batch(np.eye(2), np.ones((3, 2)), 0.0, 2.0)
    assert batch.solution(-1).feasible
    with pytest.raises(InputError, match=r"^index must pick one row of a batch of shape \(3,\), got "):
        batch.solution(index)


@pytest.mark.parametrize("threads", [0, True, 2.0, np.arange(40), "two"])
def test_threads_is_a_whole_number(threads):
    with pytest.raises(InputError, match=r"^threads must be a whole number from 1 to 1024, got "):
        solve_batch(np.eye(2), np.ones(2), 0.0, 1.0, threads=threads)


@pytest.mark.parametrize("rho", [None, 1e3])
@pytest.mark.parametrize("m", [6, 7, 8, 12])
def test_a_row_does_not_depend_on_its_company(m, rho):
    rng = np.random.default_rng(m)
    A = rng.normal(size=(60, 6, m))
    w = np.einsum("rij,rj->ri", A, rng.uniform(-0.3, 1.3, (60, m)))
    together = solve_batch(A, w, 0.0, 1.0, rho=rho)
    assert 0 < np.isfinite(together.direction).all(axis=1).sum() < 60
    for rows in (slice(0, 1), slice(7, 30), slice(31, 60, 5)):
        apart = solve_batch(A[rows], w[rows], 0.0, 1.0, rho=rho)
        for name in ("tensions", "residual", "direction", "shortfall", "support"):
            np.testing.assert_array_equal(getattr(apart, name), getattr(together, name)[rows])


def test_threads_do_not_change_a_bit():
    problems = mixture(np.random.default_rng(3), 9, 300)
    alone, together = (solve_batch(**stacked(problems), threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(alone.code, together.code)
    np.testing.assert_allclose(alone.tensions, together.tensions, rtol=0, atol=0)
