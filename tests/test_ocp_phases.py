"""Phases: loads that change, ground that bears them, and tensions that rise and fall without jumps between them."""

import copy
from itertools import product

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from towline import time_along
from towline.base.errors import InputError
from towline.figures.plan import tensions
from towline.models import Dynamics, Robot, load
from towline.models.parsing import parse_yaml
from towline.ocp import MotionStatus, Task, plan
from towline.ocp.sweeps.axis import read_axes
from towline.ocp.sweeps.cases import Cases
from towline.ocp.tasks.lay_out import lay_out
from towline.solvers import solve_batch
from towline.viewer.replay import Replay

from .told import told, without_offers

COGIRO = load("cogiro")
MASS = 50.0
LOAD = {"mass": MASS, "com": [0.1, 0.05, -0.4], "inertia": [2, 3, 4, 0.1, -0.2, 0.3]}
CORNERS = [[0.5, 0.5, -0.6], [-0.5, 0.5, -0.6], [-0.5, -0.5, -0.6], [0.5, -0.5, -0.6]]
HIGH, LOW, AWAY, DOWN = [0, 0, 2], [0, 0, 1], [1, 0, 2], [1, 0, 1]


def line(start, end, **more):
    return {"path": {"kind": "line", "start": start, "end": end}, "duration": 2, **more}


PICK_AND_PLACE = [
    line(HIGH, LOW, name="approach"),
    {"name": "pick-up", "duration": 0.5, "load": LOAD, "ground": {"support": CORNERS}},
    line(LOW, AWAY, name="lift", load=LOAD),
    line(AWAY, DOWN, name="lower", load=LOAD),
    {"name": "set-down", "duration": 0.5, "load": LOAD, "ground": {}},
    line(DOWN, AWAY, name="leave"),
]


def with_load(robot, carried):
    """The robot whose platform is one rigid body with the load, by Steiner's theorem."""
    mass, com = robot.platform.mass + carried["mass"], np.zeros(3)
    bodies = [(robot.platform.mass, np.array(robot.platform.com), robot.inertia)]
    xx, yy, zz, xy, xz, yz = carried["inertia"]
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=float)
    bodies.append((carried["mass"], np.array(carried["com"], dtype=float), own))
    com = sum(m * at for m, at, _ in bodies) / mass
    inertia = np.zeros((3, 3))
    for m, at, about in bodies:
        arm = at - com
        inertia += about + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    data = robot.model_dump()
    six = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    data["platform"] |= {"mass": mass, "com": com.tolist(), "inertia": [float(value) for value in six]}
    return Robot.model_validate(data)


def balance(planned):
    """Return the force of cables and ground on the platform at each audited instant, (n, 3) [N], from the file."""
    robot, audit = planned.scenario.robot, planned.audit
    turned = Rotation.from_euler("ZYX", audit.motion.pose[:, 5:2:-1]).as_matrix()
    attachments = audit.motion.pose[:, None, :3] + np.einsum("nij,mj->nmi", turned, robot.attachments)
    cables = robot.home_anchors - attachments
    cables /= np.linalg.norm(cables, axis=2, keepdims=True)
    pulled = np.einsum("nm,nmi->ni", audit.tensions, cables)
    return pulled + audit.supports.sum(axis=1)[:, None] * [0, 0, 1]


def carried_at(planned):
    """The load's mass at each audited instant, from the task."""
    times, mass = planned.audit.times, np.zeros(len(planned.audit.times))
    start = 0.0
    for phase in planned.scenario.task.phases:
        mass[times >= start - 1e-9] = 0.0 if phase.load is None else phase.load.mass
        start += phase.duration
    return mass


@pytest.fixture(scope="module")
def placed():
    return plan(COGIRO, {"name": "place", "phases": PICK_AND_PLACE})


def test_platform_and_load_need_what_one_rigid_body_of_both_needs():
    """Forces are equal; moments about the two centres of mass differ by the moment of the force."""
    rng = np.random.default_rng(3)
    motion = rng.uniform(-1, 1, (3, 40, 6))
    numbers = np.array([LOAD["mass"], *LOAD["com"], *LOAD["inertia"]])
    ours = Dynamics(COGIRO)
    w = ours.required_wrench(*motion) + ours.carried_wrench(*motion, numbers)
    whole = with_load(COGIRO, LOAD)
    other = Dynamics(whole).required_wrench(*motion)
    turned = Rotation.from_euler("ZYX", motion[0][:, 5:2:-1])
    arm = turned.apply(np.array(whole.platform.com) - np.array(COGIRO.platform.com))
    assert w[:, :3] == pytest.approx(other[:, :3], abs=1e-10)
    assert w[:, 3:] == pytest.approx(other[:, 3:] + np.cross(arm, other[:, :3]), abs=1e-10)


@pytest.mark.parametrize("tube", [{}, {"position": 0.05, "attitude": 0.05}])
def test_a_load_all_the_way_is_a_heavier_platform(tube):
    """The same tensions as of a robot whose file has the load, along the same path."""
    path, common = {"kind": "line", "start": HIGH, "end": [1, 0.5, 1.5, 0, 0, 0.2]}, {"steps": 20, "tube": tube}
    common["objective"] = {"tension": 1000}
    ours = plan(COGIRO, {"phases": [{"name": "carry", "path": path, "duration": 3, "load": LOAD}], **common})
    theirs = plan(with_load(COGIRO, LOAD), {"path": path, "duration": 3, **common})
    assert ours.feasible
    assert theirs.feasible
    assert ours.audit.tensions == pytest.approx(theirs.audit.tensions, abs=1e-6 if not tube else 0.1)


def test_cables_and_ground_carry_what_there_is_at_every_instant(placed):
    assert placed.feasible
    mass = COGIRO.platform.mass + carried_at(placed)
    acceleration = placed.audit.motion.acceleration[:, :3]
    assert balance(placed) == pytest.approx(mass[:, None] * (acceleration - COGIRO.gravity), abs=1e-6)
    assert (placed.audit.supports >= 0).all()


def test_moments_balance_on_the_ground(placed):
    """About the origin of the level platform: of cables, corners and both weights."""
    audit, robot = placed.audit, COGIRO
    rows = (audit.times >= 2) & (audit.times < 2.5)
    cables = robot.home_anchors - (robot.attachments + np.array(LOW))
    cables /= np.linalg.norm(cables, axis=1, keepdims=True)
    moment = audit.tensions[rows] @ np.cross(robot.attachments, cables)
    moment += audit.supports[rows, :4] @ np.cross(CORNERS, [0, 0, 1.0])
    for mass, com in ((robot.platform.mass, robot.platform.com), (MASS, LOAD["com"])):
        moment += np.cross(com, mass * np.array(robot.gravity))
    assert np.abs(moment).max() < 1e-6


def test_the_ground_bears_the_load_alone_until_the_cables_take_it_over(placed):
    audit = placed.audit
    reaction = audit.supports.sum(axis=1)
    on_ground = ((audit.times >= 2) & (audit.times <= 2.5)) | ((audit.times >= 6.5) & (audit.times <= 7))
    assert not reaction[~on_ground].any()
    for first, last, sign in ((2.0, 2.499, -1), (6.501, 6.999, 1)):
        rows = slice(*np.searchsorted(audit.times, [first, last]))
        rates = np.diff(reaction[rows]) * audit.rate
        assert rates == pytest.approx(sign * MASS * 9.81 / 0.5, rel=1e-6)
    assert reaction[np.searchsorted(audit.times, 2.0)] == pytest.approx(MASS * 9.81)


def test_tensions_are_continuous_from_phase_to_phase(placed):
    """Across a boundary a tension changes in 1 ms no more than it does at the constant rates of the ground."""
    steps = np.abs(np.diff(placed.audit.tensions, axis=0))
    boundaries = np.searchsorted(placed.audit.times, [2, 2.5, 4.5, 6.5, 7])
    taken_up = steps[np.searchsorted(placed.audit.times, 2.25)].max()
    assert steps[boundaries - 1].max() < 2 * taken_up
    assert steps[boundaries].max() < 2 * taken_up


def test_reports_files_and_viewer_know_the_phases(placed, tmp_path):
    summary = {row["name"]: row for row in placed.to_dict()["phases"]}
    assert list(summary) == [phase["name"] for phase in PICK_AND_PLACE]
    assert summary["pick-up"]["reaction_max"] == pytest.approx(MASS * 9.81)
    assert summary["lift"]["reaction_max"] is None
    assert summary["lift"]["load"] == MASS
    assert "largest ground reaction [N]" in placed.report()
    saved = xr.load_dataset(placed.save(tmp_path / "place.nc"))
    assert saved["phase_end"].values == pytest.approx([2, 2.5, 4.5, 6.5, 7, 9])
    assert saved["ground_reaction"].max() == pytest.approx(MASS * 9.81)
    again = parse_yaml(saved.attrs["task"], Task, "task")
    assert again == placed.scenario.task
    assert plan(COGIRO, again).tension_max == placed.tension_max
    assert Replay(saved, "place.nc").at(0).margin == pytest.approx(placed.audit.tensions[0].min() - 100)
    figure = tensions(saved)
    assert "lift" in [text.get_text() for text in figure.axes[0].texts]


def test_an_impossible_load_is_proven_in_its_phase(tmp_path):
    phases = copy.deepcopy(PICK_AND_PLACE)
    for phase in phases[1:5]:
        phase["load"] = {**LOAD, "mass": 5000.0}
    planned = plan(COGIRO, {"phases": phases})
    assert planned.status is MotionStatus.INFEASIBLE
    assert "in phase 'lift'" in (first := told(planned).splitlines()[0]) or "'lower'" in first
    certificate = planned.certificate
    assert certificate.direction[2] > 0.9
    assert 2.5 <= certificate.time <= 6.5
    assert certificate.at_max.max() < COGIRO.m
    spans = planned.infeasible_spans
    assert [span.span for span in spans] == [pytest.approx((2.5, 6.5), abs=0.01)]
    replay = Replay(xr.load_dataset(without_offers(planned).save(tmp_path / "heavy.nc")), "heavy.nc")
    assert replay.at(replay.index_at(4)).certificate.shortfall > 1000


TAKE_OFF = [
    {"name": "take-off", "path": {"kind": "rest", "pose": LOW}, "duration": 1, "ground": {"slack": True}},
    line(LOW, HIGH, name="climb"),
    line(HIGH, LOW, name="sink"),
    {"name": "touch-down", "duration": 1, "ground": {"slack": True}},
]


def test_a_platform_takes_off_from_slack_cables_and_lands_on_them():
    planned = plan(COGIRO, {"phases": TAKE_OFF})
    assert planned.feasible
    audit = planned.audit
    assert np.abs(audit.tensions[[0, -1]]).max() < 1e-9
    assert audit.supports[[0, -1]].sum(axis=1) == pytest.approx(COGIRO.weight)
    climbing = (audit.times >= 1) & (audit.times <= 5)
    assert (audit.tensions[climbing] >= 100).all()
    assert planned.margin == pytest.approx(0, abs=1e-9)
    # Rest, the same way up and down, rest: the motion backwards in time is the motion.
    assert audit.tensions == pytest.approx(audit.tensions[::-1], abs=1e-6)
    assert balance(planned)[audit.times < 1, 2] == pytest.approx(COGIRO.weight)


def test_without_slack_cables_keep_their_least_tension_on_the_ground():
    phases = [{**phase, "ground": {}} if "ground" in phase else phase for phase in TAKE_OFF]
    planned = plan(COGIRO, {"phases": phases})
    assert planned.feasible
    assert planned.audit.tensions.min() == pytest.approx(100)


@pytest.mark.parametrize("scheme", ["linear", "hermite"])
def test_a_motion_in_a_tube_keeps_a_limit_of_rates_through_all_phases(scheme):
    """And it is at rest, on its path, wherever it is on the ground."""
    limits, tube = {"tension_rate": 600}, {"position": 0.05, "attitude": 0.05}
    task = {"phases": PICK_AND_PLACE, "tube": tube, "limits": limits, "steps": 36, "scheme": scheme}
    planned = plan(COGIRO, task)
    assert planned.feasible
    audit = planned.audit
    assert np.abs(np.diff(audit.tensions, axis=0)).max() * audit.rate <= 601
    resting = ((audit.times >= 2) & (audit.times <= 2.5)) | ((audit.times >= 6.5) & (audit.times <= 7))
    for value, expected in zip(audit.motion, (None, 0.0, 0.0), strict=True):
        if expected is not None:
            assert np.abs(value[resting]).max() < 1e-6
    assert audit.motion.pose[audit.times < 2.4][-1, :3] == pytest.approx(LOW, abs=1e-7)
    on_ground = balance(planned)[resting, 2]
    assert on_ground == pytest.approx((COGIRO.platform.mass + carried_at(planned)[resting]) * 9.81, abs=1e-5)


def test_one_phase_without_a_load_is_the_task_without_phases():
    """The grid of one phase is the even one; so all numbers are the same."""
    path, common = {"kind": "line", "start": HIGH, "end": LOW}, {"tube": {"position": 0.05}, "steps": 12}
    ours = plan(COGIRO, {"phases": [{"name": "sink", "path": path, "duration": 3}], **common})
    theirs = plan(COGIRO, {"path": path, "duration": 3, **common})
    assert ours.objective == pytest.approx(theirs.objective, rel=1e-9)
    assert ours.audit.tensions == pytest.approx(theirs.audit.tensions, abs=1e-6)


def test_quadrotors_lift_a_load_whose_cables_were_slack():
    robot = load("multi-quadrotor-3")
    ground, high = [0, 0, 0], [0, 0, 0.2]
    phases = [
        {"name": "take-off", "path": {"kind": "rest", "pose": ground}, "duration": 1, "ground": {"slack": True}},
        line(ground, high, name="lift"),
    ]
    task = {"phases": phases, "base": {"kind": "free"}, "tube": {"position": 0.1, "attitude": 0.2}, "steps": 40}
    planned = plan(robot, task)
    assert planned.feasible
    audit = planned.audit
    assert np.abs(audit.tensions[0]).max() < 1e-6
    assert audit.supports[0].sum() == pytest.approx(robot.weight)
    lengths = np.linalg.norm(
        Dynamics(robot).points(audit.motion.pose, audit.carriers.pose)[0]
        - Dynamics(robot).points(audit.motion.pose, audit.carriers.pose)[1],
        axis=2,
    )
    assert lengths == pytest.approx(np.tile(robot.fixed_lengths, (len(lengths), 1)), abs=1e-4)
    assert np.abs(np.diff(audit.tensions, axis=0)).max() * audit.rate < 5 * robot.weight  # taken up over the second
    assert audit.drift is None


def test_a_flying_robot_picks_up_a_load_in_its_own_frame_or_in_the_world():
    """A quadrotor that holds: its frame is the world's but for a shift, and the tensions are the same."""
    robot, carried = load("wang-flying"), {"mass": 0.5, "com": [0, 0, -0.1]}
    hold = {"kind": "hold", "poses": {"quad": [0, 0, 3, 0, 0, 0.4]}}
    pulls = []
    for frame, height in (("world", 2.0), ("quad", -1.0)):
        path = {"kind": "line", "frame": frame, "start": [0, 0, height], "end": [0, 0, height + 0.2]}
        path["start"], path["end"] = ([*p, 0, 0, 0.4 * (frame == "world")] for p in (path["start"], path["end"]))
        task = {"phases": [{"name": "lift", "path": path, "duration": 2, "load": carried}], "base": hold}
        planned = plan(robot, task)
        assert planned.feasible
        pulls.append(planned.audit.tensions)
    assert pulls[0] == pytest.approx(pulls[1], abs=1e-9)
    free = {"phases": task["phases"], "tube": {"position": 0.05, "attitude": 0.05}, "base": hold, "steps": 20}
    assert plan(robot, free).feasible


IN_THE_AIR = [line(HIGH, LOW, name="empty"), line(LOW, HIGH, name="loaded", load=LOAD)]


def test_a_load_that_changes_in_the_air_makes_tensions_jump():
    planned = plan(COGIRO, {"phases": IN_THE_AIR})
    assert planned.feasible
    row = np.searchsorted(planned.audit.times, 2.0)
    jump = np.abs(planned.audit.tensions[row] - planned.audit.tensions[row - 1]).max()
    assert jump > 50
    assert f"by up to {jump:.1f} N at t = 2.000 s" in planned.report()


def changed(**fields):
    return {"phases": PICK_AND_PLACE, **fields}


def phase(index, **fields):
    phases = copy.deepcopy(PICK_AND_PLACE)
    phases[index] |= fields
    return {"phases": phases}


@pytest.mark.parametrize(
    ("task", "message"),
    [
        (
            phase(2, **line([0, 0, 1.1], AWAY)),
            r"phases\[2\] must begin where phases\[1\] ends, got a gap of 0.1 m and 0",
        ),
        (phase(2, **line([*LOW, 0, 0, 0.2], AWAY)), "a gap of 0 m and 0.2 rad"),
        (phase(2, path={"kind": "line", "timing": "uniform", "start": LOW, "end": AWAY}), "begin with the speed with"),
        (phase(0, duration=None), r"phases\[0\].duration must be a number > 0 \[s\] for a path of kind line"),
        (phase(0, path=None), r"phases\[0\].path must be a path, since no phase comes before"),
        (phase(3, name="lift"), r"phases\[3\].name must be unique, got 'lift' twice"),
        (phase(0, ground={}), r"phases\[0\].path must be of kind rest in a phase on the ground, got line"),
        (phase(1, load=None), r"phases\[1\].load must weigh at least as much as that of phases\[2\]"),
        (
            phase(1, ground={"support": [[2, 0, 0], [2, 1, 0]]}),
            r"phases\[1\].ground.support must have points on all sides",
        ),
        (phase(1, ground={"suport": []}), "suport is not a known key, did you mean 'support'"),
        (changed(duration=5), "duration must be left out with phases"),
        (changed(path={"kind": "rest", "pose": LOW}), "path must be left out with phases"),
        (changed(steps=20), "steps must be at least 4 for each phase, 24, got 20"),
        (changed(tube={"position": 0.1}, scheme="spline"), "scheme must be one of linear, hermite with phases, got"),
        (changed(tube={"position": 0.1, "waypoints": "exact"}), "tube.waypoints must be free with phases"),
        ({"phases": TAKE_OFF, "objective": {"margin": 5}}, "phases.ground.slack must be false with a margin to choose"),
        ({"phases": TAKE_OFF, "initial": {"pose": [0, 0, 1, 0, 0, 0]}}, "initial must be left out if the first phase"),
        ({"phases": IN_THE_AIR, "limits": {"tension_rate": 500}}, "limits.tension_rate must be left out because"),
        ({"phases": IN_THE_AIR, "tube": {"position": 0.1}}, "tube and base must fix the motion because"),
        ({}, "path is missing"),
    ],
)
def test_what_phases_cannot_be_is_refused_in_one_line(task, message):
    with pytest.raises(InputError, match=message) as raised:
        plan(COGIRO, task)
    assert "\n" not in str(raised.value)


def test_time_laws_are_of_one_path():
    with pytest.raises(InputError, match="phases must be left out to time a path"):
        time_along(COGIRO, {"phases": PICK_AND_PLACE})


def test_a_carrier_can_move_wait_and_move():
    """A sequence of paths is a path: here of the quadrotor that carries paper F's robot."""
    there, back = ([0, 0, 3, 0, 0, 0], [0.3, 0, 3, 0, 0, 0])
    moves = [{"kind": "line", "start": there, "end": back}, {"kind": "rest", "pose": back}]
    parts = [{"path": path, "duration": 2} for path in moves]
    base = {"kind": "given", "paths": {"quad": {"kind": "sequence", "parts": parts}}}
    path = {"kind": "rest", "frame": "quad", "pose": [0, 0, -1]}
    scenario = lay_out(load("wang-flying"), Task.model_validate({"path": path, "duration": 4, "base": base}))
    _, carriers = scenario.motion(np.array([0.0, 1.0, 2.0, 3.0, 4.0]), None)
    assert carriers.pose[:, 0, 0] == pytest.approx([0, 0.15, 0.3, 0.3, 0.3])
    parts[1]["path"] = {"kind": "rest", "pose": [0.4, 0, 3, 0, 0, 0]}
    with pytest.raises(InputError, match=r"parts\[1\] must begin where parts\[0\] ends, got a gap of 0.1 m"):
        Task.model_validate({"path": path, "duration": 4, "base": base})


def test_a_sweep_varies_a_phase_by_its_number():
    cases = Cases(
        COGIRO, Task.model_validate({"phases": PICK_AND_PLACE}), read_axes({"phases[2].duration": [1.0, 3.0]})
    )
    cases.check()
    assert [cases.case(number)[1].seconds for number in range(2)] == [8.0, 10.0]
    assert cases.units() == ("s",)


def test_a_copy_with_other_phases_has_their_path():
    """`model_copy` checks nothing and computes nothing: the path of the phases before would be followed."""
    whole = Task.model_validate({"phases": [line(HIGH, LOW, name="down"), line(LOW, HIGH, name="up")]})
    part = whole.model_copy(update={"phases": whole.phases[:1]})
    assert part.path.natural_duration == 2.0
    assert part == Task.model_validate({"phases": [line(HIGH, LOW, name="down")]})


def test_tasks_with_phases_are_equal_whatever_was_computed_from_them():
    """Compare what was given: a path keeps what it computed, arrays, which have no single truth value."""
    ours, theirs = (Task.model_validate({"phases": [line(HIGH, LOW, name="down")]}) for _ in range(2))
    assert plan(COGIRO, ours).feasible
    assert ours == theirs
    assert plan(COGIRO, theirs).feasible
    assert ours == theirs
    assert ours != ours.model_copy(update={"margin": 1.0})


def test_a_phase_between_two_instants_of_the_audit_is_refused():
    """Nothing would be evaluated in it: a load of 100 t for a third of a millisecond passed."""
    rest = {"kind": "rest", "pose": HIGH}
    phases = [{"name": name, "path": rest, "duration": 1.0001} for name in ("before", "short", "after")]
    phases[1] |= {"duration": 0.0003, "load": {"mass": 1e5}}
    with pytest.raises(InputError, match=r"phases\[1\] must last at least 0.01 s.* got 0.0003 s"):
        plan(COGIRO, {"phases": phases})
    phases[1]["duration"] = 0.01
    assert not plan(COGIRO, {"phases": phases}).feasible


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ({"kind": "lin"}, "phases[0].path.kind must be one of circle, feed, line, rest, samples, timed,"),
        ({"kind": "line", "start": HIGH}, "phases[0].path.end is missing"),
        (
            {"kind": "rest", "pose": HIGH, "frame": "moon"},
            "phases[0].path.frame must be one of world, frame, got 'moon'",
        ),
    ],
)
def test_the_path_of_a_phase_is_named_like_that_of_a_task(path, message):
    with pytest.raises(InputError) as refused:
        plan(COGIRO, {"phases": [{"name": "a", "path": path, "duration": 1}]})
    assert message in str(refused.value)


def test_a_phase_that_an_infeasible_motion_steps_over_has_no_tensions():
    """Show what is proven impossible at the samples of the output only: here every tenth of a second."""
    short = line(HIGH, [0, 0, 2.3], name="short", duration=0.02)
    phases = [line(LOW, HIGH, name="up", duration=1.01), short, line([0, 0, 2.3], HIGH, name="down", duration=0.97)]
    limits = {"platform_speed": 0.1}
    shown = plan(COGIRO, {"phases": phases, "tube": {"position": 0.01}, "limits": limits, "output_rate": 10})
    assert shown.status is MotionStatus.INFEASIBLE
    assert shown.phases[1].tension_max is None
    assert "short" in told(shown)


def test_a_certificate_of_slack_cables_has_their_lower_limit():
    """A load beside its only support: the cables that would have to push have 0 N, not t_min and the margin."""
    ground = {"slack": True, "support": [[0, 0, 0]]}
    rest = {"name": "tilting", "duration": 1, "path": {"kind": "rest", "pose": HIGH}, "ground": ground}
    tilting = plan(COGIRO, {"margin": 20, "phases": [rest | {"load": {"mass": 1e5, "com": [2, 0, 0]}}]})
    assert tilting.status is MotionStatus.INFEASIBLE
    (limits,) = (text for text in told(tilting).splitlines() if "t_min of cables" in text)
    assert "(0 N); t_max of cables" in limits
    assert "(4980 N)" in limits


def test_a_phase_with_a_space_in_its_name_is_refused_in_words():
    with pytest.raises(InputError, match=r"phases\[0\].name must have only letters, digits, .* got 'pick up'"):
        Task.model_validate({"phases": [line(HIGH, LOW, name="pick up")]})


UNSURE = {"mass": 300, "com": [0.1, 0, -0.4], "inertia": [20, 30, 40, 1, -2, 3], "mass_tolerance": 0.2}
UNSURE |= {"com_tolerance": [0.2, 0.1, 0]}


@pytest.mark.parametrize(("seconds", "tube"), [(2.4, 0), (2.1, 0.3)])
def test_tensions_exist_for_every_load_within_its_tolerances(seconds, tube):
    """A robot whose platform is one body with a load drawn from within them can follow the motion, too.

    The inertia about the CoM as given is in proportion to the mass.
    """
    fast = line([-2, -1, 1], [2, 1, 1.6], name="carry", load=UNSURE) | {"duration": seconds}
    task = {"phases": [fast], "tube": {"position": tube}, "steps": 40, "margin": 20}
    planned = plan(COGIRO, task)
    assert planned.feasible
    assert plan(COGIRO, {**task, "tube": {}}).feasible == (tube == 0)  # the tube is what makes the faster one possible
    assert "with every load of the task" in str(planned)
    rng, rows = np.random.default_rng(5), slice(None, None, 50)
    motion = [part[rows] for part in planned.audit.motion]
    A = Dynamics(COGIRO).wrench_matrix(motion[0], None)
    low, high = COGIRO.t_min + 20 - 1e-4, COGIRO.t_max - 20 + 1e-4
    for mass, x, y in [(360, 0.2, 0.1), (240, -0.2, -0.1), *rng.uniform([240, -0.2, -0.1], [360, 0.2, 0.1], (10, 3))]:
        off = np.array([x, y, 0.0])
        xx, yy, zz, xy, xz, yz = UNSURE["inertia"]
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) * mass / 300
        inertia -= mass * (off @ off * np.eye(3) - np.outer(off, off))
        six = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        its = with_load(COGIRO, {"mass": mass, "com": np.array(UNSURE["com"]) + off, "inertia": six})
        w = Dynamics(its).required_wrench(*motion)
        arm = Rotation.from_euler("ZYX", motion[0][:, 5:2:-1]).apply(its.platform.com)
        w[:, 3:] += np.cross(arm, w[:, :3])  # about the CoM of the platform alone
        assert solve_batch(A, w, low, high, length=COGIRO.length).feasible.all()


def test_a_load_is_as_uncertain_as_the_strongest_cable_permits():
    """On one vertical cable at rest the tension is (M + m (1 + e)) g."""
    data = load("point-mass-3").model_dump(mode="json")
    cable = {**data["cables"][0], "anchor": [0, 0, 3], "t_min": 0, "t_max": 60}
    hoist = Robot.model_validate({**data, "platform": {**data["platform"], "mass": 2.0}, "cables": [cable]})
    largest = (60 / 9.81 - 2) / 3 - 1

    def held(tolerance):
        rest = {"name": "hold", "path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 1}
        return plan(hoist, {"phases": [rest | {"load": {"mass": 3, "mass_tolerance": tolerance}}]})

    assert held(largest - 1e-3).feasible
    failed = held(largest + 1e-2)
    assert failed.status is MotionStatus.INFEASIBLE
    assert failed.certificate.load[0] == pytest.approx(3 * (1 + largest + 1e-2))
    assert failed.certificate.shortfall == pytest.approx(0.03 * 9.81)
    assert "with a load of 4.146 kg, CoM (0, 0, 0) m" in told(failed)


@pytest.mark.parametrize(
    ("load_keys", "keys", "message"),
    [
        ({"mass_tolerance": 1}, {}, "mass_tolerance must be less than 1, got 1"),
        ({"mass_tolerance": -0.1}, {}, "mass_tolerance must be greater than or equal to 0"),
        ({"mass_tolerance": float("nan")}, {}, "mass_tolerance"),
        ({"com_tolerance": [0.1, 0]}, {}, "com_tolerance"),
        ({"com_tolerance": [0, 0, -0.1]}, {}, r"com_tolerance\[2\] must be greater"),
        ({"mass_tolerance": 0.1}, {"robust": 0.9}, "robust"),
    ],
)
def test_wrong_tolerances_are_one_line(load_keys, keys, message):
    carried = line(HIGH, LOW, name="carry", load={"mass": 5, **load_keys})
    with pytest.raises(InputError, match=message) as caught:
        plan(COGIRO, {"phases": [carried], **keys})
    assert "\n" not in str(caught.value)


def test_a_load_within_its_tolerances_is_picked_up_from_the_ground():
    """Tensions exist for any load, whatever share of its weight the ground carries, from none to all of it."""
    support = [[x, y, -1] for x in (-1, 1) for y in (-1, 1)]
    pick_up = {"name": "pick-up", "duration": 0.5, "load": UNSURE, "ground": {"support": support}}
    phases = [line([0, 0, 3], HIGH, name="approach"), pick_up, line(HIGH, [0.5, 0, 2.5], name="lift", load=UNSURE)]
    phases[2]["duration"] = 3
    planned = plan(COGIRO, {"phases": phases})
    assert planned.feasible
    A, com = Dynamics(COGIRO).wrench_matrix(np.array([*HIGH, 0, 0, 0]), None), np.array(COGIRO.platform.com)
    pushes = np.column_stack([np.r_[0, 0, 1, np.cross(point - com, [0, 0, 1])] for point in np.array(support)])
    limits, own = [*zip(COGIRO.t_min, COGIRO.t_max, strict=True)], np.r_[0, 0, COGIRO.weight, 0, 0, 0]
    for mass, x, y in product((240, 360), (-0.2, 0.2), (-0.1, 0.1)):
        weight = np.array([0, 0, mass * 9.81])
        its = np.r_[weight, np.cross(UNSURE["com"] + np.array([x, y, 0]) - com, weight)]
        for share in (0, 0.5, 1):
            assert linprog(np.zeros(8), A_eq=A, b_eq=own + (1 - share) * its, bounds=limits).success
            assert linprog(np.zeros(4), A_eq=pushes, b_eq=share * its).success
    pick_up["ground"] = {"support": [[0.1 + x, y, -1] for x in (-0.15, 0.15) for y in (-0.15, 0.15)]}
    with pytest.raises(InputError, match=r"phases\[1\].ground.support must have points on all sides of the CoM"):
        plan(COGIRO, {"phases": phases})
    surely = UNSURE | {"com_tolerance": [0.05, 0.1, 0]}
    assert plan(COGIRO, {"phases": [phases[0], *(phase | {"load": surely} for phase in phases[1:])]}).feasible


def test_tolerances_that_are_feasible_are_offered():
    """The offered share of the tolerances is feasible, and a slightly larger one is not."""
    fast = {"phases": [line([-2, -1, 1], [2, 1, 1.6], name="carry", load=UNSURE) | {"duration": 2.1}], "margin": 20}
    (offer,) = [each for each in plan(COGIRO, fast).relaxations if "com_tolerance" in each.name]
    for share, feasible in ((offer.possible / 100, True), (offer.possible / 100 + 0.03, False)):
        x, y, z = UNSURE["com_tolerance"]
        surer = UNSURE | {"mass_tolerance": 0.2 * share, "com_tolerance": [share * x, share * y, z]}
        phases = [fast["phases"][0] | {"load": surer}]
        assert plan(COGIRO, fast | {"phases": phases}).feasible == feasible
