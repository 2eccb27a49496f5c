"""Ends at which every attitude that the tube permits touches an obstacle or has no tensions, against sampled ones."""

from functools import cache

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from towline import Robot, load
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


@cache
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


def short_at(robot, pose, turns, mass=0.0, load_com=(0, 0, 0), push=(0, 0, 0)):
    """Return the least largest wrench error of tensions inside their limits at rest, in weights, by linear programs.

    A load has its `mass` [kg] and its CoM in the platform frame [m]; the air exerts `push` on the CoM [weights].
    """
    arms, com, m = robot.attachments, np.array(robot.platform.com), robot.m
    ratio, up, found = mass / robot.platform.mass, np.array([0.0, 0.0, 1.0]), []
    for R in Rotation.from_euler("ZYX", (pose[3:] + turns)[:, ::-1]).as_matrix():
        way = robot.home_anchors - pose[:3] - arms @ R.T
        way /= np.linalg.norm(way, axis=1)[:, None]
        A = np.hstack([way, np.cross((arms - com) @ R.T, way) / robot.length]).T / robot.weight
        w = np.append((1 + ratio) * up - push, np.cross(R @ (load_com - com), ratio * up) / robot.length)
        error = np.full((6, 1), -1.0)
        rows, right = np.block([[A, error], [-A, error]]), np.concatenate([w, -w])
        limits = [*zip(robot.t_min, robot.t_max, strict=True), (0, None)]
        found.append(linprog([0.0] * m + [1.0], A_ub=rows, b_ub=right, bounds=limits).fun)
    return np.array(found)


@pytest.mark.parametrize("seed", range(4))
def test_ends_without_tensions_in_wind_at_any_attitude_are_proven(seed):
    """Attitudes drawn at random have tensions in none, or not in all, of the winds: one wind, or those of a disc."""
    rng = np.random.default_rng([31, seed])
    data = load("cogiro" if seed % 2 else "ipanema-1").model_dump(mode="json")
    data["platform"]["aero"] = {"air_density": 1.2, "drag": 0.8, "lift": 0.1, "area": 2.0}
    robot, turn = Robot.model_validate(data), float(rng.uniform(0.02, 0.1))
    speed = float(np.sqrt((0.8 + seed % 2) * robot.weight / (0.5 * 1.2 * 2.0 * 0.8)))
    end = robot.home.copy()
    end[:2] += 0.3 * np.abs(robot.home_anchors[:, :2]).max(axis=0) * rng.uniform(-1, 1, 2)
    winds = [speed * np.array([np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0, 2 * np.pi, 17)[:-1]]
    winds = winds[seed : seed + 1] if seed < 2 else winds
    turns = np.vstack([np.zeros(3), rng.uniform(-turn, turn, (4, 3))])
    worst = np.zeros(len(turns))
    for V in winds:
        push = 0.5 * 1.2 * 2.0 * np.append(0.8 * V[:2] * np.abs(V[:2]), 0.1 * V @ V) / robot.weight
        worst = np.maximum(worst, short_at(robot, end, turns, push=push))
    line = {"kind": "line", "start": robot.home.tolist(), "end": end.tolist()}
    task = {"path": line, "duration": 9, "tube": {"position": "free", "attitude": turn}}
    task["wind"] = winds[0].tolist() if seed < 2 else {"speed": speed}
    proof = infeasible_ends(Planner(robot, task).scenario)
    if worst.min() < 1e-9:
        assert proof is None
    elif worst.min() > 0.02:
        assert "no attitude in the tube has feasible tensions at rest" in proof.describe()


@pytest.mark.parametrize("seed", range(8))
def test_ends_without_tensions_at_any_attitude_are_proven(seed):
    rng = np.random.default_rng([29, seed])
    robot = load("cogiro" if seed % 2 else "ipanema-1")
    end, turn = robot.home.copy(), float(rng.uniform(0.02, 0.3))
    far = np.abs(robot.home_anchors[:, :2]).max(axis=0) * rng.uniform(0.6, 1.05)
    end[:2] = far * rng.choice([-1, 1], 2)
    carried = {"mass": robot.platform.mass * (seed % 3) / 4, "com": (robot.length * rng.uniform(-1, 1, 3)).tolist()}
    phase = {"path": {"kind": "line", "start": robot.home.tolist(), "end": end.tolist()}, "duration": 9}
    task = {"tube": {"position": "free", "attitude": turn}} | phase
    if seed % 3:
        task = {
            "tube": task["tube"],
            "phases": [{"name": "carry", "load": {**carried, "inertia": [1, 1, 1, 0, 0, 0]}} | phase],
        }
    proof = infeasible_ends(Planner(robot, task).scenario)
    turns = np.vstack([np.zeros(3), rng.uniform(-turn, turn, (24, 3))])
    least = short_at(robot, end, turns, *carried.values()).min()
    if least < 1e-9:
        assert proof is None
    elif least > 0.02:  # so few samples come nearer than that to the best attitude
        assert proof is not None
        assert "no attitude in the tube has feasible tensions at rest" in proof.describe()
