"""Limits of a task: distances by brute force, rates by differences, quadrotors by forward dynamics."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from towline.base.errors import InputError
from towline.control import stop
from towline.models import Dynamics, Robot, load
from towline.models.parsing import parse_yaml, to_yaml
from towline.ocp import plan, read_task, time_along
from towline.ocp.limits.cables import CableSpeed
from towline.ocp.limits.clearance import between_cables, cable_outside, point_outside
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import Task
from towline.ocp.tasks.task_limits import Block, Capsule, Sphere
from towline.statics.winch_forces import overloaded_winch

SHARES = np.linspace(0, 1, 201)
points = arrays(np.float64, (4, 3), elements=st.floats(-2, 2).map(lambda x: round(x, 3)))


def along(start, end):
    return start + SHARES[:, None] * (end - start)


@settings(deadline=None)
@given(ends=points)
def test_cables_are_as_far_apart_as_their_points(ends):
    p, p_end, q, q_end = ends
    lengths = np.linalg.norm(p_end - p), np.linalg.norm(q_end - q)
    if min(lengths) < 0.1:
        return
    apart = np.linalg.norm(along(p, p_end)[:, None] - along(q, q_end)[None], axis=2).min()
    told = float(between_cables(*(ca.DM(point) for point in ends)))
    # The samples are up to half a step off, and parallel lines are told apart by a billionth.
    assert told <= apart + 1e-4
    assert told >= apart - max(lengths) / 200 - 1e-4


@settings(deadline=None)
@given(ends=points)
def test_obstacles_are_as_far_as_their_points_say(ends):
    p, p_end, centre, corner = ends
    sphere = Sphere(kind="sphere", centre=tuple(centre), radius=0.3)
    step = np.linalg.norm(p_end - p) / 200 + 1e-5
    truth = np.linalg.norm(along(p, p_end) - centre, axis=1) - 0.3
    assert float(point_outside(sphere, ca.DM(p))) == pytest.approx(truth[0], abs=1e-5)
    assert truth.min() - step <= float(cable_outside(sphere, ca.DM(p), ca.DM(p_end))) <= truth.min() + 1e-5
    if np.linalg.norm(corner - centre) > 0.1:
        capsule = Capsule(kind="capsule", start=tuple(centre), end=tuple(corner), radius=0.2)
        truth = np.linalg.norm(p - along(centre, corner), axis=1).min() - 0.2
        assert truth - 0.02 <= float(point_outside(capsule, ca.DM(p))) <= truth + 1e-5
    low, high = np.minimum(centre, corner), np.maximum(centre, corner) + 0.1
    box = Block(kind="box", min=tuple(low), max=tuple(high))
    outside = np.linalg.norm(np.maximum(np.maximum(low - p, p - high), 0))
    told = float(point_outside(box, ca.DM(p)))
    deep = np.maximum(low - p, p - high).max()  # of a point inside, from the nearest face
    assert told == pytest.approx(outside if outside > 0 else deep, abs=2e-6)
    told = float(cable_outside(box, ca.DM(p), ca.DM(p_end)))
    points = along(p, p_end)
    truth = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1).min()
    if truth > step:
        assert truth - step <= told <= truth + 2e-6
    else:
        deepest = np.maximum(low - points, points - high).max(axis=1).min()
        assert deepest - step <= told <= truth + 2e-6


@settings(deadline=None)
@given(ends=points)
def test_a_program_can_follow_the_distance_of_a_cable_from_a_box(ends):
    """Its derivatives are those of differences, though a search finds where the cable is nearest."""
    box = Block(kind="box", min=(-0.3, -0.2, -0.1), max=(0.3, 0.4, 0.5))
    x = ca.SX.sym("x", 6)
    distance = cable_outside(box, x[:3], x[3:])
    value, slope = (ca.Function("f", [x], [f]) for f in (distance, ca.gradient(distance, x)))
    at = ends[:2].ravel()
    if np.linalg.norm(at[3:] - at[:3]) < 0.1 or float(value(at)) < 0.05:
        return
    size = 1e-5
    ahead = np.array([(float(value(at + h)) - float(value(at))) / size for h in size * np.eye(6)])
    behind = np.array([(float(value(at)) - float(value(at - h))) / size for h in size * np.eye(6)])
    told = slope(at).full().ravel()
    # Along a face many points are nearest: then the two differ, and what is told lies between.
    assert (np.minimum(ahead, behind) - 1e-3 <= told).all()
    assert (told <= np.maximum(ahead, behind) + 1e-3).all()


def test_a_cable_through_the_edge_of_a_thin_box_is_seen():
    """It is inside for a hundredth of its length, between any samples that one would take."""
    box = Block(kind="box", min=(0.503, -1, -1), max=(0.513, 1, 1))
    start, end = np.array([0.0, 0, 0]), np.array([1.0, 0, 0])
    assert float(cable_outside(box, ca.DM(start), ca.DM(end))) == pytest.approx(-0.005, abs=1e-9)
    x = ca.SX.sym("x", 3)
    slope = ca.Function("slope", [x], [ca.gradient(cable_outside(box, x, x + ca.DM(end)), x)])
    assert np.isfinite(slope(start).full()).all()


def test_winch_speeds_are_differences_of_lengths():
    robot = load("ipanema-1")
    path = {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.3]}
    found = plan(robot, {"path": path, "duration": 1.0, "limits": {"cable_speed": 9.0, "platform_speed": 9.0}})
    seen = found.audit
    limits = [limit for limit in found.scenario.limits if not limit.name.startswith("tube")]
    assert [limit.name for limit in limits] == ["cable_speed", "platform_speed"]
    lengths = found.scenario.dynamics.cable_lengths(seen.motion.pose, seen.carriers.pose)
    by_difference = np.gradient(lengths, seen.times, axis=0)[1:-1]
    cables, platform = seen.limited[:2]
    np.testing.assert_allclose(cables[1:-1], by_difference, atol=1e-4)
    np.testing.assert_allclose(platform[:, 0], np.linalg.norm(seen.motion.velocity[:, :3], axis=1), atol=1e-8)
    slow = plan(robot, {"path": path, "duration": 1.0, "limits": {"cable_speed": 0.5}})
    assert not slow.feasible
    assert [excess.limit for excess in slow.audit.excess] == ["cable_speed"]
    soft = plan(robot, {"path": path, "duration": 1.0, "limits": {"cable_speed": 0.5, "soft": {"cable_speed": 0.1}}})
    assert soft.feasible
    assert soft.audit.soft_excess


def test_winches_of_the_robot_file_limit_the_speeds_of_their_cables():
    plain = load("planar-4")
    line = {"path": {"kind": "line", "start": [-0.3, 0, 0.1], "end": [0.3, 0, -0.2]}, "duration": 1}
    planned = plan(plain, line).trajectory
    lengths = Dynamics(plain).cable_lengths(planned["pose"].values, planned["carrier_pose"].values)
    fastest = np.abs(np.gradient(lengths, planned["time"].values, axis=0)).max(axis=0)  # (m,) [m/s]

    def status(speeds):
        winch = {"inertia": 1, "force_max": 1000}
        data = plain.model_dump()
        cables = [{**c, "winch": {**winch, "speed_max": v}} for c, v in zip(data["cables"], speeds, strict=True)]
        found = plan(Robot.model_validate({**data, "cables": cables}), line)
        return found.status, [(excess.limit, excess.about) for excess in found.audit.excess]

    assert status(1.01 * fastest) == ("feasible", [])
    assert status(fastest * [1.01, 1.01, 0.97, 1.01]) == ("infeasible", [("cable_speed", "cable 3")])


def test_motors_of_winches_pull_and_accelerate_their_winches():
    """A mass on one cable: its motor needs m (g + a) for the tension, J a for the winch, and its friction."""
    mass, inertia, friction, rise = 2.0, 3.0, 4.0, 0.5

    def robot(force):
        winch = {"inertia": inertia, "friction": friction, "speed_max": 9, "force_max": force}
        ends = {"carrier": "frame", "anchor": [0, 0, 2], "attachment": [0, 0, 0]}
        return Robot.model_validate(
            {
                "name": "hoist",
                "source": "test",
                "platform": {"mass": mass, "dof": ["z"], "home": [0, 0, 0, 0, 0, 0]},
                "carriers": [{"name": "frame", "kind": "ground"}],
                "cables": [{**ends, "t_min": 1, "t_max": 60, "winch": winch}],
            }
        )

    line = {"path": {"kind": "line", "start": [0, 0, 0], "end": [0, 0, rise]}, "duration": 0.8}
    largest = 84 * np.sqrt(5) / 25 * rise / 0.8**2  # acceleration of a time law of seventh degree
    needed = mass * (9.81 + largest) + inertia * largest + friction
    assert plan(robot(1.01 * needed), line).feasible
    slack = plan(robot(0.99 * needed), line)
    assert [(each.limit, each.about) for each in slack.audit.excess] == [("winch_force", "cable 1")]
    assert slack.audit.excess[0].value == pytest.approx(needed - friction, rel=1e-3)
    # Motors that cannot lift the mass at rest are no matter of inertia: tensions are missing, with a proof.
    assert plan(robot(0.99 * mass * 9.81 + friction), line).certificate is not None
    weak = robot(0.8 * needed)
    fast = time_along(weak, line)
    assert fast.feasible
    for motion in (fast.trajectory, stop(fast, 0.6 * fast.duration).trajectory):
        length = 2 - motion["pose"].values[:, 2]
        times = motion["time"].values
        acceleration = np.gradient(np.gradient(length, times), times)
        force = motion["tensions"].values[:, 0] - inertia * acceleration
        assert force.max() <= 1.01 * (0.8 * needed - friction)
    # Half of the deceleration alone would need more: what the motor of a weaker robot misses is named.
    given = {"times": fast.trajectory["time"].values, "length": 2 - fast.trajectory["pose"].values[:, 2]}
    acceleration = np.gradient(np.gradient(given["length"], given["times"]), given["times"])
    at_rest = np.full(len(acceleration), mass * 9.81)
    largest = np.abs(at_rest - inertia * acceleration).max()
    for force, named in ((1.01 * largest + friction, False), (0.99 * largest + friction, True)):
        text = overloaded_winch(robot(force), given["times"], given["length"][:, None], at_rest[:, None])
        assert bool(text) == named
        assert not named or f"is {largest:.4g} N" in text


def test_a_place_is_kept_out_of():
    robot = load("ipanema-1")
    task = {
        "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.3]},
        "duration": 1.5,
        "steps": 40,
        "tube": {"position": "free", "ends": "exact"},
        "objective": {"deviation": 1.0},
    }
    through = plan(robot, task)
    middle = through.audit.motion.pose[len(through.audit.times) // 2, :3]
    post = {"kind": "sphere", "name": "post", "centre": middle.tolist(), "radius": 0.1, "cables": None}
    around = plan(robot, task | {"limits": {"keep_out": [post]}})
    assert around.feasible

    def nearest(found):
        return np.linalg.norm(found.audit.motion.pose[:, :3] - middle, axis=1).min()

    assert nearest(through) < 0.1 <= nearest(around) + 1e-6


def test_quadrotors_move_as_forward_dynamics_moves_them():
    """The thrust and torque that the plan stands for give the accelerations that it has."""
    robot = load("wang-flying-quadrotor")
    start = robot.home.tolist()
    task = {"path": {"kind": "line", "start": start, "end": [1.5, 0.5, *start[2:]]}, "duration": 3.0, "steps": 60}
    found = plan(robot, task | {"base": {"kind": "free", "ends": "rest"}})
    assert found.feasible, found.report()
    seen, scenario = found.audit, found.scenario
    names = [limit.name for limit in scenario.limits]
    first = names.index("thrust")
    assert names[first : first + 5] == ["thrust", "force perpendicular to the thrust", "torque", "torque", "torque"]
    asked = np.hstack(seen.limited[first : first + 5])
    carrier = robot.carriers[0]
    assert asked[:, 0].max() <= carrier.thrust_max
    assert np.abs(asked[:, 3:]).max() <= max(carrier.torque_max)
    nodes = np.linspace(0, len(seen.times) - 1, 61).astype(
        int
    )  # between them a little force perpendicular to the thrust is missing
    for row in nodes[::10]:
        platform, base = scenario.dynamics.coupled_acceleration(
            seen.motion.pose[row],
            seen.motion.velocity[row],
            seen.carriers.pose[row],
            seen.carriers.velocity[row],
            seen.tensions[row],
            asked[row, :1],
            asked[row, 3:6][None],
        )
        np.testing.assert_allclose(platform, seen.motion.acceleration[row], atol=1e-6)
        np.testing.assert_allclose(base, seen.carriers.acceleration[row], atol=2e-2)


@pytest.mark.parametrize(
    ("limit", "message"),
    [
        ({"cable_speed": -1}, "limits.cable_speed"),
        ({"soft": {"cable_speed": 1}}, "got 'cable_speed'"),
        ({"keep_out": [{"kind": "box", "min": [0, 0, 0], "max": [0, 1, 1]}]}, "must be smaller than max"),
        ({"keep_out": [{"kind": "cone"}]}, "limits.keep_out"),
        ({"cable_length": {"min": 2, "max": 1}}, "min must be at most max"),
    ],
)
def test_wrong_limits_are_one_line(limit, message):
    with pytest.raises(InputError) as caught:
        lay_out(load("ipanema-1"), Task.model_validate({"path": {"kind": "rest", "pose": [0, 0, 1]}, "limits": limit}))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_saved_task_keeps_distances_that_are_null():
    place = {"kind": "sphere", "centre": [1, 1, 1], "radius": 0.1, "cables": None, "platform": None}
    task = read_task({"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 1, "limits": {"keep_out": [place]}})
    assert parse_yaml(to_yaml(task), Task, "task") == task


def test_a_limit_of_some_cables_names_these():
    bounds = [2.0, None, 1.0, None, 1.0, None, None, 2.0]
    limits = list(CableSpeed.each(load("cogiro"), bounds))
    assert [limit.high for limit in limits] == [2.0, 1.0]
    assert [limit.labels for limit in limits] == [("cable 1", "cable 8"), ("cable 3", "cable 5")]
