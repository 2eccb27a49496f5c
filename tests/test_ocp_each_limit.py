"""Each limit by its name: without it a plan passes it, hard it is kept, soft it is told; judged by NumPy alone.

The judges know poses and times. Speeds are their differences, distances come from points along cables, thrust and
torque from Newton's and Euler's laws with differences of the attitude.
"""

import json
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.models import Robot, load
from towline.ocp import plan

UP = np.array([0, 0, 9.81])
SHARES = np.linspace(0, 1, 101)


def turned(poses):
    return Rotation.from_euler("ZYX", poses[..., 5:2:-1].reshape(-1, 3))


def in_world(poses, points):
    """Points (m, 3) of a body at poses (n, 6), (n, m, 3)."""
    return poses[:, None, :3] + np.einsum("nij,mj->nmi", turned(poses).as_matrix(), points)


def ends(found):
    """Attachments and anchors (n, m, 3)."""
    robot, seen = found.scenario.robot, found.audit
    attachments = in_world(seen.motion.pose, robot.attachments)
    of_carriers = [
        in_world(seen.carriers.pose[:, carrier], [cable.anchor for cable in robot.cables])
        for carrier in range(len(robot.carriers))
    ]
    anchors = [of_carriers[carrier][:, cable] for cable, carrier in enumerate(robot.carrier_of_cable)]
    return attachments, np.stack(anchors, axis=1)


def rate(found, values):
    return np.gradient(values, found.audit.times, axis=0, edge_order=2)


def lengths(found):
    attachments, anchors = ends(found)
    return np.linalg.norm(anchors - attachments, axis=2)


def spin(found, poses):
    """Angular velocity in {G} by differences (n - 1, 3) [rad/s]."""
    R = turned(poses)
    return (R[1:] * R[:-1].inv()).as_rotvec() / np.diff(found.audit.times)[:, None]


def speed(found, poses):
    return np.linalg.norm(rate(found, poses[:, :3]), axis=1)


def acceleration(found, poses):
    return np.linalg.norm(rate(found, rate(found, poses[:, :3]))[3:-3], axis=1)


def felt(found):
    """What a body on the platform feels in the axes of the platform, (n, 3) [m/s^2]."""
    poses = found.audit.motion.pose
    return turned(poses).inv().apply(rate(found, rate(found, poses[:, :3])) + UP)


def tilt(poses):
    return np.arccos(np.clip(turned(poses).apply([0, 0, 1])[:, 2], -1, 1))


def along(start, end):
    return start[..., None, :] + SHARES[:, None] * (end - start)[..., None, :]


def from_box(points, low, high):
    """Distance from a box, zero inside."""
    return np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=-1)


def from_line(points, start, end):
    line = end - start
    share = np.clip(((points - start) * line).sum(axis=-1) / (line**2).sum(axis=-1), 0, 1)
    return np.linalg.norm(points - start - share[..., None] * line, axis=-1)


def cables_apart(found):
    attachments, anchors = (points[::20] for points in ends(found))
    points = along(attachments, anchors)
    robot = found.scenario.robot
    nearest = []
    for i, j in combinations(range(robot.m), 2):
        a, b = robot.cables[i], robot.cables[j]
        if a.attachment != b.attachment and (a.carrier, a.anchor) != (b.carrier, b.anchor):
            nearest.append(from_line(points[:, i], attachments[:, j, None], anchors[:, j, None]).min(axis=1))
    return np.array(nearest)


def body_from_cables(found, start, end):
    """Distance of the cables from a line that rides on the platform, at some instants."""
    attachments, anchors = (points[::10] for points in ends(found))
    poses = found.audit.motion.pose[::10]
    points = along(attachments, anchors)
    seen = turned(poses).inv().as_matrix()[:, None, None] @ (points - poses[:, None, None, :3])[..., None]
    return from_line(seen[..., 0], np.array(start), np.array(end))


def thrust_and_torque(found):
    """Of the only quadrotor, by differences of its motion and the pull of its cables."""
    robot, seen = found.scenario.robot, found.audit
    carrier, poses = robot.carriers[0], seen.carriers.pose[:, 0]
    attachments, anchors = ends(found)
    pull = (attachments - anchors) / np.linalg.norm(attachments - anchors, axis=2)[..., None] * seen.tensions[..., None]
    twice = rate(found, rate(found, poses[:, :3]))
    up = turned(poses).apply([0, 0, 1])
    thrust = ((carrier.mass * (twice + UP) - pull.sum(axis=1)) * up).sum(axis=1)
    xx, yy, zz, xy, xz, yz = carrier.inertia
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    R = turned(poses).as_matrix()
    times = seen.times
    omega = np.stack([np.interp(times, (times[1:] + times[:-1]) / 2, part) for part in spin(found, poses).T], axis=1)
    momentum = np.einsum("nij,jk,nlk,nl->ni", R, inertia, R, omega)
    moment = np.cross(anchors - poses[:, None, :3], pull).sum(axis=1)
    torque = np.einsum("nji,nj->ni", R, rate(found, momentum) - moment)
    return thrust[5:-5], torque[5:-5]


@dataclass(frozen=True)
class Case:
    """A limit, a task in which it matters, and its judge.

    `bound` is how much of the value that the plan without it has is accepted, or how much of it is asked for.
    """

    robot: str
    task: dict[str, Any]
    judge: Any
    given: Any  # the limit's bound -> what it is in `limits`, or in the whole task or robot
    share: float = 0.85
    least: bool = False
    where: str = "limits"
    tolerance: float = 1e-4
    soft: float = 1e3
    about: str = ""


OUT = {  # out and back: what binds binds in the middle
    "path": {"kind": "waypoints", "points": [[0, 0, 1], [0.5, 0.3, 1.3, 0.2, 0.1, 0.3], [0, 0, 1]]},
    "duration": 1.5,
    "steps": 20,
    "tube": {"position": "free", "attitude": "free", "ends": "exact"},
    "objective": {"deviation": 0.1, "jerk": 100},
}
HOME = load("ipanema-2").home
TURN = OUT | {"path": {"kind": "waypoints", "points": [[*HOME], [*HOME[:5], 0.4], [*HOME]]}}
CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.6, "rate": 0.2 * np.pi}
BASE = {"path": CIRCLE, "base": {"kind": "free", "ends": "periodic"}, "steps": 24}
TOWED = {
    "path": {"kind": "line", "start": [1.2, 0.9, 0.3], "end": [1.3, 1.0, 0.5]},
    "duration": 2,
    "steps": 20,
    "base": {"kind": "free", "ends": "rest"},
}
FLOWN = {
    "path": {"kind": "line", "start": [0, 0, -1], "end": [0.25, 0.1, -0.8]},
    "duration": 1.0,
    "steps": 20,
    "base": {"kind": "free", "ends": "rest"},
    "tube": {"position": "free", "attitude": 0.3, "ends": "exact"},
    "objective": {"deviation": 0.3},
}


def platform(found):
    return found.audit.motion.pose


def base(found, index=0):
    return found.audit.carriers.pose[:, index]


MIDDLE = np.array([0.5, 0.3, 1.3])
POLE = {"start": [0.45, 0.0, 0.2], "end": [0.45, 0.0, 0.5]}


def place(kind, who, distance, **shape):
    nobody = {"platform": None, "carriers": None, "cables": None}
    return {"keep_out": [{"kind": kind, "name": kind, **shape, **nobody, who: distance}]}


CASES = {
    "platform_speed": Case("ipanema-1", OUT, lambda p: speed(p, platform(p)), lambda b: {"platform_speed": b}),
    "platform_acceleration": Case(
        "ipanema-1", OUT, lambda p: acceleration(p, platform(p)), lambda b: {"platform_acceleration": b}, tolerance=5e-3
    ),
    "platform_turn": Case(
        "ipanema-1", OUT, lambda p: np.linalg.norm(spin(p, platform(p)), axis=1), lambda b: {"platform_turn": b}
    ),
    "platform_tilt": Case("ipanema-1", OUT, lambda p: tilt(platform(p)), lambda b: {"platform_tilt": b}),
    "platform_box": Case(
        "ipanema-1",
        OUT,
        lambda p: platform(p)[:, 0],
        lambda b: {"platform_box": {"min": [-1, -1, 0], "max": [b, 1, 2]}},
    ),
    "cable_speed": Case("ipanema-1", OUT, lambda p: np.abs(rate(p, lengths(p))), lambda b: {"cable_speed": b}),
    "zone_speed": Case(
        "ipanema-1",
        OUT,
        lambda p: speed(p, platform(p))[np.linalg.norm(platform(p)[:, :3] - [0.3, 0.15, 1.15], axis=1) < 0.15],
        lambda b: {"zone_speed": [{"centre": [0.3, 0.15, 1.15], "radius": 0.15, "speed": b}]},
        tolerance=2e-3,
    ),
    "cable_acceleration": Case(
        "ipanema-1",
        OUT | {"steps": 30},  # fewer were refined
        lambda p: np.abs(rate(p, rate(p, lengths(p)))[3:-3]),
        lambda b: {"cable_acceleration": b},
        tolerance=5e-3,
    ),
    "cable_jerk": Case(
        "ipanema-1",
        OUT,
        lambda p: np.abs(rate(p, rate(p, rate(p, lengths(p))))[6:-6]),
        lambda b: {"cable_jerk": b},
        tolerance=1e-2,
    ),
    "winch_power": Case(
        "ipanema-1",
        OUT,
        lambda p: np.abs(rate(p, lengths(p)) * p.audit.tensions),
        lambda b: {"winch_power": b},
        tolerance=1e-3,
    ),
    "platform_lateral_acceleration": Case(
        "ipanema-1",
        OUT,
        lambda p: np.linalg.norm(felt(p)[3:-3, :2], axis=1),
        lambda b: {"platform_lateral_acceleration": b},
        tolerance=5e-3,
    ),
    "cable_length": Case("ipanema-1", OUT, lengths, lambda b: {"cable_length": {"min": 0, "max": b}}, share=0.97),
    "tension_rate": Case(
        "wang-flying",
        BASE,
        lambda p: np.abs(np.diff(p.audit.tensions, axis=0)) / np.diff(p.audit.times)[:, None],
        lambda b: {"tension_rate": b},
        share=0.6,
        tolerance=2e-3,
    ),
    "cable_clearance": Case(
        "ipanema-2", TURN, cables_apart, lambda b: {"cable_clearance": b}, share=1.3, least=True, tolerance=5e-3
    ),
    "carrier_separation": Case(
        "wang-ctmrts",
        TOWED,
        lambda p: [np.linalg.norm(base(p, i)[:, :3] - base(p, j)[:, :3], axis=1) for i, j in ((0, 1), (0, 2), (1, 2))],
        lambda b: {"carrier_separation": b},
        share=1.03,
        least=True,
    ),
    "keep_out sphere platform": Case(
        "ipanema-1",
        OUT,
        lambda p: 0.3 + np.linalg.norm(platform(p)[:, :3] - MIDDLE, axis=1),
        lambda b: place("sphere", "platform", b - 0.3 - 1e-5, centre=MIDDLE.tolist(), radius=1e-5),
        share=1.15,
        least=True,
    ),
    "keep_out capsule cables": Case(
        "ipanema-1",
        OUT,
        lambda p: from_line(along(*(e[::10] for e in ends(p))), np.array([0, -2.5, 2.0]), np.array([0, 2.5, 2.0])),
        lambda b: place("capsule", "cables", b - 0.05, start=[0, -2.5, 2.0], end=[0, 2.5, 2.0], radius=0.05),
        share=1.1,
        least=True,
        tolerance=5e-3,
    ),
    "keep_out box carriers": Case(
        "wang-flying",
        BASE,
        lambda p: from_box(base(p)[:, :3], np.array([1.0, -1, -1]), np.array([2, 1, 1])),
        lambda b: place("box", "carriers", b, min=[1.0, -1, -1], max=[2, 1, 1]),
        share=1.05,
        least=True,
    ),
    "cable_platform_clearance": Case(
        "wang-flying",
        BASE,
        lambda p: body_from_cables(p, **POLE),
        lambda b: {
            "keep_out": [
                {"kind": "capsule", "name": "pole", "frame": "platform", "radius": 0.01, **POLE}
                | {"cables": b - 0.01, "carriers": None}
            ]
        },
        share=1.05,
        least=True,
        tolerance=5e-3,
    ),
    "carrier_speed": Case("wang-flying", BASE, lambda p: speed(p, base(p)), lambda b: {"speed_max": b}, where="base"),
    "carrier_acceleration": Case(
        "wang-flying",
        BASE,
        lambda p: acceleration(p, base(p)),
        lambda b: {"acceleration_max": b},
        where="base",
        tolerance=5e-3,
    ),
    "carrier_tilt": Case(
        "wang-flying-quadrotor", FLOWN, lambda p: tilt(base(p)), lambda b: {"tilt_max": b}, where="base"
    ),
    "carrier_turn_acceleration": Case(
        "wang-flying-quadrotor",
        FLOWN,
        lambda p: np.abs(rate(p, rate(p, base(p)[:, 3:5])))[3:-3],
        lambda b: {"turn_acceleration_max": b},
        where="base",
        tolerance=2e-2,
    ),
    "carrier_reach": Case(
        "wang-ctmrts",
        TOWED,
        lambda p: base(p)[:, 0],
        lambda b: {"reach": {"min": [b, 0.2, 1.0], "max": [2.4, 0.7, 1.4]}},
        share=1.01,
        least=True,
        about="robot1 along x",
        soft=0.1,
        where="carrier",
    ),
    "thrust": Case(
        "wang-flying-quadrotor",
        FLOWN,
        lambda p: thrust_and_torque(p)[0],
        lambda b: {"thrust_max": b},
        share=0.98,
        where="carrier",
        tolerance=2e-3,
    ),
    "torque": Case(
        "wang-flying-quadrotor",
        FLOWN,
        lambda p: np.abs(thrust_and_torque(p)[1][:, 1]),
        lambda b: {"torque_max": [5, b, 5]},
        share=0.8,
        where="carrier",
        tolerance=3e-2,
    ),
}


def laid_out(case, given, soft):
    """The robot and the task with a limit."""
    robot, task = load(case.robot), dict(case.task)
    limits = {"soft": soft} if soft else {}
    if case.where == "carrier":
        data = robot.model_dump(mode="json")
        data["carriers"][0] |= given
        robot = Robot.model_validate(data)
    elif case.where == "base":
        task["base"] = task["base"] | given
    else:
        limits |= given
    return robot, task | {"limits": limits}


@cache
def planned(robot, task):
    return plan(load(robot), json.loads(task))


def without(name):
    found = planned(CASES[name].robot, json.dumps(CASES[name].task))
    assert found.feasible, found.report()
    return found


def worst(case, found):
    values = np.ravel(case.judge(found))
    return values.min() if case.least else values.max()


@pytest.mark.parametrize("name", CASES)
def test_each_limit(name):
    case = CASES[name]
    before = worst(case, without(name))
    bound = case.share * before
    sign = -1 if case.least else 1
    kept = plan(*laid_out(case, case.given(bound), {}))
    assert kept.feasible, kept.report()
    assert kept.audit.soft_excess == []
    assert sign * (worst(case, kept) - bound) <= case.tolerance * abs(bound)
    named = name.split()[0]
    passed = plan(*laid_out(case, case.given(bound), {named: case.soft}))
    assert passed.feasible, passed.report()
    assert [excess.limit for excess in passed.audit.soft_excess] == [named] * len(passed.audit.soft_excess)
    mine = [excess for excess in passed.audit.soft_excess if excess.about.startswith(case.about)]
    (most, *_) = sorted(mine, key=lambda excess: -abs(excess.value - excess.bound))
    exceeded = worst(case, passed)
    assert sign * (exceeded - bound) > 0.2 * sign * (before - bound)
    if "keep_out" not in name and "clearance" not in name:
        assert abs(most.value) == pytest.approx(exceeded, rel=10 * case.tolerance)
        assert abs(most.bound) == pytest.approx(bound, rel=1e-6)
