"""Poses from cable lengths: against cable lengths from poses, and against scipy's least squares.

    python -m towline.benchmarks.forward_kinematics [--poses 200000] [--runs 5]

One thread; each row is the median of several runs after one that is not counted. "tracking" starts 1 mm and 1 mrad away
per axis. The lengths of a batch are computed by the same kernel as everywhere ("kernel"), and by CasADi's map, which
smaller batches use ("map").
"""

from __future__ import annotations

import argparse
from time import perf_counter

import numpy as np
from scipy.optimize import least_squares

from ..estimation.pose import machine as code
from ..models import Robot, batch, load, points, pose_from_lengths
from ..models.dynamics import Dynamics
from .batch import timed
from .machine import machine

ROBOTS = ("cogiro", "ipanema-1", "wang-flying", "caroca-pulleys", "nist-robocrane")
SIGMA = 1e-3  # [m]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=200_000)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    print(machine())
    start = perf_counter()
    code.load()
    print(f"machine code ready after {perf_counter() - start:.1f} s")
    print(f"{'':16}{'a pose':>9}  ratio to lengths     no start    one call, ratio to     times as fast as")
    print(
        f"{'':16}{'[us]':>9}  {'kernel':>7} {'map':>7}   {'[us]':>10}    {'one of lengths':>15}     scipy's trf and lm"
    )
    for name in ROBOTS:
        report(load(name), options.poses, options.runs)


def report(robot: Robot, count: int, runs: int) -> None:
    """Print the row of a robot."""
    rng, dynamics = np.random.default_rng(0), Dynamics(robot)
    poses = robot.home + 0.1 * robot.length * rng.uniform(-1, 1, (count, 6)) * robot.dof_mask
    lengths = dynamics.cable_lengths(poses) + rng.normal(0, SIGMA, (count, robot.m))
    near = poses + rng.normal(0, 1e-3, poses.shape)
    function = dynamics.functions["cable_lengths"]
    arguments = {"pose": poses[:10_000], "carrier_pose": robot.carrier_home}
    mapped = timed(lambda: batch.call(Dynamics(robot).functions["cable_lengths"], arguments)["lengths"], runs)[1]
    batch.compiled(function)
    all_poses = {"pose": poses, "carrier_pose": robot.carrier_home}
    kernel = timed(lambda: batch.call(function, all_poses, threads=1)["lengths"], runs)[1] / count
    track = timed(lambda: pose_from_lengths(robot, lengths, near).pose, runs)[1] / count
    search = timed(lambda: pose_from_lengths(robot, lengths[:10_000]).pose, runs)[1] / 10_000
    one = timed(lambda: [pose_from_lengths(robot, lengths[0], near[0]).pose for _ in range(2000)], runs)[1]
    one /= timed(lambda: [dynamics.cable_lengths(poses[0]) for _ in range(2000)], runs)[1]
    peers = [scipy_time(robot, lengths[:100], near[:100], how) / track for how in ("trf", "lm")]
    ratios = f"{track / kernel:7.2f} {track / mapped * 10_000:7.2f}"
    print(
        f"{robot.name:16}{1e6 * track:9.3f}  {ratios}   {1e6 * search:10.2f}    {one:15.2f}"
        f"     {peers[0]:9.0f} {peers[1]:8.0f}"
    )


def scipy_time(robot: Robot, lengths: np.ndarray, starts: np.ndarray, method: str) -> float:
    """Return the seconds that scipy takes for a pose, with its own tolerances, of straight cables in NumPy."""
    anchors, attachments = robot.home_anchors, robot.attachments

    def errors(pose: np.ndarray, measured: np.ndarray) -> np.ndarray:
        attached = pose[:3] + attachments @ points.rotations(pose[3:]).T
        return np.linalg.norm(attached - anchors, axis=1) - measured

    begin = perf_counter()
    for measured, start in zip(lengths, starts, strict=True):
        least_squares(errors, start, args=(measured,), method=method)
    return (perf_counter() - begin) / len(lengths)


if __name__ == "__main__":
    main()
