"""Batches of poses on one thread: wrench matrices, cable lengths, poses from lengths, conditions of a workspace.

    python -m towline.benchmarks.batches [--poses 200000] [--runs 5]

Each time is of a pose, the median of several runs. References are what one would use without towline: CasADi's map with
conversion to NumPy, and SciPy's least squares, pose by pose. Lengths have 1 mm of noise; "tracking" starts 1 mm and
1 mrad away per axis.
"""

import argparse
from collections.abc import Iterator

import numpy as np
from scipy.optimize import least_squares

from ..base import processors
from ..estimation import pose_from_lengths
from ..models import Dynamics, Robot, load, points
from ..workspace import Condition, Lengths, Margin, Places, StaticEquilibrium, WrenchClosure, WrenchFeasible
from .harness import head, machine, row, timed

ROBOTS = ("wang-flying", "nist-robocrane", "ipanema-1", "ipanema-2", "cogiro", "caroca-pulleys")
PUSH = ((-5.0, -5.0, -5.0, 0.0, 0.0, 0.0), (5.0, 5.0, 5.0, 0.0, 0.0, 0.0))  # [N, N m]
CONDITIONS: dict[str, tuple[Condition, int]] = {  # and the part of the poses that is enough
    "static equilibrium": (StaticEquilibrium(), 1),
    "wrench closure": (WrenchClosure(), 1),
    "equilibrium and lengths": (StaticEquilibrium() & Lengths(max=5.0), 1),
    "wrench feasible, 8 pushes": (WrenchFeasible(box=PUSH), 4),
    "margin above 1 N": (Margin(above=1.0), 8),
}
FEW = 100  # poses of a reference that takes milliseconds


def measure(robot: Robot, count: int, runs: int) -> Iterator[tuple[str, float, str]]:
    """Yield what is computed, the time of a pose [s], and the time of a reference, or a share of the poses."""
    rng, dynamics = np.random.default_rng(0), Dynamics(robot)
    poses = robot.home + 0.1 * robot.length * rng.uniform(-1, 1, (count, 6)) * robot.dof_mask
    near = poses + rng.normal(0, 1e-3, poses.shape)
    for name in ("wrench_matrix", "cable_lengths"):
        mapped, home = dynamics.functions[name].map(count), np.tile(robot.carrier_home, (1, count))
        method = getattr(dynamics, name)
        with processors.at_most(1):
            seconds = timed(lambda method=method: method(poses), runs)[1]
        by_map = timed(lambda mapped=mapped, home=home: mapped(poses.T, home).full(), min(runs, 3))[1]
        yield name, seconds / count, f"map {by_map / seconds:.1f}"
    lengths = dynamics.cable_lengths(poses) + rng.normal(0, 1e-3, (count, robot.m))
    seconds = timed(lambda: pose_from_lengths(robot, lengths, near), runs)[1] / count
    pairs = list(zip(lengths[:FEW], near, strict=False))
    peer = timed(lambda: [by_scipy(robot, *given) for given in pairs], 1)[1] / len(pairs)
    yield "pose from lengths, tracking", seconds, f"scipy {peer / seconds:.0f}"
    few = lengths[:10_000]
    search = timed(lambda: pose_from_lengths(robot, few), runs)[1] / len(few)
    yield "pose from lengths, no start", search, "-"
    corners = np.vstack([robot.home_anchors, robot.home[:3]])
    poses[:, :3] = rng.uniform(corners.min(axis=0), corners.max(axis=0), (count, 3))
    places = Places.at_home(robot, poses)
    for name, (condition, part) in CONDITIONS.items():
        some = places.only(slice(0, count // part))
        held, seconds = timed(lambda condition=condition, some=some: condition.holds(robot, some), runs)
        yield name, seconds / len(held), f"{held.mean():.3f} hold"


def by_scipy(robot: Robot, lengths: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return a pose by SciPy's least squares with its own tolerances, of straight cables in NumPy."""

    def errors(pose: np.ndarray) -> np.ndarray:
        attached = pose[:3] + robot.attachments @ points.rotations(pose[3:]).T
        return np.linalg.norm(attached - robot.home_anchors, axis=1) - lengths

    return least_squares(errors, start, method="trf").x


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=200_000)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    print(f"Measured on {machine()}.\n\n{head('robot | what | us a pose | times as long', 2)}")
    for name in ROBOTS:
        for what, seconds, beside in measure(load(name), options.poses, options.runs):
            print(row(name, what, f"{1e6 * seconds:.3f}", beside), flush=True)


if __name__ == "__main__":
    main()
