"""The planner's ladder: what each stage claims, against closed forms and brute force; and where the planner starts."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.ocp import MotionStatus, Planner, plan, time_along
from towline.ocp.audits.violation import cost
from towline.ocp.nlp.solver import Solver
from towline.ocp.proofs.durations import durations
from towline.ocp.search.reference import deviation_from
from towline.ocp.search.time_law import fastest
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import Task
from towline.solvers import capacity_margin
from towline.statics.distribution import pose_problem

GRAVITY = 9.81
LINE = {"kind": "line", "start": [0, 0, 2], "end": [1, 1, 2.5]}
WAYPOINTS = {"kind": "waypoints", "points": [[0, 0, 2], [1, 1, 2.5], [2, 0, 2]]}
TUBE = {"position": 0.3, "attitude": 0.1, "ends": "exact"}


def hoist(t_max_per_weight=2.0, t_min=0.0):
    """A point mass that moves on the vertical alone, on one cable: -g <= ddz <= (t_max / weight - 1) g."""
    data = load("point-mass-3").model_dump(mode="json")
    weight = data["platform"]["mass"] * GRAVITY
    cable = {**data["cables"][0], "anchor": [0, 0, 3], "t_min": t_min, "t_max": t_max_per_weight * weight}
    return Robot.model_validate({**data, "platform": {**data["platform"], "dof": ["z"]}, "cables": [cable]})


LIFT = {"kind": "line", "start": [0, 0, 0.5], "end": [0, 0, 1.5]}


def largest_acceleration(times):
    """Of the smooth line over one metre in one second, up and down."""
    s = times
    return 420 * s**2 * (1 - s) ** 2 * (1 - 2 * s)


def names(found):
    return [stage.name for stage in found.stages]


def scenario(robot, **task):
    return lay_out(load(robot) if isinstance(robot, str) else robot, Task.model_validate(task))


@pytest.mark.parametrize("t_max_per_weight", [1.5, 2.0, 4.0])
def test_durations_of_a_lift_are_those_of_its_largest_acceleration(t_max_per_weight):
    """The profile's peak is a_1 / T^2: up it may be (t_max / weight - 1) g, and down g."""
    peak = largest_acceleration(np.linspace(0, 1, 100_001)).max()
    shortest = np.sqrt(peak / GRAVITY / min(t_max_per_weight - 1, 1.0))
    left = durations(scenario(hoist(t_max_per_weight), path=LIFT, duration=1.0))
    assert left.longest == np.inf
    # Only places are asked: what they leave is never too little, and nearly all of it is right.
    assert 0.99 * shortest <= left.shortest <= shortest * (1 + 1e-9)
    assert left.leave(shortest, 2 * shortest)
    assert not left.leave(0.1 * shortest, 0.98 * shortest)


def test_durations_agree_with_bisection_on_the_audit():
    """Cogiro's line: the audit, which knows nothing of linear programs, changes its mind at the shortest one."""
    robot = load("cogiro")

    def worst(seconds):
        found = plan(robot, {"path": LINE, "duration": float(seconds), "margin": 20})
        return -1.0 if found.feasible else 1.0

    left = durations(scenario("cogiro", path=LINE, duration=0.7, margin=20))
    edge = brentq(worst, 1.0, 1.1, xtol=2e-3)
    assert left.shortest == pytest.approx(edge, rel=3e-3)
    assert left.shortest <= edge + 1e-3


def test_durations_are_not_asked_where_they_cannot_be():
    assert durations(scenario("cogiro", path=LINE, duration=1, tube=TUBE)) is None
    assert durations(scenario("cogiro", path={"kind": "circle", "centre": [0, 0, 2], "radius": 1, "rate": 1})) is None
    assert durations(scenario("wang-flying", path={**LIFT, "start": [0, 0, -1]}, duration=1, wind=[0, 0, 0])) is None
    assert durations(scenario("wang-ctmrts", path=LINE, duration=1)) is None  # three cables


def test_what_cannot_rest_at_its_end_is_infeasible_at_once():
    path = {"kind": "line", "start": [0, 0, -1], "end": [0.8, 0, -1]}
    found = plan(load("wang-flying"), {"path": path, "duration": {"min": 1, "max": 4}})
    assert found.status is MotionStatus.INFEASIBLE
    assert found.certificate.time == pytest.approx(4.0)
    assert not any("program" in name for name in names(found))
    assert found.iterations == 0
    # The end is at rest: its shortfall is the distance of the static wrench.
    short = capacity_margin(pose_problem(Dynamics(load("wang-flying")), [0.8, 0, -1, 0, 0, 0])).value
    assert found.certificate.shortfall == pytest.approx(-short, rel=1e-6)


def test_a_motion_that_is_too_fast_tells_a_duration_that_would_do():
    robot = hoist(2.0)
    peak = largest_acceleration(np.linspace(0, 1, 100_001)).max()
    shortest = np.sqrt(peak / GRAVITY)
    found = plan(robot, {"path": LIFT, "duration": 0.5 * shortest})
    assert found.status is MotionStatus.INFEASIBLE
    assert found.relaxed.name == "duration"
    assert found.relaxed.possible == pytest.approx(shortest, rel=5e-3)
    assert found.relaxed.plan.feasible
    assert found.relaxed.plan.audit.passed
    assert (
        f"{found.relaxed.possible:.4g} s (audited), close to the shortest feasible one for this time law"
        in found.report()
    )
    assert plan(robot, {"path": LIFT, "duration": found.relaxed.possible}).feasible


@pytest.mark.parametrize(("name", "peak"), [("platform_speed", 35 / 16), ("platform_acceleration", None)])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_where_the_own_time_law_is_too_fast_in_the_longest_duration_the_fastest_is_the_plan(name, peak, share):
    """A lift of 1 m by the smooth line's own time law, of closed form, in at most 2 s."""
    most = peak / 2 if peak else largest_acceleration(np.linspace(0, 1, 100_001)).max() / 4
    task = {"path": LIFT, "duration": {"min": 0.5, "max": 2}, "limits": {name: share * most}}
    found = plan(hoist(4.0), task)
    assert found.feasible
    assert ("timing" in [stage.name for stage in found.stages]) == (share < 1)
    late = plan(hoist(4.0), task | {"duration": {"min": 1.9, "max": 2}})
    assert late.feasible
    assert 1.9 <= late.duration <= 2.0  # the fastest takes less, and is followed by a rest


def test_a_uniform_line_has_no_other_time_law_and_is_proven_infeasible():
    """The fastest cable, by differences of its length, is a little faster than its mean speed permits to tell."""
    robot, shares = load("cogiro"), np.linspace(0, 1, 2001)
    start, end = np.array([-3, 1, robot.home[2]]), np.array([3, 1, robot.home[2]])
    poses = np.hstack([start + shares[:, None] * (end - start), np.zeros((2001, 3))])
    lengths = np.linalg.norm(poses[:, None, :3] + robot.attachments - robot.home_anchors, axis=2)
    peak = np.abs(np.diff(lengths, axis=0)).max() / shares[1] / 4.0
    path = {"kind": "line", "start": start.tolist(), "end": end.tolist(), "timing": "uniform"}
    for share, status in ((0.99, MotionStatus.INFEASIBLE), (1.01, MotionStatus.FEASIBLE)):
        task = {"path": path, "duration": {"min": 1, "max": 4}, "limits": {"cable_speed": share * peak}}
        assert plan(robot, task).status is status


def test_a_lift_that_no_time_law_does_in_the_longest_duration_is_proven_infeasible():
    """With a at most, 1 m takes at least 2 sqrt(1 m / a): 2 s at 1 m/s^2."""
    task = {"path": LIFT, "duration": {"min": 0.5, "max": 1.9}, "limits": {"platform_acceleration": 1.0}}
    found = plan(hoist(4.0), task)
    assert found.status is MotionStatus.INFEASIBLE
    (excess,) = found.audit.excess
    assert excess.limit == "platform_acceleration"
    assert excess.value == pytest.approx(4 / 1.9**2, rel=1e-5)
    assert plan(hoist(4.0), task | {"duration": {"min": 0.5, "max": 2.05}}).feasible


def test_what_only_a_fast_motion_passes_is_passed_and_followed_by_a_rest():
    """Two cables hold 1 kg at the top of an arch if it is so fast that less than its weight is left to hold."""
    data = load("point-mass-3").model_dump(mode="json")
    cables = [{**data["cables"][0], "anchor": [x, 0, 0], "t_min": 0.0, "t_max": 18.0} for x in (-1, 1)]
    platform = {"mass": 1.0, "dof": ["x", "z"], "home": [0, 0, -0.6, 0, 0, 0]}
    robot = Robot.model_validate({**data, "platform": platform, "cables": cables})
    depth = 0.25
    assert GRAVITY / (2 * depth / np.hypot(1, depth)) > 18.0  # each tension if it rests at the top
    path = {"kind": "waypoints", "shape": "spline", "points": [[-0.5, 0, -0.6], [0, 0, -depth], [0.5, 0, -0.6]]}
    found = plan(robot, {"path": path, "duration": {"min": 5, "max": 8}, "objective": {"time": 1}})
    assert found.feasible
    assert found.duration == 5.0
    times, position = found.audit.times, found.audit.motion.pose[:, :3]
    assert (np.abs(position[times > 2] - [0.5, 0, -0.6]) < 1e-9).all()
    lines = np.array([[-1, 0, 0], [1, 0, 0]]) - position[:, None]
    lines /= np.linalg.norm(lines, axis=2, keepdims=True)
    force = np.einsum("nm,nmi->ni", found.audit.tensions, lines)
    assert np.allclose(force - [0, 0, GRAVITY], found.audit.motion.acceleration[:, :3], atol=1e-6)
    assert found.audit.tensions.max() <= 18.0 + 1e-6


def test_missing_spans_are_those_in_which_the_acceleration_is_too_large():
    """Half the shortest duration: too much force up in the first half, too much down in the second."""
    robot, weight = hoist(2.0), hoist(2.0).weight
    seconds = 0.3
    found = plan(robot, {"path": LIFT, "duration": seconds})
    fine = np.linspace(0, 1, 300_001)
    wanted = largest_acceleration(fine) / seconds**2
    up, down = fine[wanted > GRAVITY] * seconds, fine[wanted < -GRAVITY] * seconds
    first, second = found.infeasible_spans
    for span, times in ((first, up), (second, down)):
        np.testing.assert_allclose(list(span.span), [times[0], times[-1]], atol=1.1e-3)
    most = wanted.max() / GRAVITY * weight
    assert first.demand == pytest.approx(weight + most, rel=1e-3)
    assert first.support == pytest.approx(2 * weight, rel=1e-9)
    assert first.at_max.tolist() == [0]
    assert second.at_min.tolist() == [0]
    told = found.report()
    assert "Time spans with no feasible tensions" in told
    assert f"{first.span[0]:.3f}" in told
    assert len(found.to_dict()["infeasible_spans"]) == 2
    assert plan(robot, {"path": LIFT, "duration": 3.0}).infeasible_spans == ()


class TestTiming:
    """The stage that needs toppra."""

    @pytest.fixture(autouse=True)
    def _toppra(self):
        pytest.importorskip("toppra")

    def test_the_fastest_law_is_the_plan_where_only_it_will_do(self):
        """Full force up, free fall: T^2 = 2 d (1/a + 1/g), faster than the path's own law can be."""
        robot = hoist(2.0)
        fastest_of_all = np.sqrt(4 / GRAVITY)
        own = np.sqrt(largest_acceleration(np.linspace(0, 1, 10_001)).max() / GRAVITY)
        assert own > 1.1 * fastest_of_all
        found = plan(robot, {"path": LIFT, "duration": {"min": 0.1, "max": 1.05 * fastest_of_all}})
        assert found.feasible, found.report()
        assert found.scenario.duration == pytest.approx(fastest_of_all, rel=5e-3)
        assert not any("program" in name for name in names(found))
        assert "with the fastest time law" in found.report()
        assert found.trajectory["time"].values[-1] == pytest.approx(found.scenario.duration)

    def test_no_law_is_faster(self):
        robot = hoist(2.0)
        fastest_of_all = np.sqrt(4 / GRAVITY)
        found = plan(robot, {"path": LIFT, "duration": {"min": 0.1, "max": 0.95 * fastest_of_all}})
        assert found.status is MotionStatus.INFEASIBLE
        assert found.certificate is not None
        assert not any("program" in name for name in names(found))
        assert found.scenario.duration == pytest.approx(0.95 * fastest_of_all)
        assert found.relaxed.possible > fastest_of_all

    def test_the_objective_decides_between_the_laws(self):
        robot = load("cogiro")
        fast, easy = (
            plan(robot, {"path": LINE, "duration": {"min": 0.1, "max": 4}, "margin": 20, "objective": {"time": time}})
            for time in (1e-3, 1.0)
        )
        timing = time_along(robot, {"path": LINE, "margin": 20})
        assert fast.scenario.duration == pytest.approx(timing.duration)
        assert easy.scenario.duration > fast.scenario.duration
        assert "timing" in names(easy)
        assert easy.deviation is not None  # the program's
        # It did choose what costs less.
        timed = Planner(robot, timing.scenario.task).plan()
        task = easy.scenario.task
        assert cost(easy) < timed.scenario.duration / 1.0 + np.mean(
            np.sum((timed.audit.tensions / robot.force_scale) ** 2, axis=1)
        )
        assert task.objective.time == 1.0

    def test_waypoints_are_timed_on_the_spline_that_the_task_follows(self):
        given = scenario("cogiro", path=WAYPOINTS, duration=2, margin=20)
        timing, _ = fastest(given)
        looks = given.path.by_fraction(np.linspace(0, 1, 40_001)).pose[:, :3]
        walked = timing.scenario.motion(np.linspace(0, timing.duration, 200), None)[0].pose[:, :3]
        nearest = [np.linalg.norm(looks - point, axis=1).min() for point in walked]
        assert max(nearest) < 1e-4  # the looks lie 1e-4 apart
        # The path's own law on the same spline cannot be faster.
        assert timing.duration <= durations(given).shortest

    def test_without_toppra_the_ladder_goes_on(self, monkeypatch):
        monkeypatch.delitem(sys.modules, "towline.ocp.timing.toppra_law", raising=False)
        monkeypatch.setitem(sys.modules, "toppra", None)
        monkeypatch.setitem(sys.modules, "toppra.algorithm", None)
        found = plan(
            load("cogiro"),
            {"path": LINE, "duration": {"min": 0.1, "max": 4}, "objective": {"time": 0.001}, "steps": 30},
        )
        assert found.feasible
        (told,) = [stage.message for stage in found.stages if stage.name == "timing"]
        assert "toppra is not installed" in told

    def test_a_timing_is_a_start(self):
        """In the program's coordinates it is the very motion."""
        robot = load("cogiro")
        timing = time_along(robot, {"path": LINE, "margin": 20, "limits": {"platform_speed": 1.0}})
        task = {"path": LINE, "duration": {"min": 0.1, "max": 9}, "tube": TUBE, "steps": 60}
        given = scenario(robot, **task)
        start = deviation_from(given, timing)
        moved, _ = given.lasting(start.nodes[-1]).motion(start.nodes, start)
        wanted, _ = timing.scenario.motion(start.nodes, None)
        for mine, its in zip(moved, wanted, strict=True):
            # The last node is read off the cubic before it, which a timing is not.
            np.testing.assert_allclose(mine[:-1], its[:-1], atol=1e-9)
        assert start.nodes[-1] == pytest.approx(timing.duration)
        assert plan(robot, {**task, "duration": 3}, start=timing).feasible
        with pytest.raises(InputError, match="start must be a plan of robot 'ipanema-1'"):
            plan(load("ipanema-1"), {**task, "duration": 3}, start=timing)


def test_a_path_is_a_start():
    """Past a post on the side on which the start goes."""
    robot = load("ipanema-1")
    post = {"kind": "capsule", "start": [0, 0, -1], "end": [0, 0, 3], "radius": 0.1, "cables": None, "carriers": None}
    task = {
        "path": {"kind": "line", "start": [-0.8, 0, 1], "end": [0.8, 0, 1]},
        "tube": {"position": "free", "ends": "exact"},
        "duration": 3,
        "steps": 40,
        "limits": {"keep_out": [post]},
    }
    for side in (-0.7, 0.7):
        start = {"kind": "waypoints", "points": [[-0.8, 0, 1], [0, side, 1], [0.8, 0, 1]]}
        found = plan(robot, task, start=start)
        assert found.feasible, found.report()
        position = found.audit.motion.pose[:, :3]
        at_the_post = position[np.abs(position[:, 0]).argmin()]
        assert np.sign(side) * at_the_post[1] > 0.1
    with pytest.raises(InputError, match="start"):
        plan(robot, task, start={"kind": "line", "start": [0, 0], "end": [1, 0, 1]})


def test_wrong_starts_are_refused():
    planner = Planner(load("cogiro"), {"path": LINE, "duration": 3, "tube": TUBE, "steps": 10})
    with pytest.raises(InputError, match=r"start\.frame must be 'world', as in the task's path, got 'quad'"):
        planner.plan(start={"kind": "rest", "pose": [0, 0, 2], "frame": "quad"})
    with pytest.raises(InputError, match=r"start must be a Plan, a path .*, got 3"):
        planner.plan(start=3)
    with pytest.raises(InputError, match="kind"):
        planner.plan(start={"kind": "spiral"})


def test_every_rung_is_told_with_its_time():
    found = plan(load("cogiro"), {"path": LINE, "duration": 3, "tube": TUBE, "steps": 10})
    assert names(found)[:3] == ["ends and path", "nonlinear program, 10 steps", "audit"]
    for stage in found.stages:
        assert stage.seconds >= 0
        assert stage.message in found.report()
    assert [stage["name"] for stage in found.to_dict()["stages"]] == names(found)


@pytest.fixture
def unsolved(monkeypatch):
    """No program is solved: each run ends a metre beside its best motion."""
    solve = Solver.solve

    def failing(self, *arguments, **named):
        outcome = solve(self, *arguments, **named)
        away = replace(outcome.deviation, q=outcome.deviation.q + 1.0)
        return replace(outcome, deviation=away, success=False)

    monkeypatch.setattr(Solver, "solve", failing)


@pytest.mark.usefixtures("unsolved")
@pytest.mark.parametrize("duration", [2.0, {"min": 0.01, "max": 2.0}])
def test_a_direct_motion_that_is_feasible_is_the_plan_if_no_program_is_solved(duration):
    """Of a range the longest duration is tried, too: 2 m in 0.14 s are too fast."""
    line = {"kind": "line", "start": [-1, 0, 1], "end": [1, 0, 1]}
    found = plan("cogiro", {"path": line, "duration": duration, "tube": {"position": 0.05}, "steps": 20})
    assert found.feasible
    assert found.duration == 2.0
    assert found.tracking_error_max < 1e-9
    assert "direct motion" in found.stages[-1].name


@pytest.mark.usefixtures("unsolved")
def test_a_direct_motion_that_is_not_feasible_is_no_plan():
    line = {"kind": "line", "start": [-1, 0, 1], "end": [1, 0, 1]}
    limits = {"keep_out": [{"kind": "sphere", "centre": [0, 0, 1.3], "radius": 0.1, "cables": None}]}
    found = plan("cogiro", {"path": line, "duration": 2.0, "tube": {"position": 0.1}, "limits": limits, "steps": 20})
    assert found.status is MotionStatus.NOT_FOUND
