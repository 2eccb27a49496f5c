"""The optimum in exact arithmetic: the conditions hold in fractions, and a second derivation by hand agrees."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline.solvers import TensionProblem, solve
from towline.solvers.box_least_squares import project
from towline.solvers.exact_arithmetic import exact_optimum, minimum_in_box

from .soak.exactness import awkward_problem


def test_twin_cables_share_on_the_boundary():
    """Cable 3 pulls up alone and must do all that it can; 1 and 2 are opposed, so only their balance is a choice.

    min t1^2 + 4 t2^2 with t1 - t2 = 1: t1 = 4/5 without limits; t2 >= 0 makes it t1 = 1, t2 = 0.
    """
    A = [[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    problem = TensionProblem(A, [1.0, 7.0], 0.0, [5.0, 5.0, 7.0], weights=[1.0, 4.0, 1.0])
    np.testing.assert_allclose(
        exact_optimum(problem, project(problem).closest).closest, [1.0, 0.0, 7.0], rtol=0, atol=1e-15
    )
    negative = TensionProblem(A, [1.0, 7.0], [-5.0, -5.0, 0.0], [5.0, 5.0, 7.0], weights=[1.0, 4.0, 1.0])
    np.testing.assert_allclose(
        exact_optimum(negative, project(negative).closest).closest, [0.8, -0.2, 7.0], rtol=0, atol=1e-15
    )


def test_beyond_the_boundary_it_gives_the_nearest_wrench():
    problem = TensionProblem([[1.0, 1.0]], [10.0], 0.0, [4.0, 5.0])
    np.testing.assert_array_equal(exact_optimum(problem, project(problem).closest).closest, [4.0, 5.0])


@given(st.integers(0, 2**32), st.integers(1, 7), st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_conditions_hold_in_fractions(seed, size, unlimited):
    """The gradient is exactly zero inside the limits and points out of them at the limits: the one minimum."""
    rng = np.random.default_rng(seed)
    root = rng.integers(-4, 5, (size, size + 1))
    H = (root @ root.T + np.eye(size, dtype=int)).tolist()
    slope = rng.integers(-20, 21, size).tolist()
    low = rng.integers(-3, 1, size).tolist()
    high = [None if unlimited and rng.random() < 0.5 else each + int(rng.integers(0, 4)) for each in low]
    x, divisor = minimum_in_box(H, slope, list(zip(low, high, strict=True)), list(low), 1)
    x = [Fraction(value, divisor) for value in x]
    for i in range(size):
        gradient = sum((H[i][j] * x[j] for j in range(size)), -slope[i])
        assert low[i] <= x[i] <= (np.inf if high[i] is None else high[i])
        assert gradient == 0 or low[i] == high[i] or (x[i] == low[i] if gradient > 0 else x[i] == high[i])


@pytest.mark.parametrize("seed", range(0, 3000, 7))
def test_away_from_the_boundary_it_is_what_solve_finds(seed):
    problem = TensionProblem(*awkward_problem(seed))
    solution = solve(problem)
    if solution.feasible and not solution.detail and np.ptp(np.log10(problem.weights)) < 3:
        cost = [
            problem.weights @ (t - problem.t_ref) ** 2
            for t in (solution.tensions, exact_optimum(problem, project(problem).closest).closest)
        ]
        assert cost[1] == pytest.approx(cost[0], rel=1e-6, abs=1e-12)


def test_a_cable_that_the_null_space_does_not_move_stays_at_its_limit():
    """Cables 1 and 5 are opposed and unlimited; rounding gives cable 4, which alone must do more than it can, 1e-17."""
    problem = TensionProblem(*awkward_problem(5237))
    solution = solve(problem)
    assert solution.status == "infeasible"
    assert solution.certificate is not None
    assert solution.certificate.verify(problem)
