"""Whatever is given to a public function of `towline.solvers`: an answer, or one line that names the argument."""

import numpy as np
import pytest

from towline.base.errors import InputError
from towline.solvers import (
    TensionProblem,
    capacity_margin,
    casadi_function,
    certify,
    limit_rate,
    methods,
    sensitivity,
    solve,
    solve_batch,
)

A = np.array([[1.0, 0.0, -1.0], [0.0, 1.0, -1.0]])
PROBLEM = TensionProblem(A, [1.0, 1.0], 0.0, 10.0)
SOLUTION = solve(PROBLEM)
BEYOND = solve(TensionProblem(A, [-99.0, 0.0], 0.0, 10.0))

THINGS = [
    *(None, "spam", "", b"x", 1j, True, -1, 0, 10**400, np.nan, np.inf, object(), {}, {"a": 1}, set(), range(3), float),
    *([], [[1, 2], [3]], [np.nan] * 3, [None, 1, 2], [10**400] * 3),
    *(np.zeros((0, 3)), np.ones((3, 3, 3)), np.ones(17), np.array([1 + 1j]), np.array([None]), np.array(["a"])),
    *(np.ones(3, dtype=bool), np.float16(1), np.longdouble(1), np.int8(3), np.ma.masked, np.datetime64("2020-01-01")),
    *(PROBLEM, SOLUTION, TensionProblem([[1.0]], [1.0], 0.0, 10.0)),
]

# Name of the call, the function, and arguments that are right.
CALLS = [
    ("TensionProblem", TensionProblem, {"A": A, "w": [1, 1], "t_min": 0, "t_max": 9}),
    ("TensionProblem", TensionProblem, {"A": A, "w": [1, 1], "t_min": 0, "t_max": 9, "t_ref": 1, "weights": 1}),
    ("TensionProblem", TensionProblem, {"A": A, "w": [1, 1], "t_min": 0, "t_max": 9, "length": 1}),
    ("tolerance", PROBLEM.tolerance, {"tensions": np.ones(3)}),
    ("solve", solve, {"problem": PROBLEM, "method": "active-set", "backend": None}),
    ("solve_batch", solve_batch, {"A": A, "w": [1, 1], "t_min": 0, "t_max": 9, "t_ref": 1, "weights": 1, "length": 1}),
    ("solve_batch", solve_batch, {"A": A, "w": [1, 1], "t_min": 0, "t_max": 9, "rho": 1, "backend": None}),
    ("certify", certify, {"problem": PROBLEM}),
    ("verify", BEYOND.certificate.verify, {"problem": PROBLEM}),
    ("capacity_margin", capacity_margin, {"problem": PROBLEM}),
    ("sensitivity", sensitivity, {"problem": PROBLEM, "solution": SOLUTION}),
    ("limit_rate", limit_rate, {"problem": PROBLEM, "previous": [1, 1, 1], "rate_max": 1}),
    ("casadi_function", casadi_function, {"m": 3, "n": 2, "t_ref": 1, "weights": 1, "length": 1, "name": "t"}),
    *(
        (f"solve {name}", lambda name=name, **options: solve(PROBLEM, name, **options), {option: None})
        for name, method in methods().items()
        for option in method.options or ()
    ),
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("name", "function", "right"), CALLS)
def test_anything_is_answered_or_message_in_one_line(name, function, right):
    refused = 0
    for argument in right:
        for thing in THINGS:
            try:
                function(**{**right, argument: thing})
            except InputError as error:
                refused += 1
                message = str(error)
                assert "\n" not in message
                assert len(message) < 400
                # An argument may be right but not go with another one, which is named then.
                assert message.split()[0] in right, message
                assert " must " in message
                assert ", got " in message
    assert refused >= 10


def test_numpys_numbers_are_numbers():
    assert solve(PROBLEM, "p-norm", p=np.float32(4)).feasible
    assert solve(PROBLEM, "dykstra", max_iter=np.int64(1000)).feasible
    assert solve(PROBLEM, "log-barrier", barrier=np.float16(0.5)).feasible


@pytest.mark.parametrize("m", [17, 24, 40])
def test_more_than_sixteen_cables_are_no_trouble(m):
    rng = np.random.default_rng(m)
    matrix = rng.normal(size=(6, m))
    problem = TensionProblem(matrix, matrix @ rng.uniform(2, 9, m), 1.0, 10.0)
    expected = solve(problem, "daqp").tensions
    for name in ("active-set", "qp", "min-norm", "2-norm", "dykstra", "soft-wrench"):
        np.testing.assert_allclose(solve(problem, name).tensions, expected, rtol=0, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(solve_batch(matrix, problem.w, 1.0, 10.0).tensions, expected, rtol=0, atol=1e-8)
    assert "centroid is costly" in solve(problem, "centroid").detail
