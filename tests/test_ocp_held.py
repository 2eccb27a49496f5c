"""Motions that start, end or pass exactly on a limit have tightened programs too: the limit itself holds there."""

from copy import deepcopy

import numpy as np
import pytest

from towline import plan
from towline.models import Dynamics, Robot, load
from towline.ocp.nlp.held import held_spans
from towline.ocp.nlp.program import build
from towline.ocp.nlp.rows import Mesh
from towline.ocp.nlp.solver import Solver
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task

STEPS, SHRINK, RESERVE = 40, 6e-3, 3e-3  # as in a late refinement: 6 mm, and 0.3 % of the weight


def line(name, off=(0.3, 0.2, 0.0), **task):
    """A line from the home of a robot, at rest at both ends, in free space."""
    start = load(name).home
    end = start + np.r_[off, 0, 0, 0]
    path = {"kind": "line", "start": start.tolist(), "end": end.tolist()}
    return {"path": path, "duration": 2.0, "tube": {"position": "free"}, "steps": STEPS, **task}


def attachments(name):
    """The attachments of a robot at home, which is level, in {G}."""
    robot = load(name)
    assert not robot.home[3:].any()
    return robot.home[:3] + robot.attachments


def on_the_floor(name):
    """Start and end on the floor of the box, and up in between past a ball."""
    start = load(name).home[:3]
    box = {"min": [-9, -9, float(start[2])], "max": [9, 9, 9]}
    return line(name, limits={"platform_box": box})


def at_a_place(name, kind):
    """The lowest attachment touches a place at the start, and the motion leads along it."""
    low = attachments(name)
    x, y, z = low[low[:, 2].argmin()]
    shapes = {
        "sphere": {"centre": [x, y, z - 0.2], "radius": 0.2},
        "box": {"min": [x - 9, y - 9, z - 1], "max": [x + 9, y + 9, z]},
        "capsule": {"start": [x - 3, y, z - 0.1], "end": [x + 3, y, z - 0.1], "radius": 0.1},
    }
    return line(name, limits={"keep_out": [{"kind": kind, **shapes[kind], "cables": None}]})


def at_a_thin_place(name):
    """The same with a sheet, from which the program keeps the straight way between two nodes."""
    low = attachments(name)[:, 2].min()
    sheet = {"kind": "box", "min": [-9, -9, float(low) - 1e-3], "max": [9, 9, float(low)], "cables": None}
    return line(name, off=(0.3, 0.2, 0.1), limits={"keep_out": [sheet]})


def at_cable_length(name):
    """A cable is as long as it may be at the start."""
    robot = load(name)
    shortest = Dynamics(robot).cable_lengths(robot.home).max()
    return line(name, off=(0, 0, 0.3), limits={"cable_length": {"min": 0.01, "max": float(shortest)}})


def at_speed(name):
    """The motion starts with the largest speed."""
    initial = {"pose": load(name).home.tolist(), "velocity": [0.3, 0, 0, 0, 0, 0]}
    return line(name, initial=initial, limits={"platform_speed": 0.3})


def on_the_floor_between(name):
    """A point on the way that is passed exactly is on the floor of the box."""
    start = load(name).home
    points = [(start + np.r_[x, 0, z, 0, 0, 0]).tolist() for x, z in ((0, 0.1), (0.2, 0), (0.4, 0.1))]
    box = {"min": [-9, -9, float(start[2])], "max": [9, 9, 9]}
    task = line(name, limits={"platform_box": box}) | {"path": {"kind": "waypoints", "points": points}}
    return task | {"tube": {"position": 0.1, "waypoints": "exact"}}


def put_down(name):
    """In three phases: the platform is on the ground between two moves, on the floor of the box."""
    start = load(name).home
    up, down = (start + np.r_[x, 0, z, 0, 0, 0] for x, z in ((0, 0.1), (0.2, 0)))
    move = {"kind": "line", "start": up.tolist(), "end": down.tolist()}
    back = {"kind": "line", "start": down.tolist(), "end": up.tolist()}
    phases = [
        {"name": "down", "duration": 1.5, "path": move},
        {"name": "ground", "duration": 0.5, "ground": {}},
        {"name": "up", "duration": 1.5, "path": back},
    ]
    box = {"min": [-9, -9, float(start[2])], "max": [9, 9, 9]}
    return {"phases": phases, "steps": STEPS, "tube": {"position": 0.1}, "limits": {"platform_box": box}}


def slack_at_home():
    """A point mass that hangs at home with the smallest tension that its cables may have."""
    given = load("point-mass-3").model_dump(mode="json")
    robot = load("point-mass-3")
    A, still = Dynamics(robot).wrench_matrix(robot.home), np.zeros(6)
    w = Dynamics(robot).required_wrench(robot.home, still, still)
    tensions = np.linalg.lstsq(A[:3], w[:3], rcond=None)[0]
    given = deepcopy(given)
    for cable, tension in zip(given["cables"], tensions, strict=True):
        cable["t_min"] = float(tension)
    return Robot.model_validate(given)


CASES = {
    "cogiro on the floor": lambda: ("cogiro", on_the_floor("cogiro")),
    "team on the floor": lambda: (
        "multi-quadrotor-3",
        on_the_floor("multi-quadrotor-3") | {"base": {"kind": "free"}, "duration": 4.0, "steps": 20},
    ),
    "ipanema at a ball": lambda: ("ipanema-1", at_a_place("ipanema-1", "sphere")),
    "caroca on a box": lambda: ("caroca", at_a_place("caroca", "box")),
    "cogiro at a capsule": lambda: ("cogiro", at_a_place("cogiro", "capsule")),
    "ipanema on a sheet": lambda: ("ipanema-1", at_a_thin_place("ipanema-1")),
    "point mass with its longest cable": lambda: ("point-mass-3", at_cable_length("point-mass-3")),
    "cogiro at its speed": lambda: ("cogiro", at_speed("cogiro")),
    "point mass at t_min": lambda: (slack_at_home(), line("point-mass-3", off=(0.0, 0.0, 0.4))),
    "ipanema on the floor at a point": lambda: ("ipanema-1", on_the_floor_between("ipanema-1")),
    "cogiro puts down": lambda: ("cogiro", put_down("cogiro")),
}


@pytest.mark.parametrize("case", CASES)
def test_a_tightened_program_has_a_motion_from_its_limit(case):
    """And it is tightened where the motion is free: in its middle no value is nearer to its bound than that."""
    robot, task = CASES[case]()
    robot = load(robot) if isinstance(robot, str) else robot
    scenario = lay_out(robot, read_task(task))
    mesh = Mesh(scenario.task.steps, RESERVE * robot.force_scale, SHRINK)
    program = build(scenario, mesh)
    outcome = Solver(program).solve(None)
    assert outcome.success, outcome.message
    times = outcome.deviation.nodes[[mesh.steps // 4, 3 * mesh.steps // 4]]
    motion = scenario.lasting(outcome.duration).motion(times, outcome.deviation)
    for limit, values in zip(scenario.limits, scenario.limits.along(*motion), strict=True):
        if limit.name in ("platform_box", "keep_out", "cable_length"):
            inside = np.minimum(values - limit.low, limit.high - values)
            assert inside.min() >= SHRINK * limit.scale - 1e-6


@pytest.mark.parametrize("where", ["initial", "final"])
def test_a_motion_that_meets_the_largest_cable_speed_at_an_end_is_not_faster_beside_it(where):
    """The acceleration there is free: between the nodes a motion left the limit on every mesh up to 320 steps."""
    robot = load("ipanema-1")
    home, velocity, off = robot.home, np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0]), np.array([0.4, 0.0, 0.0, 0.0, 0.0, 0.0])
    lengths = Dynamics(robot).cable_lengths
    fastest = np.abs(lengths(home + 1e-7 * velocity) - lengths(home - 1e-7 * velocity)).max() / 2e-7
    ends = [home, home + off] if where == "initial" else [home + off, home]
    found = plan(
        robot,
        {
            "path": {"kind": "line", "start": ends[0].tolist(), "end": ends[1].tolist()},
            "duration": 3.0,
            "steps": 20,
            "tube": {"position": "free", "attitude": 0.1},
            "limits": {"cable_speed": fastest * (1 + 1e-9)},
            where: {"pose": home.tolist(), "velocity": velocity.tolist()},
        },
    )
    assert found.feasible, found.reason
    pose, times = found.audit.motion.pose, found.audit.times
    rates = np.diff([lengths(at) for at in pose], axis=0) / np.diff(times)[:, None]
    assert np.abs(rates).max() < fastest * (1 + 1e-5)


def test_only_the_end_that_meets_a_limit_is_held():
    """The other end rests, far below the largest speed: there the program is tightened as elsewhere."""
    task = {
        "path": {"kind": "line", "start": [0, 0, 1], "end": [1, 0, 1]},
        "duration": 4.0,
        "tube": {"position": "free"},
        "limits": {"platform_speed": 0.3},
        "initial": {"pose": [0, 0, 1], "velocity": [0, 0.3, 0]},
    }
    spans = held_spans(lay_out(load("cogiro"), read_task(task)), lambda _: SHRINK)
    assert [its for limit, its in spans.items() if limit.name == "platform_speed"] == [((0.0, 0.0),)]


def test_a_start_at_the_largest_speed_turns_no_faster_between_the_nodes():
    """Three cables determine the tensions: as fast as possible they jump from one limit to the other.

    On each finer mesh the parabola of an interval went beyond both limits, by as much as on a coarse one.
    """
    robot = load("point-mass-3")
    start, end = [-0.3, 0, 1], [0.3, 0.1, 1.2]
    task = {
        "path": {"kind": "line", "start": start, "end": end},
        "duration": {"min": 0.2, "max": 20},
        "objective": {"time": 0.2, "jerk": 1000},
        "tube": {"position": "free"},
        "initial": {"pose": [*start, 0, 0, 0], "velocity": [0, 0, 0.3, 0, 0, 0]},
        "limits": {"platform_speed": 0.3},
        "scheme": "hermite",
        "steps": 20,
    }
    found = plan(robot, task)
    assert found.feasible, found.reason
    times = np.linspace(0.0, found.duration, 50_001)
    platform, _ = found.scenario.motion(times, found.deviation)
    assert np.linalg.norm(platform.velocity[:, :3], axis=1).max() < 0.3 * (1 + 1e-5)
    force = robot.platform.mass * (platform.acceleration[:, :3] - np.array(robot.gravity))
    along = robot.home_anchors - platform.pose[:, None, :3] - robot.attachments
    units = along / np.linalg.norm(along, axis=2, keepdims=True)
    tensions = np.linalg.solve(units.swapaxes(1, 2), force[..., None])[..., 0]
    assert (tensions > robot.t_min - 1e-3).all()
    assert (tensions < robot.t_max + 1e-3).all()
    # The way at the largest speed is a lower bound; what the turns at both ends take is little.
    assert found.duration < 1.06 * np.linalg.norm(np.subtract(end, start)) / 0.3
