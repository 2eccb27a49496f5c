"""The kernel and `solve_batch`: exact on awkward problems, the same as `solve`, and nothing lost to a bad row."""

from importlib import import_module

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline.base.errors import InputError, SolverError
from towline.solvers import Status, TensionProblem, certify, solve, solve_batch

from .problems import T_MAX, T_MIN, ZOO, geometric_matrix, random_feasible, random_infeasible
from .references import linear_program_status, optimum_by_enumeration, support_value
from .soak.exactness import awkward_problem, check


def stacked(problems):
    return np.array([p.A for p in problems]), np.array([p.w for p in problems])


def mixture(count, m):
    rng = np.random.default_rng(m)
    return [(random_feasible, random_infeasible)[k % 2](rng, m) for k in range(count)]


def test_awkward_problems_are_right():
    report = check(range(400), "random")
    print(report.line())
    assert report.statuses == {"optimal", "infeasible", "singular"}
    assert report.wrong == []


# Problems once called optimal that were not, or whose optimum was not proven: a limit that rounding decides, weights
# that differ by a factor of 1e7, twin cables free to trade on the boundary of the available wrench set.
ONCE_WRONG = (
    *(700761054, 701602655, 900030494, 900036523, 900054442, 900085142, 900089350, 900089136),
    *(700035600, 700183909, 700216930, 700398819, 700429654, 700570383, 700655097, 700981806, 701253758, 701300675),
    *(701324090, 701408939, 701588040, 701621797, 701774034, 701813357, 701866444, 701896243, 701990715),
)


@pytest.mark.parametrize("seed", ONCE_WRONG)
def test_optimal_is_what_multipliers_prove(seed):
    report = check(range(seed, seed + 1), "random")
    assert report.wrong == []
    assert report.statuses == {"optimal"}


@pytest.mark.parametrize("seed", range(150))
def test_awkward_tensions_are_those_of_enumeration(seed):
    A, w, low, high, wish, weights = awkward_problem(10_000 + seed, m=1 + seed % 6)
    problem = TensionProblem(A, w, low, high, wish, weights)
    solution = solve(problem)
    expected = optimum_by_enumeration(A, w, low, high, wish, weights)
    if solution.feasible and expected is not None:
        # The reference takes wrench errors up to 1e-9, which a nearly singular matrix makes visible in the tensions.
        required = problem.tolerance(solution.tensions) / 1e-9
        if np.linalg.norm(A @ expected - w) <= 1e-13 * required:
            size = max(np.abs(expected).max(), np.abs(low[np.isfinite(low)]).max(initial=0.0))
            np.testing.assert_allclose(solution.tensions, expected, rtol=0, atol=1e-8 * size)
    elif solution.feasible != (expected is not None):
        assert certificate_is_close(problem, solution)


def certificate_is_close(problem, solution):
    """Return whether the two may differ: w is within 1e-9 of the boundary, relative to what is required."""
    if solution.certificate is None:
        return linear_program_status(problem.A, problem.w, problem.t_min, problem.t_max) == "optimal" or solution.detail
    return solution.certificate.shortfall < 1e3 * problem.tolerance(solution.certificate.closest)


@pytest.mark.parametrize("m", [1, 4, 6, 7, 8, 9, 12])
def test_a_batch_says_what_single_calls_say(m):
    problems = mixture(200, m)
    A, w = stacked(problems)
    batch = solve_batch(A, w, T_MIN, T_MAX)
    for row, problem in enumerate(problems):
        for method in ("active-set", "daqp"):
            single = solve(problem, method)
            assert single.status == batch.status[row]
            if single.feasible:
                np.testing.assert_allclose(batch.tensions[row], single.tensions, rtol=0, atol=1e-9 * T_MAX)
                assert (batch.tensions[row] >= T_MIN).all()
                assert (batch.tensions[row] <= T_MAX).all()
                assert batch.residual[row] <= problem.tolerance(batch.tensions[row])
                assert np.isnan(batch.direction[row]).all()
            else:
                d = batch.direction[row]
                reach = np.maximum(d @ problem.A * T_MIN, d @ problem.A * T_MAX).sum()
                assert d @ problem.w - reach > 0
                assert batch.shortfall[row] <= single.certificate.shortfall * (1 + 1e-9)
                assert single.certificate.verify(problem)
                assert np.isnan(batch.tensions[row]).all()
    assert sum(batch.count().values()) == 200
    assert batch.solution(1).status == batch.status[1]


def test_the_zoo_in_batches_of_one():
    for name, (problem, status) in ZOO.items():
        given = (problem.A, problem.w, problem.t_min, problem.t_max, problem.t_ref, problem.weights, problem.length)
        assert solve_batch(*given).status == status, name


def test_mixed_ranks_wishes_and_weights_in_one_batch():
    rng = np.random.default_rng(4)
    A = np.array([geometric_matrix(rng, 8) for _ in range(90)])
    A[::3, 3:] = 0.0
    A[1::3, :, 1] = A[1::3, :, 0]
    w = np.einsum("rij,rj->ri", A, rng.uniform(5, 40, (90, 8)))
    wish, weights = rng.uniform(0, 30, (90, 8)), 10.0 ** rng.uniform(-2, 2, (90, 8))
    batch = solve_batch(A, w, T_MIN, T_MAX, wish, weights)
    assert batch.feasible.all()
    for row in range(90):
        expected = solve(TensionProblem(A[row], w[row], T_MIN, T_MAX, wish[row], weights[row]), "daqp").tensions
        np.testing.assert_allclose(batch.tensions[row], expected, rtol=0, atol=1e-8 * T_MAX)


@pytest.mark.parametrize("backend", ["lanes", None])
@pytest.mark.parametrize("m", [5, 8, 11])
def test_threads_change_no_bit(m, backend):
    A, w = stacked(mixture(333, m))
    one, two = (solve_batch(A, w, T_MIN, T_MAX, threads=threads, backend=backend) for threads in (1, 2))
    for name in ("tensions", "code", "residual", "direction", "shortfall", "support"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes(), name


def test_leading_dimensions_broadcast():
    rng = np.random.default_rng(1)
    A = geometric_matrix(rng, 8)
    w = rng.uniform(5, 40, (3, 4, 8)) @ A.T
    high = np.array([60.0, 100.0, 1e3, np.inf])[:, None] * np.ones(8)
    shared = solve_batch(A, w, T_MIN, high)
    own = solve_batch(np.broadcast_to(A, (3, 4, 6, 8)), w, np.full((4, 8), T_MIN), high, length=np.ones((3, 1)))
    assert shared.tensions.shape == (3, 4, 8)
    assert shared.feasible.shape == shared.status.shape == shared.residual.shape == (3, 4)
    assert shared.direction.shape == (3, 4, 6)
    assert shared.tensions.tobytes() == own.tensions.tobytes()
    single = solve_batch(A, w[1, 2], T_MIN, 60)
    assert single.tensions.shape == (8,)
    assert single.feasible.shape == ()
    empty = solve_batch(A, np.empty((0, 6)), T_MIN, 60)
    assert empty.tensions.shape == (0, 8)


def test_bad_rows_are_flagged_and_the_rest_solved():
    A, w = stacked(mixture(20, 8))
    low, high, weights, wish = np.full((20, 8), T_MIN), np.full((20, 8), T_MAX), np.ones((20, 8)), np.zeros((20, 8))
    good = solve_batch(A, w, low, high, wish, weights)
    A[1, 0, 0] = w[3, 2] = low[5, 1] = high[7, 0] = wish[8, 3] = weights[9, 4] = np.nan
    A[10, 2, 2] = np.inf
    low[11, 3] = 61.0
    weights[12, 0], weights[13, 7], low[14, 0], high[15, 1] = -1.0, 0.0, np.inf, -np.inf
    w[16, 0] = 1e60
    bad = [1, 3, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]
    batch = solve_batch(A, w, low, high, wish, weights)
    assert (batch.status[bad] == Status.INVALID).all()
    assert np.isnan(batch.tensions[bad]).all()
    rest = np.setdiff1d(np.arange(20), bad)
    assert (batch.code[rest] == good.code[rest]).all()
    np.testing.assert_array_equal(batch.tensions[rest], good.tensions[rest])
    with pytest.raises(InputError, match=r"A must be finite .*, got nan at index 0, 0"):
        batch.solution(1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": np.ones(6)}, r"A must be of shape \(\.\.\., n, m\) .*, got shape \(6,\)"),
        ({"A": np.ones((2, 6, 8)) + 1j}, r"A must be .*, got entries of type complex128"),
        ({"A": [[1.0, 2.0], [3.0]]}, "A must be an array of real numbers, got .*unequal length"),
        ({"w": np.ones((2, 5))}, r"w must be of shape \(\.\.\., 6\) .*, got shape \(2, 5\)"),
        ({"w": np.ones((3, 6))}, r"A, w must have leading dimensions that are equal or 1, got \(2,\), \(3,\)"),
        ({"t_min": np.ones(6)}, r"t_min must be of shape \(\.\.\., 8\) .*, got shape \(6,\)"),
        ({"t_max": None}, r"t_max must be an array of real numbers, got None"),
        ({"threads": 0}, "threads must be a whole number from 1 to 1024, got 0"),
        ({"backend": "numba"}, "backend must be c, lanes or None, got 'numba'"),
        ({"backend": ["c"]}, r"backend must be c, lanes or None, got \['c'\]"),
        (
            {"A": np.ones((2, 6, 40)), "backend": "c"},
            "backend must be None for 6 wrench rows and 40 cables, which the C core does not take, got 'c'",
        ),
    ],
)
def test_wrong_arguments_are_told(change, message):
    given = {"A": np.ones((2, 6, 8)), "w": np.ones((2, 6)), "t_min": 0.0, "t_max": 1.0} | change
    with pytest.raises(InputError, match=message):
        solve_batch(**given)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_never_nan_never_outside_and_every_certificate_verifies(seed):
    problem = TensionProblem(*awkward_problem(seed)[:4])
    solution = solve(problem)
    if solution.feasible:
        assert np.isfinite(solution.tensions).all()
        assert solution.bound_violation == 0.0
        assert solution.residual <= problem.tolerance(solution.tensions)
    else:
        assert solution.status in (Status.INFEASIBLE, Status.SINGULAR)
        assert solution.certificate.verify(problem)


def nearly_unavailable(seed):
    """Yield wrenches 1e-12 to 1e-6 beyond the available set, relative to what is required, and just inside.

    At corners and facets of awkward problems, or where cables parallel to some digits pull with up to 1e6 times the
    load: there rounding decides most.
    """
    rng = np.random.default_rng(seed)
    if seed % 2:
        A, w, low, high, *_ = awkward_problem(seed)
        found = certify(TensionProblem(A, w, low, high))
        d = A @ rng.normal(size=A.shape[1]) if found is None else found.direction
        at = np.where(d @ A > 0, high, low)
        t = np.where(np.isfinite(at), at, np.clip(0.0, low, high)) if found is None else found.closest
        size = np.linalg.norm(A @ t) + np.linalg.norm(A, axis=0) @ np.abs(np.clip(0.0, low, high))
        push = size * d / max(np.linalg.norm(d), 1e-300)
    else:
        n, pairs = int(rng.integers(3, 7)), int(rng.integers(1, 6))
        tension, gains = 10.0 ** rng.uniform(1, 6), 10.0 ** rng.uniform(-1, 3, pairs)
        u = np.vstack([rng.normal(size=(n - 1, pairs)), np.zeros(pairs)])
        u *= gains / np.linalg.norm(u, axis=0)
        apart = np.vstack([rng.normal(size=(n - 1, pairs)) / tension, np.zeros(pairs)])
        A = np.hstack([u, apart - u, np.eye(n)[:, -1:]])
        t = np.r_[np.tile(tension / gains, 2) * rng.uniform(0.5, 2, 2 * pairs), 1.0]
        low, high = np.zeros(t.size), np.r_[np.full(2 * pairs, rng.choice([1e12, np.inf])), 1.0]
        turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
        A, push = turn @ A, turn[:, -1]
    for relative in 10.0 ** rng.uniform(-12, -6, 4):
        yield TensionProblem(A, A @ t + relative * push, low, high)


def test_no_infeasible_answer_is_without_its_certificate():
    counts = {True: 0, False: 0}
    for seed in range(200):
        for problem in nearly_unavailable(seed):
            solution = solve(problem)
            proven = solution.status in (Status.INFEASIBLE, Status.SINGULAR)
            counts[proven] += 1
            assert (solution.certificate is not None) is proven
            if proven:
                assert solution.certificate.verify(problem)
                assert solution.certificate.singular is (solution.status is Status.SINGULAR)
    print("proven and not:", counts)
    assert min(counts.values()) > 60


def in_shapes(seeds):
    """Return awkward problems of equal shapes as arrays, one list of arrays a shape."""
    shapes = {}
    for seed in seeds:
        problem = awkward_problem(seed)
        shapes.setdefault(problem[0].shape, []).append(problem)
    return [[np.array(column) for column in zip(*members, strict=True)] for members in shapes.values()]


@pytest.mark.parametrize(("rho", "accuracy"), [(None, 1e-8), (1e3, 1e-8), (1e10, 1e-7)])
def test_the_core_answers_as_the_lanes_do(rho, accuracy):
    """Statuses are equal and tensions nearly; both prove the same rows infeasible, along directions that may differ."""
    rows = proven = 0
    for arrays in in_shapes(range(6_000_000, 6_001_500)):
        core, lanes = (solve_batch(*arrays, rho=rho, backend=backend) for backend in ("c", "lanes"))
        assert (core.backend, lanes.backend) == ("c", "lanes")
        np.testing.assert_array_equal(core.code, lanes.code)
        size = np.maximum(np.abs(lanes.tensions).max(axis=1, keepdims=True), 1e-300)
        np.testing.assert_allclose(core.tensions / size, lanes.tensions / size, rtol=0, atol=accuracy)
        np.testing.assert_array_equal(np.isfinite(core.shortfall), np.isfinite(lanes.shortfall))
        for row in np.flatnonzero(np.isfinite(core.shortfall)):
            A, w, low, high, *_ = (array[row] for array in arrays)
            d = core.direction[row]
            reach = support_value(A, d, low, high)
            assert 0.0 < core.shortfall[row] <= (d @ w - reach) * (1.0 + 1e-6) + 1e-9 * abs(reach)
        rows += len(core.code)
        proven += np.isfinite(core.shortfall).sum()
    assert rows == 1500
    assert proven > 200


@pytest.mark.parametrize("shape", [(7, 9), (1, 40)])
def test_sizes_that_the_core_does_not_take_are_solved_all_the_same(shape):
    rng = np.random.default_rng(0)
    A = rng.normal(size=(5, *shape))
    w = np.einsum("rij,rj->ri", A, rng.uniform(0.0, 1.0, (5, shape[1]))) * np.array([1, 1, 1, 9, np.nan])[:, None]
    batch = solve_batch(A, w, 0.0, 1.0)
    assert batch.backend == "python"
    assert batch.status[[0, 1, 2, 4]].tolist() == ["optimal"] * 3 + ["invalid"]
    for row in range(4):
        single = solve(TensionProblem(A[row], w[row], 0.0, 1.0))
        assert single.status == batch.status[row]
        if single.feasible:
            np.testing.assert_array_equal(batch.tensions[row], single.tensions)
            assert np.isnan(batch.direction[row]).all()
        else:
            support = support_value(A[row], batch.direction[row], np.zeros(shape[1]), np.ones(shape[1]))
            assert support < batch.direction[row] @ w[row]
    assert np.isnan(batch.tensions[4]).all()


def test_the_cores_own_direction_proves_what_the_projection_misses(monkeypatch):
    """Run as if the projection failed, which it does for one in 10^5 problems with nearly parallel cables."""
    module = import_module("towline.solvers.solve")
    monkeypatch.setattr(module, "sharpest", lambda problem, projection: None)
    for k in range(40):
        problem = random_infeasible(np.random.default_rng(k), 3 + k % 8)
        solution = solve(problem)
        assert solution.certificate.verify(problem)
        assert solution.certificate.singular is (solution.status is Status.SINGULAR)
        assert solution.certificate.shortfall <= certify(problem).shortfall * (1 + 1e-9)
    monkeypatch.setattr(module, "_direction_of_core", lambda problem: None)
    with pytest.raises(SolverError, match="active-set reported infeasible, but no certificate confirms it"):
        _ = solve(TensionProblem([[1.0, -1.0]], [60.0], 1, 60)).certificate


@pytest.mark.parametrize("weight", [0.0, -1.0, np.nan, np.inf, 1e30])
@pytest.mark.parametrize("rho", [None, 1.0])
def test_the_weight_of_a_single_cable_is_checked_too(weight, rho):
    """Check one number for one cable: it once passed for "no weights"."""
    for matrix in (np.ones((1, 1)), np.ones((20, 2, 1))):
        batch = solve_batch(matrix, np.full(matrix.shape[-2], 0.5), 0.0, 1.0, weights=weight, rho=rho)
        assert set(batch.count()) == {Status.INVALID}


@pytest.mark.parametrize("rho", [1.0, 1e9])
def test_the_residual_of_a_soft_row_is_that_of_its_tensions(rho):
    """Check rows that go alone as well: nearly no weight on one cable, no matrix at all, a huge limit."""
    rng = np.random.default_rng(3)
    A, low, high = rng.normal(size=(40, 2, 9)), np.zeros((40, 9)), np.ones((40, 9))
    w = np.einsum("rim,rm->ri", A, rng.uniform(0, 1, (40, 9)))
    A[::3] = 0.0
    high[1::3, 2] = 1e9
    batch = solve_batch(A, w, low, high, weights=10.0 ** rng.uniform(-10, 10, (40, 9)), rho=rho)
    error = np.linalg.norm(np.einsum("rim,rm->ri", A, batch.tensions) - w, axis=1)
    np.testing.assert_allclose(batch.residual, error, rtol=1e-6, atol=1e-14)


def test_a_soft_row_solved_again_is_the_same_row():
    A = np.random.default_rng(0).normal(size=(6, 8))
    w = A @ np.full(8, 0.5)
    batch = solve_batch(A, [w, 9 * w], 0.0, 1.0, rho=10.0)
    for row in range(2):
        again = batch.solution(row)
        assert again.status == batch.status[row]
        np.testing.assert_allclose(again.tensions, batch.tensions[row], atol=1e-9)


@pytest.mark.parametrize("rho", [None, 1.0])
def test_cables_that_are_all_fixed(rho):
    """Check that nothing is left to choose."""
    problem = TensionProblem(np.ones((2, 3)), [1.0, 1.0], 0.5, 0.5)
    soft = solve(problem, "soft-wrench") if rho is None else solve(problem, "soft-wrench", rho=rho)
    assert (soft.tensions == 0.5).all()
    batch = solve_batch(problem.A, np.tile(problem.w, (20, 1)), 0.5, 0.5, rho=rho)
    assert set(batch.count()) == {Status.INFEASIBLE if rho is None else Status.INACCURATE}


def test_what_a_batch_returns_may_be_written():
    batch = solve_batch(np.eye(2), np.ones((3, 2)), 0.0, 2.0)
    batch.direction[0] = batch.shortfall[0] = batch.support[0] = 0.0
    assert np.isnan(batch.direction[1]).all()
