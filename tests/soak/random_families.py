"""Random tasks of each family: `random_task` determines one by its family and a seed.

    ordinary   lines, waypoints and circles with tubes, margins, open durations; a fifth leaves nothing to choose
    lift       lift, move, lower, over a few centimetres or more, sometimes with dwell times
    rack       a box stands in the way from one place to another
    window     the way leads through a hole in a wall
    team       three or four quadrotors carry a load two metres, past a ball every other time
    moving     the motion begins while platform and carriers move
    fast       as fast as the cables permit, up to 10 m/s, past places of all shapes, from or to a limit exactly
    phases     a load is picked up, lifted, carried, lowered and put down; a fifth is four times the platform's weight
    bodies     a platform with a body leads past posts
    feed       work along lines at a steady speed
    zones      as fast as possible past balls in which the platform is slow
    cycles     periodic motions through points
    least      as fast as possible, under limits of winches and of the platform
    beams      two or three quadrotors carry a beam past a post or through a gate

Where a family needs places at which the platform can rest, they are chosen so that tensions exist there with the
carriers at home. Nothing else makes a task feasible: some are not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from towline.models import Dynamics, Robot, load
from towline.models.files import as_robot
from towline.ocp import Task

from . import random_work
from .random_places import can_rest, extent, free_base, past_boxes, resting_place
from .recheck import cable_distance, point_distance
from .saved_motion import rotation

__all__ = ["FAMILIES", "ROBOTS", "random_task"]

ROBOTS = ("wang-flying", "wang-ctmrts-6", "ipanema-1", "cogiro", "planar-4", "wang-flying-quadrotor")
OF_SPACE = ("ipanema-1", "cogiro", "wang-flying", "caroca", "ipanema-2", "the-cable-robot-simulator")
FAST = (*OF_SPACE, "point-mass-3", "multi-quadrotor-3")
TEAMS = ("multi-quadrotor-3", "multi-quadrotor-4")
TEAM_STEPS = 50


def random_task(family: str, seed: int) -> tuple[Robot, Task]:
    """Return a robot and a task for it, of a family of `FAMILIES`."""
    robot, task = FAMILIES[family](np.random.default_rng(seed), seed)
    return as_robot(robot), Task.model_validate({"name": f"{family}-{seed}", **task})


def _ordinary(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a robot's name and a task for it: path, duration, tube, base, limits and objective of any kind.

    Where the planner has something to choose, the platform can rest at the points that make the path, with its carriers
    at home. Every fifth task leaves nothing to choose and goes anywhere.
    """
    name = ROBOTS[seed % len(ROBOTS)]
    robot = load(name)
    size = extent(robot)
    fixed = seed % 5 == 0
    path = _path(rng, robot, 0.25 * size, anywhere=fixed)
    task: dict[str, Any] = {"path": path, "steps": 40}
    stretches = path["kind"] in ("line", "waypoints")
    duration = float(rng.uniform(3.0, 8.0))
    if stretches:
        task["duration"] = duration
    if fixed:
        task["base"] = _fixed_base(rng, robot)
        return name, task
    task["margin"] = float(rng.choice([0.0, 0.05]))
    task["base"] = free_base(rng, robot)
    if stretches and rng.random() < 0.3:
        task["duration"] = {"min": 0.5 * duration, "max": 3.0 * duration}
        task["objective"] = {"time": 1.0}
    if rng.random() < 0.5:
        task["tube"] = {"position": float(rng.choice([0.02, 0.1])) * size, "attitude": float(rng.choice([0.0, 0.1]))}
    if rng.random() < 0.3:
        task["limits"] = {"platform_speed": float(rng.uniform(2.0, 5.0)), "tension_rate": 1e4}
    return name, task


def _path(rng: np.random.Generator, robot: Robot, reach: float, anywhere: bool) -> dict[str, Any]:
    """Return a path about the platform's home, in its degrees of freedom."""
    home = robot.home

    def near() -> np.ndarray:
        return resting_place(rng, robot, reach, anywhere)

    kind = rng.choice(["line", "waypoints", "circle"])
    if kind == "circle" and robot.dof_mask[:2].all():
        radius = 0.5 * float(np.linalg.norm((near() - home)[:2]))
        rate = float(rng.choice([-1, 1]) * rng.uniform(0.3, 1.0))
        return {
            "kind": "circle",
            "centre": home[:3].tolist(),
            "radius": radius,
            "rate": rate,
            "attitude": home[3:].tolist(),
        }
    if kind == "waypoints":
        return {"kind": "waypoints", "points": [near().tolist() for _ in range(3)]}
    return {"kind": "line", "start": near().tolist(), "end": near().tolist()}


def _fixed_base(rng: np.random.Generator, robot: Robot) -> dict[str, Any]:
    """Return carriers at rest at home, or one carrier that moves along a given path."""
    carrier = robot.carriers[0]
    if carrier.confined or carrier.efforts or rng.random() < 0.5:
        return {"kind": "hold"}
    start = robot.carrier_home[0]
    end = start + np.r_[rng.uniform(-1, 1, 3), 0.0, 0.0, 0.0]
    path = {"kind": "line", "start": start.tolist(), "end": end.tolist()}
    return {"kind": "given", "paths": {carrier.name: path}}


def _lift(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task that lifts, moves and lowers the platform."""
    name = OF_SPACE[seed % len(OF_SPACE)]
    robot = load(name)
    size = extent(robot)
    start, end = resting_place(rng, robot, 0.25 * size), resting_place(rng, robot, 0.25 * size)
    end[2], up = start[2], [0, 0, rng.uniform(0.02, 0.2) * size, 0, 0, 0]
    points = [start, start + up, end + up, end]
    path: dict[str, Any] = {"kind": "waypoints", "points": [point.tolist() for point in points]}
    task = {"path": path, "duration": float(rng.uniform(3.0, 8.0)), "steps": 60, "base": free_base(rng, robot)}
    if rng.random() < 0.3:
        path["dwell"] = [0.0, 0.3, 0.3, 0.0]
    if rng.random() < 0.5:
        task["tube"] = {"position": 0.02 * size}
    return name, task


def _rack(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task from place to place past a box that stands between them."""
    name = OF_SPACE[seed % len(OF_SPACE)]
    robot = load(name)
    size = extent(robot)

    def places(start: np.ndarray, end: np.ndarray) -> list[dict[str, Any]]:
        half, middle = 0.05 * size, 0.5 * (start + end)[:3]
        low, high = middle - [half, 3 * half, size], middle + np.array([half, 3 * half, half])
        return [{"kind": "box", "name": "rack", "min": low.tolist(), "max": high.tolist()}]

    return name, past_boxes(rng, robot, places, _distances(rng))


def _distances(rng: np.random.Generator) -> dict[str, Any]:
    """Return how far platform and cables stay from a place."""
    return {"platform": float(rng.choice([0.0, 0.05])), "cables": None if rng.random() < 0.7 else 0.01}


def _window(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task through a hole in a wall; the platform alone keeps clear of it, since the cables cannot."""
    name = OF_SPACE[seed % len(OF_SPACE)]
    robot = load(name)
    size = extent(robot)
    off = rng.uniform(-0.1, 0.1, 3) * size
    half = 0.5 * float(np.ptp(robot.attachments, axis=0).max()) + 0.1 * size
    far, thick = 3 * size, 0.02 * size
    sides = {
        "left": ([-far, -half], [-far, far]),
        "right": ([half, far], [-far, far]),
        "below": ([-half, half], [-far, -half]),
        "above": ([-half, half], [half, far]),
    }

    def places(start: np.ndarray, end: np.ndarray) -> list[dict[str, Any]]:
        middle = 0.5 * (start + end)[:3]
        hole = middle + off
        normal = int(np.abs(end - start)[:2].argmax())  # of the wall: along this axis the line goes farthest
        walls = []
        for side, (along, up) in sides.items():
            low, high = middle - thick, middle + thick
            low[1 - normal], high[1 - normal] = hole[1 - normal] + along[0], hole[1 - normal] + along[1]
            low[2], high[2] = hole[2] + up[0], hole[2] + up[1]
            walls.append({"kind": "box", "name": side, "min": low.tolist(), "max": high.tolist()})
        return walls

    return name, past_boxes(rng, robot, places, {"cables": None, "carriers": None})


def _team(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task of quadrotors that carry a load two metres."""
    name = TEAMS[seed % len(TEAMS)]
    robot = load(name)
    direction = rng.normal(size=3) * [1, 1, 0.3]
    start, end = robot.home.copy(), robot.home.copy()
    end[:3] += 2.0 * direction / np.linalg.norm(direction)
    task: dict[str, Any] = {
        "path": {"kind": "line", "start": start.tolist(), "end": end.tolist()},
        "base": {"kind": "free"},
        "tube": {"position": "free", "attitude": 0.3},
        "steps": TEAM_STEPS,
        "duration": float(rng.uniform(3.0, 5.0)),
    }
    if rng.random() < 0.5:
        task |= {"duration": {"min": 1.0, "max": 6.0}, "objective": {"time": 0.1}}
    if rng.random() < 0.5:
        ball = {"kind": "sphere", "name": "ball", "centre": (0.5 * (start + end)[:3]).tolist(), "radius": 0.15}
        task["limits"] = {"keep_out": [{**ball, "platform": 0.1, "cables": 0.02, "carriers": 0.3}]}
    return name, task


def _fast(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task of least time past some places, which starts or ends exactly on a limit."""
    name = FAST[seed % len(FAST)]
    robot = load(name)
    team = any(carrier.efforts for carrier in robot.carriers)
    extent = 4.0 if team else float(np.ptp(robot.home_anchors, axis=0)[:2].max())
    reach = 0.3 * extent
    start = robot.home.copy() if team else resting_place(rng, robot, reach)
    ends = [resting_place(rng, robot, reach) for _ in range(10)]
    end = max(ends, key=lambda pose: float(np.linalg.norm((pose - start)[:3])))
    if team:
        end = start + np.r_[2.0, rng.uniform(-1, 1), rng.uniform(0, 0.5), 0, 0, 0]
    way = end[:3] - start[:3]
    keep_out = []
    for number in range(1 if team else int(rng.integers(1, 4))):
        half = rng.uniform(0.02, 0.06) * np.linalg.norm(way)
        centre = start[:3] + rng.uniform(0.3, 0.7) * way + rng.uniform(-0.15, 0.15, 3) * np.linalg.norm(way)
        tip = rng.normal(size=3)
        tip *= 3 * half / np.linalg.norm(tip)
        shapes: dict[str, dict[str, Any]] = {
            "sphere": {"centre": centre.tolist(), "radius": half},
            "capsule": {"start": (centre - tip).tolist(), "end": (centre + tip).tolist(), "radius": half / 2},
            "box": {
                "min": (centre - half * np.array([0.3, 3, 1])).tolist(),
                "max": (centre + half * np.array([0.3, 3, 1])).tolist(),
                "attitude": [0.0, 0.0, float(rng.uniform(-1, 1))],
            },
        }
        kind = str(rng.choice(list(shapes)))
        cables = None if rng.random() < 0.6 else float(rng.choice([0.0, 0.01]))
        apart = {"platform": float(rng.choice([0.0, 0.03])), "cables": cables, "carriers": 0.2 if team else None}
        keep_out.append({"kind": kind, "name": f"{kind} {number}", **shapes[kind], **apart})
    limits: dict[str, Any] = {"keep_out": keep_out}
    if rng.random() < 0.5:
        limits["platform_speed"] = 10.0
    task: dict[str, Any] = {
        "path": {"kind": "line", "start": start.tolist(), "end": end.tolist()},
        "duration": {"min": 0.2, "max": 20.0},
        "objective": {"time": 0.2, "jerk": 1e3},
        "tube": {"position": "free", "attitude": float(rng.choice([0.0, 0.2]))},
        "base": free_base(rng, robot),
        "limits": limits,
        "scheme": str(rng.choice(["linear", "linear", "hermite", "hermite", "linear"])),
        "steps": 40,
    }
    task |= _from_a_limit(rng, robot, start, end, limits)
    return name, task


def _from_a_limit(
    rng: np.random.Generator, robot: Robot, start: np.ndarray, end: np.ndarray, limits: dict[str, Any]
) -> dict[str, Any]:
    """Add a limit that is met exactly at one end to `limits`, and return what the task needs beside that."""
    pose, anchors = start if rng.random() < 0.5 else end, robot.home_anchors
    turned = rotation(pose[3:])
    ends = pose[:3] + robot.attachments @ turned.T
    points = np.vstack([ends, pose[:3] + turned @ np.array(robot.platform.com)])
    which = str(rng.choice(["floor", "place", "cable", "length", "speed"]))
    if which == "floor":
        limits["platform_box"] = {"min": [-100.0, -100.0, float(min(start[2], end[2]))], "max": [100.0] * 3}
    elif which == "length" and robot.fixed_lengths is None:
        others = [at[:3] + robot.attachments @ rotation(at[3:]).T for at in (start, end)]
        longest = np.linalg.norm(np.array(others) - anchors, axis=-1).max()
        limits["cable_length"] = {"min": 0.01, "max": float(longest)}
    elif which == "speed":
        limits["platform_speed"] = 0.3
        return {"initial": {"pose": start.tolist(), "velocity": [0.0, 0.0, 0.3, 0.0, 0.0, 0.0]}}
    else:
        below = points[points[:, 2].argmin()] - [0.0, 0.0, 0.4]
        beside = 0.5 * (ends[0] + anchors[0]) + 0.3 * _unit(np.cross(anchors[0] - ends[0], [0.1, 0.2, 1.0]))
        ball = {"kind": "sphere", "name": "at an end", "radius": 0.1, "carriers": None}
        if which == "place":
            ball |= {"centre": below.tolist(), "cables": None}
            ball["platform"] = float(point_distance(ball, points).min())
        else:
            ball |= {"centre": beside.tolist(), "platform": None}
            ball["cables"] = float(cable_distance(ball, ends, anchors).min())
        limits["keep_out"].append(ball)
    return {}


def _moving(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task that begins while the platform moves."""
    name = OF_SPACE[seed % len(OF_SPACE)]
    robot = load(name)
    size = extent(robot)
    start, end = resting_place(rng, robot, 0.2 * size), resting_place(rng, robot, 0.2 * size)
    velocity = np.r_[rng.uniform(-0.1, 0.1, 3) * size, 0, 0, 0]
    measured = start + np.r_[rng.uniform(-0.01, 0.01, 3) * size, 0, 0, 0]
    return name, {
        "path": {"kind": "line", "start": start.tolist(), "end": end.tolist()},
        "duration": float(rng.uniform(3.0, 6.0)),
        "tube": {"position": "free"},
        "steps": 40,
        "base": free_base(rng, robot),
        "initial": {"pose": measured.tolist(), "velocity": velocity.tolist()},
    }


def _phases(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task that picks a load up, carries it and puts it down, which may be too heavy."""
    name = OF_SPACE[seed % len(OF_SPACE)]
    robot = load(name)
    size = extent(robot)
    start, end = resting_place(rng, robot, 0.2 * size), resting_place(rng, robot, 0.2 * size)
    start[3:] = end[3:] = robot.home[3:]
    end[2], up = start[2], np.array([0, 0, rng.uniform(0.05, 0.2) * size, 0, 0, 0])
    body = {"mass": robot.platform.mass, "com": [0.0, 0.0, -float(rng.uniform(0.0, 0.2)) * size]}
    heavy, dynamics = seed % 5 == 0, Dynamics(robot)

    def bears(load: dict[str, Any] | None) -> bool:
        return all(can_rest(dynamics, at, np.zeros(6), load) for at in (start, end, end + up))

    while not heavy and not bears(body) and bears(None):
        body["mass"] *= 0.7
    body["mass"] *= 4.0 if heavy else float(rng.uniform(0.2, 0.8))

    def move(name: str, first: np.ndarray, last: np.ndarray) -> dict[str, Any]:
        path = {"kind": "line", "start": first.tolist(), "end": last.tolist()}
        return {"name": name, "duration": float(rng.uniform(1.5, 4.0)), "path": path, "load": body}

    rest = {"kind": "rest", "pose": start.tolist()}
    phases = [
        {"name": "pick-up", "duration": 0.5, "path": rest, "ground": {}, "load": body},
        move("lift", start, start + up),
        move("carry", start + up, end + up),
        move("lower", end + up, end),
        {"name": "set-down", "duration": 0.5, "ground": {}, "load": body},
    ]
    task: dict[str, Any] = {"phases": phases, "steps": 60, "base": free_base(rng, robot)}
    if not heavy and rng.random() < 0.5:
        task["tube"] = {"position": 0.02 * size}
    return name, task


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


Family = Callable[[np.random.Generator, int], tuple[str | Robot, dict[str, Any]]]

FAMILIES: dict[str, Family] = {
    "ordinary": _ordinary,
    "lift": _lift,
    "rack": _rack,
    "window": _window,
    "team": _team,
    "fast": _fast,
    "moving": _moving,
    "phases": _phases,
    "bodies": random_work.bodies,
    "feed": random_work.feed,
    "zones": random_work.zones,
    "cycles": random_work.cycles,
    "least": random_work.least,
    "beams": random_work.beams,
}
