"""Measure places per second on one core, from pose to answer, and CASPR's wrench closure of IPAnema 2.

    python -m towline.benchmarks.workspace [--places 400000] [--runs 5] [--programs all]

The first table has static equilibrium (the bounded problem itself) and the other conditions, of robots with six and
eight cables, at random poses among their anchors, all of which differ. The second has wrench closure at the 14 823
poses of CASPR's paper, which reports 89 s to 455 s in MATLAB for its methods, and counts by a linear program, pose by
pose (HiGHS), on request. Times are medians of several runs, after one that is not counted: wall time and process time.
"""

from __future__ import annotations

import argparse
import time
from statistics import median

import numpy as np
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from ..models import Dynamics, Robot, load
from ..workspace import (
    Condition,
    Lengths,
    Margin,
    Places,
    StaticEquilibrium,
    WrenchClosure,
    WrenchFeasible,
    load_kernels,
)
from .machine import machine

PUSH = ((-5.0, -5.0, -5.0, 0.0, 0.0, 0.0), (5.0, 5.0, 5.0, 0.0, 0.0, 0.0))  # [N, N m]


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--places", type=int, default=400_000)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--programs", default="97", help="a linear program checks every N-th pose; or all")
    options = parser.parse_args()
    print(machine())
    report_throughput(options.places, options.runs)
    report_closure(options.runs, 1 if options.programs == "all" else int(options.programs))


def report_throughput(count: int, runs: int) -> None:
    """Print the places per second of some conditions."""
    conditions: list[tuple[str, Condition, int]] = [
        ("static equilibrium", StaticEquilibrium(), count),
        ("wrench closure", WrenchClosure(), count),
        ("lengths", Lengths(max=5.0), count),
        ("equilibrium and lengths", StaticEquilibrium() & Lengths(max=5.0), count),
        ("wrench feasible, 8 pushes", WrenchFeasible(box=PUSH), count // 4),
        ("margin above 1 N", Margin(above=1.0), count // 8),
    ]
    print("robot             m  condition                 places   held   wall s  places/s   process s  places/s")
    for name in ("wang-flying", "nist-robocrane", "ipanema-2", "cogiro"):
        robot = load(name)
        load_kernels(robot)
        places = random_places(robot, count)
        for label, condition, most in conditions:
            some = places.only(slice(0, most))
            held, wall, own = timed(robot, condition, some, runs)
            print(
                f"{name:16} {robot.m:2}  {label:25} {most:7} {held.mean():6.3f} {wall:8.3f} {most / wall:9.3g}"
                f" {own:11.3f} {most / own:9.3g}"
            )


def report_closure(runs: int, every: int) -> None:
    """Print the result for CASPR's 14 823 poses, and that of a linear program at every `every`-th of them."""
    robot, poses = load("ipanema-2"), caspr_poses()
    places = Places.at_home(robot, poses)
    held, wall, own = timed(robot, WrenchClosure(), places, runs)
    print(f"\nwrench closure of ipanema-2: {held.sum()} of {len(places)} poses, {wall:.4f} s ({own:.4f} s of process)")
    A = Dynamics(robot).wrench_matrix(poses[::every])
    start = time.perf_counter()
    closed = np.array([closed_by_program(matrix) for matrix in A])
    seconds = time.perf_counter() - start
    print(
        f"by a linear program each: {closed.sum()} of {len(A)}, {seconds:.1f} s; "
        f"{(closed != held[::every]).sum()} differ; CASPR reports 89 s to 455 s for all"
    )


def random_places(robot: Robot, count: int) -> Places:
    """Return poses uniform in the box of anchors and home, turned by up to 0.1 rad."""
    rng = np.random.default_rng(1)
    corners = np.vstack([robot.home_anchors, robot.home[:3]])
    poses = robot.home + rng.uniform(-0.1, 0.1, (count, 6))
    poses[:, :3] = rng.uniform(corners.min(axis=0), corners.max(axis=0), (count, 3))
    return Places.at_home(robot, poses)


def caspr_poses() -> np.ndarray:
    """Return poses (14823, 6): XYZ Euler 30, -30, 5 degrees; X -4 to 4 m and Y -3 to 3 m by 0.1 m, Z 2, 3, 4 m."""
    axes = np.linspace(-4, 4, 81), np.linspace(-3, 3, 61), np.array([2.0, 3.0, 4.0])
    poses = np.zeros((81 * 61 * 3, 6))
    poses[:, :3] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    poses[:, 3:] = Rotation.from_euler("XYZ", [30, -30, 5], degrees=True).as_euler("ZYX")[::-1]
    return poses


def closed_by_program(A: np.ndarray) -> bool:
    """Return whether balanced tensions of sum 1 exist that are all positive, and A has full row rank."""
    n, m = A.shape
    result = linprog(
        np.r_[np.zeros(m), -1.0],  # the least tension, as large as it can be
        A_ub=np.hstack([-np.eye(m), np.ones((m, 1))]),
        b_ub=np.zeros(m),
        A_eq=np.block([[A, np.zeros((n, 1))], [np.ones((1, m)), np.zeros((1, 1))]]),
        b_eq=np.r_[np.zeros(n), 1.0],
        bounds=[(None, None)] * (m + 1),
        method="highs",
    )
    return bool(result.status == 0 and -result.fun > 1e-9 and np.linalg.matrix_rank(A) == n)


def timed(robot: Robot, condition: Condition, places: Places, runs: int) -> tuple[np.ndarray, float, float]:
    """Return the answers, and medians of wall time and process time [s]."""
    held, wall, own = condition.holds(robot, places), [], []
    for _ in range(runs):
        start, before = time.perf_counter(), time.process_time()
        held = condition.holds(robot, places)
        wall.append(time.perf_counter() - start)
        own.append(time.process_time() - before)
    return held, median(wall), median(own)


if __name__ == "__main__":
    main()
