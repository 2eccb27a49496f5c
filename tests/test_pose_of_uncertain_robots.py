"""Poses from lengths of a robot that is known with errors: their covariance against what happens."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from towline import InputError, Robot, load
from towline.estimation import pose_from_lengths
from towline.estimation.calibration import Measurements, calibrate
from towline.estimation.logs.encoders import lengths_of, readings_of
from towline.estimation.pose.from_log import poses_from_log
from towline.estimation.pose.residual_tests import length_errors, squares_of
from towline.models import Dynamics, Uncertainty, points
from towline.statics.robust import uncertainty_of

from .robots_as_built import as_built, random_poses
from .user_recordings import FRAME, PLATFORM, robot_file


def normalised(estimate, poses):
    """Squared errors of poses over their covariances, in the coordinates that move, (N,)."""
    free = estimate.robot.dof_mask > 0
    turned = points.rotations(estimate.pose[:, 3:]) @ np.swapaxes(points.rotations(poses[:, 3:]), 1, 2)
    errors = np.hstack([estimate.pose[:, :3] - poses[:, :3], Rotation.from_matrix(turned).as_rotvec()])[:, free]
    return np.einsum("ni,nij,nj->n", errors, np.linalg.inv(estimate.covariance[:, free][:, :, free]), errors)


def uncertain(name, sizes, seed=0):
    """A robot with encoders in other units, and correlated errors of all that a calibration determines."""
    data, draw = load(name).model_dump(mode="json"), np.random.default_rng(seed)
    for i, cable in enumerate(data["cables"]):
        cable["encoder"] = {"offset": 0.1 * i, "scale": -2e-3, "build_up": -1e-8}
    names = [f"cables[{i}].{word}" for i in range(len(data["cables"])) for word in sizes]
    mixed = np.eye(len(names)) + draw.normal(0, 0.5, (len(names), len(names)))
    factor = np.tile(list(sizes.values()), len(data["cables"]))[:, None] * mixed / np.sqrt(len(names))
    known = {"parameters": names, "covariance": (factor @ factor.T).tolist()}
    return Robot.model_validate(data | {"uncertainty": known})


@pytest.mark.parametrize("name", ["caroca-pulleys", "planar-4"])
def test_covariances_include_the_uncertainty_of_the_file(name):
    """Robots are drawn, and each has its own lengths at one pose; the file's encoders see them."""
    sizes = {"anchor.x": 3e-3, "attachment.x": 2e-3, "encoder.offset": 3e-3, "encoder.scale": 1e-6}
    sizes |= {"pulley.radius": 1e-3} if name == "caroca-pulleys" else {"encoder.build_up": 1e-10}
    robot, count, draw = uncertain(name, sizes), 150, np.random.default_rng(1)
    pose = random_poses(robot, 1, draw, (0.3, 0.3, 0.3, 0.1, 0.1, 0.1))[0]
    true = robot.drawn(count)
    lengths = np.array([Dynamics(one).cable_lengths(pose) for one in true])
    lengths += draw.normal(0, 1e-3, lengths.shape)
    readings = np.array([readings_of(one, row) for one, row in zip(true, lengths, strict=True)])
    found = pose_from_lengths(robot, lengths_of(robot, readings), pose)
    freedoms, squares = int(robot.dof_mask.sum()), normalised(found, np.tile(pose, (count, 1)))
    assert squares.mean() == pytest.approx(freedoms, abs=4 * np.sqrt(2 * freedoms / count))
    # The file's uncertainty explains all residuals, whose squares have the chi-square distribution of spare cables.
    spare = robot.m - freedoms
    assert found.cost.mean() == pytest.approx(spare, abs=4 * np.sqrt(2 * spare / count))
    assert (
        np.mean(~found.consistent)
        < 0.06
        < np.mean(np.sum((found.residuals / 1e-3) ** 2, axis=1) > chi2.ppf(0.99, spare))
    )
    assert np.mean(found.suspects() ** 2) == pytest.approx(1, abs=4 * np.sqrt(2 / count))
    wrong = lengths_of(robot, readings) + 0.05 * np.eye(robot.m)[0]
    assert np.mean(pose_from_lengths(robot, wrong, pose).consistent) < 0.2
    alone = pose_from_lengths(robot, lengths_of(robot, readings[0]), pose)  # by the function of streams
    np.testing.assert_allclose(alone.covariance, found.covariance[0], rtol=1e-3, atol=1e-12)
    assert alone.covariance[0, 0] > 2 * alone.covariance_of_noise[0, 0]


def test_ellipsoids_of_poses_after_a_calibration_contain_the_poses():
    """Anchors and offsets that a calibration confuses: without their covariance, half of the ellipsoids do not."""
    squares = []
    for seed in range(8):
        built = as_built(30, seed)
        draw = np.random.default_rng(100 + seed)
        seen = built.poses + draw.normal(0, 2e-3, built.poses.shape)
        given = Measurements(built.readings, seen, sigma={"lengths": 1e-3, "position": 2e-3, "rotation": 2e-3})
        robot = calibrate("cogiro", given).robot
        poses = random_poses(robot, 20, draw)
        readings = Dynamics(built.robot).cable_lengths(poses) - built.offsets + draw.normal(0, 1e-3, (20, 8))
        squares.append(normalised(pose_from_lengths(robot, lengths_of(robot, readings), poses), poses))
    inside = np.mean(np.array(squares) < chi2.ppf(0.95, 6))
    assert 0.9 <= inside <= 0.99


def test_encoders_are_no_geometry():
    """Tensions do not depend on them; a file that knows only these has no margins for robust plans."""
    robot = uncertain("planar-4", {"encoder.offset": 1e-3, "anchor.x": 1e-3})
    geometry = uncertainty_of(robot)
    assert geometry.parameters == tuple(f"cables[{i}].anchor.x" for i in range(4))
    np.testing.assert_array_equal(geometry.matrix, robot.uncertainty.matrix[1::2, 1::2])
    names = ["cables[1].encoder.scale"]
    assert robot.with_parameters({names[0]: 3.0}).parameter_values(names) == [3.0]
    only = robot.model_copy(update={"uncertainty": Uncertainty(parameters=names, covariance=[[1e-6]])})
    with pytest.raises(InputError, match=r"robust must be left out if the robot's file has no uncertainty"):
        uncertainty_of(only)
    with pytest.raises(InputError, match="must be of a cable with an encoder, got 'cables"):
        load("planar-4").parameter_values(names)


@pytest.mark.parametrize("name", ["multi-quadrotor-3", "wang-ctmrts"])
def test_the_uncertainty_moves_poses_at_rest(name):
    """Derivatives by the file's parameters agree with equilibria of slightly different robots."""
    sizes = {"anchor.x": 1e-3, "anchor.z": 1e-3, "attachment.x": 1e-3, "attachment.y": 1e-3, "encoder.offset": 1e-3}
    robot = uncertain(name, sizes)
    lengths = Dynamics(robot).cable_lengths(robot.home)
    found = pose_from_lengths(robot, lengths, robot.home)
    assert found.by_gravity
    names, readings, step = robot.uncertainty.parameters, readings_of(robot, lengths), 1e-6
    by_parameter = []
    for parameter, value in zip(names, robot.parameter_values(names), strict=True):
        ends = [robot.with_parameters({parameter: value + sign * step}) for sign in (1, -1)]
        one, two = (pose_from_lengths(each, lengths_of(each, readings), found.pose).pose for each in ends)
        turn = points.rotations(one[3:]) @ points.rotations(two[3:]).T
        by_parameter.append(np.hstack([one[:3] - two[:3], Rotation.from_matrix(turn).as_rotvec()]) / (2 * step))
    expected = np.transpose(by_parameter) @ robot.uncertainty.matrix @ by_parameter
    finite = np.isfinite(found.covariance)
    assert finite[:3, :3].all()
    np.testing.assert_allclose(
        (found.covariance - found.covariance_of_noise)[finite], expected[finite], atol=1e-3 * expected.max()
    )


@pytest.mark.parametrize("name", ["caroca-pulleys", "planar-4"])
def test_squared_residuals_are_the_least_of_all_poses(name):
    """Of linearised lengths, by least squares in the metric of all errors; other poses do not change them."""
    robot = uncertain(name, {"anchor.x": 3e-3, "anchor.z": 1e-4, "attachment.x": 5e-4, "encoder.offset": 1e-3})
    sigma, draw, free = np.linspace(1e-3, 4e-3, robot.m), np.random.default_rng(4), robot.dof_mask > 0
    pose, residuals = robot.home[None], 5e-3 * draw.normal(size=(1, robot.m))
    lengths = Dynamics(robot).cable_lengths(pose) - residuals
    L, J = length_errors(robot, pose, lengths, robot.carrier_home)
    root = np.linalg.inv(np.linalg.cholesky(np.diag(sigma**2) + L[0] @ robot.uncertainty.matrix @ L[0].T))
    least = np.linalg.lstsq(root @ J[0][:, free], root @ residuals[0], rcond=None)[1]
    found = squares_of(robot, pose, residuals, sigma, robot.carrier_home)
    np.testing.assert_allclose(found, least, rtol=1e-6)
    shifted = residuals + 1e-3 * J[0][:, free].sum(axis=1)
    np.testing.assert_allclose(squares_of(robot, pose, shifted, sigma, robot.carrier_home), least, rtol=1e-3)


def test_hanging_poses_of_a_log_include_the_uncertainty_of_the_file(tmp_path):
    """Four cables and an AHRS: the poses of a robot with another anchor differ as the covariance says."""
    robot, sigma = load(robot_file(tmp_path / "crane.yaml", FRAME, PLATFORM, [0, 0, 1, 0, 0, 0])), 1e-4
    level = np.array([[0.3, -0.2, 1.1, 0, 0, 0], [-0.5, 0.4, 0.8, 0, 0, 0]])
    rest = pose_from_lengths(robot, Dynamics(robot).cable_lengths(level), level).pose
    log = Measurements(Dynamics(robot).cable_lengths(rest), orientations=rest[:, 3:], sigma={"rotation": 0.01})
    name = "cables[1].anchor.x"
    one = Uncertainty(parameters=(name,), covariance=((sigma**2,),))
    there = poses_from_log(robot.model_copy(update={"uncertainty": one}), log).estimate
    other = poses_from_log(robot.with_parameters({name: robot.parameter_values([name])[0] + sigma}), log).estimate
    assert there.by_gravity.all()
    change = (other.pose - there.pose)[:, :3]
    assert np.linalg.norm(change, axis=1).min() > sigma / 5
    np.testing.assert_allclose(
        there.by_parameters[:, :3, :3], change[:, :, None] * change[:, None], rtol=0.02, atol=1e-11
    )
