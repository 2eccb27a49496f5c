"""Where the platform of a random task may start and end, and what stands between: helpers of the families."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from towline.models import Dynamics, Robot
from towline.solvers import solve
from towline.statics.distribution import wrench_problem

__all__ = ["can_rest", "extent", "free_base", "outside", "past_boxes", "resting_place"]


def resting_place(rng: np.random.Generator, robot: Robot, reach: float, anywhere: bool = False) -> np.ndarray:
    """Return a pose about the platform's home at which it can rest, (6,), unless it may be `anywhere`."""
    dynamics, pose = Dynamics(robot), robot.home.copy()
    for attempt in range(100):
        pose = robot.home.copy()
        pose[:3] += rng.uniform(-reach, reach, 3) * 0.97**attempt * robot.dof_mask[:3]
        pose[3:] += rng.uniform(-0.05, 0.05, 3) * robot.dof_mask[3:]
        if anywhere or can_rest(dynamics, pose, np.zeros(6)):
            break
    return pose


def extent(robot: Robot) -> float:
    """Return the extent of the robot, between half a metre and three [m]."""
    anchors = robot.anchors + robot.carrier_home[robot.carrier_of_cable, :3]
    return float(np.clip(np.ptp(anchors, axis=0).max(), 0.5, 3.0))


def can_rest(dynamics: Dynamics, pose: np.ndarray, rest: np.ndarray, load: dict[str, Any] | None = None) -> bool:
    """Return whether tensions hold the platform at `pose` with velocity and acceleration `rest`, all (6,)."""
    robot = dynamics.robot
    A, w = dynamics.wrench_matrix(pose), dynamics.required_wrench(pose, rest, rest)
    if load is not None:
        weight = -load["mass"] * np.array(robot.gravity)
        w = w + np.r_[weight, np.cross(np.array(load["com"]) - robot.platform.com, weight)]  # the platform is level
    spare = 0.05 * (robot.t_max - robot.t_min)
    return solve(wrench_problem(dynamics.robot, A, w, robot.t_min + 0.1, robot.t_max - spare)).feasible


def free_base(rng: np.random.Generator, robot: Robot) -> dict[str, Any]:
    """Return free carriers where the robot has some that can move: always for quadrotors, mostly for others."""
    held, movable = (any(values) for values in zip(*((c.efforts, c.moves) for c in robot.carriers), strict=True))
    if held or (movable and rng.random() < 0.8):
        return {"kind": "free", "ends": str(rng.choice(["free", "rest"]))}
    return {"kind": "hold"}


def past_boxes(
    rng: np.random.Generator,
    robot: Robot,
    places: Callable[[np.ndarray, np.ndarray], list[dict[str, Any]]],
    distances: dict[str, Any],
) -> dict[str, Any]:
    """Return a task from place to place on any path past boxes that leave the platform at both ends clear."""
    reach = 0.3 * extent(robot)
    start = end = robot.home
    boxes: list[dict[str, Any]] = []
    for _ in range(30):
        start = resting_place(rng, robot, reach)
        others = [resting_place(rng, robot, reach) for _ in range(20)]
        end = max(others, key=lambda pose: float(np.linalg.norm((pose - start)[:2])))
        boxes = places(start, end)
        if min(outside(robot, pose, box) for pose in (start, end) for box in boxes) > 0.1 * reach:
            break
    path = {"kind": "line", "start": start.tolist(), "end": end.tolist()}
    tube = {"position": "free", "attitude": float(rng.choice([0.0, 0.2]))}
    limits = {"keep_out": [{**box, **distances} for box in boxes]}
    task = {"path": path, "duration": float(rng.uniform(4.0, 8.0)), "tube": tube, "limits": limits}
    return task | {"steps": 60, "base": free_base(rng, robot)}


def outside(robot: Robot, pose: np.ndarray, box: dict[str, Any]) -> float:
    """Return how far the platform is outside a box [m]; it is nearly level."""
    points = pose[:3] + np.vstack([robot.attachments, robot.platform.com])
    beyond = np.maximum(np.array(box["min"]) - points, points - np.array(box["max"]))
    return float(beyond.max(axis=1).min())
