"""Calibration by the balance of forces, against platforms at rest and in motion that plain NumPy computes."""

import json
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from towline.base.errors import InputError
from towline.estimation.calibration import Measurements, calibrate, outliers, representative as module, solving, stretch
from towline.estimation.calibration.autocorrelation import information_of
from towline.estimation.calibration.balance import Balance, FeltTensions
from towline.estimation.calibration.cross_validation import compare
from towline.estimation.calibration.fit import fit
from towline.estimation.calibration.hanging import carrying
from towline.estimation.calibration.model import Model
from towline.estimation.calibration.motion import motion_of
from towline.estimation.calibration.normal_equations import NormalEquations
from towline.estimation.calibration.parameters import COMMON, FRAMES, GROUPS, OF_CABLE, Parameters
from towline.estimation.calibration.representative import representative
from towline.estimation.calibration.solving import model_of, solve
from towline.estimation.calibration.stretch import with_elasticity, with_stretch
from towline.estimation.logs.load_cells import slack
from towline.estimation.pose.from_log import poses_from_log
from towline.models import Dynamics, Robot, load
from towline.models.files import as_robot

from .framed import framed
from .warm import towline as run

CORNERS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
ANCHORS = np.column_stack([CORNERS * [2.9, 2.5], [4.0, 4.1, 3.9, 4.0]])
ATTACHMENTS = np.column_stack([CORNERS * [0.28, 0.25], np.full(4, 0.05)])
COM, MASS, GRAVITY = np.array([0.02, -0.01, -0.06]), 12.0, np.array([0, 0, -9.81])
AHRS = np.radians(0.5)


def robot_file(anchors, attachments, com, mass, home, dof=("x", "y", "z", "roll", "pitch", "yaw"), stiffness=None):
    body = {"mass": mass, "com": list(com), "inertia": [0.1, 0.1, 0.1, 0, 0, 0], "home": home, "dof": list(dof)}
    return framed(zip(anchors, attachments, strict=True), body, stiffness=stiffness)


def lines(pose, anchors=ANCHORS, attachments=ATTACHMENTS):
    """Unit vectors to the anchors, (m, 3), arms of the attachments, (m, 3), and lengths, (m,)."""
    arms = attachments @ Rotation.from_euler("xyz", pose[3:]).as_matrix().T
    along = anchors - pose[:3] - arms
    lengths = np.linalg.norm(along, axis=1)
    return along / lengths[:, None], arms, lengths


def at_rest(position, taut=(1, 1, 1, 1)):
    """A pose in which four cables, or those that are taut, hold the platform at a position, and their tensions."""

    def out_of_balance(z):
        u, arms, _ = lines(np.concatenate([position, z[:3]]))
        com = Rotation.from_euler("xyz", z[:3]).as_matrix() @ COM
        pulls = (taut * z[3:])[:, None] * MASS * 9.81 * u
        moments = np.cross(arms, pulls).sum(axis=0) + np.cross(com, MASS * GRAVITY)
        return np.concatenate([pulls.sum(axis=0) + MASS * GRAVITY, moments])

    z, step = np.array([0, 0, 0, *np.full(4, 0.3)]), 1e-6 * np.eye(7)
    for _ in range(8):  # Gauss and Newton's, with the shortest of all steps
        now = out_of_balance(z)
        slope = np.stack([out_of_balance(z + each) - now for each in step], axis=1) / 1e-6
        z = z - np.linalg.pinv(slope) @ now
    assert np.abs(out_of_balance(z)).max() < 1e-5
    assert z[3:].min() > 0
    return np.concatenate([position, z[:3]]), taut * z[3:] * MASS * 9.81


@cache
def rests(seed):
    """27 poses at rest, readings, orientations and tensions of four cables, and the offsets of the readings."""
    draw = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], [0.8, 1.4, 2.0], indexing="ij"), axis=-1).reshape(-1, 3)
    both = [at_rest(place + draw.normal(0, 0.05, 3)) for place in grid]
    poses, tensions = (np.array(part) for part in zip(*both, strict=True))
    offsets = draw.normal(0, 0.3, 4)
    readings = np.array([lines(pose)[2] for pose in poses]) - offsets + draw.normal(0, 1e-3, (27, 4))
    errors = Rotation.from_rotvec(draw.normal(0, AHRS, (27, 3)))
    angles = (errors * Rotation.from_euler("xyz", poses[:, 3:])).as_euler("xyz")
    return poses, readings, angles, tensions * (1 + draw.normal(0, 0.02, tensions.shape)), offsets


def drawn(com=COM):
    return robot_file(ANCHORS, ATTACHMENTS, com, MASS, [0, 0, 1.4, 0, 0, 0])


def test_four_cables_calibrate_without_a_camera():
    """Lengths up to offsets, an inertial sensor and tensions: poses to 10 mm, and a CoM 30 mm off to 3 mm."""
    ratios, errors, wrong_com = [], [], COM + 0.03 * np.array([0.6, -0.64, 0.48])
    names = [f"cables[{i}].{end}.{axis}" for i in range(4) for end in ("anchor", "attachment") for axis in "xyz"]
    exact = {"parameters": names, "covariance": (1e-12 * np.eye(24)).tolist()}  # as the ends of its cables are
    file = Robot.model_validate(drawn(wrong_com).model_dump() | {"uncertainty": exact})
    for seed in range(2):
        poses, readings, angles, tensions, offsets = rests(seed)
        sigma = {"lengths": 1e-3, "rotation": AHRS, "tensions": 0.02}
        log = Measurements(readings, orientations=angles, tensions=tensions, sigma=sigma)
        result = calibrate(file, log)
        assert result.free == ("offsets", "com")
        assert result.converged
        assert not result.not_identifiable
        assert np.sqrt(((result.poses - poses)[:, :3] ** 2).sum(axis=1).mean()) < 0.01
        found = np.array([one.value for one in result.parameters])
        errors.append(np.abs(found[4:] - COM).max())
        np.testing.assert_array_equal(result.robot.platform.com, found[4:])
        error = found - np.concatenate([offsets, COM])
        ratios.append(error @ np.linalg.solve(result.covariance, error))
    assert np.median(errors) < 0.003
    assert chi2.ppf(1e-3, 14) < sum(ratios) < chi2.ppf(1 - 1e-3, 14)


def test_a_sensor_mounted_askew_is_no_wrong_com():
    """By 3 degrees. Without its mount, the CoM and the offsets would be many standard deviations off."""
    poses, readings, angles, tensions, offsets = rests(0)
    mount = Rotation.from_rotvec([0.03, -0.04, 0.02])
    angles = (Rotation.from_euler("xyz", angles) * mount).as_euler("xyz")
    sigma = {"lengths": 1e-3, "rotation": AHRS, "tensions": 0.02}
    result = calibrate(drawn(), Measurements(readings, orientations=angles, tensions=tensions, sigma=sigma))
    assert set(result.free) == {"offsets", "com", "body"}
    names = [one.name for one in result.parameters]
    at = [names.index(f"{name}.{axis}") for name in ("body.turn", "com") for axis in "xyz"]
    at = [names.index(f"cables[{i}].offset") for i in range(4)] + at
    error = np.array([result.parameters[k].value for k in at]) - [*offsets, *mount.inv().as_rotvec(), *COM]
    assert error @ np.linalg.solve(result.covariance[np.ix_(at, at)], error) < chi2.ppf(1 - 1e-3, len(at))
    assert np.sqrt(((result.poses - poses)[:, :3] ** 2).sum(axis=1).mean()) < 0.02
    assert max(result.parameters[k].sigma for k in at[4:]) < 0.015  # [m, rad]
    assert "mounted askew" in result.report()


def test_residuals_show_how_wrong_the_anchors_of_a_file_are():
    """Of anchors 30 mm off, six times as far as files usually are, offsets and CoM are as far off as stated."""
    ratios = []
    for seed in range(2):
        _, readings, angles, tensions, offsets = rests(seed)
        anchors = ANCHORS + np.random.default_rng(seed).normal(0, 0.03, (4, 3))
        file = robot_file(anchors, ATTACHMENTS, COM, MASS, [0, 0, 1.4, 0, 0, 0])
        sigma = {"lengths": 1e-3, "rotation": AHRS, "tensions": 0.02}
        result = calibrate(file, Measurements(readings, orientations=angles, tensions=tensions, sigma=sigma))
        at = [f"cables[{i}].offset" for i in range(4)] + [f"com.{axis}" for axis in "xyz"]
        names = [one.name for one in result.parameters]
        own = [names.index(name) for name in at]
        error = np.array([result.parameters[k].value for k in own]) - [*offsets, *COM]
        ratios.append(error @ np.linalg.solve(result.covariance[np.ix_(own, own)], error))
        assert "(as residuals show)" in result.report()
    assert chi2.ppf(1e-3, 14) < sum(ratios) < chi2.ppf(1 - 1e-3, 14)


def test_errors_of_attachments_displace_anchors_that_forces_show():
    """Attachments 4 mm off, as in usual files: without them anchors, offsets and CoM were off by eight sigmas."""
    squares = []
    for seed in range(3):
        _, readings, angles, tensions, offsets = rests(seed)
        draw = np.random.default_rng(7 + seed)
        file = robot_file(ANCHORS, ATTACHMENTS + draw.normal(0, 4e-3, (4, 3)), COM, MASS, [0, 0, 1.4, 0, 0, 0])
        sigma = {"lengths": 1e-3, "rotation": AHRS, "tensions": 0.02}
        log = Measurements(readings, orientations=angles, tensions=tensions, sigma=sigma)
        result = calibrate(file, log, ("anchors", "offsets", "com"))
        truth = np.concatenate([np.hstack([ANCHORS, offsets[:, None]]).ravel(), COM])
        error = np.array([one.value for one in result.parameters]) - truth
        values, vectors = np.linalg.eigh(result.covariance)
        known = values > 1e-10 * values[-1]  # not the position of all, for example
        assert known.sum() == 16
        squares.append((error @ vectors[:, known]) ** 2 @ (1 / values[known]))
    assert chi2.ppf(1e-3, 48) < sum(squares) < chi2.ppf(1 - 1e-3, 48)


def hung(lengths):
    """The pose in which cables of some lengths (4,) hold the platform, taut or slack: that of the lowest CoM."""
    start, steps = np.array([0, 0, 0.5, 0, 0, 0]), 1e-7 * np.eye(7)[:, 1:]

    def slack_and_height(pose):  # and their derivatives by the pose, (4, 6) and (6,)
        poses = pose + steps
        turned = Rotation.from_euler("xyz", poses[:, 3:]).as_matrix()
        ends = poses[:, None, :3] + ATTACHMENTS @ turned.swapaxes(1, 2)
        room, height = lengths - np.linalg.norm(ANCHORS - ends, axis=2), poses[:, 2] + (turned @ COM)[:, 2]
        return room[0], (room[1:] - room[0]).T / 1e-7, height[0], (height[1:] - height[0]) / 1e-7

    taut = {"type": "ineq", "fun": lambda at: slack_and_height(at)[0], "jac": lambda at: slack_and_height(at)[1]}
    height = {"fun": lambda at: slack_and_height(at)[2:], "jac": True}
    found = minimize(x0=start, method="SLSQP", constraints=taut, options={"ftol": 1e-10}, **height)
    assert found.success
    return found.x


def test_slack_cables_are_no_stretch_of_the_others():
    """Some of four cables are longer than the way to the platform, so the readings of the taut ones look too short."""
    draw = np.random.default_rng(5)
    places = np.column_stack([draw.uniform(-1.8, 1.8, (27, 2)), draw.uniform(0.8, 2, 27), np.zeros((27, 3))])
    readings = np.array([lines(place)[2] for place in places])
    poses = np.array([hung(row) for row in readings])
    loose = readings - [lines(pose)[2] for pose in poses] > 2e-3
    assert 10 < loose.sum() < 30
    offsets = draw.normal(0, 0.05, 4)
    angles = Rotation.from_rotvec(draw.normal(0, AHRS, (27, 3))) * Rotation.from_euler("xyz", poses[:, 3:])
    seen = readings - offsets + draw.normal(0, 1e-3, (27, 4))
    log = Measurements(seen, orientations=angles.as_euler("xyz"), sigma={"lengths": 1e-3, "rotation": AHRS})
    result = calibrate(drawn(), log, "offsets")
    assert result.free == ("offsets",)
    error = np.array([one.value for one in result.parameters]) - offsets
    assert error @ np.linalg.solve(result.covariance, error) < chi2.ppf(1 - 1e-3, 4)
    assert "hardly pull" in str(result.report())


def test_stretch_follows_the_tensions_at_estimated_poses():
    """Ropes that stretch by up to 2 %, of platforms that tilt by up to 25 degrees, at 27 places."""
    poses, readings, _, tensions, offsets = rests(1)
    readings = (readings + offsets) / (1 + tensions / 4e3) - offsets
    errors = Rotation.from_rotvec(np.random.default_rng(7).normal(0, 2e-3, (27, 3)))
    angles = (errors * Rotation.from_euler("xyz", poses[:, 3:])).as_euler("xyz")
    log = Measurements(readings, orientations=angles, sigma={"lengths": 1e-3, "rotation": 2e-3})
    found = calibrate(drawn(COM + 0.02), log, ("offsets", "com"))
    elastic = found.parameters[-1]
    assert abs(elastic.value - 1 / 4e3) < 3 * elastic.sigma < 0.3 / 4e3
    assert np.abs(found.robot.platform.com - COM).max() < 0.003
    assert (
        np.sqrt(((found.poses - poses)[:, :3] ** 2).sum(axis=1).mean()) < 0.015
    )  # 540 mm with tensions at level poses


def test_a_wrong_reading_of_a_hanging_platform_is_listed():
    """Orientations and the balance of forces are redundant, although four lengths fit any pose."""
    _, readings, angles, _, offsets = rests(0)
    readings = readings + offsets
    readings[7, 2] += 0.15
    log = Measurements(readings, orientations=angles, sigma={"lengths": 1e-3, "rotation": AHRS})
    found = poses_from_log(drawn(), log)
    np.testing.assert_array_equal(np.flatnonzero(~found.fits), [7])
    assert any("sample 7: no pose fits" in line for line in found.lines())


@pytest.mark.parametrize("by_file", [False, True])
def test_errors_of_fixed_attachments_are_part_of_what_is_weighed(by_file):
    """Files whose attachments are wrong by what they state, or by the usual error: mass and CoM of many such files."""
    poses, readings, _, tensions, _ = rests(0)
    draw, size, errors = np.random.default_rng(3), 8e-3 if by_file else 4e-3, []  # 0.1 % of cables of 4 m
    names = [f"cables[{i}].{end}.{axis}" for i in range(4) for end in ("anchor", "attachment") for axis in "xyz"]
    stated = {"parameters": names, "covariance": np.diag(np.tile([1e-12] * 3 + [size**2] * 3, 4)).tolist()}
    log = Measurements(readings, poses=poses, tensions=tensions, sigma={"lengths": 1e-3, "tensions": 0.02})
    for _ in range(5):
        robot = robot_file(ANCHORS, ATTACHMENTS + draw.normal(0, size, (4, 3)), COM, MASS, [0, 0, 1.4, 0, 0, 0])
        robot = Robot.model_validate(robot.model_dump() | {"uncertainty": stated}) if by_file else robot
        found = calibrate(robot, log, ("anchors", "offsets", "mass", "com"), prior={"anchors": 1e-6})
        error = np.array([one.value for one in found.parameters[-4:]]) - [MASS, *COM]
        errors.append(error @ np.linalg.solve(found.covariance[-4:, -4:], error))
    assert chi2.ppf(1e-3, 20) < sum(errors) < chi2.ppf(1 - 1e-3, 20)


def test_without_tensions_gravity_still_adds_two_equations():
    """Four cables at known offsets, and an inertial sensor: the balance across the cables finds the CoM."""
    _, readings, angles, _, offsets = rests(0)
    log = Measurements(readings + offsets, orientations=angles, sigma={"lengths": 1e-3, "rotation": AHRS})
    result = calibrate(drawn(COM + np.array([0.03, 0, 0])), log, "com")
    assert abs(result.parameters[0].value - COM[0]) < 4 * result.parameters[0].sigma < 0.02
    with pytest.raises(InputError, match="tensions must be given to estimate mass, got none"):
        calibrate(drawn(), log, "mass")


def moving(seed, friction=0.05, elasticity=2e-5, swing=60, noise=0.02, seconds=15, of_poses=3e-4):
    """A motion of a planar robot with elastic cables of varying pretension, wrong drums and another clock, at 50 Hz."""
    draw, robot = np.random.default_rng(seed), load("planar-4")
    t = np.arange(0, seconds, 0.02)
    arg = 2 * np.pi * draw.uniform(0.15, 0.4, (3, 3, 1)) * t + draw.uniform(0, 6, (3, 3, 1))
    curve = CubicSpline(t, np.sin(arg).sum(axis=1).T * [0.17, 0.08, 0.04] + np.array([0, 0.75, 0]))

    def poses(at):
        full = np.zeros((len(at), 6))
        full[:, [0, 2, 4]] = curve(at)
        return full

    a, b = robot.anchors, robot.attachments
    now, acceleration = poses(t), curve(t, 2)
    tensions, lengths = np.empty((len(t), 4)), np.empty((len(t), 4))
    for k, pose in enumerate(now):
        u, arms, lengths[k] = lines(pose, a, b)
        A = np.vstack([u.T, np.cross(arms, u).T])[[0, 2, 4]]
        inertia = [4.0, 4.0, robot.platform.inertia[1]] * acceleration[k]
        wanted = inertia - [0, -4 * 9.81, 0]
        level = np.full(4, 110 + swing * np.sin(0.5 * t[k]))
        tensions[k] = level + np.linalg.pinv(A) @ (wanted - A @ level)
    sign = np.sign(np.gradient(lengths, axis=0))
    scales, offsets = 1 + draw.normal(0, 0.02, 4), draw.normal(0, 0.1, 4)
    readings = (lengths / (1 + elasticity * tensions) - offsets) / scales + draw.normal(0, 1e-3, lengths.shape)
    measured = tensions * np.exp(-friction * sign) * (1 + draw.normal(0, noise, sign.shape))
    later = poses(t - 0.034) + draw.normal(0, of_poses, (len(t), 6)) * (robot.dof_mask > 0)
    sigma = {"lengths": 1e-3, "position": of_poses, "rotation": of_poses, "tensions": noise}
    return Measurements(readings, later, tensions=measured, times=t, sigma=sigma), scales


def test_friction_stiffness_and_mass_of_a_motion(tmp_path):
    log, scales = moving(0)
    heavy = load("planar-4").model_dump(mode="json")
    heavy["platform"]["mass"] = 4.4
    file = Robot.model_validate(heavy).save(tmp_path / "heavy.yaml")
    free = ("anchors", "offsets", "scales", "clock", "mass", "capstan", "stiffness")
    data = tmp_path / "log.nc", "--free", ",".join(free), "--json", "--out", tmp_path / "built.yaml"
    log.save(data[0])
    done = run("calibrate", file, *data)
    found = {one["name"]: one["value"] for one in json.loads(done.stdout)["parameters"]}
    built = load(tmp_path / "built.yaml")
    assert built.platform.mass == pytest.approx(4.0, rel=0.01)
    assert found["clock"] == pytest.approx(0.034, abs=1e-3)
    for i in range(4):
        assert found[f"cables[{i}].capstan"] == pytest.approx(0.05, rel=0.1)
        assert found[f"cables[{i}].scale"] == pytest.approx(scales[i], abs=5e-3)
    assert np.mean([1 / cable.stiffness for cable in built.cables]) == pytest.approx(2e-5, rel=0.1)


def test_noise_of_poses_does_not_make_the_platform_seem_lighter():
    """Zeros of load cells explain a weight, so only accelerations tell the mass: their noise would look like less."""
    log, _ = moving(0, elasticity=0, noise=0.01, of_poses=1e-3)
    free = ["offsets", "scales", "clock", "mass", "capstan", "zeros"]
    found = {one.name: one for one in calibrate("planar-4", log, free).parameters}
    assert abs(found["mass"].value - 4.0) < 3 * found["mass"].sigma < 0.8


def test_noise_of_tensions_does_not_make_cables_seem_stiffer():
    """Tensions with 20 % of noise, a third of how far they vary: without their errors as unknowns it is 14 %."""
    free = ("anchors", "offsets", "scales", "clock", "mass", "capstan", "stiffness")
    result = calibrate("planar-4", moving(0, swing=40, noise=0.2)[0], free)
    rows = [k for k, one in enumerate(result.parameters) if one.name.endswith("compliance")]
    error = np.array([result.parameters[k].value for k in rows]) - 2e-5
    assert abs(error.mean()) < 0.1 * 2e-5
    squares = error @ np.linalg.solve(result.covariance[np.ix_(rows, rows)], error)
    assert squares < chi2.ppf(1 - 1e-3, 4)


def test_measured_tensions_show_stretch_without_being_asked_for():
    free = ("anchors", "offsets", "scales", "clock")
    result = calibrate("planar-4", moving(1, seconds=8)[0], free)
    assert result.free == ("anchors", "attachments", "offsets", "scales", "clock", "elasticity")
    compliance = result.parameters[-1]
    assert abs(compliance.value - 2e-5) < min(3 * compliance.sigma, 0.25 * 2e-5)
    assert calibrate("planar-4", moving(1, seconds=8, elasticity=0.0)[0], free).free == free


def test_accelerations_of_an_oscillation_are_as_large_as_they_are():
    """Parabolas as wide make them a quarter too small, and the fit of four cables then moves attachments by 30 mm."""
    t, rate = np.arange(0, 20, 0.02), 2 * np.pi * 1.4
    noise, poses = np.random.default_rng(0).normal(0, 5e-4, (len(t), 6)), np.zeros((len(t), 6))
    poses[:, 2], poses[:, 5] = 0.01 * np.sin(rate * t), 0.02 * np.sin(rate * t)
    lengths = lines(poses[0])[2] + poses[:, 2:3]
    data = robot_file(ANCHORS, ATTACHMENTS, COM, MASS, [0] * 6)
    motion = motion_of(Robot.model_validate(data), Measurements(lengths, poses + noise, times=t))
    shape = np.sin(rate * t) / (np.sin(rate * t) ** 2).sum()
    assert shape @ (motion.gravity[:, 2] - GRAVITY[2]) == pytest.approx(0.01 * rate**2, rel=0.04)
    assert shape @ motion.spin[:, 2] == pytest.approx(-0.02 * rate**2, rel=0.04)
    off = motion.gravity[:, 2] - GRAVITY[2] - 0.01 * rate**2 * np.sin(rate * t)
    assert np.std(off[50:-50]) < 0.15  # 0.33 by polynomials of degree 4 that are as exact, and then a CoM is 8 mm off


def test_noise_of_accelerations_is_no_larger_where_poses_are_measured_more_often():
    """Quartics through 51 samples at 1 kHz: 3.2 m/s^2, so that a mass of 4 kg seemed to be 0.12 +- 0.13 kg."""
    t, robot = np.arange(0, 3, 0.001), load("planar-4")
    poses = np.random.default_rng(0).normal(0, 5e-4, (len(t), 6)) * (robot.dof_mask > 0)
    poses[:, 2] += 0.75 + 0.1 * np.sin(3 * t)
    lengths = Dynamics(robot).cable_lengths(poses)
    motion = motion_of(robot, Measurements(lengths, poses, times=t, tensions=np.full((len(t), 4), 100.0)))
    off = (motion.gravity[:, 2] + 9.81 - 0.9 * np.sin(3 * t))[100:-100]
    assert np.sqrt((off**2).mean()) == pytest.approx(np.median(motion.sigma), rel=0.3)
    assert np.median(motion.sigma) < 0.15


@pytest.mark.parametrize("size", [0.0, 1.0])
def test_the_balance_does_not_depend_on_the_unit_of_force(size):
    """With twice the mass and gains, all forces of a point are twice as large, and so are errors of accelerations."""
    draw, t = np.random.default_rng(0), 0.05 * np.arange(40)
    dof = ("x", "y", "z", "roll", "pitch", "yaw") if size else ("x", "y", "z")
    robot = robot_file(ANCHORS, size * ATTACHMENTS, np.zeros(3), MASS, [0, 0, 1.4, 0, 0, 0], dof)
    poses = robot.home + 0.2 * np.sin(np.outer(t, [1, 1.3, 0.8, 0.4 * size, 0.5 * size, 0.6 * size]))
    poses += draw.normal(0, 2e-3, poses.shape) * robot.dof_mask
    log = Measurements(np.ones((40, 4)), poses, times=t, tensions=draw.uniform(30, 60, (40, 4)))
    parameters, balance = Parameters(robot, ("mass", "gains")), Balance(robot, log)
    forces = np.zeros(parameters.count)
    forces[parameters.clock + 1], parameters.table(forces)[:, 13] = MASS, 1.0
    placed = poses[:, :3], Rotation.from_euler("xyz", poses[:, 3:]).as_matrix()
    less, once, more, twice = (
        balance.at(parameters, parameters.first + change * forces, placed) for change in (-1e-5, 0, 1e-5, 1)
    )
    if not size:
        np.testing.assert_allclose(twice.residuals, once.residuals, atol=1e-9)
    parts = np.einsum("ni,nip->p", once.residuals, once.by_parameters * forces)  # of the gradient
    slope = ((more.residuals**2).sum() - (less.residuals**2).sum()) / 4e-5
    assert parts.sum() == pytest.approx(slope, abs=1e-5 * np.abs(parts).max())


def test_a_log_does_not_tell_mass_from_gains():
    """Errors of accelerations grow with the mass, and so with the gains: else no fit would end."""
    log, _ = moving(1, elasticity=0, seconds=3)
    result = calibrate("planar-4", log, ("offsets", "scales", "clock", "mass", "capstan", "gains"))
    assert result.converged
    assert "mass and gains together: no force is known for certain" in result.not_identifiable
    assert "mass" not in result.identifiable


def test_the_clock_of_measured_poses_is_sought_without_forces(monkeypatch):
    """A hundred offsets are tried; the balance of forces would take most of the time, and lengths tell more."""
    log, _ = moving(1, seconds=4)
    model = solving.model_of(load("planar-4"), log, ("offsets", "scales", "clock", "mass", "capstan", "gains"), {})
    usual, evaluated = Balance.at, []
    monkeypatch.setattr(Balance, "at", lambda *given, **more: evaluated.append(0) or usual(*given, **more))
    state = solving.begin_with_clock(model, 2.0)
    assert len(evaluated) <= 1
    assert state.x[model.parameters.clock] == pytest.approx(0.034, abs=2e-3)


def test_tensions_do_not_move_anchors_out_of_the_plane_of_a_planar_robot():
    log, _ = moving(1, seconds=4)
    noise = np.random.default_rng(3).normal(0, 1e-3, log.poses.shape) * [0, 1, 0, 1, 0, 1]  # of y, roll and yaw
    result = calibrate("planar-4", log.changed(poses=log.poses + noise), ("anchors", "offsets", "clock", "mass"))
    assert result.converged
    assert [one.correction for one in result.parameters if one.name.endswith("anchor.y")] == [0.0] * 4


@pytest.mark.parametrize("name", ["caroca-pulleys", "planar-4", "cogiro"])
def test_gradients_are_slopes_of_the_cost(name):
    robot, draw, count = load(name), np.random.default_rng(0), 9
    poses = robot.home + draw.uniform(-1, 1, (count, 6)) * 0.2 * robot.dof_mask
    tensions = draw.uniform(0.5, 2, (count, robot.m)) * robot.weight / robot.m
    sigma = {"lengths": 1e-2, "position": 1e-2, "rotation": 1e-2}
    lengths = draw.uniform(1, 2, (count, robot.m))
    log = Measurements(lengths, poses, tensions=tensions, times=0.05 * np.arange(count), sigma=sigma)
    groups = tuple(group for group in GROUPS if group != "clock" and (group != "radii" or robot.pulley_radii.any()))
    felt = FeltTensions(tensions, draw.normal(0, 0.1 * robot.weight, (count, robot.m, 2)))
    model = Model(Parameters(robot, groups), log, {}, np.ones((robot.m, count)), felt=felt)
    state = model.begin()._replace(errors=draw.normal(size=(count, 2)))
    model.parameters.table(state.x)[:, 10:13] = 1e-6, 0.05, 1.0
    varies, last = model.parameters.varies, model.parameters.clock
    state.x[last:][FRAMES] = 0.3 * draw.normal(size=12) * varies[last:][FRAMES]  # the frames of the poses
    small = [*range(10, last, OF_CABLE), last + COMMON]  # compliances
    residuals, derivatives = model.linearised(state)
    exact = np.einsum("nip,ni->p", derivatives.balance.by_parameters, residuals.balance)
    exact[last:][varies[last:]] += np.einsum("mn,mnk->k", residuals.readings, derivatives.others)
    for i in range(robot.m):
        exact[i * OF_CABLE : (i + 1) * OF_CABLE] += residuals.readings[i] @ derivatives.cables[i]
    for column in np.flatnonzero(varies):
        step = 1e-6 * np.eye(len(state.x))[column] * (1e-6 if column in small else 1.0)
        more, less = (model.cost(state._replace(x=state.x + sign * step)) for sign in (1, -1))
        assert (more - less) / (4 * step.max()) == pytest.approx(exact[column], rel=1e-3, abs=1e-4 * abs(exact).max())
    of_pose = np.einsum("mnc,mn->nc", derivatives.poses, residuals.readings)
    of_pose += np.einsum("nic,ni->nc", derivatives.balance.by_pose, residuals.balance)
    for axis in np.flatnonzero([*robot.dof_mask, 1, 1]):
        move = 1e-6 * np.outer(np.ones(count), np.eye(8)[axis])
        more, less = (model.residuals(model.moved(state, 0 * state.x, sign * move)) for sign in (1, -1))
        slope = (more.balance**2).sum(axis=1) + (more.readings**2).sum(axis=0)
        slope -= (less.balance**2).sum(axis=1) + (less.readings**2).sum(axis=0)
        np.testing.assert_allclose(slope / 4e-6, of_pose[:, axis], rtol=1e-3, atol=1e-5 * abs(of_pose).max())


@pytest.mark.parametrize("groups", [("anchors", "attachments", "elasticity", "com"), ("offsets", "mass", "com")])
def test_gradients_of_a_hanging_platform_include_those_of_its_tensions(groups):
    """Every cable's tension depends on the ends of all cables, the CoM and the pose, so each reading does, too."""
    draw, t = np.random.default_rng(0), 0.05 * np.arange(60)
    poses = np.array([0, 0, 1.4, 0, 0, 0]) + 0.1 * np.sin(np.outer(t, draw.uniform(1, 2, 6)) + draw.uniform(0, 6, 6))
    lengths = np.array([lines(pose)[2] for pose in poses])
    robot = robot_file(ANCHORS, ATTACHMENTS, COM, MASS, [0, 0, 1.4, 0, 0, 0], stiffness=2e4)
    sigma = {"lengths": 1e-2, "position": 1e-2, "rotation": 1e-2}
    log = Measurements(lengths + draw.normal(0, 0.05, lengths.shape), poses, times=t, sigma=sigma)
    model = Model(Parameters(robot, groups), log, {}, np.ones((4, 60)))
    state = model.begin()
    model = replace(model, forces=model._forces)
    model = replace(model, felt=carrying(model, state, True))
    assert model.felt.errors.shape == (60, 4, 6)
    state = model.begin()._replace(errors=draw.normal(size=(60, 6)))
    residuals, derivatives = model.linearised(state)
    varies = model.parameters.varies
    exact = np.einsum("nip,ni->p", derivatives.balance.by_parameters, residuals.balance)
    exact += np.einsum("mnp,mn->p", derivatives.through, residuals.readings)
    exact[model.parameters.clock :][varies[model.parameters.clock :]] += np.einsum(
        "mn,mnk->k", residuals.readings, derivatives.others
    )
    for i in range(4):
        exact[i * OF_CABLE : (i + 1) * OF_CABLE] += residuals.readings[i] @ derivatives.cables[i]
    small = model.parameters.clock + COMMON
    for column in np.flatnonzero(varies):
        step = 1e-6 * np.eye(len(state.x))[column] * (1e-6 if column == small else 1.0)
        more, less = (model.cost(state._replace(x=state.x + sign * step)) for sign in (1, -1))
        assert (more - less) / (4 * step.max()) == pytest.approx(
            exact[column], rel=1e-3, abs=1e-6 * abs(exact[:small]).max()
        )
    of_pose = np.einsum("mnc,mn->nc", derivatives.poses, residuals.readings)
    of_pose += np.einsum("nic,ni->nc", derivatives.balance.by_pose, residuals.balance)
    for axis in range(12):
        move = 1e-6 * np.outer(np.ones(60), np.eye(12)[axis])
        more, less = (model.residuals(model.moved(state, 0 * state.x, sign * move)) for sign in (1, -1))
        slope = (more.balance**2).sum(axis=1) + (more.readings**2).sum(axis=0)
        slope -= (less.balance**2).sum(axis=1) + (less.readings**2).sum(axis=0)
        np.testing.assert_allclose(slope / 4e-6, of_pose[:, axis], rtol=1e-3, atol=1e-5 * abs(of_pose).max())


def hanging(seed, compliance):
    """A point mass on three cables, whose tensions are those of its weight and acceleration; file and log."""
    rng, t = np.random.default_rng(seed), np.arange(0, 30, 0.1)
    directions = 2 * np.pi * np.arange(3) / 3
    anchors = np.column_stack([3 * np.cos(directions), 3 * np.sin(directions), np.full(3, 4.0)])
    rates, size, begin = np.array([0.9, 0.7, 1.1]), np.array([0.9, 0.9, 0.5]), rng.uniform(0, 6, 3)
    p = size * np.sin(rates * t[:, None] + begin) + [0, 0, 1.2]
    acceleration = -(rates**2) * size * np.sin(rates * t[:, None] + begin)
    away = anchors - p[:, None]
    lengths = np.linalg.norm(away, axis=2)
    u = np.swapaxes(away / lengths[..., None], 1, 2)
    tensions = np.linalg.solve(u, MASS * (acceleration - GRAVITY)[..., None])[..., 0]
    assert tensions.min() > 5
    noise = rng.normal(0, 3e-4, (2, *p.shape))
    readings = lengths / (1 + compliance * tensions) + noise[0]
    robot = robot_file(
        anchors + rng.normal(0, 0.02, (3, 3)), np.zeros((3, 3)), [0, 0, 0], MASS, [0, 0, 1.2, 0, 0, 0], "xyz"
    )
    return anchors, robot, Measurements(readings, poses=np.pad(p + noise[1], ((0, 0), (0, 3))), times=t)


def test_stretch_of_cables_is_found_by_the_weight_that_hangs_from_them():
    anchors, robot, log = hanging(1, 2e-5)
    found = calibrate(robot, log)
    elastic = found.parameters[-1]
    assert elastic.name == "compliance"
    assert abs(elastic.value - 2e-5) < 3 * elastic.sigma < 1e-5
    assert [1 / cable.stiffness for cable in found.robot.cables] == pytest.approx([elastic.value] * 3)
    assert "cables stretch: E A is" in str(found.report())
    wrong = np.array([cable.anchor for cable in found.robot.cables]) - anchors
    assert np.linalg.norm(wrong, axis=1).max() < 6e-3  # 20 mm and more without stretch
    # Validation samples are stretched by the tensions of the fit, not by those with which it began.
    model = found._solved.model
    begun = model.felt._replace(tensions=0.5 * model.felt.tensions)
    held_out = compare(replace(found._solved, model=replace(model, felt=begun)), found.free, found.prior)
    assert held_out.after == pytest.approx(found.held_out.after, rel=1e-6)
    assert "elasticity" not in calibrate(*hanging(1, 0.0)[1:]).free
    for lost, is_found in ((slice(150, 152), True), (slice(100, 120), False)):  # accelerations are then unknown
        poses = log.poses.copy()
        poses[lost] = np.nan
        again = calibrate(robot, log.changed(poses=poses))
        assert ("elasticity" in again.free) == is_found
        assert not is_found or abs(again.parameters[-1].value - 2e-5) < 3 * elastic.sigma
    with pytest.raises(InputError, match=r"known throughout a motion to estimate elasticity .* 280 of 300"):
        calibrate(robot, again.measurements, free=("anchors", "offsets", "elasticity"))
    timeless = log.changed(times=None)
    with pytest.raises(InputError, match="times must be given to estimate elasticity, got none, and the poses look"):
        calibrate(robot, timeless, free=("anchors", "offsets", "elasticity"))
    assert "a motion without times, so stretch of the cables was not sought" in str(calibrate(robot, timeless).report())
    stiff = robot.model_copy(
        update={"cables": tuple(one.model_copy(update={"stiffness": 1e5}) for one in robot.cables)}
    )
    more = calibrate(stiff, log, ("anchors", "offsets", "elasticity"))
    by_both = 1 / more.robot.cables[0].stiffness
    assert abs(by_both - 2e-5) < 3 * more.parameters[-1].sigma
    assert f"1 / (E A) is {1e6 * by_both - 10:.2f} 1/MN more, +-" in str(more.report())


def test_cables_are_slack_by_the_weight_of_a_body_whose_com_is_wrong_in_the_file():
    """The CoM decides how four cables share the weight, so which of them are slack, and how far the others stretch."""
    draw = np.random.default_rng(0)
    places = draw.uniform([-1, -1, 0.8], [1, 1, 2.0], (40, 3))
    taut, farthest = np.ones((40, 4)), np.argmin(places[:, :2] @ CORNERS.T, axis=1)
    taut[np.arange(0, 40, 3), farthest[::3]] = 0.0  # three cables can hold what is between them
    both = [at_rest(*one) for one in zip(places, taut, strict=True)]
    poses, tensions = (np.array(part) for part in zip(*both, strict=True))
    lengths = np.array([lines(pose)[2] for pose in poses]) / (1 + 1e-4 * tensions)
    readings = lengths + (1 - taut) * draw.uniform(0.005, 0.05, (40, 4)) + draw.normal(0, 3e-4, (40, 4)) + 0.1
    anchors, ends = (one + draw.normal(0, size, (4, 3)) for one, size in ((ANCHORS, 0.03), (ATTACHMENTS, 2e-3)))
    robot = robot_file(anchors, ends, COM + np.array([0.03, 0.02, 0]), MASS, [0, 0, 1.4, 0, 0, 0])
    sigma = {"lengths": 3e-4, "position": 3e-4, "rotation": 3e-4}
    found = calibrate(robot, Measurements(readings, poses=poses + draw.normal(0, 3e-4, (40, 6)), sigma=sigma))
    assert {"elasticity", "com"} <= set(found.free)
    assert not (found._solved.model.weights.T & (taut == 0)).any()
    assert np.abs(found.robot.platform.com - COM)[:2].max() < 3e-3
    assert found.robot.cables[0].stiffness == pytest.approx(1e4, rel=0.1)
    away = np.array([cable.anchor for cable in found.robot.cables]) - ANCHORS
    assert np.linalg.norm(away, axis=1).max() < 0.02  # 90 mm and more with the CoM of the file
    sigmas = [one.sigma for one in found.parameters if ".anchor." in one.name]
    assert np.abs(away.ravel() / sigmas).max() < 3.5
    stiff = tuple(one.model_copy(update={"stiffness": 1e4}) for one in robot.cables)
    known = calibrate(robot.model_copy(update={"cables": stiff}), found.measurements)
    assert "com" in known.free
    assert np.abs(known.robot.platform.com - COM)[:2].max() < 3e-3


def test_tensions_of_a_platform_are_those_of_all_parts_where_one_is_not_finite(monkeypatch):
    _, robot, log = hanging(1, 2e-5)
    model = model_of(robot, log, ("anchors", "offsets", "elasticity"), {})
    state, whole = model.begin(), carrying(model, model.begin(), True)
    monkeypatch.setattr("towline.estimation.calibration.model.PART", 100)
    shift = np.where(np.arange(len(log))[:, None] == 250, np.nan, state.shift)
    parts = carrying(model, state._replace(shift=shift), True)
    assert parts.errors.shape == whole.errors.shape == (300, 3, 6)
    np.testing.assert_allclose(parts.errors[:200], whole.errors[:200])


def test_blocks_of_a_long_log_show_stretch_as_all_samples_do(monkeypatch):
    """Accelerations of half a metre per second squared would show another stretch where they are ignored."""
    _, robot, log = hanging(2, 2e-5)
    solved = solve(robot, log, ("anchors", "offsets"), {}, False)
    place = solved.model.parameters.clock + COMMON
    whole = with_stretch(solved).fit.state.x[place]
    assert representative(robot, log) is None
    monkeypatch.setattr(module, "BLOCKS", 3)
    monkeypatch.setattr(module, "BLOCK", 45)
    part = log.only(representative(robot, log))
    assert len(part) == 135
    of_blocks = with_stretch(solve(robot, part, ("anchors", "offsets"), {}, False))
    assert of_blocks.fit.state.x[place] == pytest.approx(whole, rel=0.1)
    assert whole == pytest.approx(2e-5, rel=0.1)
    stiff = robot.model_copy(
        update={"cables": tuple(one.model_copy(update={"stiffness": 2e5}) for one in robot.cables)}
    )
    for other, rows in ((stiff, log), (robot, hanging(2, 0.0)[2]), (robot, hanging(2, -2e-5)[2])):
        assert with_stretch(solve(other, rows, ("anchors", "offsets"), {}, False)) is None
    monkeypatch.setattr(stretch, "turning", lambda *_: SimpleNamespace(enough=True))
    groups, sigmas = with_elasticity(solved)
    assert "attachments" in groups
    assert 0 < sigmas["attachments"] <= 5e-3


def test_nothing_is_computed_twice_of_a_long_log(monkeypatch):
    """The noise of a fit tells whether cables stretch, and is reported; wrong readings need no normal equations."""
    computed = []
    monkeypatch.setattr(solving, "information_of", lambda *given: computed.append(given) or information_of(*given))
    _, robot, log = hanging(1, 0.0)
    found = calibrate(robot, log.only(slice(200)).changed(sigma={"lengths": 3e-4, "position": 3e-4}))
    assert found.autocorrelation >= 1
    assert len(computed) == 1
    solved = found._solved
    assert solved.model.poses_vary.any()
    monkeypatch.setattr(NormalEquations, "at", None)
    assert outliers.find_outliers(solved.model, solved.fit.state)[0] == []


def test_some_samples_of_a_long_log_show_which_readings_are_wrong(monkeypatch):
    """A robust fit takes as long as dozens of others, also where poses have errors, so it is one of some samples."""
    _, robot, log = hanging(1, 0.0)
    lengths, wrong = log.lengths.copy(), np.random.default_rng(0).choice(300, 40, replace=False)
    lengths[wrong, wrong % 3] += 0.02 + 1e-4 * wrong
    log = log.changed(lengths=lengths, sigma={"lengths": 3e-4, "position": 3e-4})
    whole = solve(robot, log, ("anchors", "offsets"), {}, True)
    counts = []

    def counted(model, *rest, **options):
        counts.extend([len(model.measurements)] if model.parameters.groups else [])
        return fit(model, *rest, **options)

    monkeypatch.setattr(outliers, "fit", counted)
    monkeypatch.setattr(outliers, "MOST_SAMPLES", 100)
    some = solve(robot, log, ("anchors", "offsets"), {}, True)
    assert max(counts) == 100
    assert {(one.cable, one.sample) for one in some.outliers} == {(k % 3, k) for k in wrong.tolist()}
    np.testing.assert_allclose(some.fit.state.x, whole.fit.state.x, atol=1e-7)


def test_wrong_requests_are_one_line():
    _, readings, angles, tensions, _ = rests(0)
    weightless = drawn().model_copy(update={"gravity": (0.0, 0.0, 0.0)})
    with pytest.raises(InputError, match="free must not have mass without gravity"):
        calibrate(weightless, Measurements(readings, orientations=angles, tensions=tensions), "mass")
    with pytest.raises(InputError, match="without tensions, unless the robot has fewer cables than coordinates"):
        calibrate("cogiro", Measurements(np.full((30, 8), 9.0)), "com")
    with pytest.raises(InputError, match="tensions must be given to estimate stiffness"):
        calibrate("cogiro", Measurements(np.full((30, 8), 9.0)), "stiffness")
    with pytest.raises(InputError, match="tensions must be given to estimate elasticity"):
        calibrate("cogiro", Measurements(np.full((30, 8), 9.0)), "elasticity")
    with pytest.raises(InputError, match=r"sigma.tensions must be a number from 1e-06 to 100, got 0"):
        Measurements(readings, sigma={"tensions": 0})


def test_cables_without_tension_are_left_out():
    """A slack cable is longer than the way to the platform, so its reading is left out; dead load cells show none."""
    file = robot_file(ANCHORS, ATTACHMENTS, COM, MASS, [0, 0, 1.5, 0, 0, 0])
    pull = np.full((8, 4), 40.0) + np.arange(8)[:, None]
    pull[2, 1], pull[:, 3] = 0.3, 0.0
    expected = np.zeros((8, 4), dtype=bool)
    expected[2, 1] = True
    for poses in (None, np.zeros((8, 6))):
        log = Measurements(np.full((8, 4), 3.0), poses, tensions=pull)
        np.testing.assert_array_equal(slack(as_robot(file), log), expected)


def test_thrusts_of_a_carrier_whose_cable_never_pulls_do_not_hide_the_mass():
    """Such thrusts carry the carrier alone: their error relative to the tension, which is 0, was infinite."""
    robot, draw = load("multi-quadrotor-4"), np.random.default_rng(0)
    poses = robot.home + 0.05 * draw.uniform(-1, 1, (60, 6))
    A, w = Dynamics(robot).wrench_matrix(poses), Dynamics(robot).required_wrench(poses, np.zeros(6), np.zeros(6))
    pulls = [0, 2, 3]
    tensions = np.zeros((60, 4))
    tensions[:, pulls] = np.linalg.solve(A[:, :3, pulls], w[:, :3, None])[..., 0]
    carriers = np.tile(robot.carrier_home, (60, 1, 1))
    log = Measurements(Dynamics(robot).cable_lengths(poses), poses, tensions=np.abs(tensions), carrier_poses=carriers)
    found = calibrate(robot, log, free=("mass",))
    assert 1e-3 < np.sqrt(found.covariance[0, 0]) / robot.platform.mass < 0.05


def test_noise_of_accelerations_makes_no_mass_smaller():
    """With zeros of load cells, only accelerations tell the mass: their noise looked like a mass of 72 kg."""
    draw, robot, times = np.random.default_rng(1), load("cogiro"), 0.02 * np.arange(500)
    rates, size = np.array([1.1, 0.7, 0.9, 0.6, 0.8, 0.5]), np.array([1, 0.8, 0.3, 0, 0, 0])
    swing = np.sin(np.outer(times, rates))
    poses, dynamics = robot.home + size * swing, Dynamics(robot)
    A = dynamics.wrench_matrix(poses)  # moments about the CoM
    pull = np.zeros((len(times), 6, 1))
    pull[:, :3, 0] = robot.platform.mass * ((-size * rates**2 * swing)[:, :3] - robot.gravity)
    tensions = 300 + (np.linalg.pinv(A) @ (pull - 300 * A.sum(axis=2, keepdims=True)))[..., 0]
    assert tensions.min() > 100
    sigmas = np.repeat([5e-3, 1e-4], 3)
    log = Measurements(
        dynamics.cable_lengths(poses) + draw.normal(0, 1e-3, tensions.shape),
        poses + sigmas * draw.normal(0, 1, poses.shape),
        times=times,
        tensions=tensions * (1 + draw.normal(0, 0.005, tensions.shape)),
        sigma={"lengths": 1e-3, "position": 5e-3, "rotation": 1e-4, "tensions": 0.005},
    )
    found = {one.name: one for one in calibrate(robot, log, ("offsets", "mass", "zeros")).parameters}
    mass = found["mass"]
    assert mass.sigma < 0.05 * robot.platform.mass
    assert mass.value == pytest.approx(robot.platform.mass, abs=3 * mass.sigma)
    zeros = [one for name, one in found.items() if "zero" in name]
    assert len(zeros) == robot.m
    assert max(abs(one.value / one.sigma) for one in zeros) < 3
