"""Ends that are in the way of an obstacle at every attitude that the tube permits, against sampled attitudes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import load
from towline.ocp.planner import Planner
from towline.ocp.proofs.infeasible_ends import infeasible_ends

TURN = 0.3
ROBOTS = ("cogiro", "caroca", "wang-flying")


def clearance(robot, pose, turns, centre, radius):
    """Return by how much the platform is outside a ball at attitudes `turns` (n, 3) from a pose, (n,) [m]."""
    points = np.vstack([robot.attachments, robot.platform.com])
    R = Rotation.from_euler("ZYX", (pose[3:] + turns)[:, ::-1]).as_matrix()
    at = pose[:3] + np.einsum("nij,kj->nki", R, points)
    return np.linalg.norm(at - centre, axis=2).min(axis=1) - radius


def case(seed):
    """Return the proof of a random task if a ball is its reason, and the best clearance of each end [arms]."""
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
    best = [clearance(robot, pose, turns, centre, radius).max() / arm for pose in (start, end)]
    proof = infeasible_ends(Planner(robot, task).scenario)
    by_ball = proof is not None and any(excess.limit == "keep_out" for excess in proof.excess)
    return proof if by_ball else None, best


@pytest.mark.parametrize("seed", range(24))
def test_proofs_are_those_of_sampled_attitudes(seed):
    proof, best = case(seed)
    if min(best) > 0.0:
        assert proof is None
    elif min(best) < -0.05:  # so many samples come nearer than that to the best attitude
        assert proof is not None


def test_the_reason_is_stated():
    proofs = [proof.describe() for proof in (case(seed)[0] for seed in range(24)) if proof is not None]
    assert sum("no attitude in the tube keeps all distances" in proof for proof in proofs) >= 2
