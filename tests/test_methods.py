"""Check each method against what it claims: status, optimality, continuity; agreement where theory says they agree."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from towline.base.errors import InputError
from towline.solvers import TensionProblem, capacity_margin, certify, limit_rate, methods, solve

from .problems import T_MAX, T_MIN, ZOO, geometric_matrix, random_feasible, random_infeasible
from .references import optimum_by_enumeration
from .soak.continuity import JUMP, KINDS, SMOOTH, Motion, continuity, leaving, smoothness
from .soak.exactness import awkward_problem

# The methods that test_solvers does not take through the zoo already.
NEW = [name for name in methods() if name not in ("active-set", "qp", "min-norm")]
ALWAYS_FIND = [name for name in NEW if methods()[name].exact]
CLOSED = ("closed-form", "improved-closed-form")

# Feasible problems to which a method has no result, by its docstring.
CENTRELESS = {"no limits at all", "no upper limit"}
DECLINED = {
    "centroid": CENTRELESS,
    "analytic-centre": CENTRELESS,
    "least-sum": {"no limits at all"},
    "largest-margin": CENTRELESS,
    "min-max": {"no limits at all"},
}


@pytest.mark.parametrize("method", NEW)
def test_the_zoo_is_told_apart_or_declined_as_documented(method):
    failed = []
    for name, (problem, status) in ZOO.items():
        solution = solve(problem, method)
        if status != "optimal":
            assert solution.certificate is not None
            assert solution.certificate.verify(problem)
            assert (solution.status == "inaccurate") if method == "soft-wrench" else (solution.status == status), name
        elif solution.feasible:
            assert solution.residual <= problem.tolerance(solution.tensions)
            assert solution.bound_violation == 0.0
            assert solution.certificate is None
        else:
            assert solution.status == "failed", name
            assert solution.detail
            assert solution.certificate is None
            failed.append(name)
    if method not in CLOSED:
        assert set(failed) <= DECLINED.get(method, set())


@pytest.mark.parametrize("method", NEW)
def test_every_feasible_problem_is_solved_by_methods_that_say_so(method):
    rng = np.random.default_rng(31)
    counts = {"optimal": 0, "failed": 0}
    for k in range(24):
        problem = random_feasible(rng, 3 + k % 8)
        counts[solve(problem, method).status] += 1
    if method in ALWAYS_FIND or method == "dykstra":
        assert counts["failed"] == 0
    else:
        assert counts["optimal"] >= (18 if method == "improved-closed-form" else 9)
    for k in range(8):
        problem = random_infeasible(rng, 3 + k % 8)
        solution = solve(problem, method)
        assert not solution.feasible
        assert solution.certificate.shortfall == certify(problem).shortfall


def inner_problem(rng, m, **wish):
    """Return a problem with tensions well inside the limits."""
    A = geometric_matrix(rng, m)
    return TensionProblem(A, A @ rng.uniform(5, 50, m), T_MIN, T_MAX, **wish)


def best_along(problem, gradient):
    """Return the least gradient . t among the feasible tensions, by linear program."""
    bounds = np.column_stack([problem.t_min, problem.t_max])
    answer = linprog(gradient, A_eq=problem.A, b_eq=problem.w, bounds=bounds, method="highs")
    assert answer.status == 0
    return answer.fun


def test_methods_that_solve_the_same_problem_agree():
    rng = np.random.default_rng(32)
    same = [("2-norm", {}), ("dykstra", {}), ("soft-wrench", {}), ("p-norm", {"p": 2})]
    for k in range(20):
        m = 6 + k % 5
        problem = inner_problem(rng, m, t_ref=rng.uniform(0, 60, m), weights=10.0 ** rng.uniform(-1, 1, m))
        expected = solve(problem).tensions
        for method, options in same:
            found = solve(problem, method, **options).tensions
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6 * T_MAX, err_msg=method)
        sums = {method: solve(problem, method).tensions.sum() for method in ("1-norm", "least-sum")}
        assert sums["1-norm"] == pytest.approx(sums["least-sum"], rel=1e-8)
        assert sums["1-norm"] == pytest.approx(best_along(problem, np.ones(m)), rel=1e-6)


def test_one_norm_counts_negative_tensions_as_tensions():
    rng = np.random.default_rng(33)
    for m in (7, 8, 9, 10):
        A = geometric_matrix(rng, m)
        problem = TensionProblem(A, A @ rng.uniform(-20, 20, m), -30, 30)
        doubled = linprog(np.ones(2 * m), A_eq=np.hstack([A, -A]), b_eq=problem.w, bounds=(0, 30), method="highs")
        assert np.abs(solve(problem, "1-norm").tensions).sum() == pytest.approx(doubled.fun, rel=1e-7)


def test_linear_programs_reach_the_optimum_of_a_plain_formulation():
    rng = np.random.default_rng(34)
    for k in range(20):
        m = 7 + k % 3
        problem = inner_problem(rng, m, weights=10.0 ** rng.uniform(-1, 1, m))
        equal = {"A_eq": np.hstack([problem.A, np.zeros((6, 1))]), "b_eq": problem.w, "method": "highs"}
        one, bounds = np.ones((m, 1)), [(None, None)] * (m + 1)
        last = np.r_[np.zeros(m), 1.0]
        box = np.r_[np.full(m, T_MAX), np.full(m, -T_MIN)]
        safe = linprog(-last, A_ub=np.block([[np.eye(m), one], [-np.eye(m), one]]), b_ub=box, bounds=bounds, **equal)
        t = solve(problem, "largest-margin").tensions
        assert min((t - T_MIN).min(), (T_MAX - t).min()) == pytest.approx(-safe.fun, rel=1e-6)
        low = linprog(
            last, A_ub=np.hstack([np.eye(m), -one]), b_ub=np.zeros(m), bounds=[(T_MIN, T_MAX)] * m + bounds[:1], **equal
        )
        assert solve(problem, "min-max").tensions.max() == pytest.approx(low.fun, rel=1e-6)


@pytest.mark.parametrize(("p", "spread"), [(3, 1), (4, 1), (8, 1), (8, 3), (20, 3)])
def test_p_norm_is_optimal(p, spread):
    """Check that no feasible direction goes down: the gradient's best feasible point is the answer itself."""
    rng = np.random.default_rng(35)
    for k in range(20):
        m = 7 + k % 3
        problem = inner_problem(rng, m, t_ref=30.0 * (k % 2), weights=10.0 ** rng.uniform(-spread, spread, m))
        t = solve(problem, "p-norm", p=p).tensions
        apart = np.sqrt(problem.weights) * (t - problem.t_ref)
        size = np.abs(apart).max()
        gradient = np.sqrt(problem.weights) * np.sign(apart) * np.abs(apart / size) ** (p - 1)
        assert gradient @ t - best_along(problem, gradient) <= 1e-6 * (np.abs(gradient) @ np.abs(t))


def test_barrier_methods_are_stationary_and_strictly_inside():
    rng = np.random.default_rng(36)
    for k in range(20):
        m = 7 + k % 4
        problem = inner_problem(rng, m, t_ref=rng.uniform(0, 60, m))
        null = np.linalg.svd(problem.A)[2][6:]
        for method, mu in (("log-barrier", (0.01 * (T_MAX - T_MIN)) ** 2), ("analytic-centre", 1.0)):
            t = solve(problem, method).tensions
            assert (t > T_MIN).all()
            assert (t < T_MAX).all()
            pull = mu * (1 / (T_MAX - t) - 1 / (t - T_MIN))
            gradient = pull if method == "analytic-centre" else t - problem.t_ref + pull
            assert np.abs(null @ gradient).max() <= 1e-7 * np.abs(gradient).max()


def on_a_face(rng):
    """Return a problem in which four cables share 3 N and the others must be at limits, and the tensions of those.

    The rows are mixed by a random rotation, so that w is on the boundary but for rounding.
    """
    n = int(rng.integers(2, 6))
    A = np.zeros((n, n + 4))
    A[0, :4], A[1:, 4 : n + 3], A[-1, -1] = 1.0, np.eye(n - 1), -1.0
    t_max = np.r_[np.full(4, 60.0), rng.uniform(3, 9, n)]
    held = np.r_[t_max[4:-1], 0.0]
    A = np.linalg.qr(rng.normal(size=(n, n)))[0] @ A
    t = np.r_[3.0, 0.0, 0.0, 0.0, held]
    return TensionProblem(A, A @ t, 0.0, t_max, t_ref=rng.uniform(0, 5, n + 4)), held


def test_on_the_boundary_methods_keep_their_own_criterion():
    """Least squares to t_ref, which differs for each of the four, are neither their centre nor least with a barrier."""
    rng = np.random.default_rng(46)
    for _ in range(10):
        problem, held = on_a_face(rng)
        nearest = solve(problem)
        assert nearest.feasible
        for method in ("centroid", "analytic-centre", "log-barrier"):
            solution = solve(problem, method)
            assert solution.feasible
            t = solution.tensions[:4]
            np.testing.assert_allclose(solution.tensions[4:], held, rtol=0, atol=1e-9)
            assert np.abs(t - nearest.tensions[:4]).max() > 0.1
            if method == "log-barrier":
                gradient = t - problem.t_ref[:4] + 0.6**2 * (1.0 / (60.0 - t) - 1.0 / t)
                np.testing.assert_allclose(gradient, gradient.mean(), rtol=0, atol=1e-6)
            else:
                np.testing.assert_allclose(t, 0.75, rtol=0, atol=1e-6)


def test_where_one_distribution_is_left_every_method_has_it():
    rng = np.random.default_rng(47)
    for m in (6, 8, 10):
        A = geometric_matrix(rng, m)
        corner = np.where(rng.normal(size=6) @ A > 0, T_MAX, T_MIN)
        problem = TensionProblem(A, A @ corner, T_MIN, T_MAX, t_ref=20.0)
        for method in ALWAYS_FIND:
            np.testing.assert_allclose(solve(problem, method).tensions, corner, rtol=0, atol=1e-6, err_msg=method)


def test_a_barrier_converges_with_tensions_next_to_their_limits():
    """Rounding of the Newton step is then more than its length at the minimum: no step is a shorter one."""
    for seed in (8_000_114, 8_000_193, 8_000_399):
        problem = TensionProblem(*awkward_problem(seed))
        solution = solve(problem, "log-barrier")
        assert solution.feasible
        assert not solution.detail
        moving = problem.t_min < problem.t_max
        t, low, high = (x[moving] for x in (solution.tensions, problem.t_min, problem.t_max))
        gradient = t - problem.t_ref[moving] + (0.01 * (high - low).min()) ** 2 * (1 / (high - t) - 1 / (t - low))
        null = np.linalg.svd(problem.A[:, moving])[2][np.linalg.matrix_rank(problem.A[:, moving]) :]
        assert np.abs(null @ gradient).max() <= 1e-6 * np.abs(gradient).max()


def test_log_barrier_tends_to_the_least_squares_as_its_weight_falls():
    rng = np.random.default_rng(37)
    for m in (7, 8, 10):
        problem = inner_problem(rng, m)
        expected = solve(problem).tensions
        apart = [np.abs(solve(problem, "log-barrier", barrier=b).tensions - expected).max() for b in (1e-1, 1e-2, 1e-3)]
        assert apart[0] > apart[1] > apart[2]
        assert apart[2] < 1e-2


def test_a_warm_start_saves_newton_steps():
    rng = np.random.default_rng(38)
    A, t = geometric_matrix(rng, 8), rng.uniform(5, 50, 8)
    for method in ("log-barrier", "analytic-centre"):
        cold, warm, last = [], [], None
        for phase in np.linspace(0, 1, 40):
            problem = TensionProblem(A, A @ (t + 4 * np.sin(6 * phase + np.arange(8))), T_MIN, T_MAX)
            first = solve(problem, method)
            cold.append(first.iterations)
            if last is not None:
                again = solve(problem, method, start=last)
                warm.append(again.iterations)
                np.testing.assert_allclose(again.tensions, first.tensions, rtol=0, atol=1e-7)
            last = first.tensions
        print(method, "Newton steps, cold and warm:", np.median(cold), np.median(warm))
        assert np.median(warm) < np.median(cold)


def test_the_centroid_of_shapes_that_everybody_knows():
    for m in (1, 2, 3, 4, 5, 6):  # a simplex, of dimension m - 1
        t = solve(TensionProblem(np.ones((1, m)), [3.0], 0, 60), "centroid").tensions
        np.testing.assert_allclose(t, 3.0 / m, rtol=1e-9)
    for pairs in (1, 2, 3, 4):  # a box: each pair pulls against itself
        A = np.kron(np.eye(pairs), [[1.0, -1.0]])
        t = solve(TensionProblem(A, np.full(pairs, 2.0), 1, 9, weights=range(1, 2 * pairs + 1)), "centroid").tensions
        np.testing.assert_allclose(t, np.tile([6.0, 4.0], pairs), rtol=1e-9)
    # No wish: where it is symmetric, the origin is nothing special.
    t = solve(TensionProblem([[1.0, -1.0]], [0.0], -1, 9), "centroid").tensions
    np.testing.assert_allclose(t, 4.0)


def test_the_centroid_of_a_polygon_is_the_mean_of_its_points():
    rng = np.random.default_rng(39)
    for _ in range(2):
        problem = inner_problem(rng, 8)
        null = np.linalg.svd(problem.A)[2][6:]
        particular = np.linalg.lstsq(problem.A, problem.w, rcond=None)[0]
        # Tile the polygon's bounding box.
        ends = [[best_along(problem, sign * row) * sign for sign in (1, -1)] for row in null]
        edges = [np.linspace(low, high, 801) for low, high in ends]
        x, y = np.meshgrid(*[(edge[1:] + edge[:-1]) / 2 for edge in edges])
        points = np.column_stack([x.ravel(), y.ravel()]) @ null + particular
        points = points[((points >= T_MIN) & (points <= T_MAX)).all(axis=1)]
        found = solve(problem, "centroid").tensions
        np.testing.assert_allclose(found, points.mean(axis=0), rtol=0, atol=5e-3 * np.ptp(points, axis=0).max())


def test_the_closed_form_is_the_pseudo_inverse_about_the_middle_and_its_improvement_finds_more():
    rng = np.random.default_rng(40)
    found = dict.fromkeys(CLOSED, 0)
    for k in range(100):
        problem = random_feasible(rng, 7 + k % 3)
        middle = np.full(problem.m, (T_MIN + T_MAX) / 2)
        expected = middle + np.linalg.pinv(problem.A) @ (problem.w - problem.A @ middle)
        inside = (expected >= T_MIN).all() and (expected <= T_MAX).all()
        for method in CLOSED:
            solution = solve(problem, method)
            found[method] += solution.feasible
            if inside:
                np.testing.assert_allclose(solution.tensions, expected, rtol=0, atol=1e-8)
            if not solution.feasible:
                assert solution.status == "failed"
                assert solution.detail
        assert solve(problem, "closed-form").feasible is bool(inside)
    print("found of 100:", found)
    assert found["improved-closed-form"] > found["closed-form"]


def test_soft_wrench_gives_the_nearest_wrench_with_the_least_norm():
    rng = np.random.default_rng(41)
    for k in range(60):
        problem = random_infeasible(rng, 4 + k % 6)
        solution = solve(problem, "soft-wrench")
        assert solution.status == "inaccurate"
        if not solution.certificate.singular:
            assert solution.residual == pytest.approx(solution.certificate.shortfall, rel=1e-6)
        if k < 12 and problem.m <= 6:
            given = problem.A @ solution.tensions
            least = optimum_by_enumeration(problem.A, given, problem.t_min - 1e-7, problem.t_max + 1e-7)
            np.testing.assert_allclose(solution.tensions, least, rtol=0, atol=1e-3)


def test_soft_wrench_with_a_weight_minimises_the_sum():
    rng = np.random.default_rng(42)
    for rho in (1e-2, 1.0, 1e3):
        problem = inner_problem(rng, 8, t_ref=rng.uniform(0, 60, 8))
        solution = solve(problem, "soft-wrench", rho=rho)
        assert solution.status == "inaccurate"
        assert solution.certificate is None
        t = solution.tensions
        gradient = t - problem.t_ref + rho * problem.A.T @ (problem.A @ t - problem.w)
        free = (t > T_MIN) & (t < T_MAX)
        assert np.abs(gradient[free]).max() <= 1e-8 * max(1.0, rho) * T_MAX
        assert (gradient[t == T_MIN] >= 0).all()
        assert (gradient[t == T_MAX] <= 0).all()


CONTINUOUS = [name for name, method in methods().items() if method.continuous]


@pytest.mark.parametrize("method", CONTINUOUS)
def test_methods_that_claim_continuity_do_not_jump(method):
    """Check a motion of each kind; `python -m tests.soak continuity` takes a hundred."""
    result = continuity(method, range(2, 5))
    print(method, result)
    assert result.worst <= JUMP
    assert result.unanswered == 0
    assert result.inaccurate == 0 or method == "dykstra"


def test_the_continuity_test_can_see():
    """Check that linear programs jump as the cables turn; of the first twenty motions, two show it."""
    assert continuity("1-norm", range(8, 9)).worst > 0.3


@pytest.mark.parametrize("options", [{}, {"rho": 1.0}])
def test_soft_wrench_does_not_jump_as_the_wrench_leaves_the_set(options):
    result = leaving("soft-wrench", range(4), **options)
    assert result.worst <= JUMP
    assert result.unanswered == 0
    assert result.inaccurate > 50


@pytest.mark.parametrize(
    ("method", "smooth"), [("log-barrier", True), ("analytic-centre", True), ("active-set", False)]
)
def test_barrier_methods_have_a_continuous_derivative_and_least_squares_has_not(method, smooth):
    worst = smoothness(method, range(4), **SMOOTH.get(method, {})).worst
    print(f"{method}: {worst:.1e} of a change of the derivative left")
    assert worst <= JUMP if smooth else worst > 0.1


def test_the_motions_reach_the_boundary_where_they_say():
    for seed in range(20):
        kind = KINDS[seed % len(KINDS)]
        motion = Motion(seed, kind)
        for moment in (0.0, 0.5, 1.0, 1.2, 1.9):
            problem = motion.at(moment)
            reserve = capacity_margin(problem).value
            at_boundary = (kind == "touching" and moment == 1.0) or (kind == "following" and 0.7 <= moment <= 1.3)
            assert (reserve < 1e-9 * T_MAX) is at_boundary
            assert solve(problem).feasible


def test_rate_limits_hold_for_every_method():
    rng = np.random.default_rng(43)
    problem = inner_problem(rng, 8)
    last = solve(problem).tensions
    moved = TensionProblem(problem.A, problem.w + problem.A @ rng.uniform(-0.3, 0.3, 8), T_MIN, T_MAX)
    limited = limit_rate(moved, last, 0.5)
    for method in methods():
        solution = solve(limited, method)
        if method in CLOSED and not solution.feasible:
            continue
        assert solution.feasible, method
        assert np.abs(solution.tensions - last).max() <= 0.5 + 1e-12
    far = TensionProblem(problem.A, problem.A @ (last + 2.0), T_MIN, T_MAX + 10)
    assert solve(far).feasible
    assert solve(limit_rate(far, last, 0.5)).certificate is not None
    assert solve(limit_rate(far, last, np.inf)).tensions == pytest.approx(solve(far).tensions)
    # Tensions that were outside the limits come back as fast as they may.
    back = limit_rate(TensionProblem([[1.0, -1.0]], [0.0], 1, 10), [15, -3], 2)
    assert (back.t_min.tolist(), back.t_max.tolist()) == ([13, -1], [13, -1])
    for wrong, message in (
        ((last, -1), "rate_max must be .*, got -1"),
        ((last[:3], 1), r"previous must be .*, got shape \(3,\)"),
    ):
        with pytest.raises(InputError, match=message):
            limit_rate(problem, *wrong)


@pytest.mark.parametrize(
    ("method", "options", "message"),
    [
        ("p-norm", {"p": 1}, "p must be a number from 2 to 20, got 1"),
        ("dykstra", {"max_iter": 0}, "max_iter must be a whole number from 1 .*, got 0"),
        ("log-barrier", {"barrier": "big"}, "barrier must be a number .*, got 'big'"),
        ("log-barrier", {"start": [1, 2]}, r"start must be .* of shape \(8,\) of finite numbers, got .* \(2,\)"),
        ("soft-wrench", {"rho": -1}, "rho must be a number .*, got -1"),
        ("centroid", {"p": 4}, "options must be empty for method centroid, got 'p'"),
    ],
)
def test_wrong_options_are_told(method, options, message):
    with pytest.raises(InputError, match=message):
        solve(inner_problem(np.random.default_rng(44), 8), method, **options)


def test_dykstra_says_how_far_it_came():
    rng = np.random.default_rng(45)
    problem = inner_problem(rng, 8, t_ref=[-50, 0, 0, 200, 0, 9, 90, 10])
    rough = solve(problem, "dykstra", max_iter=3)
    assert rough.status == "inaccurate"
    assert "3 iterations" in rough.detail
    assert rough.residual > 0


def test_the_page_on_adding_a_method_works():
    page = (Path(__file__).parent.parent / "docs" / "adding-a-method.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["optimal", "inaccurate", "infeasible"], done.stderr
