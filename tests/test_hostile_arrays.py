"""Arrays that NumPy accepts and mechanics does not: too many dimensions, too large, read-only, of longer floats."""

import warnings

import numpy as np
import pytest

from towline import Dynamics, InputError, load, solve_batch
from towline.estimation import branches, pose_from_lengths
from towline.solvers import Horizon

ROBOT = load("wang-flying")
LENGTHS = Dynamics(ROBOT).cable_lengths(ROBOT.home)
DEEP = (1,) * 60


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Dynamics(ROBOT).wrench_matrix(np.zeros((*DEEP, 6))), "pose must have at most 32 leading dimensions"),
        (lambda: solve_batch(np.eye(6, 7), np.ones((*DEEP, 6)), 0, 9), "w must have at most 32 leading dimensions"),
        (lambda: pose_from_lengths(ROBOT, np.ones((*DEEP, 6))), "lengths must have at most 32 leading dimensions"),
        (
            lambda: Dynamics(ROBOT).natural_frequencies(np.full(6, 1e308), np.ones(6)),
            r"pose must be numbers up to 1e\+09, got 1e\+308",
        ),
        (
            lambda: Dynamics(ROBOT).natural_frequencies(ROBOT.home, np.ones(6), np.zeros((1, 1, 6))),
            r"carrier_pose must have the shape \(1, 6\), got \(1, 1, 6\)",
        ),
        (
            lambda: pose_from_lengths(ROBOT, LENGTHS, carrier_pose=np.full((1, 6), 1e308)),
            r"carrier_pose must be numbers up to 1e\+09 \[m, rad\], got 1e\+308",
        ),
        (lambda: pose_from_lengths(ROBOT, LENGTHS, sigma=1e-200).suspects(), "sigma must be numbers > 0 .* got 1e-200"),
        (lambda: branches(ROBOT, LENGTHS, sigma=1e-320), "sigma must be numbers > 0 .*, got "),
        (lambda: Dynamics(ROBOT).wrench_matrix(np.full(6, np.longdouble("1e4000"))), "pose must be finite numbers"),
        (lambda: pose_from_lengths(ROBOT, np.full(6, np.longdouble("1e4000"))), "lengths must be finite numbers"),
    ],
)
def test_they_are_refused_in_one_line(call, message):
    """These were errors of NumPy and LAPACK, or warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError, match=message):
            call()


def test_limits_of_longer_floats_are_infinite():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        answer = solve_batch(np.eye(2), np.ones(2), 0.0, np.full(2, np.longdouble("1e4000")))
    np.testing.assert_array_equal(answer.tensions, [1.0, 1.0])


def test_a_horizon_takes_references_that_cannot_be_written_to():
    horizon, plain = Horizon(2, 3, 1), Horizon(2, 3, 1)
    states, controls = np.arange(9.0).reshape(3, 3), np.arange(2.0).reshape(2, 1)
    plain.relative_to(states, controls)
    for array in (states, controls):
        array.flags.writeable = False
    horizon.relative_to(states, np.broadcast_to(controls, (2, 1)))
    np.testing.assert_array_equal(horizon.c, plain.c)
    with pytest.raises(InputError, match=r"states must have shape \(3, 3\), got \(1000000000, 3\)"):
        horizon.relative_to(np.broadcast_to(0.0, (10**9, 3)), controls)
