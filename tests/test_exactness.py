"""Statuses, tensions, certificates and margins are those of exact arithmetic, and its judge can be trusted."""

import shutil

import numpy as np
import pytest

from towline.solvers import TensionProblem, capacity_margin, certify, solve, solve_batch

from .references import linear_program_status
from .soak.exact_judge import DOUBLE, Judge
from .soak.exact_problems import exact_problem
from .soak.exactness import check, check_float
from .soak.step_distribution import StepDistribution

BACKENDS = ("lanes", "c")
COUNT = 1200


@pytest.fixture(scope="module")
def steps(tmp_path_factory):
    """Return the distribution of an exported step by its precision."""
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler: no command cc")
    return {name: StepDistribution(name, tmp_path_factory.mktemp(name)) for name in ("double", "float")}


def problem_of(p):
    return TensionProblem(*p[:6], length=p.length)


# Cables that pull along w by 5e-12 of the largest, or less, and by 1e-4 of it and more with the tensions that they may
# have. By hand: together they give 1 + 2 * 5e-12 * 1e7 = 1.0001, and 1 + 5e-12 * 1e9 = 1.005.
SMALL_PULLS = [([[1.0, 5e-12, 5e-12], [0.0, 1.0, -1.0]], [1.0, 1e7, 1e7], 1.0001), ([[1.0, 5e-12]], [1.0, 1e9], 1.005)]


@pytest.mark.parametrize(("A", "high", "most"), SMALL_PULLS)
@pytest.mark.parametrize("share", [-0.2, 0.0, 0.2])
def test_small_pulls_count_where_limits_are_known(A, high, most, share):
    A, high = np.array(A), np.array(high)
    beyond = share * (most - 1.0)
    w = np.zeros(len(A))
    w[0] = most + beyond
    problem = TensionProblem(A, w, 0.0, high)
    expected = "infeasible" if beyond > 0.0 else "optimal"
    for method in ("active-set", "daqp", "largest-margin"):
        if share != 0.0 or method != "largest-margin":
            assert solve(problem, method).status == expected, method
    for backend in BACKENDS:
        assert solve_batch(A[None], w, 0.0, high, backend=backend).status == [expected]
    assert capacity_margin(problem).value == pytest.approx(-beyond, rel=1e-6, abs=1e-12)
    certificate = certify(problem)
    assert (certificate is not None) is (beyond > 0.0)
    if certificate is not None:
        assert certificate.verify(problem)
        assert certificate.shortfall == pytest.approx(beyond, rel=1e-6)
        assert certificate.support == pytest.approx(most)
        assert not certificate.verify(TensionProblem(A, w, 0.0, 2.0 * high))


def test_small_pulls_of_cables_without_a_limit_void_a_certificate():
    """Cables 2 and 3 have no limit: together they give any part of w, with tensions of 1e8."""
    A = np.array([[1.0, 5e-12, 5e-12], [0.0, 1.0, -1.0]])
    problem = TensionProblem(A, [1.004, 0.0], 0.0, [1.0, np.inf, np.inf])
    assert solve(problem).status == "optimal"
    limited = TensionProblem(A, [1.004, 0.0], 0.0, [1.0, 1.0, 1.0])
    certificate = solve(limited).certificate
    assert certificate is not None
    assert certificate.verify(limited)
    assert not certificate.verify(problem)


# Problems in which rounding once decided: tensions of 1e15 N and more whose own rounding exceeded w; a null space known
# to eight digits, whose noise was taken for limits, at a multiple of the least cost; a matrix of lower rank that the
# lanes took for full; an optimum that the exact search ended short of; a certificate that was not found; a cable that
# pulls along nothing, with 4.7e6 N instead of none; a direction along which cables without a limit pulled by rounding;
# a wrench error that was corrected with a cable at its limit.
ONCE_WRONG = {
    "singular": (505187, 6674, 468858, 5134550),
    "infeasible": (996016, 5172282, 10349914, 10298160, 10417452),
    "optimal": (
        125707,
        168932,
        189143,
        194569,
        374783,
        408856,
        471049,
        549114,
        627900,
        761470,
        637458,
        744035,
        843508,
        5076352,
        10815584,
        10006748,
        10513568,
        10534020,
    ),
}


@pytest.mark.parametrize(("status", "seed"), [(status, seed) for status, seeds in ONCE_WRONG.items() for seed in seeds])
def test_what_rounding_once_decided(status, seed):
    report = check(range(seed, seed + 1))
    assert report.wrong == []
    assert {word.split(" to ")[0] for word in report.statuses} == {status}


# The exported step has rounded numbers only. It was unsure where a column of zeros or one parallel to another kept a
# direction from being made orthogonal to cables without a limit, and where a cable of small weight was off by the
# rounding of the others.
@pytest.mark.parametrize(
    ("status", "seed"),
    [
        ("infeasible", 10595203),
        ("infeasible", 10933684),
        ("infeasible", 10949467),
        ("optimal", 10662599),
        ("optimal", 10796204),
    ],
)
def test_the_step_is_sure_where_nothing_is_near(status, seed, steps):
    report = check(range(seed, seed + 1), "exact", steps["double"])
    assert (report.wrong, report.statuses) == ([], {status})


def test_the_core_sees_that_limits_exclude_each_other_where_their_normals_are_known_to_five_digits():
    """What rounding left of a normal that the others span counted as a way out, so that the core was unsure."""
    p = exact_problem(412526)
    solution = solve(TensionProblem(p.A, p.w, p.t_min, p.t_max, p.t_ref, p.weights, p.length))
    assert (solution.status, solution.backend) == ("infeasible", "c")


def test_every_solver_is_right_and_says_the_same(steps):
    report = check(range(COUNT), "exact", steps["double"])
    print(report.line(), report.answers)
    assert report.wrong == []
    assert {status for solver, status in report.answers if solver != "step"} == {"optimal", "infeasible", "singular"}
    assert report.answers["step", "inaccurate"] < 0.15 * COUNT


def test_in_float_nothing_is_optimal_that_is_out_of_reach(steps):
    report = check_float(range(COUNT), steps["float"])
    print(report.line(), report.answers)
    assert report.wrong == []
    assert report.statuses == {"optimal", "infeasible", "singular", "inaccurate"}


@pytest.mark.parametrize("seed", [seed for seed in range(40) if not exact_problem(seed).rough][:8])
def test_the_number_of_rows_does_not_change_a_status(seed):
    """One row, some, many, and rows that share a matrix."""
    p = exact_problem(seed)
    w = np.outer(np.r_[np.linspace(-1.0, 3.0, 32), 1.0], p.w)
    rest = (p.t_min, p.t_max, p.t_ref, p.weights, p.length)
    expected = [str(solve_batch(p.A, row, *rest).status) for row in w]
    assert expected[-1] == solve(problem_of(p)).status
    for backend in BACKENDS:
        assert solve_batch(p.A, w, *rest, backend=backend).status.tolist() == expected
    sure = np.flatnonzero(
        [solve(problem_of(p._replace(w=row))).backend == "c" for row in w]
    )  # others take milliseconds
    many, times = np.tile(w[sure], (200, 1)), [expected[row] for row in sure]
    assert solve_batch(p.A, many, *rest).status.tolist() == times * 200
    rows = np.tile(p.A, (len(many), 1, 1))
    assert solve_batch(rows, many, *rest).status.tolist() == times * 200


def test_margins_are_the_distances_that_problems_were_made_with():
    outside = 0
    for seed in range(1000):
        p = exact_problem(seed)
        problem = problem_of(p)
        margin, doubt = capacity_margin(problem).value, 4.0 * problem.tolerance(np.zeros(problem.m))
        if p.outside > doubt:
            assert margin == pytest.approx(-p.outside, rel=1e-6, abs=doubt), seed
            outside += 1
        else:
            assert margin >= -doubt, seed
    assert outside > 150


def test_the_truth_is_that_of_a_linear_program():
    """Of problems of one scale a linear program in floating point knows the truth too."""
    compared = 0
    for seed in range(400):
        p = exact_problem(seed)
        problem = problem_of(p)
        if p.rough or 0.0 < p.outside < 1e-5 * np.linalg.norm(problem.scaled_w) or p.place in ("face", "corner"):
            continue
        if not (p.A.any() and p.w.any()):
            continue
        unit, load = np.abs(p.A).max(), np.abs(p.t_min[np.isfinite(p.t_min)]).max(initial=0.0) or 1.0
        status = linear_program_status(p.A / unit, p.w / unit / load, p.t_min / load, p.t_max / load)
        assert (status == "optimal") is (p.outside == 0.0), seed
        compared += 1
    assert compared > 100


def test_the_multipliers_drawn_prove_an_optimum():
    seen = 0
    for seed in range(300):
        p = exact_problem(seed)
        if p.multipliers is None:
            continue
        judge = Judge(p, DOUBLE)
        best = np.clip(p.t_ref + judge.SA.T @ p.multipliers / p.weights, p.t_min, p.t_max)
        assert judge.gap(best, p.multipliers) <= 1e-15
        assert judge.error(best) <= 1e-12 * (np.linalg.norm(judge.Sw) + judge.norms @ np.abs(best))
        seen += 1
    assert seen > 50


def test_wrong_answers_do_not_hide():
    """What is spoilt is seen: tensions that miss w, cost too much or are beyond a limit, and directions that lie."""
    costly = lying = 0
    for p in map(exact_problem, range(300)):
        judge = Judge(p, DOUBLE)
        solution = solve(problem_of(p))
        if solution.tensions is None:
            direction = solution.certificate.direction
            assert judge.excludes(direction)
            assert not judge.excludes(-direction)
            reachable = Judge(p._replace(w=p.A @ np.clip(0.0, p.t_min, p.t_max), outside=0.0), DOUBLE)
            assert not reachable.excludes(direction)
            lying += 1
            continue
        t = solution.tensions
        assert judge.error(t) <= judge.tolerance(t)
        if np.isfinite(p.t_max).any():
            assert judge.error(np.where(np.isfinite(p.t_max), np.nextafter(p.t_max, np.inf), t)) == np.inf
        null = np.linalg.svd(judge.SA)[2][np.linalg.matrix_rank(judge.SA) :]
        if p.rough or not len(null):
            continue
        for sign in (1.0, -1.0):
            moved = t + sign * 1e-2 * np.abs(t).max() * null[0]
            # The least cost of their wrench is that of t, and it grows with the square of the distance.
            more = p.weights @ (moved - t) ** 2 / (p.weights @ (moved - p.t_ref) ** 2)
            if ((moved >= p.t_min) & (moved <= p.t_max)).all() and more > 1e-6:
                assert judge.smallest_gap(moved) > 0.9 * more
                costly += 1
    assert min(costly, lying) > 20
