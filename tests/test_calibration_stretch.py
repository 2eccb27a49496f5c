"""Platforms in motion on six cables: noise of measured poses must not look like stretch, nor change a stiffness."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Measurements, calibrate, load
from towline.estimation.logs.smoothing import Polynomials

NOISE = 1e-3  # [m, rad], of lengths and poses


def recording(seed, stiffness=np.inf, scales=0.0, seconds=60):
    """A log by Newton and Euler of the robot's own mass, and the lengths and poses without noise of a larger motion."""
    robot, draw = load("nist-robocrane"), np.random.default_rng(seed)
    platform, inertia, h = robot.platform, np.asarray(robot.inertia), 1e-4
    anchors, offsets = robot.anchors + draw.normal(0, 0.01, (6, 3)), draw.uniform(-0.1, 0.1, 6)
    rates, phases = draw.uniform(1.2, 2.6, 6), draw.uniform(0, 6, 6)
    scale = 1 + draw.uniform(-scales, scales, 6)

    def pose(t, size=1.0):
        return robot.home + size * np.array([0.5, 0.5, 0.25, 0.1, 0.1, 0.15]) * np.sin(np.outer(t, rates) + phases)

    def turned(t):
        return Rotation.from_euler("xyz", pose(t)[:, 3:])

    def rate(t):
        return (turned(t + h) * turned(t - h).inv()).as_rotvec() / (2 * h)

    def centre(t):
        return pose(t)[:, :3] + turned(t).apply(platform.com)

    def cables(poses):
        ends = robot.attachments @ Rotation.from_euler("xyz", poses[:, 3:]).as_matrix().swapaxes(1, 2)
        return anchors - poses[:, None, :3] - ends, ends

    t = np.arange(0, seconds, 0.02)
    along, ends = cables(pose(t))
    lengths, R, w = np.linalg.norm(along, axis=2), turned(t).as_matrix(), rate(t)
    units, arms = along / lengths[..., None], ends - turned(t).apply(platform.com)[:, None]
    force = platform.mass * ((centre(t + h) - 2 * centre(t) + centre(t - h)) / h**2 - robot.gravity)
    I = R @ inertia @ R.swapaxes(1, 2)  # noqa: E741
    spin, momentum = (rate(t + h) - rate(t - h)) / (2 * h), np.einsum("nij,nj->ni", I, w)
    moment = np.einsum("nij,nj->ni", I, spin) + np.cross(w, momentum)
    W = np.concatenate([units, np.cross(arms, units)], axis=2).swapaxes(1, 2)
    tensions = np.linalg.solve(W, np.hstack([force, moment])[..., None])[..., 0]
    assert tensions.min() > 0
    readings = (lengths / (1 + tensions / stiffness) - offsets) / scale + draw.normal(0, NOISE, lengths.shape)
    log = Measurements(readings, pose(t) + draw.normal(0, NOISE, (len(t), 6)), times=t)
    larger = pose(t, 1.5)
    return robot, log, larger, (np.linalg.norm(cables(larger)[0], axis=2) - offsets) / scale


def test_noise_of_poses_is_no_stretch():
    """With accelerations by the same noise cables seemed as soft as rubber, and predictions were off by decimetres."""
    robot, log, poses, readings = recording(1, scales=0.02)
    found = calibrate(robot, log)
    assert found.refused is None
    assert "elasticity" not in found.free
    ends = np.asarray(found.robot.attachments) @ Rotation.from_euler("xyz", poses[:, 3:]).as_matrix().swapaxes(1, 2)
    lengths = np.linalg.norm(np.asarray(found.robot.anchors) - poses[:, None, :3] - ends, axis=2)
    offset, scale, _ = np.asarray(found.robot.encoders).T
    assert np.sqrt((((lengths - offset) / scale - readings) ** 2).mean()) < 0.5 * NOISE


@pytest.mark.parametrize("seed", range(2))
def test_noise_of_poses_does_not_change_the_stiffness(seed):
    """With accelerations by the same noise it was 12 to 28 % too small, 3 to 6 standard deviations."""
    robot, log, *_ = recording(seed, stiffness=3e3)
    found = calibrate(robot, log)
    (compliance,) = (one for one in found.parameters if one.name == "compliance")
    assert compliance.sigma < 0.1 * compliance.value
    assert abs(compliance.value - 1 / 3e3) < 2.5 * compliance.sigma
    assert 1 / compliance.value == pytest.approx(3e3, rel=0.1)


def test_polynomials_without_their_nearest_samples():
    """They pass through motions of their degree, know nothing of these samples, and tell the noise as it is."""
    times, draw = np.arange(0, 4, 0.01), np.random.default_rng(0)
    motion = np.stack([np.sin(times), times**3], axis=1)
    hollow = Polynomials(times, 81, 8, hollow=11)
    found = hollow.fitted(motion)
    np.testing.assert_allclose(found.bends[20:-20], np.stack([-np.sin(times), 6 * times], axis=1)[20:-20], atol=1e-4)
    moved = motion.copy()
    moved[195:206] += 1.0
    np.testing.assert_allclose(hollow.fitted(moved).bends[200], found.bends[200], atol=1e-9)
    noisy = hollow.fitted(motion + draw.normal(0, 0.01, motion.shape))
    spread = (noisy.bends - found.bends)[50:-50].std(axis=0)
    assert noisy.noise[2][50:-50].mean(axis=0) == pytest.approx(spread, rel=0.15)
