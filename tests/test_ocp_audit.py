"""The audit by itself: a motion that keeps all is changed by hand to leave one thing, which the audit names."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag
from scipy.optimize import linprog

from towline.base.errors import InputError
from towline.models import Dynamics, load
from towline.ocp import MotionStatus, plan
from towline.ocp.audits.audit import audit
from towline.ocp.audits.excess import Excess
from towline.ocp.audits.tensions import few_and_inverse
from towline.ocp.tasks.deviation import Deviation
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task
from towline.ocp.tasks.task_limits import TaskLimits

LASTS = 2.0  # [s]
NODES = np.linspace(0, LASTS, 21)
RIGHT = {"kind": "line", "start": [0, 0, 1], "end": [0.2, 0.1, 1.1]}
POINTS = {"kind": "waypoints", "blend": 0, "points": [[0, 0, 1], [0.1, 0.1, 1], [0.2, 0, 1.1]]}
IN_CARRIER = {"kind": "line", "start": [0, 0, -1], "end": [0.05, 0, -1.1], "frame": "quad"}
ROUND = {"quad": {"kind": "circle", "centre": [0, 0, 0], "radius": 0.05, "rate": 2 * np.pi / LASTS}}


def on_the_path(task, robot="ipanema-1"):
    """The scenario and the deviation that is none."""
    scenario = lay_out(load(robot), read_task({"duration": LASTS, **task}))
    none = np.zeros((len(NODES), scenario.count))
    return scenario, Deviation(NODES, none, none, none, np.zeros((len(NODES), scenario.robot.m)))


def moved(scenario, deviation, owner, coordinate, values, bc_type="not-a-knot"):
    """The deviation with one coordinate along the cubic spline through values at the nodes: a motion, exactly."""
    curve = CubicSpline(NODES, values, bc_type=bc_type)
    column = scenario.owners().index((owner, coordinate))
    parts = []
    for k, part in enumerate((deviation.q, deviation.v, deviation.a)):
        parts.append(part.copy())
        parts[-1][:, column] = curve(NODES, k)
    return Deviation(NODES, *parts, deviation.tensions)


def found(scenario, deviation):
    """What the audit saw passed, by name."""
    passed = {}
    for excess in audit(scenario, deviation).excess:
        passed.setdefault(excess.limit, []).append(excess)
    return passed


TUBE = {"position": 0.05, "attitude": 0.1, "ends": "exact"}
SMALL = 1e-4


@pytest.mark.parametrize("frame", ["world", "carrier"])
@pytest.mark.parametrize("coordinate", [0, 2, 4])
def test_ends_of_the_tube(frame, coordinate):
    if frame == "world":
        scenario, none = on_the_path({"path": RIGHT, "tube": TUBE})
    else:
        base = {"kind": "given", "paths": ROUND}
        scenario, none = on_the_path({"path": IN_CARRIER, "tube": TUBE, "base": base}, "wang-flying")
    assert audit(scenario, none).passed
    away = moved(scenario, none, None, coordinate, np.full(len(NODES), SMALL))
    told = found(scenario, away)
    assert set(told) == {"tube.ends"}
    assert [excess.time for excess in told["tube.ends"]] == [0, LASTS]
    assert [excess.value for excess in told["tube.ends"]] == pytest.approx([SMALL] * 2, rel=1e-3)
    assert str(told["tube.ends"][0]).startswith("tube.ends of the platform: distance from its path must be 0 ")
    late = moved(scenario, none, None, coordinate, SMALL * NODES**2 * (NODES - LASTS))  # speed at the end alone
    told = found(scenario, late)
    assert set(told) == {"tube.ends"}
    (excess,) = told["tube.ends"]
    assert excess.time == LASTS
    assert excess.unit == ("rad/s" if coordinate == 4 else "m/s")
    assert excess.value == pytest.approx(SMALL * LASTS**2, rel=1e-3)
    free, _ = on_the_path({"path": RIGHT, "tube": {**TUBE, "ends": "free"}})
    if frame == "world":
        assert audit(free, away).passed
        assert audit(free, late).passed


class Rising(Deviation):
    """A deviation t^4 (T - t)^4 of x, a polynomial beyond those of any scheme, with an acceleration at the start."""

    def evaluate(self, times):
        u, slope = times * (LASTS - times), LASTS - 2 * times
        size, pushed = SNAP / (24 * LASTS**4), self.a[0, 0] / (2 * LASTS**3)
        parts = np.zeros((3, len(times), self.q.shape[1]))
        parts[0, :, 0] = size * u**4 + pushed * times**2 * (LASTS - times) ** 3
        parts[1, :, 0] = 4 * size * u**3 * slope  # the ends are judged by positions
        parts[2, :, 0] = size * (12 * (u * slope) ** 2 - 8 * u**3)
        return *parts, None


SNAP = 5e6  # [m/s^4]


def test_rest_at_an_end_whatever_the_snap():
    """A motion whose jerk grows at once is at rest at its ends: differences there have no error that is seen."""
    scenario, none = on_the_path({"path": RIGHT, "tube": {"position": "free", "ends": "rest"}})
    rising = Rising(none.nodes, none.q, none.v, none.a, none.tensions)
    assert "tube.ends" not in found(scenario, rising)
    pushed = np.zeros_like(none.a)
    pushed[0, 0] = 2e-3
    (excess,) = found(scenario, replace(rising, a=pushed))["tube.ends"]
    assert (excess.time, excess.unit) == (0, "m/s^2")
    assert excess.value == pytest.approx(2e-3, rel=0.02)


def test_exact_waypoints():
    tube = {"position": 0.05, "attitude": 0.1, "ends": "free", "waypoints": "exact"}
    scenario, none = on_the_path({"path": POINTS, "tube": tube})
    assert audit(scenario, none).passed
    knot = scenario.task.path.knots(LASTS)[1]
    bump = SMALL * np.exp(-(((NODES - knot) / 0.3) ** 2))
    told = found(scenario, moved(scenario, none, None, 1, bump))
    assert set(told) == {"tube.waypoints"}
    (excess,) = told["tube.waypoints"]
    assert excess.time == pytest.approx(knot)
    assert excess.value == pytest.approx(SMALL, rel=0.01)
    assert excess.about == "platform at point 2"
    beside = SMALL * np.sin(2 * np.pi * (NODES - knot))
    assert audit(scenario, moved(scenario, none, None, 1, beside)).excess == []


def test_the_tube_and_its_attitude():
    scenario, none = on_the_path({"path": RIGHT, "tube": {**TUBE, "ends": "free"}})
    bump = np.sin(np.pi * NODES / LASTS)
    told = found(scenario, moved(scenario, none, None, 1, 0.051 * bump))["tube.position"]
    assert told[0].value == pytest.approx(0.051, rel=1e-4)
    assert told[0].time == pytest.approx(LASTS / 2, abs=0.01)
    told = found(scenario, moved(scenario, none, None, 3, 0.11 * bump))["tube.attitude"]
    assert told[0].value == pytest.approx(0.11, rel=1e-4)


@pytest.mark.parametrize(("seconds", "bound"), [(0.9, 1.0), (3.2, 3.0)])
def test_durations_of_a_range(seconds, bound):
    path = {"kind": "rest", "pose": [0, 0, 1]}
    scenario, none = on_the_path({"path": path, "duration": {"min": 1, "max": 3}, "tube": TUBE})
    inside = replace(none, nodes=NODES / LASTS * 2)
    assert audit(scenario.lasting(2.0), inside).passed
    told = found(scenario.lasting(seconds), replace(none, nodes=NODES / LASTS * seconds))
    assert set(told) == {"duration"}
    assert told["duration"][0].value == pytest.approx(seconds)
    assert told["duration"][0].bound == bound
    # The nodes end elsewhere than the motion that was audited.
    assert set(found(scenario.lasting(2.0), replace(none, nodes=NODES / LASTS * 2.2))) == {"duration"}
    fixed, none = on_the_path({"path": path, "tube": TUBE})
    assert set(found(fixed.lasting(2.5), replace(none, nodes=NODES / LASTS * 2.5))) == {"duration"}


@pytest.mark.parametrize(("beyond", "passes"), [(0.5, True), (2.0, False)])
@pytest.mark.parametrize(("bound", "sign"), [(1.0, -1), (3.0, 1)])
def test_durations_have_a_relative_tolerance(bound, sign, beyond, passes):
    """A twentieth of a millionth beyond the bound is rounding, a fifth of one is too short or too long."""
    path = {"kind": "rest", "pose": [0, 0, 1]}
    scenario, none = on_the_path({"path": path, "duration": {"min": 1, "max": 3}, "tube": TUBE})
    seconds = bound * (1 + sign * beyond * 1e-7)
    told = found(scenario.lasting(seconds), replace(none, nodes=NODES / LASTS * seconds))
    assert set(told) == (set() if passes else {"duration"})
    # Nodes and audited motion agree as far.
    apart = found(scenario.lasting(2.0), replace(none, nodes=NODES / LASTS * 2.0 * (1 + beyond * 1.5e-7)))
    assert set(apart) == (set() if passes else {"duration"})


def test_the_platforms_box():
    limits = {"platform_box": {"min": [-1, -1, 0], "max": [0.21, 1, 2]}}
    scenario, none = on_the_path({"path": RIGHT, "tube": {**TUBE, "ends": "free"}, "limits": limits})
    assert audit(scenario, none).passed
    told = found(scenario, moved(scenario, none, None, 0, 0.02 * NODES / LASTS))
    assert set(told) == {"platform_box"}
    (excess,) = told["platform_box"]
    assert (excess.time, excess.bound, excess.accepted) == (LASTS, 0.21, "at most")
    assert excess.value == pytest.approx(0.22)


@pytest.mark.parametrize("ends", ["rest", "periodic", "exact"])
def test_ends_of_carriers(ends):
    rest = {"path": {"kind": "rest", "pose": [0, 0, -1]}, "base": {"kind": "free", "ends": ends}}
    scenario, none = on_the_path(rest, "wang-flying")
    assert audit(scenario, none).passed
    for values in (SMALL * NODES / LASTS, SMALL * NODES**2):
        assert set(found(scenario, moved(scenario, none, 0, 1, values))) == {"base.ends"}
    away = moved(scenario, none, 0, 1, np.full(len(NODES), SMALL))
    assert set(found(scenario, away)) == ({"base.ends"} if ends == "exact" else set())


def test_a_motion_does_not_jump():
    """Values that belong together nowhere else than in a program that was not solved."""
    scenario, none = on_the_path({"path": RIGHT, "tube": {**TUBE, "ends": "free"}})
    for part, unit in (("q", "m"), ("v", "m/s")):
        values = getattr(none, part).copy()
        values[10:, 1] += 1e-3
        told = found(scenario, replace(none, **{part: values}))
        assert "motion" in told
        assert told["motion"][0].time >= NODES[9]
        assert unit in {excess.unit for excess in told["motion"]}
    base = {"kind": "free", "ends": "free"}
    scenario, none = on_the_path({"path": {"kind": "rest", "pose": [0, 0, -1]}, "base": base}, "wang-flying")
    values = none.q.copy()
    values[5, 0] += 1e-3
    assert {excess.about for excess in found(scenario, replace(none, q=values))["motion"]} == {"carriers"}


def test_soft_limits_are_told_apart():
    limits = {"platform_speed": 0.05, "platform_acceleration": 0.01, "soft": {"platform_speed": 0.1}}
    scenario, _ = on_the_path({"path": RIGHT, "limits": limits})
    seen = audit(scenario, None)
    assert [excess.limit for excess in seen.excess] == ["platform_acceleration"]
    assert [excess.limit for excess in seen.soft_excess] == ["platform_speed"]
    assert not seen.passed
    speeds = np.linalg.norm(seen.motion.velocity[:, :3], axis=1)
    assert seen.soft_excess[0].value == pytest.approx(speeds.max(), rel=1e-6)
    assert seen.soft_excess[0].time == seen.times[speeds.argmax()]


def test_an_excess_is_a_sentence_and_data():
    excess = Excess("cable_speed", "cable 3", 0.25, 1.5, 1.0, "m/s")
    assert str(excess) == "cable_speed of cable 3 must be at most 1 m/s but is 1.5 m/s at t = 0.250 s"
    told = json.loads(json.dumps(excess.to_dict()))
    assert told["text"] == str(excess)
    assert (told["limit"], told["about"], told["time"], told["value"], told["bound"], told["unit"]) == (
        "cable_speed",
        "cable 3",
        0.25,
        1.5,
        1.0,
        "m/s",
    )
    nowhere = Excess("duration", "motion", None, np.nan, 1.0, "s", "at least", "why")
    assert str(nowhere) == "duration of motion must be at least 1 s but is undefined (why)"
    assert nowhere.to_dict()["value"] is None
    scenario, _ = on_the_path({"path": RIGHT, "limits": {"cable_speed": 0.01}})
    summary = json.loads(json.dumps(audit(scenario, None).to_dict()))
    assert summary["excess"][0]["limit"] == "cable_speed"
    assert summary["excess"][0]["value"] > 0.01


ACROSS = {"kind": "line", "start": [-0.3, 0, 0.6], "end": [0.3, 0, 0.9]}


@pytest.mark.parametrize("seconds", [1e-3, 2e-3, 0.0123])
def test_a_motion_of_milliseconds_is_looked_at_inside_too(seconds):
    """At its ends and in its middle this line accelerates nowhere; between them it asks for what no cable gives."""
    found = plan(load("planar-4"), {"path": ACROSS, "duration": seconds})
    assert found.status is MotionStatus.INFEASIBLE
    way = np.linalg.norm(np.subtract(ACROSS["end"], ACROSS["start"]))
    s = np.linspace(0, 1, 10_001)
    most = (420 * s**2 * (1 - s) ** 2 * np.abs(1 - 2 * s)).max() * way / seconds**2
    robot = found.scenario.robot
    given = robot.weight + robot.t_max.sum()
    assert found.audit.violation.max() > 0.99 * robot.platform.mass * most - given  # instants are near the peak
    # What is saved and drawn shows it too.
    assert np.isnan(found.trajectory["tensions"].to_numpy()).any(axis=1).sum() > 1


def least_tension_rate(dynamics, motion, seconds, intervals=40):
    """The least largest rate of any tensions that give what a motion needs at instants, by one linear program."""
    robot, times = dynamics.robot, np.linspace(0, seconds, intervals + 1)
    path = motion.at(times, seconds)
    rows = robot.dof_mask.astype(bool)
    A = dynamics.wrench_matrix(path.pose)[:, rows]
    w = dynamics.required_wrench(*path)[:, rows]
    n, m = len(times), robot.m
    balance = np.hstack([block_diag(*A), np.zeros((n * A.shape[1], 1))])
    step = np.kron(np.diff(np.eye(n), axis=0), np.eye(m)) / np.diff(times)[0]
    change = np.vstack([np.hstack([sign * step, -np.ones((len(step), 1))]) for sign in (1, -1)])
    box = [*zip(np.tile(robot.t_min, n), np.tile(robot.t_max, n), strict=True), (0, None)]
    cost = np.append(np.zeros(n * m), 1.0)
    return linprog(cost, change, np.zeros(len(change)), balance, w.ravel(), box, method="highs").fun


def test_tensions_that_change_too_fast_prove_nothing_where_others_do_not():
    """A fixed motion of a redundant robot: which tensions give it is a choice, and some change slowly."""
    robot, task = load("planar-4"), read_task({"path": ACROSS, "duration": 1.0, "steps": 20})
    rate = least_tension_rate(Dynamics(robot), task.path, 1.0)
    nearest = plan(robot, task).audit
    assert 1.2 * rate < np.abs(np.diff(nearest.tensions, axis=0)).max() * nearest.rate
    found = plan(robot, task.model_copy(update={"limits": TaskLimits(tension_rate=1.2 * rate)}))
    assert found.feasible
    assert np.abs(np.diff(found.audit.tensions, axis=0)).max() * found.audit.rate <= 1.2 * rate * 1.001
    # The motion itself is still the task's, and what no choice keeps is not called proven.
    assert found.tracking_error_max == 0
    too_slow = plan(robot, task.model_copy(update={"limits": TaskLimits(tension_rate=0.5 * rate)}))
    assert too_slow.status is MotionStatus.NOT_FOUND
    assert [excess.limit for excess in too_slow.audit.excess] == ["tension_rate"]


@pytest.mark.parametrize(("most", "passes"), [(1e-3, False), (0.00149, False), (0.00151, True), (0.3, True)])
def test_a_small_tilt_is_told_as_exactly_as_a_large_one(most, passes):
    rest = {"kind": "rest", "pose": [0, 0, 0.75, 0, 0.0015, 0]}
    found = plan(load("planar-4"), {"path": rest, "duration": 0.5, "limits": {"platform_tilt": most}})
    assert found.feasible is passes
    assert [excess.limit for excess in found.audit.excess] == ([] if passes else ["platform_tilt"])


def test_more_samples_than_a_machine_holds_are_refused():
    with pytest.raises(InputError, match=r"output_rate must be at most 500000 1/s, .*got 1e\+09 1/s") as raised:
        plan(load("planar-4"), {"path": ACROSS, "duration": 2, "output_rate": 1e9})
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("size", [1.0, 1e-6])
def test_a_motion_is_feasible_if_and_only_if_it_has_tensions_whatever_the_size_of_forces(size):
    """Just beyond what the cables can hold, by a linear program: the verdict and the tensions agree."""
    robot, pose = load("cogiro"), np.array([1.0, 0.5, 1.5, 0, 0, 0])
    balance = np.column_stack([Dynamics(robot).wrench_matrix(pose), np.zeros(6)])
    below = np.column_stack([np.eye(8), -np.ones(8)])
    weight = [0, 0, robot.weight, 0, 0, 0]
    least = linprog([0] * 8 + [1], below, np.zeros(8), balance, weight, method="highs").fun  # [N], the largest tension
    for short in (-1e-9, 1e-10, 1e-8, 1e-6, 1e-5):  # of it
        cables = [
            cable.model_copy(update={"t_min": 0.0, "t_max": least * (1 - short) * size}) for cable in robot.cables
        ]
        platform = robot.platform.model_copy(update={"mass": robot.platform.mass * size})
        smaller = robot.model_copy(update={"cables": tuple(cables), "platform": platform})
        found = plan(smaller, {"path": {"kind": "rest", "pose": pose.tolist()}, "duration": 0.1})
        assert np.isfinite(found.audit.tensions).all() == found.feasible
        assert found.feasible or short > 0
        assert not found.feasible or short <= 1e-6
        if found.feasible:
            assert (found.audit.tensions <= smaller.t_max).all()


@pytest.mark.parametrize(("name", "duration"), [("multi-quadrotor-3", 0.6), ("wang-ctmrts", 1.2)])
def test_the_certificate_of_few_cables_is_that_of_the_worst_instant(name, duration):
    """By least squares at each instant, whose residual is missing whatever the tensions are."""
    robot = load(name)
    end = np.add(robot.home[:3], [1.5, 0, 0])
    task = {"path": {"kind": "line", "start": robot.home[:3].tolist(), "end": end.tolist()}, "duration": duration}
    found = plan(robot, task)
    worst, motion = found.certificate, found.audit.motion
    assert worst.shortfall == pytest.approx(max(each.shortfall for each in found.infeasible_spans))
    required = Dynamics(robot).required_wrench(*motion)
    matrices = Dynamics(robot).wrench_matrix(motion.pose, found.audit.carriers.pose)
    scale = np.array([1, 1, 1, *3 * [1 / robot.length]])
    for row in range(0, len(required), 50):
        A, w = scale[:, None] * matrices[row], scale * required[row]
        missing = np.linalg.norm(w - A @ np.linalg.lstsq(A, w)[0])  # of tensions of any sign
        assert missing <= worst.shortfall * (1 + 1e-6)


@pytest.mark.parametrize(("moving", "m"), [([0, 2, 4], 4), ([0, 1, 2], 4), ([*range(6)], 6), ([*range(6)], 8)])
def test_cables_that_lose_a_freedom_are_few_and_have_the_pseudo_inverse(moving, m):
    """Rounding gives products A A^T of these ranks an inverse, of which 9 in 10 looked like one of full rank."""
    draw, n = np.random.default_rng(m), len(moving)
    for rank in [*range(1, n + 1)] * 20:
        A = np.zeros((1, 6, m))
        A[0, moving] = draw.normal(size=(n, rank)) @ draw.normal(size=(rank, m))
        few, inverse = few_and_inverse(A, np.array(moving))
        assert few or rank == n
        np.testing.assert_allclose(A[0] @ inverse[0] @ A[0], A[0], atol=1.1e-3 * np.linalg.norm(A[0], 2))
