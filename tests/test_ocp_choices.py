"""What a task leaves open: durations, ways between points, margins; against closed forms and linear programs."""

import numpy as np
import pytest
from scipy.optimize import linprog

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.ocp import MotionStatus, plan

from .told import told

GRAVITY = 9.81
FREE = {"kind": "free", "acceleration_max": 3, "ends": "periodic"}
CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.6, "rate": 0.2 * np.pi}


def hoist(t_max_per_weight=2.0):
    """A point mass on one vertical cable: -g <= ddz <= (t_max / weight - 1) g."""
    data = load("point-mass-3").model_dump(mode="json")
    weight = data["platform"]["mass"] * GRAVITY
    cable = {**data["cables"][0], "anchor": [0, 0, 3], "t_min": 0, "t_max": t_max_per_weight * weight}
    return Robot.model_validate({**data, "cables": [cable]})


LIFT = {
    "path": {"kind": "line", "start": [0, 0, 0.5], "end": [0, 0, 1.5]},
    "tube": {"position": "free", "ends": "exact"},
    "objective": {"time": 0.001, "jerk": 1e4},
    "duration": {"min": 0.1, "max": 3},
}


@pytest.mark.parametrize("t_max_per_weight", [1.5, 2.0, 4.0])
def test_minimum_time_is_that_of_full_force_and_none(t_max_per_weight):
    """Up with a = (t_max / weight - 1) g, then free fall: T^2 = 2 d (1/a + 1/g). A node more or less is 1 %."""
    found = plan(hoist(t_max_per_weight), {**LIFT, "steps": 80})
    assert found.feasible, found.report()
    up = (t_max_per_weight - 1) * GRAVITY
    shortest = np.sqrt(2 * (1 / up + 1 / GRAVITY))
    assert shortest * (1 - 1e-6) <= found.scenario.duration <= 1.01 * shortest
    np.testing.assert_allclose(found.audit.motion.pose[[0, -1], 2], [0.5, 1.5], atol=1e-9)
    np.testing.assert_allclose(found.audit.motion.velocity[[0, -1]], 0, atol=1e-9)


def test_durations_stay_in_their_range():
    for low, high, chosen in ((1.0, 2.0, 1.0), (0.1, 3.0, 0.6386)):
        found = plan(hoist(), {**LIFT, "steps": 40, "duration": {"min": low, "max": high}})
        assert found.feasible, found.report()
        assert found.scenario.duration == pytest.approx(chosen, rel=0.01)
        assert low - 1e-6 <= found.scenario.duration <= high + 1e-6
        assert found.trajectory["time"].values[-1] == pytest.approx(found.scenario.duration)
        assert "make time add to the cost" not in found.report()
    slow = plan(hoist(), {**LIFT, "steps": 40, "objective": {"jerk": 1e-3}, "duration": {"min": 0.8, "max": 2.5}})
    assert slow.scenario.duration == pytest.approx(2.5, rel=1e-5)  # smooth is slow
    assert "which has the lowest cost; to make time add to the cost" in slow.report()


def test_a_report_says_if_time_is_not_all_that_costs():
    task = {**LIFT, "steps": 40, "duration": {"min": 0.2, "max": 5.0}}
    weighed, fast = (plan(hoist(), {**task, "objective": {"time": time, "jerk": 4.0}}) for time in (1.0, 0.01))
    share = weighed.scenario.duration / weighed.objective
    assert share < 0.9
    assert (
        f"which has the lowest cost, {100 * share:.0f} % of it due to time; for a shorter duration, lower"
        in weighed.report()
    )
    assert fast.scenario.duration < 0.9 * weighed.scenario.duration  # as the sentence promises
    assert "of it due to time" not in fast.report()


def test_exact_waypoints_are_passed_though_the_tube_is_used():
    path = {"kind": "waypoints", "points": [[0, 0, -1], [0.25, 0, -1.1], [0, 0.2, -1.2], [0, 0, -1]]}
    tube = {"position": 0.1, "ends": "exact", "waypoints": "exact"}
    found = plan(
        load("wang-flying"),
        {"path": path, "duration": 4, "steps": 37, "tube": tube, "objective": {"deviation": 10, "tension": 1}},
    )
    assert found.feasible, found.report()
    knots = found.scenario.task.path.knots(4.0)
    there, _ = found.scenario.motion(knots, found.deviation)
    np.testing.assert_allclose(there.pose[:, :3], path["points"], atol=1e-9)
    assert found.tracking_error_max > 1e-3


STATIONS = [[0, 0, 1], [2, -1, 1], [2, 1, 1.5], [-2, 1, 1.5], [-2, -1, 1.2], [0, 0, 1]]
TOUR = {"duration": {"min": 0.5, "max": 20}, "objective": {"time": 0.1, "jerk": 1000}, "steps": 24}


def test_points_are_passed_when_it_is_best():
    """No other times that are tried are better, those of the path least; and the points are passed as they must."""
    points = [[-2, 1, 1.5], *STATIONS[:3]]
    path = {"kind": "waypoints", "points": points}
    task = {"path": path, "tube": {"position": "free", "waypoints": "exact"}, **TOUR}
    found = plan("cogiro", task)
    chosen = found.scenario.path
    assert found.feasible
    there, _ = found.scenario.motion(chosen.knots(found.duration), found.deviation)
    np.testing.assert_allclose(there.pose[:, :3], points, atol=1e-6)
    tried = [found.scenario.task.path.knots(1.0).tolist()]
    for off in (0.04, -0.04):
        tried += [[*chosen.shares[:2], chosen.shares[2] + off, *chosen.shares[3:]]]
    others = [plan("cogiro", task | {"path": path | {"shares": shares}}) for shares in tried]
    assert all(other.scenario.path.shares == tuple(shares) for other, shares in zip(others, tried, strict=True))
    assert min(other.objective for other in others) > found.objective
    assert others[0].duration > 1.03 * found.duration
    again = plan("cogiro", task, start=found)
    assert again.scenario.path == chosen
    assert again.objective == pytest.approx(found.objective, rel=1e-3)


@pytest.mark.parametrize("duration", [{"min": 1, "max": 1.2}, 1.0], ids=["open", "fixed"])
def test_margin_is_the_largest_that_there_is(duration):
    """At a resting pose a linear program knows it: max s with A t = w and t at least s inside its limits."""
    robot = load("ipanema-1")
    path = {"kind": "rest", "pose": [0.2, 0.1, 1]}
    objective = {"margin": 1e-3, "tension": 1e4}
    found = plan(robot, {"path": path, "duration": duration, "steps": 5, "objective": objective})
    assert found.feasible, found.report()
    dynamics = Dynamics(robot)
    pose = np.array([*path["pose"], 0, 0, 0])
    A, w = dynamics.wrench_matrix(pose), dynamics.required_wrench(pose, np.zeros(6), np.zeros(6))
    m = robot.m
    beside = np.vstack([np.hstack([-np.eye(m), np.ones((m, 1))]), np.hstack([np.eye(m), np.ones((m, 1))])])
    best = linprog(
        [*np.zeros(m), -1],
        A_ub=beside,
        b_ub=np.concatenate([-robot.t_min, robot.t_max]),
        A_eq=np.hstack([A, np.zeros((6, 1))]),
        b_eq=w,
        bounds=[(None, None)] * (m + 1),
    )
    assert found.margin == pytest.approx(-best.fun, rel=1e-4)


def test_tensions_of_a_fixed_motion_are_those_that_the_objective_prefers():
    """Least squares at each instant jump where a cable becomes slack; the weight of their rates smooths them."""
    task = {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.6]}, "duration": 1, "steps": 50}

    def squares(found):
        rates = np.diff(found.audit.tensions, axis=0) / np.diff(found.audit.times)[:, None]
        return np.mean(np.sum(found.audit.tensions**2, axis=1)), np.mean(np.sum(rates**2, axis=1))

    least, smooth = (plan("ipanema-1", task | {"objective": weights}) for weights in ({}, {"tension_rate": 100}))
    assert least.feasible
    assert smooth.feasible
    (size, rate), (larger, lower) = squares(least), squares(smooth)
    weight = load("ipanema-1").force_scale
    assert larger > size
    assert lower < rate
    assert larger / weight**2 + lower / 100**2 < size / weight**2 + rate / 100**2


def test_tension_rates_hold_in_the_saved_trajectory():
    robot = load("wang-flying")
    task = {"path": CIRCLE, "base": FREE, "steps": 40}

    def fastest(found):
        values = found.trajectory["tensions"].values
        return np.abs(np.diff(values, axis=0)).max() / found.trajectory["time"].values[1]

    before = fastest(plan(robot, task))
    found = plan(robot, {**task, "limits": {"tension_rate": 0.5 * before}})
    assert found.feasible, found.report()
    assert fastest(found) <= 0.5 * before * (1 + 1e-3)


def test_a_given_motion_without_tensions_that_rise_slowly_enough_has_a_reason():
    path = {"kind": "line", "start": [0, 0, 2], "end": [0.5, 0, 2.4]}
    failed = plan("cogiro", {"path": path, "duration": 1, "steps": 8, "limits": {"tension_rate": 5}})
    assert failed.status is MotionStatus.NOT_FOUND
    assert failed.reason == "no motion with feasible tensions was found that keeps every other limit"
    assert failed.reason in told(failed).splitlines()[0]


def test_a_program_with_more_equations_than_unknowns_is_an_answer_without_a_warning(capfd):
    """Quadrotors that hold their places give no force across their thrust: few motions do without, or none."""
    path = {"kind": "line", "start": [0, 0, 0], "end": [0.03, -0.04, 0.02]}
    tube = {"position": 0.05, "attitude": 0.1}
    held = plan("flycrane", {"path": path, "duration": 1, "steps": 4, "tube": tube})
    assert held.status is MotionStatus.NOT_FOUND
    assert capfd.readouterr() == ("", "")


def test_what_the_audit_reports_is_kept_clear_of_on_the_next_mesh():
    """Between nodes the rates of 8 cables exceed theirs by a fifth on 40 steps, and by a twentieth on 160."""
    path = {"kind": "line", "start": [-0.5, 0.3, 2.0], "end": [0.4, -0.2, 2.1]}
    task = {"path": path, "duration": 2.8, "steps": 40, "tube": {"position": "free"}, "limits": {"tension_rate": 60}}
    found = plan("cogiro", task)
    assert found.feasible, found.report()
    assert found.stages[-2].name == "nonlinear program, 80 steps"


def test_a_plan_to_start_from_saves_iterations():
    robot = load("wang-flying")
    task = {"path": CIRCLE, "base": FREE, "steps": 40}
    first = plan(robot, task)
    near = {**task, "path": {**CIRCLE, "radius": 0.62}}
    cold, warm = plan(robot, near), plan(robot, near, start=first)
    assert warm.feasible
    assert warm.iterations < cold.iterations
    np.testing.assert_allclose(warm.audit.carriers.pose, cold.audit.carriers.pose, atol=1e-3)


WRONG = {
    "range": ({"duration": {"min": 2, "max": 1}}, r"task: duration.min must be at most max \(1\), got 2"),
    "range of a circle": (
        {"path": CIRCLE, "duration": {"min": 1, "max": 2}},
        "duration must be a number .s., because path of kind circle has its own times, got a range",
    ),
    "tube": ({"tube": {"position": "loose"}}, "tube.position must be a number or .*'free', got 'loose'"),
    "range of what": (
        {"duration": {"min": 2, "mx": 3}},
        "duration.(max is missing|mx is not a known key, did you mean 'max')",
    ),
    "length": (
        {"limits": {"cable_length": {"min": 2, "max": 1}}},
        r"cable_length.min must be at most max \(1\), got 2",
    ),
    "soft": (
        {"limits": {"cable_speed": 1, "soft": {"cable_sped": 0.1}}},
        "soft must name limits of this task .cable_speed, .*got 'cable_sped', did you mean 'cable_speed'",
    ),
    "box": (
        {"limits": {"keep_out": [{"kind": "box", "min": [0, 0, 0], "max": [1, 0, 1]}]}},
        r"keep_out.*min must be smaller than max",
    ),
    "speed": ({"limits": {"platform_speed": -1}}, "limits.platform_speed must be greater than 0, got -1"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_choices_are_one_line(case):
    task, message = WRONG[case]
    with pytest.raises(InputError, match=message) as caught:
        plan(hoist(), {**LIFT, **task})
    assert "\n" not in str(caught.value)


def test_a_plan_of_another_robot_is_no_start():
    lifted = plan(hoist(), {**LIFT, "steps": 10})
    with pytest.raises(InputError, match=r"start must be a plan .*, got one of 'point-mass-3'") as caught:
        plan(load("wang-flying"), {"path": CIRCLE, "base": FREE}, start=lifted)
    assert "\n" not in str(caught.value)
