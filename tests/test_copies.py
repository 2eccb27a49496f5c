"""Copies and pickles of what users hold compute what the originals compute."""

import copy
import pickle

import numpy as np
import pytest

from towline import load
from towline.control import ComputedTorque, Predictive, Reference, State
from towline.solvers.in_place import InPlace

COPIES = {"pickle": lambda value: pickle.loads(pickle.dumps(value)), "deepcopy": copy.deepcopy}
ROBOTS = ["wang-flying", "ipanema-1", "wang-ctmrts", "multi-quadrotor-3", "point-mass-3"]


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("steps", [0, 2])
def test_a_copy_of_a_controller_commands_the_same(name, kind, how, steps):
    """A new controller that was pickled commanded no tensions: parts of its arrays had become arrays of their own."""
    robot = load(name)
    count, draw = len(robot.carriers), np.random.default_rng(3)
    none = np.zeros((count, 6))
    reference = Reference(robot.home, *np.zeros((2, 6)), robot.carrier_home, none, none)

    def state():
        pose = robot.home + draw.normal(0, 1e-3, 6) * robot.dof_mask
        return State(pose, draw.normal(0, 1e-3, 6) * robot.dof_mask, robot.carrier_home, none)

    controller = kind(robot)
    for time in range(steps):
        controller.step(0.001 * time, state(), reference)
    other = COPIES[how](controller)
    for time in (0.002, 0.003, 0.004):
        measured = state()
        expected, given = controller.step(time, measured, reference), other.step(time, measured, reference)
        for one, two in zip(expected, given, strict=True):
            if one is not None:
                np.testing.assert_array_equal(one, two)
        assert given.tensions.any()


@pytest.mark.parametrize("how", COPIES)
def test_a_copy_of_problems_in_place_is_solved_apart(how):
    problems = InPlace(2, 6, 8, 1.0)
    problems.A[:], problems.w[:] = np.eye(6, 8), 5.0
    problems.bounds[0], problems.bounds[1] = 1.0, 9.0
    other = COPIES[how](problems)
    other.bounds[1] = 4.0
    assert problems.solve()
    assert not other.solve()
    np.testing.assert_allclose(problems.tensions[:, :6], 5.0, atol=1e-9)
    np.testing.assert_allclose(other.tensions[:, :6], 4.0, atol=1e-6)
