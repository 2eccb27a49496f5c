"""Calibration without poses: which valley the fit ends in."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from towline import load
from towline.estimation.calibration import Measurements, calibrate, read_measurements
from towline.estimation.pose.from_log import poses_from_log
from towline.models import Dynamics

from .framed import framed
from .robots_as_built import NOISE, moved_anchors

PRIOR = {"anchors": 0.01, "offsets": 0.05}


def shrunk(name, size):
    """A library robot with a platform of another size [m]."""
    robot = load(name)
    factor = size / np.ptp(robot.attachments, axis=0).max()
    cables = [
        cable.model_copy(update={"attachment": tuple((factor * np.array(cable.attachment)).tolist())})
        for cable in robot.cables
    ]
    return robot.model_copy(update={"cables": tuple(cables)})


def a_log(robot, seed, turn, offsets=PRIOR["offsets"], anchors=PRIOR["anchors"]):
    """Return the robot as built, its offsets, poses and readings."""
    draw = np.random.default_rng(seed)
    built = moved_anchors(robot, draw, anchors)
    room = 0.25 * np.ptp(robot.home_anchors, axis=0)
    poses = robot.home + draw.uniform(-1, 1, (120, 6)) * [*room, turn, turn, turn] * robot.dof_mask
    own = draw.normal(0, offsets, robot.m)
    readings = Dynamics(built).cable_lengths(poses) - own
    return built, own, poses, readings + draw.normal(0, NOISE, readings.shape)


def distance(result, built, offsets):
    """Return the squared distance from the truth, over what 99.9 % of true results have."""
    error = np.array([one.value for one in result.parameters]) - np.hstack([built.anchors, offsets[:, None]]).ravel()
    return error @ np.linalg.solve(result.covariance, error) / chi2.ppf(0.999, len(error))


def turned(found, poses):
    """Return the median angle [deg] between found and true orientations, after one turn of all."""
    apart = Rotation.from_euler("xyz", found[:, 3:]) * Rotation.from_euler("xyz", poses[:, 3:]).inv()
    return np.degrees(np.median((apart * apart.mean().inv()).magnitude()))


@pytest.mark.parametrize(
    ("name", "size", "turn"),
    [
        ("cogiro", 0.06, 0.4),
        ("cogiro", 1.0, 1.0),
        ("ipanema-2", 0.06, 0.4),
        ("caroca", 0.3, 0.4),
        ("planar-4", 0.06, 0.4),
    ],
)
def test_the_truth_is_inside_the_ellipsoid(name, size, turn):
    """A platform of 6 cm whose offsets are 5 cm off seems turned by a right angle at first."""
    robot = shrunk(name, size)
    for seed in range(4):
        built, offsets, poses, readings = a_log(robot, seed, turn)
        result = calibrate(robot, Measurements(readings), prior=PRIOR, outliers=False)
        assert result.converged
        assert distance(result, built, offsets) < 1
        assert turned(result.poses, poses) < 8


def test_lengths_do_not_tell_the_size_of_a_robot_from_a_scale_of_all_readings():
    """Readings of drums that are 2 % too small fit a robot that is smaller by 2 %: the report says so."""
    robot = load("planar-4")
    _, _, _, readings = a_log(robot, 0, 0.3, offsets=0.0, anchors=1e-3)
    said = str(calibrate(robot, Measurements(readings / 1.02), ("anchors",), outliers=False).report())
    assert "the anchors are 1.8 % closer together than in the file" in said
    assert "with --free anchors,scales --prior anchors=0.02,scales=0.02 they include errors of both" in said


def test_anchors_out_of_the_plane_are_errors_of_offsets():
    """They lengthen cables to second order only, here by several standard deviations of the offsets."""
    robot, prior = load("planar-4"), {"anchors": 0.03, "offsets": 0.05}
    for seed in range(8):
        built, offsets, _, readings = a_log(robot, seed, 0.3, anchors=prior["anchors"])
        assert distance(calibrate(robot, Measurements(readings), prior=prior), built, offsets) < 1


def test_readings_that_count_from_home():
    """Offsets of metres are no errors of the file: they are found without a prior."""
    robot = load("cogiro")
    for seed in range(3):
        built, offsets, poses, readings = a_log(robot, seed, 0.3)
        poses[0] = robot.home
        readings[0] = Dynamics(built).cable_lengths(robot.home) - offsets
        result = calibrate(robot, Measurements(readings - readings[0]), outliers=False)
        assert result.converged
        assert result.residual_after < NOISE
        assert turned(result.poses, poses) < 1


def test_orientations_alone_help(tmp_path):
    """An inertial sensor knows the orientation and no position: what is left open is less than without it."""
    robot = load("cogiro")
    _, _, poses, readings = a_log(robot, 0, 0.3)
    header = [*(f"l{i} [m]" for i in range(8)), "roll [rad]", "pitch [rad]", "yaw [rad]"]
    np.savetxt(
        tmp_path / "log.csv", np.hstack([readings, poses[:, 3:]]), delimiter=",", header=",".join(header), comments=""
    )
    log = read_measurements(tmp_path / "log.csv", {"lengths": NOISE, "rotation": 1e-3})
    assert np.isnan(log.poses[:, :3]).all()
    np.testing.assert_allclose(log.poses[:, 3:], poses[:, 3:], atol=1e-9)
    found, blind = (calibrate(robot, given, outliers=False) for given in (log, Measurements(readings)))
    assert found.converged
    assert len(found.not_identifiable) == 3 < 6 == len(blind.not_identifiable)
    assert turned(found.poses, poses) < 0.1
    same = Measurements(readings, orientations=poses[:, 3:], sigma={"lengths": NOISE, "rotation": 1e-3})
    np.testing.assert_array_equal(same.poses, log.poses)


@pytest.mark.parametrize(("name", "size", "seed"), [("cogiro", 1.0, 1), ("cogiro", 0.06, 4), ("caroca", 0.3, 4)])
def test_no_pose_of_a_platform_that_turns_far_is_left_in_another_valley(name, size, seed):
    """Attitudes up to 1 rad about each axis: no sample fits worse than noise does once in 100 000 samples."""
    robot = shrunk(name, size)
    built, offsets, _, readings = a_log(robot, seed, 1.0)
    result = calibrate(robot, Measurements(readings), prior=PRIOR, outliers=False)
    assert result.converged
    assert distance(result, built, offsets) < 1
    squares = ((result.residuals / NOISE) ** 2).sum(axis=1)
    assert squares.max() < chi2.ppf(1 - 1e-5, robot.m)


@pytest.mark.parametrize(("seed", "share"), [(3, 0.01), (7, 0.1)])
def test_wrong_readings_do_not_hide_in_poses_and_parameters(seed, share):
    """Four lengths of three coordinates tell which samples have a wrong reading, not which of the four it is."""
    robot = shrunk("planar-4", 0.06 if share < 0.1 else 0.3)
    built, offsets, _, readings = a_log(robot, seed, 0.4)
    draw = np.random.default_rng(seed)
    wrong = draw.random(readings.shape) < share
    readings = readings + wrong * draw.choice([-1, 1], wrong.shape) * draw.uniform(0.05, 0.3, wrong.shape)
    result = calibrate(robot, Measurements(readings), prior=PRIOR)
    found, true = {one.sample for one in result.outliers}, set(np.flatnonzero(wrong.any(axis=1)).tolist())
    assert found == true if share < 0.1 else len(found ^ true) <= 4  # a few errors hardly show
    assert distance(result, built, offsets) < 1


@pytest.mark.parametrize("seed", [3, 10])
def test_a_wrong_reading_that_could_be_of_any_cable_tells_nothing(seed):
    """With one redundant length, a wrong choice may leave six that fit no pose but seem to determine parameters."""
    robot = load("cogiro")
    robot = robot.model_copy(update={"cables": robot.cables[:7]})
    built, offsets, _, readings = (part[:60] if np.ndim(part) == 2 else part for part in a_log(robot, seed, 0.3))
    draw = np.random.default_rng(seed)
    wrong = (draw.random((120, 7)) < 0.01) * draw.choice([-1, 1], (120, 7)) * draw.uniform(0.05, 0.3, (120, 7))
    result = calibrate(robot, Measurements(readings + wrong[:60]), prior=PRIOR)
    assert distance(result, built, offsets) < 1
    assert "CANNOT TELL" not in str(result.report())
    wrong = (draw.random((60, 7)) < 0.1) * draw.choice([-1, 1], (60, 7)) * draw.uniform(0.05, 0.3, (60, 7))
    other = calibrate(robot, Measurements(readings + wrong), prior=PRIOR)
    assert "CANNOT TELL which readings are wrong" in str(other.report())
    lost = {one.sample for one in result.outliers if one.others}
    assert lost == set(np.flatnonzero(np.isnan(result.poses[:, 0])).tolist()) != set()


@pytest.mark.parametrize(("name", "seed"), [("cogiro", 15), ("planar-4", 1)])
def test_wrong_readings_are_no_slip(name, seed):
    """Before they are left out, wrong readings near an end of the record look like a slip there."""
    robot = load(name)
    _, _, poses, readings = a_log(robot, seed, 0.3)
    draw, shape = np.random.default_rng([seed, 1]), readings.shape
    wrong = (draw.random(shape) < 0.03) * draw.choice([-1, 1], shape) * draw.uniform(0.01, 0.3, shape)
    poses = poses + draw.normal(0, 1e-3, poses.shape) * robot.dof_mask
    sigma = {"lengths": NOISE, "position": 1e-3, "rotation": 1e-3}
    result = calibrate(robot, Measurements((readings + wrong)[:60], poses[:60], sigma=sigma), prior=PRIOR)
    assert result.outliers
    assert not result.slips


def test_the_winch_that_slipped_is_named():
    """A slip moves the unknown poses, so that the residuals of another cable may show it more clearly."""
    robot = load("caroca")
    for seed, (cable, sample, size) in enumerate([(6, 81, 0.034), (1, 40, -0.05)]):
        _, _, _, readings = a_log(robot, seed, 0.2)
        readings[sample:, cable] -= size
        (found,) = calibrate(robot, Measurements(readings), prior=PRIOR).slips
        assert (found.cable, found.sample) == (cable, sample)
        assert found.size == pytest.approx(size, abs=2e-3)


@pytest.mark.parametrize("turn", [0.0, 0.05])
def test_noise_of_unmeasured_pitch_tells_nothing_of_anchors(turn):
    """A planar platform that does not turn leaves open how its attachments are turned, whatever its pitch seems to be.

    Errors would be four times as large as their standard deviations, and larger than those of the file.
    """
    robot = shrunk("planar-4", 0.12)
    squares, errors, t = [], [], 0.1 * np.arange(150)
    for seed in range(5):
        draw = np.random.default_rng(seed)
        built, room = moved_anchors(robot, draw, 0.01), np.ptp(robot.home_anchors, axis=0)
        swing = np.column_stack([0.3 * np.sin(1.1 * t), 0 * t, 0.3 * np.sin(1.37 * t + 0.4)])
        poses = robot.home + np.zeros((len(t), 6))
        poses[:, :3] += swing * room
        poses[:, 4] += turn * np.sin(0.9 * t)
        readings = Dynamics(built).cable_lengths(poses) + draw.normal(0, NOISE, (len(t), 4))
        result = calibrate(robot, Measurements(readings, poses[:, :3]), outliers=False)
        assert result.converged
        known = [one for one in result.parameters if not one.name.endswith("anchor.y")]
        true = np.hstack([built.anchors[:, [0, 2]], np.zeros((4, 1))]).ravel()
        error = np.array([one.value for one in known]) - true
        squares.append(np.mean((error / [one.sigma for one in known]) ** 2))
        errors.append(error)
        assert np.isfinite([one.sigma for one in known]).all() == (turn > 0)
    assert np.mean(squares) < 1.5
    assert np.sqrt(np.mean(np.square(errors))) < 0.006


def under_six_cables():
    """A robot whose cables all come from above."""
    angles = np.radians([[80, 100, 200, 220, 320, 340], [40, 140, 160, 260, 280, 20]])
    anchors, attachments = (
        radius * np.column_stack([np.cos(around), np.sin(around), np.full(6, height)])
        for around, radius, height in zip(angles, (3.0, 0.6), (1.2, 0.1), strict=True)
    )
    body = {"mass": 20.0, "inertia": [2, 2, 3, 0, 0, 0], "home": [0, 0, 1.7, 0, 0, 0]}
    return framed(zip(anchors, attachments, strict=True), body)


def seen_by_ahrs(robot, seed, built=None):
    """Positions, readings with offsets of 20 mm, and orientations within 0.5 degrees, at 27 poses."""
    draw, built = np.random.default_rng(seed), robot if built is None else built
    poses = robot.home + draw.uniform(-1, 1, (27, 6)) * [1.3, 1.1, 0.6, 0.12, 0.12, 0.12]
    own = draw.normal(0, 0.02, 6)
    readings = Dynamics(built).cable_lengths(poses) - own + draw.normal(0, NOISE, (27, 6))
    turned = Rotation.from_euler("xyz", poses[:, 3:]) * Rotation.from_rotvec(draw.normal(0, np.radians(0.5), (27, 3)))
    sigma = {"lengths": NOISE, "rotation": np.radians(0.5)}
    return poses, own, Measurements(readings, orientations=turned.as_euler("xyz"), sigma=sigma)


def test_offsets_that_an_ahrs_hardly_shows_stay_near_the_file():
    """Six cables and orientations within 0.5 degrees: errors of the file are better known than most offsets."""
    robot = under_six_cables()
    before, after, surprises = [], [], []
    for seed in range(2):
        _, own, log = seen_by_ahrs(robot, seed)
        result = calibrate(robot, log, ["offsets"])
        error = np.array([one.value for one in result.parameters]) - own
        before.append((own**2).mean())
        after.append((error**2).mean())
        surprises.append(error @ np.linalg.solve(result.covariance, error) / 6)
    assert np.mean(after) < np.mean(before)
    assert np.mean(surprises) < 2.5


def test_offsets_that_an_ahrs_does_not_show_are_not_written():
    """Anchors wrong by 10 mm, too: poses may become worse than with the file, unless its errors are stated."""
    robot = under_six_cables()
    poses, _, log = seen_by_ahrs(robot, 0, moved_anchors(robot, np.random.default_rng(0), 0.01))
    alone, stated = calibrate(robot, log), calibrate(robot, log, prior={"offsets": 0.02, "anchors": 0.01})
    assert "offsets are in the file: give priors" in alone.refused
    assert stated.refused is None
    by_file = poses_from_log(robot, log).estimate.pose
    assert np.less(*(((found - poses)[:, :3] ** 2).sum() for found in (stated.poses, by_file)))
