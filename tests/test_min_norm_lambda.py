"""The lambda of paper C's Eq. 17, given and returned: by SciPy's null space, and by the limits of each cable."""

import numpy as np
import pytest
from scipy.linalg import null_space

import towline
from towline.base.errors import InputError
from towline.models import Dynamics, load
from towline.solvers import TensionProblem, solve

from .problems import random_feasible


def towed(m, shift=(0.65, 0.0, 0.3), t_min=0.0, t_max=500.0):
    """Balance of forces of m robots and their load, near one side."""
    robot = load(f"wang-ctmrts-{m}")
    A = Dynamics(robot).wrench_matrix(robot.home + np.r_[shift, np.zeros(3)])[:3]
    return TensionProblem(A, [0.0, 0.0, robot.weight], t_min, t_max)


@pytest.mark.parametrize("m", [4, 5, 6])
@pytest.mark.parametrize("method", ["min-norm", "largest-margin"])
def test_tensions_are_the_pseudo_inverse_and_n_lambda(m, method):
    problem = towed(m, t_min=10.0, t_max=250.0)
    N, expected = problem.null_space, null_space(problem.A)
    assert N.shape == (m, m - 3)
    np.testing.assert_allclose(N.T @ N, np.eye(m - 3), atol=1e-12)
    np.testing.assert_allclose(N @ N.T, expected @ expected.T, atol=1e-12)  # the same space
    solution = solve(problem, method)
    np.testing.assert_allclose(
        np.linalg.pinv(problem.A) @ problem.w + N @ solution.lambda_, solution.tensions, rtol=0, atol=1e-9
    )
    again = solve(problem, "min-norm", lambda_=solution.lambda_)
    assert again.status == "optimal"
    np.testing.assert_allclose(again.tensions, solution.tensions, rtol=0, atol=1e-9)


def test_the_basis_depends_on_the_null_space_alone():
    """Other rows of the same space, as from another LAPACK, frame or unit, have the same N: its echelon."""
    rng, problem = np.random.default_rng(5), towed(6)
    A = problem.A.copy()
    A[:, 1] = A[:, 0]  # one line: cable 2 has no column of its own
    for matrix in (problem.A, A):
        N = TensionProblem(matrix, problem.w, 0, 500).null_space
        firsts = np.argmax(np.abs(N) > 1e-9, axis=0)
        assert (np.diff(firsts) > 0).all()
        assert (N[firsts, np.arange(3)] > 0).all()
        for _ in range(5):
            mixed = rng.normal(size=(3, 3)) @ matrix
            np.testing.assert_allclose(TensionProblem(mixed, np.zeros(3), 0, 500).null_space, N, rtol=0, atol=1e-9)


def test_the_printed_scalar_is_used_as_it_is():
    """Inside the limits the tensions move along the null-space vector; beyond the first limit that is met they fail."""
    problem = towed(4)
    plain, null = np.linalg.pinv(problem.A) @ problem.w, null_space(problem.A)[:, 0]
    null *= np.sign(null[0])
    for chosen in (0.0, 0.5, 1.0):
        solution = solve(problem, "min-norm", lambda_=chosen)
        assert solution.feasible
        assert solution.lambda_ == pytest.approx([chosen], abs=1e-10)
        np.testing.assert_allclose(solution.tensions, plain + chosen * null, rtol=0, atol=1e-10)
    ends = np.where(null > 0, -plain / null, np.inf)  # lambda at which a cable has 0 N on the way down
    last = -np.min(-ends[null > 0])
    cable = int(np.flatnonzero(null > 0)[np.argmax(ends[null > 0])])
    assert solve(problem, "min-norm", lambda_=last + 1e-6).feasible
    beyond = solve(problem, "min-norm", lambda_=last - 3.0)
    assert (beyond.status, beyond.tensions, beyond.lambda_) == ("failed", None, None)
    assert beyond.detail == f"A^+ w + N lambda_ leaves the limits of cable {cable} by {3 * null[cable]:.3g} N"


def test_a_given_lambda_is_not_corrected_by_reference_weights_or_a_balance_at_rest():
    """Where w = 0 the method's own answer is t_ref; a lambda still counts, and so it does with weights."""
    A = np.array([[1.0, -1.0]])
    for more in ({}, {"t_ref": [5.0, 5.0]}, {"weights": [1.0, 9.0]}):
        solution = solve(TensionProblem(A, [0.0], 0.0, 60.0, **more), "min-norm", lambda_=2.0)
        np.testing.assert_allclose(solution.tensions, np.sqrt(2) * np.ones(2), atol=1e-12)
        assert solution.status == "optimal"
    held = TensionProblem(A, [0.0], [3.0, 0.0], [3.0, 9.0])  # the first tension is fixed
    assert solve(held, "min-norm", lambda_=3 * np.sqrt(2)).feasible
    assert solve(held, "min-norm", lambda_=2.0).detail.startswith("A^+ w + N lambda_ leaves the limits of cable 0")


def test_no_lambda_makes_a_wrench_available():
    pair = np.array([[1.0, -1.0]])
    solution = solve(TensionProblem(pair, [70.0], 1.0, 60.0), "min-norm", lambda_=60.0)
    assert solution.status == "infeasible"
    assert solution.certificate.shortfall == pytest.approx(11.0)
    robot = load("wang-ctmrts")  # six rows and three cables: a level load is in no balance
    assert towline.tensions(robot, robot.home, method="min-norm", lambda_=[]).status == "singular"


def test_any_lambda_inside_the_limits_is_optimal_and_any_outside_is_not():
    rng = np.random.default_rng(7)
    kept = 0
    for _ in range(60):
        problem = random_feasible(rng, 8)
        chosen = solve(problem, "min-norm").lambda_ + rng.normal(size=2) * rng.choice([0.1, 10.0])
        t = np.linalg.pinv(problem.A) @ problem.w + problem.null_space @ chosen
        inside = bool((t >= problem.t_min).all() and (t <= problem.t_max).all())
        solution = solve(problem, "min-norm", lambda_=chosen)
        assert solution.feasible == inside
        assert solution.status == ("optimal" if inside else "failed")
        kept += inside
    assert 10 < kept < 50


@pytest.mark.parametrize(
    ("m", "given", "message"),
    [
        (4, [1.0, 2.0], r"lambda_ must be a finite number \(m = 4, rank 3\), got \[1.0, 2.0\]"),
        (4, np.nan, r"lambda_ must be a finite number .*, got nan"),
        (5, 0.5, r"lambda_ must be 2 finite numbers, one for each column of the null space \(m = 5, .*, got 0.5"),
        (6, "half", r"lambda_ must be an array of real numbers, got 'half'"),
    ],
)
def test_a_wrong_lambda_is_one_line(m, given, message):
    with pytest.raises(InputError, match=f"^{message}$"):
        solve(towed(m), "min-norm", lambda_=given)


def test_three_robots_have_no_lambda():
    robot = load("wang-ctmrts")
    with pytest.raises(InputError, match=r"^lambda_ must be empty, as A has no null space \(m = 3, rank 3\), got 0.5$"):
        towline.tensions(robot, robot.home, method="min-norm", lambda_=0.5)


@pytest.mark.parametrize("method", ["qp", "active-set", "min-norm"])
def test_qpsolvers_word_for_a_back_end_leads_to_ours(method):
    message = (
        r"^solver must be left out, as a QP solver is chosen by method='qp' with backend=\.\.\., got solver='osqp'$"
    )
    with pytest.raises(InputError, match=message):
        solve(towed(4), method, solver="osqp")
    with pytest.raises(InputError, match=message):
        towline.tensions("wang-flying", load("wang-flying").home, method=method, solver="osqp")
