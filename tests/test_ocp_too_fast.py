"""A motion is proven too fast only if no motion is slow enough, and then if its ends alone show it."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline.models import Dynamics, Robot, load
from towline.ocp import MotionStatus, plan
from towline.ocp.limits.cables import WinchPower
from towline.ocp.proofs.infeasible_ends import infeasible_ends
from towline.ocp.proofs.too_fast import too_fast
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task

ROBOT = load("ipanema-1")
TIMES = np.linspace(0.0, 2.0, 41)
FINE = np.linspace(0.0, 2.0, 801)


def scenario(speed, acceleration, **limits):
    """A laid-out task with limits of the platform and others; its path does not matter here."""
    limits |= {"platform_speed": speed, "platform_acceleration": acceleration}
    return lay_out(ROBOT, read_task({"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 2, "limits": limits}))


def exceeded(limited, places, spread, rests):
    """The names of the limits that are proven exceeded."""
    poses = np.zeros((1 + len(ROBOT.carriers), len(TIMES), 6))
    poses[0, :, :3] = places
    off = np.zeros(poses.shape[:2])
    off[0] = spread
    return {excess.limit for excess in too_fast(limited, TIMES, poses, off, *[np.array([rests])] * 2)}


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_a_motion_that_exists_is_never_proven_too_fast(seed, rests):
    """Any motion inside a tube about places, with its own largest speeds and accelerations as limits."""
    rng = np.random.default_rng(seed)
    if rests:  # u^2 (3 - 2 u) of a straight line: at rest at both ends
        end, u = rng.uniform(-1, 1, 3), FINE / 2
        motion = (u**2 * (3 - 2 * u))[:, None] * end
        places = motion[::20] + rng.uniform(-0.1, 0.1, (41, 3))
    else:
        waves = np.sin(rng.uniform(0, 10, (5, 1)) * FINE + rng.uniform(0, 6, (5, 1)))
        motion = (rng.uniform(-0.1, 0.1, (3, 5)) @ waves).T
        places = motion[::20] + rng.uniform(-0.2, 0.2, (41, 3))
    spread = np.linalg.norm(places - motion[::20], axis=1)
    step = FINE[1]
    speed = np.linalg.norm(np.diff(motion, axis=0), axis=1).max() / step
    acceleration = np.linalg.norm(np.diff(motion, 2, axis=0), axis=1).max() / step**2
    poses = np.column_stack([motion, np.zeros_like(motion)])
    lengths = Dynamics(ROBOT).cable_lengths(poses, np.tile(ROBOT.carrier_home, (len(FINE), 1, 1)))
    of_cables = np.abs(np.diff(lengths, 2, axis=0)).max() / step**2
    limited = scenario(speed * (1 + 1e-3), acceleration * (1 + 1e-2), cable_acceleration=of_cables * (1 + 1e-2))
    assert not exceeded(limited, places, spread, rests)


def test_a_cable_rests_only_where_both_of_its_ends_do():
    """A carrier that moves evenly accelerates the cables to a platform at rest by less than 4 d / T^2."""
    poses = np.zeros((2, len(TIMES), 6))
    poses[1, :, 0] = 0.25 * TIMES
    lengths = Dynamics(ROBOT).cable_lengths(poses[0], poses[1:].swapaxes(0, 1))
    most = np.abs(np.diff(lengths, 2, axis=0)).max() / TIMES[1] ** 2
    limited, rests = scenario(100, 100, cable_acceleration=1.01 * most), np.array([True, False])
    assert most < 0.3 * 4 * np.ptp(lengths, axis=0).max() / TIMES[-1] ** 2
    assert not list(too_fast(limited, TIMES, poses, np.zeros(poses.shape[:2]), rests, rests))


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_the_bounds_between_two_rests_are_those_of_constant_speed_and_of_bang_bang(share):
    """Over d in T: the speed is at least d / T; the acceleration at least 4 d / T^2, which bang-bang control has."""
    places = np.zeros((41, 3))
    places[-1] = [0.6, 0.0, 0.8]
    spread = np.full(41, np.inf)
    spread[[0, -1]] = 0.0
    assert exceeded(scenario(0.5 * share, 100), places, spread, True) == ({"platform_speed"} if share < 1 else set())
    of_acceleration = {"platform_acceleration"} if share < 1 else set()
    assert exceeded(scenario(100, 1.0 * share), places, spread, True) == of_acceleration
    assert not exceeded(scenario(100, 1.0 * share), places, spread, False)


@pytest.mark.parametrize("name", ["platform_acceleration", "cable_acceleration"])
def test_a_circle_that_leaves_its_platform_behind_at_the_start_is_proven_too_fast(name):
    """From rest the platform goes a t^2 / 2 at most, and may be the tube's radius behind the circle."""
    radius, rate, tube = 0.3, 1.0, 0.1
    path = {"kind": "circle", "centre": [0, 0, 1], "radius": radius, "rate": rate}
    task = {"path": path, "tube": {"position": tube, "ends": "rest"}, "limits": {name: 1e6}}
    times = np.linspace(0.01, 2, 500)
    poses = np.zeros((501, 6))
    poses[1:, :3] = radius * np.column_stack([np.cos(rate * times), np.sin(rate * times), 0 * times])
    poses[0, 0] = radius
    poses[:, 2] = 1.0
    moved = 2 * radius * np.sin(rate * times / 2)[:, None]
    if name == "cable_acceleration":
        lengths = Dynamics(ROBOT).cable_lengths(poses, np.tile(ROBOT.carrier_home, (501, 1, 1)))
        moved = np.abs(lengths[1:] - lengths[0])
    least = (2 * (moved - tube) / times[:, None] ** 2).max()  # at the end, by symmetry in time, a similar one
    for share in (0.5, 0.97):
        task["limits"][name] = share * least
        proof = infeasible_ends(lay_out(ROBOT, read_task(task)))
        assert {excess.limit for excess in proof.excess} == {name}
    for limits in ({name: 1.5 * least}, {"cable_jerk": 0.5 * least}):  # a jerk is no acceleration
        assert infeasible_ends(lay_out(ROBOT, read_task(task | {"limits": limits}))) is None


def test_planning_ends_at_once_and_offers_a_duration():
    path = {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 1.2]}
    task = {"path": path, "duration": 1, "steps": 12, "tube": {"position": 0.05}, "limits": {"platform_speed": 0.3}}
    planned = plan(ROBOT, task)
    assert planned.status is MotionStatus.INFEASIBLE
    assert [stage.name for stage in planned.stages] == ["ends and path"]
    longer = {relaxed.name: relaxed.possible for relaxed in planned.relaxations}["duration"]
    assert longer > np.linalg.norm([0.5, 0.3, 0.2]) / 0.3
    assert plan(ROBOT, task | {"duration": longer}).feasible


def test_cables_are_too_fast_where_their_lengths_change_too_much():
    """The lengths at both ends are known where the platform is, whatever it does between."""
    path = {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 1.2]}
    task = {"path": path, "duration": 2, "tube": {"position": "free"}, "steps": 20}
    poses = np.array([[*path["start"], 0, 0, 0], [*path["end"], 0, 0, 0]])
    home = np.tile(ROBOT.carrier_home, (2, 1, 1))
    change = np.abs(np.diff(Dynamics(ROBOT).cable_lengths(poses, home), axis=0)).max()
    assert (
        plan(ROBOT, task | {"limits": {"cable_speed": 0.98 * change / 2}}).stages[0].message.startswith("cable_speed")
    )
    assert not plan(ROBOT, task | {"limits": {"cable_speed": 3 * change / 2}}).stages[0].message


@pytest.mark.parametrize("height", [0.5, -0.5])
def test_a_duration_is_too_short_for_cable_and_gravity(height):
    """Bang-bang control of a mass on a vertical cable takes T^2 = 2 d (m / (t_max - m g) + m / (m g - t_min))."""
    mass, t_min, t_max = 2.0, 1.0, 40.0
    cable = {"carrier": "frame", "anchor": [0, 0, 4], "attachment": [0, 0, 0], "t_min": t_min, "t_max": t_max}
    robot = Robot(
        name="mass",
        source="test",
        platform={"mass": mass, "dof": ["z"], "home": [0, 0, 0, 0, 0, 0]},
        carriers=[{"name": "frame", "kind": "ground"}],
        cables=[cable],
    )
    weight = 9.81 * mass
    seconds = np.sqrt(2 * abs(height) * mass * (1 / (t_max - weight) + 1 / (weight - t_min)))
    task = {"path": {"kind": "line", "start": [0, 0, 0], "end": [0, 0, height]}, "tube": {"position": 0.1}, "steps": 40}
    planned = plan(robot, task | {"duration": 0.99 * seconds})
    assert planned.status is MotionStatus.INFEASIBLE
    (excess,) = planned.audit.excess
    assert (excess.limit, excess.bound) == ("duration", pytest.approx(seconds, rel=1e-4))
    (offer,) = planned.relaxations
    assert offer.name == "duration"
    assert plan(robot, task | {"duration": offer.possible}).feasible
    assert plan(robot, task | {"duration": 1.03 * seconds}).feasible


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_range_of_durations_leaves_the_time_law_to_the_planner(share):
    """The path's own law needs 7.5 d / T^2 where bang-bang needs 4 d / T^2: only less than that is too little."""
    most = 2 * share * np.sqrt(1.0 / 1.25)
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": [1, 0, 1]}, "duration": {"min": 0.1, "max": most}}
    task |= {"objective": {"time": 1}, "limits": {"platform_acceleration": 1.25}}
    proof = infeasible_ends(lay_out(ROBOT, read_task(task)).lasting(most))
    assert (proof is not None) == (share < 1)


def test_suspended_platforms_fall_no_faster_than_gravity_lets_them():
    """Half-way the platform is 0.9 m lower than at its rests, within 0.1 m: at least sqrt(2 * 0.7 m / g) from each."""
    task = {"path": {"kind": "waypoints", "points": [[0, 0, 3], [0, 0, 2.1], [0, 0, 3]]}, "tube": {"position": 0.1}}
    robot = load("cogiro")
    proof = infeasible_ends(lay_out(robot, read_task(task | {"duration": 0.6})))
    (excess,) = proof.excess
    assert excess.limit == "duration"
    assert 2 * np.sqrt(2 * 0.7 / 9.81) < excess.bound < 1.5
    assert infeasible_ends(lay_out(robot, read_task(task | {"duration": 1.5}))) is None


def test_a_short_turn_about_an_origin_is_feasible_though_the_centre_of_mass_is_elsewhere():
    """The centre of mass moves at both ends too: it is not accelerated from rest but kept on a circle by 4.5 m/s^2."""
    robot, arm, rate = load("cogiro"), 0.5, 3.0
    robot = robot.model_copy(update={"platform": robot.platform.model_copy(update={"com": (arm, 0, 0)})})
    turn = 2 * arm * rate**2 / (robot.t_max.sum() / robot.platform.mass + 9.81)  # half of what is proven from rest
    home, turning = [*robot.home[:3], 0, 0, 0], [0, 0, 0, 0, 0, rate]
    task = {
        "path": {"kind": "rest", "pose": home},
        "duration": turn / rate,
        "tube": {"position": 0.01, "attitude": 0.1},
        "steps": 8,
        "initial": {"pose": home, "velocity": turning},
        "final": {"pose": [*home[:5], turn], "velocity": turning},
    }
    assert plan(robot, task).feasible


def test_a_power_that_no_tensions_need_is_the_least_that_is_feasible():
    """A percent less is proven infeasible; with a little more an audit finds tensions, without a program."""
    robot = load("ipanema-1")
    start = np.array(robot.home[:3])
    line = {"kind": "line", "start": start.tolist(), "end": (start + np.array([0.3, 0.0, 0.2])).tolist()}
    task = {"path": line, "duration": 1.0}

    def planned(power):
        return plan(robot, task | {"limits": {"winch_power": power}})

    (excess,) = planned(0.01).audit.excess
    least = excess.value
    rate, moment = 1e-4, excess.time
    poses = lay_out(robot, read_task(task)).path.at(moment + rate * np.array([-1.0, 0.0, 1.0]), 1.0)
    before, _, after = Dynamics(robot).cable_lengths(poses.pose)
    assert planned(0.99 * least).status is MotionStatus.INFEASIBLE
    both = {"winch_power": 0.99 * least, "own": (WinchPower(robot, 2 * least),)}
    assert plan(robot, task | {"limits": both}).audit.excess[0].value == pytest.approx(least)
    faster = {"duration": {"min": 0.4, "max": 1.0}}  # motions need more power still
    in_range = plan(robot, task | faster | {"limits": {"winch_power": 0.99 * least}})
    assert in_range.status is MotionStatus.INFEASIBLE
    assert [each.value for each in in_range.audit.excess] == pytest.approx([least])
    assert plan(robot, task | faster | {"limits": {"winch_power": 1.003 * least}}).feasible
    enough = planned(1.003 * least)
    assert enough.feasible
    assert enough.deviation is None
    row = int(np.abs(enough.audit.times - moment).argmin())
    assert (np.abs(after - before) / (2 * rate) * enough.audit.tensions[row]).max() <= 1.003 * least * (1 + 1e-3)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_duration_is_too_short_for_the_thrusts_of_all_carriers_whatever_the_attitude(share):
    """The CoM is on a level line in any attitude: thrusts tilted by 0.6 rad, and 5 m/s^2 of the carriers, pull it."""
    robot = load("multi-quadrotor-4")
    most = (4 * 40 * np.sin(0.6) + 4 * 1.5 * 5) / robot.platform.mass
    seconds = share * 2 * np.sqrt(1.0 / most)
    task = {"path": {"kind": "line", "start": [0, 0, 0], "end": [0.6, 0.8, 0]}, "duration": seconds, "steps": 20}
    task |= {"base": {"kind": "free", "ends": "rest"}, "tube": {"position": 0.2, "attitude": 0.15}}
    proof = infeasible_ends(lay_out(robot, read_task(task)))
    assert (proof is not None) == (share < 1)
    if proof is not None:
        (excess,) = proof.excess
        assert (excess.limit, excess.bound) == ("duration", pytest.approx(seconds / share))


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_load_on_cables_of_fixed_length_cannot_leave_its_carriers_behind(share):
    """Each goes at least the way of the load less twice its cable's length, soonest with bang-bang control."""
    robot = load("multi-quadrotor-4")
    most = robot.carriers[0].acceleration_max
    way = 10.0 - 2 * robot.fixed_lengths.min() - 2e-4  # lengths are audited within 0.1 mm
    seconds = share * 2 * np.sqrt(way / most)
    line = {"kind": "line", "start": [0, 0, 0], "end": [10, 0, 0]}
    task = {"path": line, "duration": seconds, "steps": 20, "base": {"kind": "free", "ends": "rest"}}
    proof = infeasible_ends(lay_out(robot, read_task(task | {"tube": {"position": 0.5}})))
    assert (proof is not None) == (share < 1)
    if proof is not None:
        assert {excess.limit for excess in proof.excess} == {"carrier_acceleration"}
        assert proof.excess[0].value == pytest.approx(most / share**2)
