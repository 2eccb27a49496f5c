"""Check that lanes answer as single problems do, machine code as plain Python, and old machine code is not used."""

import os
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from towline.base import tolerances
from towline.base.errors import InputError
from towline.solvers import Status, TensionProblem, compiled, solve
from towline.solvers import solve_batch as solve_by_core_or_lanes

from .problems import random_feasible, random_infeasible

solve_batch = partial(solve_by_core_or_lanes, backend="lanes")


@pytest.fixture(scope="module", autouse=True)
def kernels():
    return compiled.load()


@pytest.fixture(scope="module")
def arithmetic():
    """Return what computes everything that `simd_llvm` can do with two vectors and a number."""
    import numba

    from towline.base.machine_code.simd_llvm import load, magnitude, maximum, minimum, splat, sqrt, store, where

    @numba.njit
    def compute(x, y, a, result):
        u, v = load(x, 0), load(y, 0)
        zero, one = splat(0.0), splat(1.0)
        store(result, 0, u + v)
        store(result, 1, a - v)
        store(result, 2, u * a)
        store(result, 3, u / v)
        store(result, 4, -u)
        store(result, 5, sqrt(magnitude(u)))
        store(result, 6, maximum(u, v))
        store(result, 7, minimum(u, v))
        store(result, 8, where(u < v, one, zero))
        store(result, 9, where(u >= a, one, zero))
        store(result, 10, where((u > v) & ~(u <= 0.0), u, v))
        store(result, 11, where((u > v) | (v > 1.0), u, 2 * v))

    compute(np.ones(16), np.ones(16), 1.0, np.empty(12 * 16))  # compiled now: hypothesis counts the time of a call
    return compute


numbers = st.floats(-1e3, 1e3).filter(lambda x: abs(x) > 1e-6)
many = st.lists(numbers, min_size=16, max_size=16).map(np.array)


@settings(deadline=None)
@given(x=many, y=many, a=numbers)
def test_vectors_compute_as_numpy_does(arithmetic, x, y, a):
    result = np.empty(12 * 16)
    arithmetic(x, y, a, result)
    expected = [
        x + y,
        a - y,
        x * a,
        x / y,
        -x,
        np.sqrt(np.abs(x)),
        np.maximum(x, y),
        np.minimum(x, y),
        1.0 * (x < y),
        1.0 * (x >= a),
        np.where((x > y) & (x > 0.0), x, y),
        np.where((x > y) | (y > 1.0), x, 2 * y),
    ]
    np.testing.assert_array_equal(result.reshape(12, 16), expected)


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
def test_lanes_answer_as_single_problems_do(kernels, m):
    problems = mixture(np.random.default_rng(m), m, 203)  # no multiple of sixteen
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


@pytest.mark.parametrize("m", [6, 7, 8])
def test_lanes_prove_by_themselves_that_wrenches_are_out_of_reach(monkeypatch, m):
    """Count the rows that leave the lanes: one by one they take ten times as long."""
    alone, module = [], import_module("towline.solvers.batch")
    monkeypatch.setattr(module, "CABLES", 0)
    monkeypatch.setattr(module, "_alone", lambda problem, rho: alone.append(problem) or solve(problem))
    monkeypatch.setattr(compiled, "_kernels", compiled.PLAIN)
    rng = np.random.default_rng(m)
    batch = solve_batch(**stacked([random_infeasible(rng, m) for _ in range(100)]))
    assert (batch.status == Status.INFEASIBLE).all()
    assert len(alone) < 5


@pytest.mark.parametrize("m", [3, 6, 8, 12])
@pytest.mark.parametrize("rho", [1e-3, 1.0, 1e3, 1e6])
def test_a_soft_batch_minimises_what_soft_wrench_does(m, rho):
    problems = mixture(np.random.default_rng(m), m, 61)
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


def test_machine_code_of_other_sources_is_forgotten(tmp_path, monkeypatch):
    folder = tmp_path / "kernels"
    (folder / "__pycache__").mkdir(parents=True)
    index, source = folder / "__pycache__" / "rows.solve_rows-1.py311.nbi", folder / "single.py"
    monkeypatch.setattr(compiled, "_FOLDER", folder)
    monkeypatch.setattr(compiled, "_SHARED", (tmp_path / "tolerances.py",))
    assert Path(tolerances.__file__).is_file()
    source.write_text("a = 1")
    compiled._forget_old_code()
    index.touch()
    compiled._forget_old_code()
    assert index.exists()
    for change in (source, tmp_path / "tolerances.py"):
        index.touch()
        change.write_text("a = 2")
        os.utime(change, (1000, 1000))  # as old as possible: the content decides
        compiled._forget_old_code()
        assert not index.exists()


def test_without_a_folder_or_space_for_machine_code_it_is_not_kept(tmp_path, monkeypatch):
    space = {}
    exec(compile("def twice(x):\n    return 2 * x", "<nowhere>", "exec"), space)  # Numba finds no place for this
    assert compiled.machine_code(space["twice"])(21) == 42
    monkeypatch.setattr("shutil.disk_usage", lambda _: type("usage", (), {"free": 1000}))
    assert not compiled._has_space()


def test_threads_do_not_change_a_bit():
    problems = mixture(np.random.default_rng(3), 9, 300)
    alone, together = (solve_batch(**stacked(problems), threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(alone.code, together.code)
    np.testing.assert_allclose(alone.tensions, together.tensions, rtol=0, atol=0)
