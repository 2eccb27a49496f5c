"""One pose as a tension problem, and the samples at which a robot can rest."""

import numpy as np
import pytest

from towline.models import Dynamics, load
from towline.models.part import Box
from towline.solvers import solve
from towline.statics.distribution import pose_problem
from towline.workspace import StaticEquilibrium, sample
from towline.workspace.resting_box import resting_box

from .framed import framed


def test_a_suspended_robot_rests_inside_its_anchors():
    """No cable can push: a platform that hangs from a ring rests only where its CoM is under the ring."""
    box = resting_box(load("wang-flying"))
    assert 5 < len(box.resting) < box.samples
    assert np.linalg.norm(box.resting[:, :2], axis=1).max() < 0.52
    assert (box.resting[:, 2] < -0.07).all()


def test_a_point_mass_balances_forces_only():
    """Three cables hold a point mass, although they cannot hold a body: the moment rows do not count."""
    ends = [([np.cos(a), np.sin(a), 0], [0, 0, 0]) for a in (0, 2, 4)]
    robot = framed(ends, {"mass": 1, "dof": ["x", "y", "z"], "home": [0, 0, -1, 0, 0, 0]}, t_max=100)
    solution = solve(pose_problem(Dynamics(robot), [0, 0, -1, 0, 0, 0]))
    assert solution.feasible
    directions = np.array([[np.cos(a), np.sin(a), 1] for a in (0, 2, 4)]).T / np.sqrt(2)
    np.testing.assert_allclose(solution.tensions, np.linalg.solve(directions, [0, 0, 9.81]), rtol=1e-9)


def test_a_planar_robot_ignores_what_its_guide_takes():
    platform = {"mass": 2, "inertia": [1, 1, 1, 0, 0, 0], "dof": ["x", "z", "pitch"], "home": [0, 0, 0, 0, 0, 0]}
    ends = [([x, 0, z], [0.1 * x, 0, 0.1 * -z]) for x in (-1, 1) for z in (-1, 1)]
    robot = framed(ends, platform, t_min=1, t_max=500)
    dynamics = Dynamics(robot)
    pose, acceleration = np.array([0.1, 0, 0.2, 0, 0.1, 0]), np.array([1.0, 5.0, 0.5, 3.0, 0.3, 4.0])
    problem = pose_problem(dynamics, pose, acceleration=acceleration)
    np.testing.assert_array_equal(problem.w[[1, 3, 5]], 0)
    solution = solve(problem)
    assert solution.feasible
    found = dynamics.acceleration(pose, np.zeros(6), solution.tensions)
    np.testing.assert_allclose(found, acceleration * robot.dof_mask, atol=1e-9)


@pytest.mark.parametrize("name", ["wang-flying", "ipanema-1"])
def test_moving_faster_needs_more(name):
    robot = load(name)
    dynamics = Dynamics(robot)
    still = solve(pose_problem(dynamics, robot.home))
    up = solve(pose_problem(dynamics, robot.home, acceleration=[0, 0, 2, 0, 0, 0]))
    assert up.cost > still.cost


def test_the_default_region_is_above_the_floor_and_in_the_room():
    """Below the floor the cables could hold the platform too; no point of it may be there."""
    free = load("ipanema-2")  # attachments and CoM at home's attitude: offsets from the platform's origin
    lowest = np.vstack([free.attachments, free.platform.com]).min(axis=0)
    highest = np.vstack([free.attachments, free.platform.com]).max(axis=0)
    room = {"min": [-1, -9, -9], "max": [2, 9, 3.5]}
    robot = free.model_copy(update={"floor": 1.5, "workspace_box": Box(**room)})
    every = {name: sample(r, StaticEquilibrium(), samples=400) for name, r in {"free": free, "bounded": robot}.items()}
    assert every["free"]["position"].values[:, 2].min() < 1.5 - lowest[2]
    position = every["bounded"]["position"].values
    assert len(position) > 100
    assert (position + lowest >= [-1, -9, 1.5]).all()
    assert (position + highest <= [2, 9, 3.5]).all()
    low, high = position.min(axis=0), position.max(axis=0)
    np.testing.assert_allclose(low[[0, 2]] + lowest[[0, 2]], [-1, 1.5], atol=0.1)  # nothing more is left out
    np.testing.assert_allclose(high[[0, 2]] + highest[[0, 2]], [2, 3.5], atol=0.1)


def test_the_default_region_of_a_crane_goes_down_to_its_floor():
    """Its home and anchors alone are a box that ends 4 m above the floor."""
    ends = [([x, 0, 12], [x, 0, 0.5]) for x in (-0.5, 0.5)]
    robot = framed(ends, {"mass": 500, "dof": ["z"], "home": [0, 0, 5, 0, 0, 0]}, t_max=6000)
    height = sample(robot.model_copy(update={"floor": 1.0}), StaticEquilibrium(), samples=500)["position"].values[:, 2]
    np.testing.assert_allclose([height.min(), height.max()], [1, 11.5], atol=0.3)


def test_the_default_region_of_a_long_robot_is_no_wider_than_its_platform_can_be():
    """Farther beyond the anchors than an attachment is from the platform's origin, all cables pull back."""
    ends = [([12 * x, y, 3], [-0.2 * x, 0.3 * y, 0.4 * z]) for x in (-1, 1) for y in (-1, 1) for z in (0, 1)]
    platform = {"mass": 5, "inertia": [1, 1, 1, 0, 0, 0], "home": [0, 0, 0, 0, 0, 0]}
    robot = framed(ends, platform, t_max=500)
    width = 1 + np.linalg.norm([0.2, 0.3, 0.4])
    wide = {"position": {"min": [-14, -6, -9], "max": [14, 6, 9]}, "attitude": {"min": [-1, -1, -1], "max": [1, 1, 1]}}
    everywhere = sample(robot, StaticEquilibrium(), wide)
    assert everywhere.attrs["accepted"] > 500
    assert np.abs(everywhere["position"].values[:, 1]).max() < width
    tried = sample(robot, StaticEquilibrium(), samples=100, keep="all")["position"].values
    assert 0.9 * width < np.abs(tried[:, 1]).max() <= width
    assert tried[:, 2].min() < -4  # along gravity there is space as before
