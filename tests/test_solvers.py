"""Tension distribution: every method against the others and against references that share no code with them."""

import json
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from towline.base.errors import InputError
from towline.solvers import Status, TensionProblem, certify, methods, solve, solve_batch

from .problems import T_MAX, T_MIN, ZOO, geometric_matrix, random_feasible, random_infeasible, random_tensions
from .references import distance_to_available, linear_program_status, optimum_by_enumeration, row_scale, support_value

CONTENDERS = [("active-set", None), ("min-norm", None), ("qp", "clarabel"), ("qp", "osqp")]
EXACT = CONTENDERS[:2]


def assert_proves(certificate, problem):
    """Check a certificate from the definitions: beyond the support value, by the distance that another solver finds."""
    A, w = problem.A, problem.w
    S = np.array(row_scale(problem.n, problem.length))
    assert np.linalg.norm(certificate.direction / S) == pytest.approx(1.0, abs=1e-12)
    gap = certificate.direction @ w - support_value(A, certificate.direction, problem.t_min, problem.t_max)
    assert gap > 0
    assert gap == pytest.approx(certificate.shortfall, rel=1e-9)
    assert certificate.demand - certificate.support == pytest.approx(certificate.shortfall, rel=1e-12)
    assert (certificate.closest >= problem.t_min).all()
    assert (certificate.closest <= problem.t_max).all()
    if certificate.singular:
        scaled = S[:, None] * A
        beyond = S * w - scaled @ np.linalg.lstsq(scaled, S * w, rcond=1e-11)[0]
        assert certificate.shortfall == pytest.approx(np.linalg.norm(beyond), rel=1e-6)
    else:
        # The closest tensions are as far away as the direction proves that all are: that is the distance.
        assert np.linalg.norm(S * (A @ certificate.closest - w)) == pytest.approx(certificate.shortfall, rel=1e-6)
        distance, size = distance_to_available(A, w, problem.t_min, problem.t_max, problem.length)
        assert certificate.shortfall == pytest.approx(distance, rel=1e-6, abs=1e-9 * size)
    # Each binding cable is where it pulls most along the direction; the others do not pull along it.
    pull = certificate.direction @ A
    assert (certificate.closest[certificate.at_max] == problem.t_max[certificate.at_max]).all() or certificate.singular
    assert (pull[certificate.at_max] > 0).all()
    assert (pull[certificate.at_min] < 0).all()
    assert certificate.verify(problem)


@pytest.mark.parametrize(("method", "backend"), CONTENDERS)
@pytest.mark.parametrize("name", ZOO)
def test_the_zoo_is_told_apart(name, method, backend):
    problem, status = ZOO[name]
    solution = solve(problem, method, backend)
    assert solution.status == status, solution.detail
    assert solution.method == method
    if method != "active-set":
        assert solution.backend == backend
    assert solution.feasible is (status == "optimal")
    assert solution.time > 0
    json.dumps(solution.to_dict(), allow_nan=False)
    if status == "optimal":
        assert solution.certificate is None
        assert np.isfinite(solution.tensions).all()
        assert solution.residual <= problem.tolerance(solution.tensions)
        assert solution.bound_violation == 0.0
    else:
        assert solution.tensions is None
        assert np.isnan([solution.residual, solution.cost, solution.bound_violation]).all()
        assert_proves(solution.certificate, problem)


@pytest.mark.parametrize("name", [name for name, case in ZOO.items() if case.status == "optimal"])
def test_the_zoo_has_the_optimum_that_enumeration_finds(name):
    problem = ZOO[name].problem
    expected = optimum_by_enumeration(
        problem.A, problem.w, problem.t_min, problem.t_max, problem.t_ref, problem.weights
    )
    size = max(np.abs(expected).max(), np.abs(problem.t_ref).max())
    for method, backend in CONTENDERS:
        tensions = solve(problem, method, backend).tensions
        np.testing.assert_allclose(tensions, expected, rtol=0, atol=1e-6 * size, err_msg=f"{method} {backend}")


def test_methods_and_a_linear_program_agree_on_feasible_problems():
    rng = np.random.default_rng(500)
    worst = dict.fromkeys(CONTENDERS, 0.0)
    for k in range(96):
        problem = random_feasible(rng, m=3 + k % 6)
        assert linear_program_status(problem.A, problem.w, problem.t_min, problem.t_max) == "optimal"
        solutions = {contender: solve(problem, *contender) for contender in CONTENDERS}
        details = {contender: solution.detail for contender, solution in solutions.items() if not solution.feasible}
        assert not details, f"problem {k}"
        for contender, solution in solutions.items():
            apart = np.abs(solution.tensions - solutions["active-set", None].tensions).max() / T_MAX
            worst[contender] = max(worst[contender], apart)
    print("largest difference to active-set in units of t_max:", worst)
    assert max(worst.values()) <= 1e-6


def test_methods_and_a_linear_program_agree_on_infeasible_problems():
    rng = np.random.default_rng(200)
    statuses = set()
    for k in range(42):
        problem = random_infeasible(rng, m=3 + k % 6)
        expected = linear_program_status(problem.A, problem.w, problem.t_min, problem.t_max)
        statuses.add(expected)
        certificates = []
        for contender in CONTENDERS:
            solution = solve(problem, *contender)
            assert solution.status == expected, f"problem {k}, {contender}: {solution.detail}"
            certificates.append(solution.certificate)
        assert_proves(certificates[0], problem)
        assert {c.shortfall for c in certificates} == {certificates[0].shortfall}
    assert statuses == {"infeasible", "singular"}


def test_active_set_satisfies_the_optimality_conditions():
    rng = np.random.default_rng(11)
    for k in range(80):
        m = 6 + k % 4
        A = geometric_matrix(rng, m)
        t_ref, weights = rng.uniform(0, 30, m), 10.0 ** rng.uniform(-2, 2, m)
        problem = TensionProblem(A, A @ random_tensions(rng, m), T_MIN, T_MAX, t_ref, weights)
        t = solve(problem).tensions
        # Stationarity: the gradient is A^T y, but for a part that pushes against an active limit (sign as below).
        gradient = weights * (t - t_ref)
        low, high = t - T_MIN < 1e-7, T_MAX - t < 1e-7
        best_bounds = [(None, None)] * 6 + [(0, None)] * int(low.sum()) + [(0, None)] * int(high.sum())
        columns = np.hstack([A.T, np.eye(m)[:, low], -np.eye(m)[:, high]])
        assert _smallest_error(columns, gradient, best_bounds) <= 1e-7 * np.abs(gradient).max()


def _smallest_error(columns, target, bounds):
    """Return the smallest max-norm of columns y - target with y inside its bounds, by linear program."""
    from scipy.optimize import linprog

    size = np.abs(target).max()
    rows, one = columns.shape[0], np.ones((columns.shape[0], 1))
    answer = linprog(
        np.r_[np.zeros(columns.shape[1]), 1.0],
        A_ub=np.block([[columns, -one], [-columns, -one]]),
        b_ub=np.r_[target, -target] / size,
        bounds=[*bounds, (0, None)],
        method="highs",
    )
    assert answer.status == 0, f"{rows} rows"
    return answer.fun * size


@pytest.mark.parametrize("length", [0.01, 0.3, 25.0])
def test_length_changes_the_certificate_and_nothing_else(length):
    rng = np.random.default_rng(5)
    for m in (5, 6, 8):
        given = random_infeasible(rng, m)
        scaled = TensionProblem(given.A, given.w, given.t_min, given.t_max, length=length)
        assert solve(scaled).status == solve(given).status
        assert_proves(solve(scaled).certificate, scaled)
        feasible = random_feasible(rng, m)
        again = TensionProblem(feasible.A, feasible.w, T_MIN, T_MAX, length=length)
        np.testing.assert_allclose(solve(again).tensions, solve(feasible).tensions, rtol=0, atol=1e-7 * T_MAX)


def test_certificate_is_found_however_small_the_shortfall():
    rng = np.random.default_rng(8)
    A = geometric_matrix(rng, 8)
    d = rng.normal(size=6)
    d /= np.linalg.norm(d)
    corner = A @ np.where(d @ A > 0, T_MAX, T_MIN)
    # At the corner d is one of many outward directions and the distance is at most the push.
    for push in 10.0 ** np.arange(-5, 3):
        certificate = certify(TensionProblem(A, corner + push * d, T_MIN, T_MAX))
        assert certificate is not None
        assert certificate.shortfall == pytest.approx(push, rel=1e-5)
    for problem in (TensionProblem(A, corner, T_MIN, T_MAX), TensionProblem(A, corner + 1e-12 * d, T_MIN, T_MAX)):
        assert certify(problem) is None
        for contender in EXACT:
            assert solve(problem, *contender).status == "optimal"


def test_a_spoilt_certificate_does_not_verify():
    rng = np.random.default_rng(3)
    problem = random_infeasible(rng, 8)
    certificate = solve(problem).certificate
    reachable = TensionProblem(problem.A, problem.A @ np.full(8, 10.0), T_MIN, T_MAX)
    assert certificate.verify(problem)
    assert not certificate.verify(reachable)
    for change in (
        {"direction": -certificate.direction},
        {"direction": 2 * certificate.direction},
        {"direction": certificate.direction[:3]},
        {"shortfall": 2 * certificate.shortfall},
        {"at_max": certificate.at_max[:-1]},
    ):
        assert not type(certificate)(**(vars(certificate) | change)).verify(problem), change


def random_problem(seed, m, n):
    """Make a problem of any kind: some cables double, fixed or unlimited, w at, in or out of the available wrenches."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, m))
    if rng.random() < 0.3:
        A[:, rng.integers(m)] = A[:, 0]
    if rng.random() < 0.2:
        A[n // 2 :] = 0.0
    low = rng.uniform(-1.0, 1.0, m)
    high = low + rng.uniform(0.1, 2.0, m) * (rng.random(m) > 0.1)
    high[rng.random(m) < 0.1] = np.inf
    t = low + np.minimum(high - low, 2.0) * np.clip(rng.uniform(-0.5, 1.5, m), 0.0, 1.0)
    w = A @ t if rng.random() < 0.6 else 3.0 * rng.normal(size=n)
    return A, w, low, high


SEEDS = st.integers(0, 2**32 - 1)
HYPOTHESIS = settings(max_examples=40, deadline=None, derandomize=True)


@HYPOTHESIS
@given(seed=SEEDS, m=st.integers(1, 12), n=st.integers(1, 6), load=st.floats(-6, 6), unit=st.floats(-6, 6))
def test_answers_scale_with_the_units(seed, m, n, load, unit):
    A, w, low, high = random_problem(seed, m, n)
    load, unit = 10.0**load, 10.0**unit
    for method, backend in EXACT:
        here = solve(TensionProblem(A, w, low, high), method, backend)
        there = solve(TensionProblem(unit * A, unit * load * w, load * low, load * high), method, backend)
        assert here.status == there.status
        if here.feasible:
            np.testing.assert_allclose(there.tensions / load, here.tensions, rtol=0, atol=1e-6)
        else:
            assert there.certificate.shortfall / (unit * load) == pytest.approx(here.certificate.shortfall, rel=1e-5)


@HYPOTHESIS
@given(seed=SEEDS, m=st.integers(1, 12), n=st.integers(1, 6))
def test_the_order_of_cables_does_not_matter(seed, m, n):
    A, w, low, high = random_problem(seed, m, n)
    order = np.random.default_rng(seed + 1).permutation(m)
    for method, backend in EXACT:
        here = solve(TensionProblem(A, w, low, high), method, backend)
        there = solve(TensionProblem(A[:, order], w, low[order], high[order]), method, backend)
        assert here.status == there.status
        if here.feasible:
            np.testing.assert_allclose(there.tensions, here.tensions[order], rtol=0, atol=1e-6)


@HYPOTHESIS
@given(seed=SEEDS, m=st.integers(1, 12), n=st.integers(1, 6), reference=st.floats(-100, 100))
def test_tensions_are_numbers_inside_the_limits_or_there_is_a_proof(seed, m, n, reference):
    A, w, low, high = random_problem(seed, m, n)
    problem = TensionProblem(A, w, low, high, t_ref=reference)
    for method, backend in EXACT:
        solution = solve(problem, method, backend)
        if solution.feasible:
            assert np.isfinite(solution.tensions).all()
            assert solution.bound_violation == 0.0
            assert np.linalg.norm(A @ solution.tensions - w) <= problem.tolerance(solution.tensions)
        else:
            assert solution.status in (Status.INFEASIBLE, Status.SINGULAR), solution.detail
            assert solution.certificate.verify(problem)


@HYPOTHESIS
@given(seed=SEEDS, m=st.integers(2, 7), n=st.integers(1, 4))
def test_weights_and_wish_give_the_optimum_that_enumeration_finds(seed, m, n):
    A, w, low, high = random_problem(seed, m, n)
    rng = np.random.default_rng(seed + 2)
    t_ref, weights = rng.uniform(-2, 2, m), 10.0 ** rng.uniform(-1, 1, m)
    solution = solve(TensionProblem(A, w, low, high, t_ref, weights))
    assume(solution.feasible)
    expected = optimum_by_enumeration(A, w, low, high, t_ref, weights)
    np.testing.assert_allclose(solution.tensions, expected, rtol=0, atol=1e-6)


A8 = geometric_matrix(np.random.default_rng(0), 8)
W8 = A8 @ np.full(8, 10.0)
RAGGED = [[1.0, 2.0], [3.0]]

# The argument that is changed, and the one line: its name, what is accepted, the value or shape.
WRONG = {
    "A one-dimensional": ({"A": np.ones(6)}, r"A must be of shape \(n, m\) .*, got shape \(6,\)"),
    "A without cables": ({"A": np.ones((6, 0))}, r"A must be .*m >= 1 cables, got shape \(6, 0\)"),
    "A ragged": ({"A": RAGGED}, r"A must be an array of real numbers, got .*unequal length"),
    "A complex": ({"A": A8 + 1j}, r"A must be .*real numbers, got entries of type complex128"),
    "A of objects": ({"A": np.full((6, 8), None)}, r"A must be .*, got entries of type object"),
    "A of text": ({"A": "spam"}, r"A must be .*, got 'spam'"),
    "A with NaN": ({"A": np.where(np.arange(8) == 5, np.nan, A8)}, r"A must be finite .*, got nan at index 0, 5"),
    "A infinite": ({"A": np.full((6, 8), np.inf)}, r"A must be .*, got inf at index 0, 0"),
    "w too short": ({"w": np.ones(3)}, r"w must be of shape \(6,\), .*, got shape \(3,\)"),
    "w a column": ({"w": np.ones((6, 1))}, r"w must be .*, got shape \(6, 1\)"),
    "w with NaN": ({"w": [0, 0, np.nan, 0, 0, 0]}, r"w must be .*, got nan at index 2"),
    "w infinite": ({"w": [0, 0, 0, 0, -np.inf, 0]}, r"w must be .*, got -inf at index 4"),
    "w beyond all measure": ({"w": np.full(6, 1e60)}, r"w must be finite numbers below 1e\+50, got 1e\+60 at index 0"),
    "w of booleans": ({"w": np.ones(6, dtype=bool)}, r"w must be .*, got entries of type bool"),
    "t_min of another length": ({"t_min": np.zeros(6)}, r"t_min must be of shape \(8,\), .*, got shape \(6,\)"),
    "t_min NaN": ({"t_min": np.nan}, r"t_min must be .*, got nan at index 0"),
    "t_min inf": ({"t_min": np.inf}, r"t_min must be numbers up to .*, or -inf, got inf at index 0"),
    "t_max -inf": ({"t_max": -np.inf}, r"t_max must be .*, got -inf at index 0"),
    "t_max None": ({"t_max": None}, r"t_max must be .*, got None"),
    "limits crossed": (
        {"t_max": [60, 60, 60, 0.25, 60, 60, 60, 60]},
        r"t_min must be at most t_max, got 0.5 above 0.25 at cable 3",
    ),
    "t_ref infinite": ({"t_ref": np.inf}, r"t_ref must be .*, got inf at index 0"),
    "t_ref of another length": ({"t_ref": [1, 2]}, r"t_ref must be .*, got shape \(2,\)"),
    "weights zero": (
        {"weights": [1, 1, 0, 1, 1, 1, 1, 1]},
        r"weights must be numbers > 0, from 1e-20 .*, got 0 at index 2",
    ),
    "weights negative": ({"weights": -1}, r"weights must be .*, got -1 at index 0"),
    "weights infinite": ({"weights": np.inf}, r"weights must be .*, got inf at index 0"),
    "weights a matrix": ({"weights": np.eye(8)}, r"weights must be .*, got shape \(8, 8\)"),
    "length zero": ({"length": 0}, r"length must be one number > 0 .*, got 0"),
    "length NaN": ({"length": np.nan}, r"length must be .*, got nan"),
    "length an array": ({"length": [1, 2]}, r"length must be .*, got shape \(2,\)"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_told_in_one_line(name):
    change, message = WRONG[name]
    arguments = {"A": A8, "w": W8, "t_min": T_MIN, "t_max": T_MAX} | change
    with pytest.raises(InputError, match=message) as caught:
        TensionProblem(**arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"method": "magic"}, r"method must be one of active-set, daqp, qp, min-norm.*, got 'magic'"),
        ({"method": None}, r"method must be .*, got None"),
        ({"method": "qp", "backend": "magic"}, r"backend must be one of clarabel, .*osqp.*, got 'magic'"),
        ({"method": "min-norm", "backend": "osqp"}, r"backend must be left out: min-norm has no back ends, got 'osqp'"),
        ({"magic": 1}, r"options must be empty for method active-set, got 'magic'"),
        ({"method": "qp", "magic": 1}, r"options must be settings of clarabel, got magic"),
        ({"method": "qp", "backend": "osqp", "magic": 1}, r"options must be settings of osqp, got magic"),
    ],
)
def test_wrong_choices_list_what_there_is(arguments, message):
    with pytest.raises(InputError, match=message):
        solve(TensionProblem(A8, W8, T_MIN, T_MAX), **arguments)


def test_solving_something_else_is_told():
    with pytest.raises(InputError, match=r"problem must be a TensionProblem, got an array .* of type ndarray"):
        solve(A8)


def test_a_problem_keeps_its_own_read_only_copy():
    A = A8.copy()
    problem = TensionProblem(A, W8, T_MIN, T_MAX)
    A[:] = 0.0
    assert (problem.A == A8).all()
    with pytest.raises(ValueError, match="read-only"):
        problem.t_max[0] = 1.0


def test_a_back_end_that_gives_up_is_a_status_and_no_exception(capfd):
    problem = TensionProblem(A8, W8, T_MIN, T_MAX)
    solution = solve(problem, "qp", "clarabel", max_iter=1)
    assert solution.status is Status.FAILED
    assert solution.tensions is None
    assert "clarabel" in solution.detail
    problem = random_feasible(np.random.default_rng(1), 8)
    rough = solve(problem, "qp", "osqp", eps_abs=1e-2, polishing=False)
    assert rough.status is Status.INACCURATE
    assert rough.residual > problem.tolerance(rough.tensions)
    assert capfd.readouterr() == ("", "")


def test_a_back_end_that_calls_a_feasible_problem_infeasible_is_not_believed(monkeypatch):
    import qpsolvers

    def liar(problem, solver, **settings):
        return qpsolvers.Solution(problem, found=False, extras={"status": "infeasible"})

    def broken(problem, solver, **settings):
        raise ZeroDivisionError("oops")

    problem = TensionProblem(A8, W8, T_MIN, T_MAX)
    for back_end, detail in ((liar, "infeasible"), (broken, "ZeroDivisionError: oops")):
        monkeypatch.setattr(qpsolvers, "solve_problem", back_end)
        solution = solve(problem, "qp")
        assert solution.status is Status.FAILED
        assert detail in solution.detail


def test_methods_tell_about_themselves():
    listed = methods()
    assert list(listed)[:4] == ["active-set", "daqp", "qp", "min-norm"]
    assert {"closed-form", "centroid", "dykstra", "log-barrier", "soft-wrench"} <= set(listed)
    for name, method in listed.items():
        assert method.name == name
        assert method.guarantee
        assert method.source
    assert {"clarabel", "osqp"} <= set(listed["qp"].backends())
    listed.clear()
    assert methods()


def test_importing_costs_nothing_heavy():
    heavy = {"scipy", "qpsolvers", "osqp", "clarabel", "casadi"}
    code = "import sys, towline.solvers; print(*{name.split('.')[0] for name in sys.modules})"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not heavy & set(loaded)


def test_weights_fourteen_decades_apart():
    """Check that the methods of least squares give the optimum; the daqp package alone finds nothing in one of ten."""
    rng = np.random.default_rng(0)
    for _ in range(60):
        A = rng.normal(size=(6, 8))
        problem = TensionProblem(A, A @ rng.uniform(0.1, 1.0, 8), 0.1, 1.0, weights=10.0 ** rng.uniform(-7, 7, 8))
        ours = solve_batch(*(getattr(problem, name) for name in ("A", "w", "t_min", "t_max", "t_ref", "weights")))
        assert ours.feasible
        np.testing.assert_allclose(solve(problem, "daqp").tensions, ours.tensions, rtol=0, atol=1e-6)


def test_a_certificate_of_a_direction_along_which_no_cable_pulls_does_not_say_that_cables_pull_the_other_way():
    rounded = TensionProblem([[1, -1], [-1e-17, -1e-17]], [0, 5], 1, 60)  # the support value is below zero by rounding
    singular = solve(rounded).certificate.describe()
    assert "no cable pulls along this direction" in singular
    assert "the other way" not in singular
    assert "the other way" in solve(TensionProblem([[1, 1]], [-5], 1, 60)).certificate.describe()
