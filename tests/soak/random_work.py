"""Random tasks of a working day, for the families of `random_families` that need more than a robot of the library.

Where a family needs places at which the platform can rest, they are chosen so that tensions exist there with the
carriers at home. Nothing else makes a task feasible: some are not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from towline.models import Robot, load

from .random_places import extent, free_base, resting_place

__all__ = ["beams", "bodies", "cycles", "feed", "least", "with_beam", "zones"]

WIDE = ("cogiro", "caroca", "ipanema-1", "ipanema-2")
AT_WORK = (*WIDE, "the-cable-robot-simulator", "wang-flying")


def bodies(rng: np.random.Generator, seed: int) -> tuple[Robot, dict[str, Any]]:
    """Return a robot whose platform is a box about its attachments, and a task that leads it past posts."""
    robot = load(WIDE[seed % len(WIDE)])
    low, high = robot.attachments.min(axis=0) - 0.01, robot.attachments.max(axis=0) + 0.01
    data = robot.model_dump()
    body = {"kind": "box", "min": low.tolist(), "max": high.tolist()}
    robot = Robot.model_validate(data | {"platform": data["platform"] | {"body": body}})
    start, end = _ends(rng, robot, 0.35 * extent(robot))
    posts = []
    for number in range(int(rng.integers(1, 4))):
        at = start[:3] + rng.uniform(0.3, 0.7) * (end - start)[:3] + rng.uniform(-0.3, 0.3, 3) * [1, 1, 0]
        top = at + np.array([0, 0, rng.uniform(-0.2, 0.3) * extent(robot)])
        foot = [float(at[0]), float(at[1]), float(top[2] - 3)]
        shape = {"kind": "capsule", "start": foot, "end": top.tolist(), "radius": float(rng.uniform(0.01, 0.06))}
        cables = None if rng.random() < 0.7 else 0.01
        posts.append({"name": f"post {number}", **shape, "cables": cables, "platform": float(rng.choice([0.0, 0.03]))})
    task = _line(start, end) | {"limits": {"keep_out": posts}, "steps": 60}
    task["tube"] = {"position": "free", "attitude": float(rng.choice([0.0, 0.2]))}
    return robot, task | _lasting(rng, 4.0, 8.0)


def feed(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task that works along lines at a steady speed: a raster, or lines between random points."""
    name = AT_WORK[seed % len(AT_WORK)]
    robot = load(name)
    start, end = _ends(rng, robot, 0.2 * extent(robot))
    end[3:] = start[3:] = robot.home[3:]
    points = [start, end]
    if rng.random() < 0.6:
        up = np.array([0, 0, float(rng.uniform(0.01, 0.05)) * extent(robot)])
        ends = [start[:3], np.r_[end[:2], start[2]]]
        rows = int(rng.integers(2, 8))
        points = [ends[(k + j) % 2] + k * up for k in range(rows) for j in range(2)]
    else:
        points = [resting_place(rng, robot, 0.2 * extent(robot)) for _ in range(int(rng.integers(2, 12)))]
    path = {
        "kind": "feed",
        "points": [[*point[:3].tolist(), *robot.home[3:].tolist()] for point in points],
        "feed": float(rng.uniform(0.05, 0.6)),
        "acceleration": float(rng.uniform(0.5, 5.0)),
        "tolerance": float(rng.choice([0.0, 0.001, 0.005, 0.02])),
    }
    task: dict[str, Any] = {"path": path, "base": free_base(rng, robot)}
    if rng.random() < 0.3:
        task |= {"tube": {"position": 0.002}, "steps": 100}
    return name, task


def zones(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task as fast as possible that passes balls in which the platform is slow."""
    name = AT_WORK[seed % len(AT_WORK)]
    robot = load(name)
    start, end = _ends(rng, robot, 0.3 * extent(robot))
    way = end[:3] - start[:3]
    length = float(np.linalg.norm(way))
    balls = [
        {
            "name": f"zone {number}",
            "centre": (start[:3] + rng.uniform(-0.1, 1.1) * way + rng.normal(0, 0.1, 3) * length).tolist(),
            "radius": float(rng.uniform(0.05, 0.4)) * length,
            "speed": float(rng.uniform(0.05, 0.5)),
        }
        for number in range(int(rng.integers(1, 4)))
    ]
    task = _line(start, end) | {"duration": {"min": 0.3, "max": 60.0}, "objective": {"time": 1.0}, "steps": 60}
    task |= {"limits": {"zone_speed": balls}, "base": free_base(rng, robot)}
    if rng.random() < 0.5:
        task["tube"] = {"position": "free" if rng.random() < 0.5 else 0.05 * length}
    return name, task


def cycles(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task that is repeated without a stop: periodic, through points, as fast as possible or not."""
    name = AT_WORK[seed % len(AT_WORK)]
    robot = load(name)
    points = [resting_place(rng, robot, 0.2 * extent(robot)).tolist() for _ in range(int(rng.integers(2, 5)))]
    path = {"kind": "waypoints", "points": [*points, points[0]]}
    tube = {"position": float(rng.choice([0.05, 0.2])) * extent(robot), "attitude": 0.05, "ends": "periodic"}
    if rng.random() < 0.5:
        tube["waypoints"] = "exact"
    task: dict[str, Any] = {"path": path, "tube": tube, "base": free_base(rng, robot), "steps": 60}
    if rng.random() < 0.3:
        task["limits"] = {"cable_speed": float(rng.uniform(1.0, 3.0))}
    return name, task | _lasting(rng, 4.0, 10.0)


def least(rng: np.random.Generator, seed: int) -> tuple[str, dict[str, Any]]:
    """Return a task as fast as possible: a line or waypoints, in a tube or not, under limits of winches."""
    name = AT_WORK[seed % len(AT_WORK)]
    robot = load(name)
    start, end = _ends(rng, robot, 0.3 * extent(robot))
    task, path = _line(start, end), dict[str, Any]()
    if rng.random() < 0.5:
        between = [resting_place(rng, robot, 0.25 * extent(robot)).tolist() for _ in range(int(rng.integers(1, 4)))]
        path |= {"kind": "waypoints", "points": [start.tolist(), *between, end.tolist()]}
        if rng.random() < 0.5:
            path["dwell"] = float(rng.uniform(0.1, 0.5))
        elif rng.random() < 0.5:
            path["order"] = "free"
        task["path"] = path
    task |= {"duration": {"min": 0.2, "max": 30.0}, "objective": {"time": 1.0}, "base": free_base(rng, robot)}
    if "dwell" in path:
        task["base"] = {"kind": "hold"}
    elif (tube := rng.random()) < 0.6:
        task |= {"tube": {"position": 0.02 * extent(robot) if tube < 0.3 else "free"}, "steps": 60}
    bounds = {
        "cable_speed": float(rng.uniform(0.5, 4.0)),
        "cable_acceleration": float(rng.uniform(3.0, 20.0)),
        "winch_power": float(rng.uniform(0.3, 2.0)) * float(robot.t_max.max()),
        "platform_acceleration": float(rng.uniform(1.0, 10.0)),
        "platform_lateral_acceleration": float(rng.uniform(0.5, 2.0)),
    }
    chosen = rng.choice(list(bounds), int(rng.integers(0, 3)), replace=False)
    task["limits"] = {key: bounds[key] for key in chosen.tolist()}
    return name, task


def beams(rng: np.random.Generator, seed: int) -> tuple[Robot, dict[str, Any]]:
    """Return two or three quadrotors that carry a beam on two cables each, and a way past a post or through a gate."""
    carriers = 2 + seed % 2
    half = float(rng.uniform(0.7, 1.3))
    robot = with_beam(half, carriers)
    start = np.array([-2.0, 0.0, 1.5, 0.0, 0.0, 0.0])
    end = start + np.r_[rng.uniform(3, 5), rng.uniform(-1, 1), rng.uniform(0, 0.5), 0, 0, 0]
    task = _line(start, end) | {"base": {"kind": "free", "ends": "rest"}, "steps": 50}
    task |= {"tube": {"position": "free", "attitude": float(rng.uniform(0.3, 0.9))}}
    middle = 0.5 * (start + end)[:3]
    apart = {"platform": 0.05, "carriers": 0.3, "cables": None if rng.random() < 0.5 else 0.02}
    if rng.random() < 0.5:
        foot = np.r_[middle[:2] + rng.uniform(-half, half, 2), -1.0]
        shape = {"kind": "capsule", "start": foot.tolist(), "end": [*foot[:2].tolist(), 5.0], "radius": 0.1}
        places = [{"name": "post", **shape, **apart}]
    else:
        wide = float(rng.uniform(1.3, 2.0)) * half
        sides = ([-9.0, -wide], [wide, 9.0])
        boxes = [
            {"min": [middle[0] - 0.1, middle[1] + low, -1.0], "max": [middle[0] + 0.1, middle[1] + high, 6.0]}
            for low, high in sides
        ]
        places = [{"kind": "box", "name": f"wall {k}", **box, **apart} for k, box in enumerate(boxes)]
    task["limits"] = {"keep_out": places, "carrier_separation": 0.5}
    return robot, task | _lasting(rng, 5.0, 9.0)


def with_beam(half: float, carriers: int) -> Robot:
    """Return a beam of length 2 `half` [m] along y under quadrotors."""
    quadrotors, cables = [], []
    for k, y in enumerate(np.linspace(-half, half, carriers).tolist()):
        home = [-2.0, y, 3.0, 0.0, 0.0, 0.0]
        quadrotors.append(
            {
                "name": f"quad{k}",
                "kind": "quadrotor",
                "home": home,
                "mass": 1.2,
                "inertia": [0.015, 0.015, 0.025, 0, 0, 0],
                "thrust_max": 40.0,
                "torque_max": [2.0, 2.0, 0.5],
                "tilt_max": 0.6,
                "speed_max": 5.0,
                "acceleration_max": 6.0,
            }
        )
        inner, outer = (0.85 * y, 1.0 * y) if y else (-0.1, 0.1)
        for at in (inner, outer):
            attachment = [0.0, float(np.clip(at, -0.95 * half, 0.95 * half)), 0.05]
            ends = {"carrier": f"quad{k}", "anchor": [0, 0, 0], "attachment": attachment}
            cables.append({**ends, "t_min": 0.2, "t_max": 60.0})
    return Robot.model_validate(
        {
            "name": f"beam-{carriers}",
            "source": "made for a random task",
            "platform": {
                "mass": 1.0,
                "inertia": [half**2 / 3, 0.004, half**2 / 3, 0, 0, 0],
                "home": [-2.0, 0.0, 1.5, 0, 0, 0],
                "body": {"kind": "capsule", "start": [0, -half, 0], "end": [0, half, 0], "radius": 0.04},
            },
            "carriers": quadrotors,
            "cables": cables,
        }
    )


def _ends(rng: np.random.Generator, robot: Robot, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a place to start and one far from it, (6,) each."""
    start = resting_place(rng, robot, reach)
    others = [resting_place(rng, robot, reach) for _ in range(10)]
    return start, max(others, key=lambda pose: float(np.linalg.norm((pose - start)[:2])))


def _line(start: np.ndarray, end: np.ndarray) -> dict[str, Any]:
    return {"path": {"kind": "line", "start": start.tolist(), "end": end.tolist()}}


def _lasting(rng: np.random.Generator, low: float, high: float) -> dict[str, Any]:
    """Return a duration, or a range whose time counts."""
    if rng.random() < 0.5:
        return {"duration": float(rng.uniform(low, high))}
    return {"duration": {"min": 0.2 * low, "max": 3 * high}, "objective": {"time": 1.0}}
