"""A robot does not notice where in {G} it stands: all its scales are its own."""

import numpy as np
import pytest

from towline import Dynamics, Robot, load, tensions
from towline.control import Predictive
from towline.estimation.calibration import next_poses
from towline.estimation.calibration.geometry import length_of
from towline.models import points
from towline.models.diagnosis import diagnose
from towline.solvers import capacity_margin
from towline.statics.distribution import pose_problem

AWAY = np.array([120.0, -40.0, 65.0])


def moved(robot):
    """Return the robot with anchors and home elsewhere in {G}."""
    data = robot.model_dump(mode="json")
    for cable in data["cables"]:
        cable["anchor"] = (np.array(cable["anchor"]) + AWAY).tolist()
    if data["platform"]["home"] is not None:
        data["platform"]["home"] = [*(robot.home[:3] + AWAY), *robot.home[3:]]
    return Robot.model_validate(data)


@pytest.mark.parametrize("name", ["cogiro", "ipanema-1", "caroca-pulleys", "example-spatial", "planar-4"])
def test_a_ground_robot_elsewhere_is_the_same_robot(name):
    here, there = load(name), moved(load(name))
    assert there.length == here.length
    np.testing.assert_allclose(there.home - here.home, [*AWAY, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(there.wrench_scale, here.wrench_scale)
    pose = here.home + 0.1 * here.length * here.dof_mask
    elsewhere = pose + np.r_[AWAY, 0, 0, 0]
    A, B = Dynamics(here).wrench_matrix(pose), Dynamics(there).wrench_matrix(elsewhere)
    np.testing.assert_allclose(B, A, atol=1e-10)
    one, other = (tensions(robot, at) for robot, at in ((here, pose), (there, elsewhere)))
    assert one.status == other.status
    if one.feasible:
        np.testing.assert_allclose(other.tensions, one.tensions, rtol=1e-7)
    margins = [
        capacity_margin(pose_problem(Dynamics(robot), at)).value for robot, at in ((here, pose), (there, elsewhere))
    ]
    assert margins[0] == pytest.approx(margins[1], rel=1e-6)
    reports = [diagnose(robot) for robot in (here, there)]
    np.testing.assert_allclose(reports[0].singular_values, reports[1].singular_values, rtol=1e-8)


def test_default_homes_move_with_the_anchors():
    robot = load("cogiro")
    level = points.default_home(robot.anchors, robot.attachments)
    np.testing.assert_allclose(points.default_home(robot.anchors + AWAY, robot.attachments) - level, [*AWAY, 0, 0, 0])


def test_a_calibration_has_the_scale_of_the_cables():
    here, there = load("cogiro"), moved(load("cogiro"))
    assert length_of(here) == pytest.approx(Dynamics(here).cable_lengths(here.home).mean())
    assert length_of(there) == pytest.approx(length_of(here))


@pytest.mark.parametrize("name", ["cogiro", "planar-4"])
def test_the_poses_to_measure_next_move_with_the_robot(name):
    here, there = load(name), moved(load(name))
    poses = next_poses(here, count=4)
    np.testing.assert_allclose(next_poses(there, count=4) - poses, np.tile([*AWAY, 0, 0, 0], (4, 1)), atol=1e-9)
    assert np.ptp(poses[:, :3], axis=0).max() > 0.5 * length_of(here), "they are all over the robot's workspace"
    assert 0.2 < np.abs(poses[:, 3:]).max() <= 0.3


def test_quadrotors_elsewhere_react_as_far():
    here = load("multi-quadrotor-3")
    data = here.model_dump(mode="json")
    for part in (data["platform"], *data["carriers"]):
        part["home"] = [*(np.array(part["home"][:3]) + AWAY), *part["home"][3:]]
    one, other = (Predictive(robot)._weights for robot in (here, Robot.model_validate(data)))
    np.testing.assert_allclose(other.states, one.states, rtol=1e-6)
    np.testing.assert_allclose(other.controls, one.controls, rtol=1e-6)
