"""Capacity margin, sensitivity and the CasADi form, each against differences and against solvers that share no code."""

import casadi as ca
import numpy as np
import pytest

from towline.base.errors import InputError
from towline.solvers import TensionProblem, capacity_margin, casadi_function, sensitivity, solve
from towline.solvers.derivatives import derivatives

from .problems import T_MAX, T_MIN, ZOO, geometric_matrix, random_infeasible
from .references import distance_to_available


def inner_problem(rng, m, **wish):
    A = geometric_matrix(rng, m)
    return TensionProblem(A, A @ rng.uniform(T_MIN, T_MAX, m), T_MIN, T_MAX, **wish)


def shifted(problem, step):
    return TensionProblem(
        problem.A, problem.w + step, problem.t_min, problem.t_max, problem.t_ref, problem.weights, problem.length
    )


def test_margin_is_the_radius_of_the_largest_ball_of_available_wrenches():
    rng = np.random.default_rng(1)
    for k in range(30):
        problem = inner_problem(rng, 6 + k % 5, length=(1.0, 0.3)[k % 2])
        margin = capacity_margin(problem)
        assert margin.value > 0
        S = problem.row_scale
        assert np.linalg.norm(margin.direction / S) == pytest.approx(1.0)
        for step, status in ((1 - 1e-4, "optimal"), (1 + 1e-4, "infeasible")):
            w = problem.w + step * margin.value * margin.direction / S**2
            # Judged by active set and certificate, which know nothing of facets.
            assert solve(TensionProblem(problem.A, w, T_MIN, T_MAX, length=problem.length)).status == status
        for _ in range(20):
            d = rng.normal(size=6)
            w = problem.w + (1 - 1e-9) * margin.value * d / np.linalg.norm(d) / S
            assert solve(TensionProblem(problem.A, w, T_MIN, T_MAX)).feasible


def test_margin_of_an_infeasible_wrench_is_minus_the_shortfall():
    rng = np.random.default_rng(2)
    for k in range(60):
        problem = random_infeasible(rng, 3 + k % 8)
        certificate, margin = solve(problem).certificate, capacity_margin(problem)
        distance, size = distance_to_available(problem.A, problem.w, problem.t_min, problem.t_max)
        assert -margin.value == pytest.approx(distance, rel=1e-6, abs=1e-9 * size)
        if certificate.singular:
            assert -margin.value >= certificate.shortfall * (1 - 1e-9)
        else:
            assert -margin.value == pytest.approx(certificate.shortfall, rel=1e-7)
            np.testing.assert_allclose(margin.direction, certificate.direction, atol=1e-6)


def test_margin_depends_on_forces_not_on_units_of_single_cables():
    """A column a billionth as long, with limits a billion times as wide, makes the same set of wrenches."""
    rng = np.random.default_rng(17)
    for m in (7, 8, 9):
        A, high = geometric_matrix(rng, m), rng.uniform(20, 60, m)
        w = A @ (high * rng.uniform(0.3, 0.7, m))
        expected = capacity_margin(TensionProblem(A, w, 0.0, high, length=0.5))
        units = 10.0 ** rng.choice([-9, -5, 0], m)
        margin = capacity_margin(TensionProblem(A * units, w, 0.0, high / units, length=0.5))
        assert margin.value == pytest.approx(expected.value, rel=1e-9)
        np.testing.assert_allclose(margin.direction, expected.direction, atol=1e-9)


def test_margin_gradient_is_that_of_differences():
    rng = np.random.default_rng(3)
    h = 1e-5
    for k in range(40):
        m = 6 + k % 5
        problem = inner_problem(rng, m, length=0.5) if k % 2 else random_infeasible(rng, m)
        gradient = capacity_margin(problem).gradient
        ahead, behind = ([capacity_margin(shifted(problem, s * e)).value for e in h * np.eye(6)] for s in (1, -1))
        np.testing.assert_allclose((np.array(ahead) - behind) / (2 * h), gradient, atol=1e-5)


def test_margin_knows_the_shapes_that_everybody_knows():
    square = np.eye(2)
    assert capacity_margin(TensionProblem(square, [3, 5], 0, 10)).value == pytest.approx(3)
    assert capacity_margin(TensionProblem(square, [3, 5], 0, np.inf)).value == pytest.approx(3)
    assert capacity_margin(TensionProblem(square, [3, 5], 4, 10)).value == pytest.approx(-1)
    np.testing.assert_allclose(capacity_margin(TensionProblem(square, [3, 5], 0, 10)).gradient, [1, 0], atol=1e-12)
    assert capacity_margin(TensionProblem(square, [3, 5], -np.inf, np.inf)).value == np.inf
    # Flat sets: measured inside the range; a single wrench has none; a fixed cable shifts the set.
    flat = np.vstack([square, np.zeros((4, 2))])
    assert capacity_margin(TensionProblem(flat, [3, 5, 0, 0, 0, 0], 0, 10)).value == pytest.approx(3)
    assert capacity_margin(TensionProblem(flat, [3, 5, 1, 0, 0, 0], 0, 10)).value == pytest.approx(-1)
    assert capacity_margin(TensionProblem(square, [3, 5], [3, 5], [3, 5])).value == pytest.approx(0)
    assert capacity_margin(
        TensionProblem(np.c_[square, [1, 0]], [3, 5], [0, 0, 2], [10, 10, 2])
    ).value == pytest.approx(1)


@pytest.mark.parametrize("name", ZOO)
def test_the_sign_of_the_margin_is_the_status(name):
    problem, status = ZOO[name]
    margin = capacity_margin(problem)
    assert not np.isnan(margin.value)
    assert np.isfinite(margin.gradient).all()
    assert (margin.value >= -problem.tolerance(problem.t_ref)) is (status == "optimal")


def test_sensitivity_is_that_of_differences():
    rng = np.random.default_rng(4)
    h = 1e-5
    for k in range(40):
        m = 6 + k % 5
        problem = inner_problem(rng, m, t_ref=rng.uniform(0, 30, m), weights=10.0 ** rng.uniform(-1, 1, m), length=0.4)
        found = sensitivity(problem, solve(problem))
        assert found.shape == (m, 6)
        np.testing.assert_allclose(problem.A @ found, np.eye(6), atol=1e-8)
        for j, step in enumerate(h * np.eye(6)):
            change = solve(shifted(problem, step)).tensions - solve(shifted(problem, -step)).tensions
            np.testing.assert_allclose(found[:, j], change / (2 * h), atol=1e-5)


def test_sensitivity_at_a_kink_is_one_sided():
    A = [[1.0, -1.0]]
    # At w = 0 both cables are at t_min = 1; more w pulls the first, less the second. Nothing but w itself holds them.
    problem = TensionProblem(A, [0.0], 1, 10)
    found = sensitivity(problem, solve(problem))
    assert found.shape == (2, 1)
    assert np.isfinite(found).all()
    # A cable that touches its limit by chance is free: with t_ref = 3 and w = 0, t = 3 is its own optimum.
    touching = TensionProblem(A, [0.0], [3, 0], 10, t_ref=3)
    found = sensitivity(touching, solve(touching))
    np.testing.assert_allclose(found[:, 0], [0.5, -0.5], atol=1e-12)
    with pytest.raises(InputError, match="solution must be one with tensions, got status infeasible"):
        sensitivity(problem, solve(TensionProblem(A, [50.0], 1, 10)))


def test_derivatives_with_respect_to_everything_inside_and_outside_the_set():
    rng = np.random.default_rng(5)
    h = 1e-6
    for k in range(40):
        m = 6 + k % 5
        A, low, high = geometric_matrix(rng, m), np.full(m, T_MIN), np.full(m, T_MAX)
        w = A @ rng.uniform(T_MIN, T_MAX, m) * (3.0 if k % 4 == 0 else 1.0)
        wish = {"t_ref": rng.uniform(0, 30, m), "weights": 10.0 ** rng.uniform(-1, 1, m), "length": 0.7}

        def tensions(*data, wish=wish):
            return solve(TensionProblem(*data, **wish), "soft-wrench").tensions

        found = derivatives(TensionProblem(A, w, low, high, **wish), tensions(A, w, low, high))
        for i, field in enumerate(("A", "w", "t_min", "t_max")):
            ahead, behind = [A, w, low, high], [A, w, low, high]
            d = rng.normal(size=ahead[i].shape)
            ahead[i], behind[i] = ahead[i] + h * d, behind[i] - h * d
            change = (tensions(*ahead) - tensions(*behind)) / (2 * h)
            expected = getattr(found, field).reshape(m, -1) @ d.ravel()
            np.testing.assert_allclose(
                change, expected, rtol=0, atol=1e-4 * (1 + np.abs(expected).max()), err_msg=field
            )


def test_the_casadi_function_is_solve_with_a_derivative():
    rng = np.random.default_rng(6)
    problem = inner_problem(rng, 8)
    function = casadi_function(8)
    assert function.name_in() == ["A", "w", "t_min", "t_max"]
    data = problem.A, problem.w, problem.t_min, problem.t_max
    # solve may be the kernel by now, if other tests have loaded it.
    np.testing.assert_allclose(function(*data).full()[:, 0], solve(problem).tensions, rtol=0, atol=1e-9 * T_MAX)
    symbols = [ca.MX.sym(name, *np.atleast_2d(value.T).T.shape) for name, value in zip("Awlh", data, strict=True)]
    t = function(*symbols)
    jacobian = ca.Function("jacobian", symbols, [ca.jacobian(t, ca.vec(symbol)) for symbol in symbols])
    h = 1e-6
    for i, block in enumerate(jacobian(*data)):
        ahead, behind = list(data), list(data)
        d = rng.normal(size=data[i].shape)
        ahead[i], behind[i] = data[i] + h * d, data[i] - h * d
        change = (function(*ahead).full() - function(*behind).full())[:, 0] / (2 * h)
        np.testing.assert_allclose(block.full() @ d.ravel("F"), change, rtol=0, atol=1e-5 * (1 + np.abs(change).max()))
    assert np.isnan(function(problem.A, problem.w, 2, 1).full()).all()


def test_the_casadi_function_works_inside_a_nonlinear_program():
    """Compare with the same quadratic program, solved as such: the load, near a wished one, of the least effort."""
    rng = np.random.default_rng(7)
    problem = inner_problem(rng, 8)
    function = casadi_function(8)
    x = ca.MX.sym("x", 6)
    t = function(problem.A, problem.w + x, problem.t_min, problem.t_max)
    settings = {
        "ipopt.hessian_approximation": "limited-memory",
        "ipopt.print_level": 0,
        "print_time": 0,
        "ipopt.sb": "yes",
    }
    program = ca.nlpsol("program", "ipopt", {"x": x, "f": ca.sumsqr(t) + 10 * ca.sumsqr(x)}, settings)
    answer = program(x0=np.zeros(6))
    assert program.stats()["success"]
    expected = solve(problem, "soft-wrench", rho=10.0).tensions
    found = function(problem.A, problem.w + answer["x"].full()[:, 0], problem.t_min, problem.t_max).full()[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3)


def test_wrong_sizes_of_the_casadi_function_are_told():
    with pytest.raises(InputError, match=r"m must be a whole number .*, got 0"):
        casadi_function(0)
    with pytest.raises(InputError, match=r"weights must be .*, got shape \(3,\)"):
        casadi_function(8, weights=[1, 2, 3])
