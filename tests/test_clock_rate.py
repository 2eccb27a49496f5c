"""Clocks of two computers: cable speeds show their rate too roughly where the anchors of the file are wrong."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import Measurements, calibrate, load
from towline.estimation.calibration import clock_rate
from towline.estimation.calibration.normal_equations import metric
from towline.estimation.calibration.solving import solve
from towline.estimation.logs import read_log
from towline.models import Dynamics

from .recorded import motion, quaternions
from .test_logs import write_csv

SLOW = 0.2  # times the usual speed


def recording(robot, seed, folder, one_clock=False):
    """A log of lengths and poses by NumPy alone, the rate and the offset of the poses' clock, and the anchors."""
    draw = np.random.default_rng(seed)
    anchors = robot.anchors + draw.normal(0, 0.02, (robot.m, 3)) * (robot.dof_mask[:3] > 0)
    rate, ahead = (1.0, 0.0) if one_clock else (1 + draw.uniform(-5e-5, 5e-5), draw.uniform(-1e3, 1e3))
    times, seen = np.arange(0, 60, 0.04), np.arange(0, 60, 0.02)
    poses = motion(robot, SLOW * times)
    ends = poses[:, None, :3] + robot.attachments @ Rotation.from_euler("xyz", poses[:, 3:]).as_matrix().swapaxes(1, 2)
    readings = np.linalg.norm(anchors - ends, axis=2) + draw.normal(0, 3e-4, (len(times), robot.m))
    noise = draw.normal(0, 1e-3, (len(seen), 6)) * [1, 1, 1, 0.3, 0.3, 0.3]
    poses = motion(robot, SLOW * seen) + noise * (robot.dof_mask > 0)
    lengths = write_csv(folder / "l.csv", "t," + ",".join(f"l{i}" for i in range(robot.m)), times, readings)
    columns = (ahead + rate * seen, poses[:, :3], quaternions(poses))
    mocap = write_csv(folder / "p.csv", "t,x,y,z,qx,qy,qz,qw", *columns)
    return read_log(lengths, poses=mocap, robot=robot), rate, ahead, anchors


@pytest.mark.parametrize("name", ["cogiro", "nist-robocrane", "planar-4"])
def test_the_rate_of_a_clock_is_fitted_and_part_of_the_sigmas(name, tmp_path):
    """Anchors wrong by 20 mm let clocks seem to drift by 10 to 100 ppm, which moved anchors by several sigmas."""
    robot, squares, of_rates, aligned = load(name), [], [], []
    for seed in range(3):
        read, rate, ahead, anchors = recording(robot, seed, tmp_path)
        found = calibrate(robot, read.measurements)
        assert found.refused is None
        rows = np.flatnonzero(["anchor" in one.name for one in found.parameters])
        rows = rows[np.tile(robot.dof_mask[:3] > 0, robot.m)]
        errors = np.array([one.value for one in found.parameters])[rows] - anchors[:, robot.dof_mask[:3] > 0].ravel()
        covariance = found.covariance[np.ix_(rows, rows)]
        squares.append(errors @ np.linalg.solve(covariance, errors) / len(errors))
        of_rates.append((read.clock.rate * (1 + found.clock_rate.value) / rate - 1) / found.clock_rate.sigma)
        aligned.append((read.clock.rate / rate - 1) / found.clock_rate.sigma)
        late = read.clock.offset + found.clock - ahead + (read.clock.rate - rate) * 30.0  # in the middle
        assert abs(late) < 2e-4
    assert max(squares) < 1.7, squares
    assert np.abs(of_rates).max() < 4, of_rates
    assert np.abs(aligned).max() > 8, aligned  # otherwise nothing was to be found


def test_one_clock_has_no_rate(tmp_path):
    read, *_ = recording(load("cogiro"), 7, tmp_path, one_clock=True)
    found = calibrate("cogiro", read.measurements)
    whole = abs(read.clock.rate * (1 + found.clock_rate.value) - 1)
    assert whole < 4 * found.clock_rate.sigma


def test_sigmas_include_the_uncertainty_of_the_rate(monkeypatch):
    """They grow by what a rate that is wrong by a standard deviation does to the parameters."""
    robot, times = load("cogiro"), np.arange(0, 15, 0.05)
    lengths = Dynamics(robot).cable_lengths(motion(robot, 0.5 * times))

    def solved(at):
        given = Measurements(lengths, motion(robot, 0.5 * at), times=times)
        return solve(robot, given, ("anchors", "offsets", "clock"), {}, False)

    free = solved(times)
    (rate,) = free.clocks.parameters(1.0)
    assert 1e-7 < rate.sigma < clock_rate.USUAL
    monkeypatch.setattr(clock_rate, "USUAL", 1e-12)
    known, other = solved(times), solved(times + 10 * rate.sigma * (times - 7.475))
    moved = ((other.fit.state.x - known.fit.state.x) * metric(known.model))[known.model.parameters.varies] / 10
    growth = free.observability.covariance - known.observability.covariance
    np.testing.assert_allclose(growth, np.outer(moved, moved), atol=0.2 * growth.max())
