"""What a report offers in place of an infeasible task is feasible when it is planned, and little less is not."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from towline.models import Dynamics, load
from towline.ocp import MotionStatus, plan
from towline.ocp.limits import Limit
from towline.ocp.nlp.rows import Mesh
from towline.ocp.proofs.durations import durations
from towline.ocp.search import feasible_changes, refinement, slower
from towline.ocp.search.feasible_changes import looser_limits
from towline.ocp.search.largest_share import _may_be_feasible as may_be_feasible
from towline.ocp.search.search import Search
from towline.ocp.tasks import scenario, task_checks
from towline.ocp.tasks.ends import between_fixed_values
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task

ROBOT = load("ipanema-1")
LINE = {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 1.2]}
TASK = {"path": LINE, "duration": 2}
BELOW = {"min": [-1, -1, 0], "max": [1, 1, 0.5]}  # both ends of paths
BALL = {"kind": "sphere", "name": "post", "centre": [0.25, 0.15, 2.0], "radius": 0.2}


def with_change(task, relaxed):
    """The task with what is offered, by the words of the offer."""
    name, value = relaxed.name, relaxed.possible
    if name in ("duration", "margin"):
        return task | {name: value}
    limits = dict(task["limits"])
    if name.startswith("clearance of "):
        about = name.split()[2]
        return task | {"limits": limits | {"keep_out": [limits["keep_out"][0] | {about: value}]}}
    field, _, side = name.removeprefix("limits.").partition(".")
    if not side:
        return task | {"limits": limits | {field: value}}
    side, _, axis = side.rstrip("]").partition("[")
    bound = dict(limits[field])
    bound[side] = [value if str(i) == axis else old for i, old in enumerate(bound[side])] if axis else value
    return task | {"limits": limits | {field: bound}}


@pytest.mark.parametrize(
    ("limits", "offered"),
    [
        ({"platform_speed": 0.3}, {"duration", "limits.platform_speed"}),
        ({"platform_acceleration": 0.5}, {"duration", "limits.platform_acceleration"}),
        ({"cable_speed": 0.2}, {"duration", "limits.cable_speed"}),
        ({"cable_length": {"min": 3.2, "max": 9.0}}, {"limits.cable_length.min"}),
        ({"platform_box": {"min": [-1, -1, 0], "max": [1, 1, 1.1]}}, {"limits.platform_box.max[2]"}),
        ({"cable_clearance": 0.5}, {"limits.cable_clearance"}),
        ({"keep_out": [{**BALL, "platform": 1.0, "cables": None}]}, {"clearance of platform from post"}),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_what_is_offered_is_feasible_and_little_less_is_not(limits, offered):
    task = TASK | {"limits": limits}
    planned = plan(ROBOT, task)
    assert planned.status is MotionStatus.INFEASIBLE
    assert {relaxed.name for relaxed in planned.relaxations} == offered
    for relaxed in planned.relaxations:
        assert plan(ROBOT, with_change(task, relaxed)).feasible
        assert relaxed.plan.audit.passed
        assert f"feasible {relaxed.name}" in planned.report()
        nearly = relaxed.possible + 0.01 * (relaxed.requested - relaxed.possible)
        less = type(relaxed)(relaxed.name, relaxed.unit, relaxed.requested, nearly, relaxed.plan)
        assert not plan(ROBOT, with_change(task, less)).feasible


def test_the_margin_that_is_offered_is_the_largest():
    task = {"path": {**LINE, "start": [0, 0, 2], "end": [1, 1, 2.5]}, "duration": 3, "margin": 400}
    planned = plan("cogiro", task)
    (relaxed,) = planned.relaxations
    assert relaxed.name == "margin"
    assert plan("cogiro", task | {"margin": relaxed.possible}).feasible
    assert not plan("cogiro", task | {"margin": relaxed.possible + 1.0}).feasible


def test_limits_that_are_exceeded_together_are_offered_together():
    task = TASK | {"limits": {"platform_speed": 0.3, "cable_speed": 0.2}}
    planned = plan(ROBOT, task)
    both = [relaxed for relaxed in planned.relaxations if relaxed.name != "duration"]
    assert len({id(relaxed.plan) for relaxed in both}) == 1
    for relaxed in both:
        task = with_change(task, relaxed)
    assert plan(ROBOT, task).feasible
    assert "together with limits." in planned.report()


class Low(Limit):
    """Keep the platform below 1.5 m."""

    name, unit, high = "low", "m", 1.5

    def values(self, state):
        return state.platform.position[2]


@pytest.mark.parametrize(
    ("limits", "offered"),
    [
        ({"platform_speed": 0.2}, {"duration", "limits.platform_speed"}),
        ({"platform_box": {"min": [-1, -1, 0], "max": [1, 1, 1.1]}}, {"limits.platform_box.max[2]"}),
    ],
    ids=["speed", "end"],
)
def test_a_motion_in_a_tube_is_offered_what_it_needs(limits, offered):
    task = TASK | {"tube": {"position": 0.02}, "steps": 20, "limits": limits}
    planned = plan(ROBOT, task)
    assert not planned.feasible
    assert {relaxed.name for relaxed in planned.relaxations} == offered
    for relaxed in planned.relaxations:
        assert relaxed.plan.audit.passed
        assert plan(ROBOT, with_change(task, relaxed)).feasible


def test_no_longer_duration_is_tried_where_an_end_is_in_the_way(monkeypatch):
    """Spare a program or two for nothing: whether an end is inside a ball does not depend on time."""
    durations = []
    monkeypatch.setattr(slower, "_lasting", lambda *given: durations.append(given))
    for limits in ({"keep_out": [{**BALL, "centre": [0.5, 0.3, 1.2], "cables": None}]}, {"platform_speed": 0.2}):
        task = TASK | {"tube": {"position": 0.02}, "steps": 20, "limits": limits}
        _ = plan(ROBOT, task).relaxations
    assert len(durations) == 1


def test_tension_rates_of_more_cables_than_needed_are_offered_by_their_least():
    path = {**LINE, "end": [0.6, 0.4, 1.6]}
    task = {"path": path, "duration": 1, "steps": 12, "limits": {"tension_rate": 100}}
    planned = plan(ROBOT, task)
    assert planned.status is MotionStatus.NOT_FOUND
    (rate,) = (relaxed.possible for relaxed in planned.relaxations if relaxed.name == "limits.tension_rate")
    least_squares = plan(ROBOT, {key: value for key, value in task.items() if key != "limits"}).audit
    rates = np.diff(least_squares.tensions, axis=0) / np.diff(least_squares.times)[:, None]
    assert rate < 0.3 * np.abs(rates).max()
    assert plan(ROBOT, task | {"limits": {"tension_rate": rate}}).feasible


def test_a_plan_without_a_solution_can_be_sent_to_another_process_with_its_relaxations():
    """Pickle a plan whose relaxations are not computed yet: what computes them holds programs, which no pickle has."""
    task = {"duration": 1, "tube": {"position": 0.02}, "steps": 8, "limits": {"tension_rate": 3}}
    planned = plan("point-mass-3", task | {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.3, 0, 1.1]}})
    assert planned.status is MotionStatus.NOT_FOUND
    sent = pickle.loads(pickle.dumps(planned))
    assert [relaxed.to_dict() for relaxed in sent.relaxations] == [each.to_dict() for each in planned.relaxations]
    assert sent.relaxations


@pytest.mark.parametrize("tube", [0, 0.02])
def test_no_duration_is_offered_that_an_audit_cannot_sample(tube, monkeypatch):
    """The longest duration is set to 2.1 s, but the limit on the speed requires more than 2.8 s."""
    for module in (scenario, task_checks):
        monkeypatch.setattr(module, "MOST_SAMPLES", 2100)
    task = TASK | {"tube": {"position": tube}, "steps": 20, "limits": {"platform_speed": 0.4}}
    planned = plan(ROBOT, task)
    assert not planned.feasible
    assert [relaxed.name for relaxed in planned.relaxations] == ["limits.platform_speed"]


def test_limits_of_ones_own_stay_and_stay_soft():
    task = TASK | {"limits": {"own": (Low(),), "soft": {"low": 0.1}, "platform_speed": 0.3}}
    planned = plan(ROBOT, task)
    assert planned.status is MotionStatus.INFEASIBLE
    assert {relaxed.name for relaxed in planned.relaxations} == {"duration", "limits.platform_speed"}
    for relaxed in planned.relaxations:
        assert float(f"{relaxed.possible:.4g}") == relaxed.possible
        assert [limit.name for limit in relaxed.plan.scenario.task.limits.own] == ["low"]


def test_a_way_past_an_obstacle_is_offered_and_only_a_nearer_end_without_tensions():
    ball = {**BALL, "centre": [0.25, 0.15, 1.1], "cables": None}
    offered = plan(ROBOT, TASK | {"limits": {"keep_out": [ball]}}).relaxations
    assert [offer.name for offer in offered] == ["length of a way round"]
    again = plan(ROBOT, offered[0].plan.scenario.task.model_dump())
    assert again.feasible
    position = again.trajectory["pose"].values[:, :3]
    assert np.linalg.norm(position - ball["centre"], axis=1).min() > ball["radius"]
    np.testing.assert_allclose(position[[0, -1]], [LINE["start"], LINE["end"]])
    length = np.linalg.norm(np.diff(position, axis=0), axis=1).sum()
    assert np.linalg.norm(np.subtract(LINE["end"], LINE["start"])) < offered[0].possible <= 1.001 * length
    outside = {**LINE, "end": [9.0, 0.3, 1.2]}
    offered = plan(ROBOT, {"path": outside, "duration": 2}).relaxations
    assert [offer.name for offer in offered] == ["length of the line"]  # no strength holds it beyond the frame


def test_a_nearer_end_keeps_the_coordinates_that_do_not_change():
    line = {"kind": "line", "start": [0.0123456, -0.1234567, 1.0234567]}
    offered = plan(ROBOT, {"path": {**line, "end": [9.0, -0.1234567, 1.0234567]}, "duration": 2}).relaxations
    nearer = next(offer for offer in offered if offer.name == "length of the line").plan.scenario.task.path
    assert nearer.end[1:3] == (-0.1234567, 1.0234567)
    assert float(f"{nearer.end[0]:.4g}") == nearer.end[0]


def test_the_closest_motion_of_a_tube_offers_what_it_keeps():
    """In a tube of 1 cm about the line the clearance of 1 m cannot be kept; what is offered can, with the same tube."""
    task = TASK | {"tube": {"position": 0.01}, "steps": 20}
    task |= {"limits": {"keep_out": [{**BALL, "platform": 0.7, "cables": None}]}}
    planned = plan(ROBOT, task)
    assert not planned.feasible
    for relaxed in planned.relaxations:
        assert relaxed.possible < 0.7
        assert plan(ROBOT, with_change(task, relaxed)).feasible
    away = np.linalg.norm(np.array(BALL["centre"]) - [0.25, 0.15, 1.1])
    assert all(relaxed.possible < away - 0.2 + 0.01 for relaxed in planned.relaxations)


def given_again(relaxed):
    """The plan of the robot and the task that are offered."""
    return plan(relaxed.plan.scenario.robot, relaxed.plan.scenario.task)


@pytest.mark.parametrize("tube", [0, 0.05])
def test_a_duration_in_another_unit_is_offered_the_one_that_tensions_permit(tube):
    """A line takes the same time however much too short a duration is."""
    task = {"path": LINE, "steps": 15, "tube": {"position": tube}}
    (of_micro, of_tenth) = (plan(ROBOT, task | {"duration": seconds}).relaxations[0] for seconds in (1e-6, 0.2))
    assert of_micro.name == of_tenth.name == "duration"
    assert of_micro.possible == pytest.approx(of_tenth.possible, rel=0.05)  # that in a tube is rounded generously
    assert given_again(of_micro).feasible


@pytest.mark.parametrize(
    ("limits", "most"), [({}, np.inf), ({"cable_speed": 0.4}, 0.4)], ids=["tensions", "cable_speed"]
)
def test_a_phase_that_is_too_short_is_offered_the_duration_that_it_needs(limits, most):
    rest = {"name": "before", "path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 1}
    phases = [rest, {"name": "go", "path": LINE, "duration": 0.2}, {"name": "after", "duration": 1}]
    offer = plan(ROBOT, {"phases": phases, "limits": limits}).relaxations[0]
    assert (offer.name, offer.requested) == ("phases[1].duration", 0.2)
    found = given_again(offer)
    assert found.feasible
    assert found.duration == pytest.approx(2 + offer.possible)
    phases[1] |= {"duration": 0.98 * offer.possible}
    assert not plan(ROBOT, {"phases": phases, "limits": limits}).feasible
    if limits:  # the rates of the lengths of cables, by differences
        lengths = Dynamics(ROBOT).cable_lengths(found.audit.motion.pose)
        fastest = np.abs(np.diff(lengths, axis=0) / np.diff(found.audit.times)[:, None]).max()
        assert 0.97 * most < fastest <= 1.001 * most


def test_a_state_outside_the_tube_is_offered_a_wider_one():
    task = TASK | {"tube": {"position": 0.05}, "steps": 15, "final": {"pose": [0.5, 0.5, 1.2, 0, 0, 0]}}
    (offer,) = plan(ROBOT, task).relaxations
    assert offer.name == "tube.position"
    assert 0.2 < offer.possible < 0.22  # the end of the line is 0.2 m away
    assert given_again(offer).feasible


def test_a_start_too_fast_to_stop_is_offered_a_slower_one():
    """To stop within x from v takes at least v^2 / 2 x, and all cables together give less than their t_max."""
    task = TASK | {"tube": {"position": 0.05}, "steps": 10, "final": {"velocity": 0}}
    task |= {"initial": {"pose": [0, 0, 1, 0, 0, 0], "velocity": [0, 9, 0, 0, 0, 0]}}
    (offer,) = plan(ROBOT, task).relaxations
    assert (offer.name, offer.requested) == ("initial.velocity", 9.0)
    assert offer.possible**2 / (2 * 0.05) < ROBOT.t_max.sum() / ROBOT.platform.mass
    found = given_again(offer)
    assert found.feasible
    assert np.linalg.norm(found.audit.motion.velocity[0, :3]) == pytest.approx(offer.possible)


def test_the_jerk_of_cables_is_kept_by_a_longer_duration():
    """It falls with the cube of the duration."""
    found = plan(ROBOT, TASK | {"limits": {"cable_jerk": 0.1}})
    longer, limit = found.relaxations
    assert longer.name == "duration"
    assert (longer.possible / 2) ** 3 == pytest.approx(limit.possible / 0.1, rel=0.02)
    assert given_again(longer).feasible


def test_a_smaller_change_keeps_tensions_also_where_an_audit_missed_them():
    """A jerk of 0.04 s in 6 s of rest is between the instants at which tensions are sought before an audit."""
    robot = load("ipanema-1")
    start, end = np.array(robot.home[:3]), np.add(robot.home[:3], [0.009, 0.0, 0.0036])
    line = {"kind": "line", "start": start.tolist(), "end": end.tolist()}
    rests = [{"path": {"kind": "rest", "pose": place.tolist()}, "duration": 3} for place in (start, end)]
    parts = [rests[0], {"path": line, "duration": 0.04}, rests[1]]
    scenario = lay_out(robot, read_task({"path": {"kind": "sequence", "parts": parts}}))
    search = Search(scenario, {}, None)
    assert may_be_feasible(search, scenario)
    audit = search.audit_motion(scenario, None)
    assert abs(audit.times[audit.worst] - 3.02) < 0.02
    assert not may_be_feasible(search, scenario)
    found = feasible_changes.feasible_changes(search, scenario, None, audit)
    assert found.found
    assert all(plan(each.plan.scenario.robot, each.plan.scenario.task).feasible for each in found.found)


def test_a_program_without_a_solution_ends_with_the_effort_that_it_may_take():
    """The platform is too fast for its limit, which the program does not see at once."""
    line = {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.6]}
    task = {"path": line, "duration": 1.0, "tube": {"position": 0.05}, "limits": {"platform_speed": 0.1}}
    whole, cut = (Search(lay_out(load("ipanema-1"), read_task(task)), {}, None) for _ in range(2))
    assert not whole.solve("program", Mesh(20), None).success
    cut.most_effort = 0.8 * whole.effort
    assert not cut.solve("program", Mesh(20), None).success
    assert cut.effort <= 1.1 * cut.most_effort  # restoration takes some iterations more


def test_an_enclosed_end_has_a_way_without_the_wall_that_closes_it(monkeypatch):
    """Six walls enclose the end: those that the closest motion passes through go, and planning finds the way."""
    robot, end, h = load("point-mass-3"), np.array([0.4, 0.2, 1.0]), 0.2
    walls = []
    for axis, sign in ((axis, sign) for axis in range(3) for sign in (1, -1)):
        low, high = end - h, end + h
        (low if sign > 0 else high)[axis] = end[axis] + sign * 0.9 * h
        box = {"min": low.tolist(), "max": high.tolist(), "cables": None}
        walls.append({"kind": "box", "name": f"wall {'xyz'[axis]}{sign:+d}", **box})
    task = {"path": {"kind": "line", "start": [-0.5, 0.2, 1], "end": end.tolist()}, "duration": 6, "steps": 20}
    task |= {"tube": {"position": "free"}}
    laid_out = lay_out(robot, read_task(task | {"limits": {"keep_out": walls}}))
    through = between_fixed_values(laid_out)

    search = Search(laid_out, {}, None)
    (offer,) = feasible_changes.feasible_changes(
        search, laid_out, through, search.audit_motion(laid_out, through)
    ).found
    assert offer.name == "number of keep-out regions"
    kept = [wall for wall in walls if repr(wall["name"]) not in offer.detail]
    assert offer.possible == len(kept) < len(walls)
    assert plan(robot, task | {"limits": {"keep_out": kept}}).feasible
    monkeypatch.setattr(refinement, "LEAST_EFFORT", np.inf)
    none = feasible_changes.feasible_changes(search, laid_out, through, search.audit_motion(laid_out, through))
    assert not none.found
    assert none.cut_short
    refused = replace(plan(robot, task | {"limits": {"platform_box": BELOW}}), offers=lambda: none)
    assert "the search for changes was cut short" in refused.report()


def test_robots_that_cannot_be_so_far_apart_have_a_distance_at_which_they_hold_the_platform():
    """The farthest corners of their reach are less than 8 m apart."""
    task = {"path": {"kind": "rest", "pose": [1.26, 0.96, 0.4]}, "duration": 1, "base": {"kind": "free"}, "steps": 4}
    task |= {"tube": {"position": 0.02, "attitude": 0.1}}
    robot = load("wang-ctmrts")
    laid_out = lay_out(robot, read_task(task | {"limits": {"carrier_separation": 8.4}}))
    search = Search(laid_out, {}, None)
    (offer,) = looser_limits(search, laid_out, None, search.audit_motion(laid_out, None))
    assert offer.name == "limits.carrier_separation"
    corners = np.array([[carrier.reach.min, carrier.reach.max] for carrier in robot.carriers])
    assert np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)) < 8
    anchors = robot.home_anchors
    nearest = min(np.linalg.norm(anchors[i] - anchors[j]) for i in range(3) for j in range(i))
    assert 0.7 * nearest < offer.possible < 8.4
    assert plan(robot, task | {"limits": {"carrier_separation": offer.possible}}).feasible


@pytest.mark.parametrize("kind", ["waypoints", "samples"])
def test_points_with_times_are_passed_later(kind):
    """Accelerations fall with the square of the times."""
    times = np.linspace(0, 1.2, 7)
    share = times / 1.2
    share = share**3 * (10 - 15 * share + 6 * share**2)
    poses = np.column_stack([0.5 * share, 0.3 * share, 1 + 0.2 * share]).tolist()
    path = {"kind": kind, "poses": poses} if kind == "samples" else {"kind": kind, "points": poses, "shape": "spline"}
    task = {"path": path | {"times": times.tolist()}, "limits": {"platform_acceleration": 0.4}}
    planned = plan("ipanema-1", task)
    (excess,) = planned.audit.excess
    later = {relaxed.name: relaxed for relaxed in planned.relaxations}["path.times"]
    assert later.requested == 1.2
    assert later.possible == pytest.approx(1.2 * np.sqrt(excess.value / 0.4), rel=5e-3)
    assert plan("ipanema-1", later.plan.scenario.task).feasible
    assert later.plan.scenario.task.path.times == pytest.approx(later.possible / 1.2 * times, rel=1e-3)


def test_a_duration_is_offered_though_the_instant_that_decides_lies_between_the_places_that_were_checked():
    points = [[-1.7, 0.1, 1.9], [-1.6, 0.5, 2.6], [0.3, -0.9, 2.6]]
    task = {"path": {"kind": "waypoints", "points": points}, "duration": 0.2}
    robot = load("cogiro")
    proven = durations(lay_out(robot, read_task(task))).shortest
    assert plan(robot, task | {"duration": slower.LONGER * proven}).status is MotionStatus.INFEASIBLE
    offered = {relaxed.name: relaxed.possible for relaxed in plan(robot, task).relaxations}["duration"]
    assert slower.LONGER * proven < offered < 1.02 * proven
    assert plan(robot, task | {"duration": offered}).feasible
