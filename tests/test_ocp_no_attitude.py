"""Ends that are in the way of an obstacle at every attitude that the tube permits, against sampled attitudes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import load
from towline.ocp.blocked import blocked
from towline.ocp.planner import Planner

TURN = 0.3
ROBOTS = ("cogiro", "caroca", "wang-flying")


def clearance(robot, pose, turns, centre, radius):
    """Return by how much the platform is outside a ball at attitudes `turns` (n, 3) from a pose, (n,) [m]."""
    points = np.vstack([robot.attachments, robot.platform.com])
    R = Rotation.from_euler("ZYX", (pose[3:] + turns)[:, ::-1]).as_matrix()
    at = pose[:3] + np.einsum("nij,kj->nki", R, points)
    return np.linalg.norm(at - centre, axis=2).min(axis=1) - radius


@pytest.mark.parametrize("seed", range(24))
def test_proofs_are_those_of_sampled_attitudes(seed):
    rng = np.random.default_rng(seed)
    robot = load(ROBOTS[seed % len(ROBOTS)])
    start, end = robot.home.copy(), robot.home.copy()
    end[:3] += rng.normal(size=3) * 0.2 * robot.length
    points = np.vstack([robot.attachments, robot.platform.com])
    arm = np.linalg.norm(points, axis=1).max()
    surface = points[rng.integers(len(points))] / arm
    centre = end[:3] + surface * arm * rng.uniform(0.8, 1.3) + rng.normal(size=3) * 0.05 * arm
    radius = float(rng.uniform(0.05, 0.6)) * arm
    ball = {"kind": "sphere", "centre": centre.tolist(), "radius": radius, "cables": None, "carriers": None}
    task = {
        "path": {"kind": "line", "start": start.tolist(), "end": end.tolist()},
        "duration": 9,
        "tube": {"position": "free", "attitude": TURN},
        "limits": {"keep_out": [{"name": "ball", "platform": 0.0, **ball}]},
    }
    turns = rng.uniform(-TURN, TURN, (20_000, 3))
    best = [clearance(robot, pose, turns, centre, radius).max() for pose in (start, end)]
    proof = blocked(Planner(robot, task).scenario)
    by_ball = proof is not None and any(excess.limit == "keep_out" for excess in proof.excess)
    if min(best) > 0.0:
        assert not by_ball
    elif min(best) < -0.05 * arm:  # so many samples come nearer than that to the best attitude
        assert by_ball


def test_a_ball_about_the_point_that_turning_does_not_move_is_in_the_way_at_every_attitude():
    """Prove it although the other points of the platform could leave the ball: the CoM is the platform's origin."""
    robot = load("caroca")
    end = robot.home.copy()
    assert robot.platform.com == (0.0, 0.0, 0.0)
    start = end[:3] - np.array([0.5, 0.0, 0.0])
    ball = {"kind": "sphere", "name": "ball", "centre": end[:3].tolist(), "radius": 0.05, "cables": None}
    task = {
        "path": {"kind": "line", "start": start.tolist(), "end": end[:3].tolist()},
        "duration": 9,
        "tube": {"position": "free", "attitude": 0.2},
        "limits": {"keep_out": [{**ball, "platform": 0.0}]},
    }
    proof = blocked(Planner(robot, task).scenario)
    assert proof is not None
    assert "is -0.05 m at t = 9.000 s (no attitude in the tube keeps all distances)" in proof.describe()
