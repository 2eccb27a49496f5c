"""How motions start and end: at rest where the path does; and ends and paths that no choice of the planner frees."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from towline import InputError
from towline.models import Dynamics, Robot, load
from towline.models.points import placed
from towline.ocp import MotionStatus, Planner, plan
from towline.ocp.audits.audit import audit
from towline.ocp.proofs.infeasible_ends import infeasible_ends
from towline.ocp.proofs.no_cycle import FEW, PLACES, Cycle
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task import read_task
from towline.ocp.tasks.task_limits import TaskLimits

from .told import told

LINE = {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 1.2]}
TUBE = {"position": 0.05, "attitude": 0.1}
ROBOT = load("ipanema-1")


def ends_of(planned):
    """Pose, and speed and acceleration by differences, of the platform and of each carrier at both ends."""
    times, poses = planned.audit.times, [planned.audit.motion.pose, *np.moveaxis(planned.audit.carriers.pose, 1, 0)]
    step = times[1] - times[0]
    for pose in poses:
        for rows in (pose[:4], pose[:-5:-1]):
            speed = (-11 * rows[0] + 18 * rows[1] - 9 * rows[2] + 2 * rows[3]) / (6 * step)
            acceleration = (2 * rows[0] - 5 * rows[1] + 4 * rows[2] - rows[3]) / step**2
            yield rows[0], np.abs(speed).max(), np.abs(acceleration).max()


@pytest.mark.parametrize("scheme", ["linear", "hermite", "spline"])
def test_a_line_in_a_tube_starts_and_ends_at_rest_on_its_points(scheme):
    """By differences of the audited poses: the program's own derivatives are not used."""
    planned = plan(ROBOT, {"path": LINE, "duration": 2, "tube": TUBE, "scheme": scheme, "steps": 40})
    assert planned.feasible
    for (pose, speed, acceleration), point in zip(ends_of(planned), (LINE["start"], LINE["end"]), strict=False):
        assert pose[:3] == pytest.approx(point, abs=1e-7)
        assert speed < 1e-4
        assert acceleration < 1e-2


@pytest.mark.parametrize("frame", ["world", "quad"])
def test_rest_can_be_required_on_a_path_that_moves(frame):
    """The platform leaves a circle's speed for rest at both ends, also in the frame of a carrier that is turned."""
    centre = [0, 0, 1] if frame == "world" else [0, 0, -1]
    circle = {"kind": "circle", "frame": frame, "centre": centre, "radius": 0.1, "rate": 0.5}
    task = {"path": circle, "duration": 4, "steps": 30, "tube": {"position": 0.1, "ends": "rest"}}
    robot = "ipanema-1"
    if frame == "quad":
        robot, hold = "wang-flying", {"kind": "hold", "poses": {"quad": [0, 0, 0, 0, 0, 3.1]}}
        task |= {"base": hold, "limits": {"platform_speed": 0.09}}
    planned = plan(robot, task)
    assert planned.feasible
    for _, speed, acceleration in list(ends_of(planned))[:2]:
        assert speed < 1e-4
        assert acceleration < 1e-2


SQUARE = {"kind": "waypoints", "points": [[0, 0, 1], [0.4, 0, 1.2], [0.4, 0.4, 1], [0, 0.3, 1.1], [0, 0, 1]]}
CYCLE = {"path": SQUARE, "duration": 3, "tube": {"position": "free", "ends": "periodic", "waypoints": "exact"}}


@pytest.mark.parametrize("scheme", ["linear", "spline"])
def test_a_cycle_ends_as_it_starts_without_a_stop(scheme):
    """Two rounds joined are one smooth motion, by differences across the joint; and no stop takes less force."""
    task = CYCLE | {"steps": 40, "scheme": scheme, "objective": {"jerk": 1000}}
    planned = plan(ROBOT, task)
    assert planned.feasible
    times = np.linspace(0, 3, 3001)
    pose = planned.scenario.motion(times, planned.deviation)[0].pose
    two = np.vstack([pose[:-1], pose])
    speed = np.diff(two, axis=0) / 1e-3
    changes = np.abs(np.diff(speed, n=2, axis=0)) / 1e-3  # of the acceleration, in a millisecond
    assert changes[2990:3010].max() < 1.2 * changes[100:2900].max()
    assert np.linalg.norm(speed[3000]) > 0.1
    knots = planned.scenario.path.knots(3.0)
    there = planned.scenario.motion(knots, planned.deviation)[0].pose[:, :3]
    np.testing.assert_allclose(there, SQUARE["points"], atol=1e-7)
    stopping = plan(ROBOT, task | {"tube": CYCLE["tube"] | {"ends": "rest"}})
    assert planned.objective < stopping.objective


def test_the_audit_sees_a_cycle_that_does_not_close():
    planned = plan(ROBOT, CYCLE | {"steps": 40})
    open_ended = planned.deviation.a.copy()
    open_ended[-1] += 1e-4
    off = audit(planned.scenario, replace(planned.deviation, a=open_ended))
    assert "tube.ends" in [excess.limit for excess in off.excess]


def test_carriers_of_a_cycle_return_by_default_and_it_can_be_replanned():
    circle = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.3, "rate": 0.5}
    task = {"path": circle, "base": {"kind": "free", "acceleration_max": 3}, "steps": 40}
    planner = Planner("wang-flying", task | {"tube": {"position": 0.05, "ends": "periodic"}})
    planned = planner.plan()
    assert planned.feasible
    for part in (*planned.audit.motion, *planned.audit.carriers):
        np.testing.assert_allclose(part[0], part[-1], atol=1e-6)
    here = planned.trajectory.isel(time=50)
    state = {name: here[name].values.tolist() for name in ("pose", "velocity", "carrier_pose", "carrier_velocity")}
    assert planner.replan(state, 0.5).feasible


NO_CYCLE = {
    "open": (
        {"path": LINE},
        "path must end with the pose with which it starts, since tube.ends is periodic, got .* 0.5",
    ),
    "drift": (
        {"path": {"kind": "circle", "centre": [0, 0, 1], "radius": 0.1, "rate": 1, "drift": [0, 0, 0.1]}},
        "path must end with the pose",
    ),
    "started": (
        {"initial": {"pose": [0, 0, 1], "velocity": [0] * 6}},
        "initial must be left out with tube.ends periodic",
    ),
    "ended": ({"final": {"velocity": 0}}, "final must be left out with tube.ends periodic"),
    "in a frame": ({"path": {"kind": "rest", "frame": "quad", "pose": [0, 0, -1]}}, "path.frame must be world"),
}


@pytest.mark.parametrize("case", NO_CYCLE)
def test_what_is_no_cycle_is_one_line(case):
    keys, message = NO_CYCLE[case]
    with pytest.raises(InputError, match=message) as caught:
        plan("wang-flying" if case == "in a frame" else ROBOT, CYCLE | {"tube": {"ends": "periodic"}} | keys)
    assert "\n" not in str(caught.value)


def test_free_ends_may_move():
    """The default is what the tests above see: a line with free ends leaves its points where that saves tension."""
    planned = plan(ROBOT, {"path": LINE, "duration": 2, "tube": {**TUBE, "ends": "free"}, "steps": 40})
    assert planned.feasible
    assert np.linalg.norm(next(ends_of(planned))[0][:3] - LINE["start"]) > 1e-4


def test_carriers_rest_where_the_platform_does():
    """Three quadrotors carry a load: all are without speed at both ends, and the load without acceleration."""
    line = {"kind": "line", "start": [0, 0, 1], "end": [1, 0, 1]}
    task = {"path": line, "duration": 4, "tube": {"attitude": 0.3}, "base": {"kind": "free"}, "steps": 20}
    planned = plan("multi-quadrotor-3", task)
    assert planned.feasible
    assert max(speed for _, speed, _ in ends_of(planned)) < 1e-3
    assert np.abs(planned.audit.motion.acceleration[[0, -1], :3]).max() < 1e-9


def ball(centre, radius, **more):
    return {"limits": {"keep_out": [{"kind": "sphere", "centre": list(centre), "radius": radius, **more}]}}


@settings(max_examples=15, deadline=None)
@given(
    at_end=st.booleans(),
    towards=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    depth=st.floats(-0.3, 0.3).filter(lambda depth: abs(depth) > 1e-3),
)
def test_a_ball_about_an_end_blocks_it_exactly_if_the_platform_starts_inside(at_end, towards, depth):
    """The CoM is `depth` inside a ball of 0.4 m, or outside: then the other points are too, or they block."""
    point = np.array(LINE["end" if at_end else "start"])
    centre = point + (0.4 - depth) * np.array(towards) / np.linalg.norm(towards)
    task = {"path": LINE, "duration": 2, "tube": {"position": 0.6, "attitude": 0.0}, "steps": 20, "time_limit": 1e-3}
    planned = plan(ROBOT, task | ball(centre, 0.4, cables=None))
    points = np.array([LINE["start"], LINE["end"]])[:, None] + np.vstack([ROBOT.platform.com, ROBOT.attachments])
    blocks = (np.linalg.norm(points - centre, axis=2) < 0.4 - 2e-6).any()
    assert (planned.status is MotionStatus.INFEASIBLE) == blocks
    if blocks:
        missing = 0.4 - np.linalg.norm(points - centre, axis=2).min()
        assert planned.audit.excess[0].value == pytest.approx(-missing, abs=1e-5)
        assert "platform is " in told(planned).splitlines()[0]


@settings(max_examples=25, deadline=None)
@given(
    angles=st.tuples(*[st.floats(-0.3, 0.3)] * 3),
    shift=st.tuples(*[st.floats(-1, 1)] * 3),
    turn=st.floats(0.01, 0.1),
    share=st.floats(-0.5, 1.5),
)
def test_no_end_is_called_blocked_that_a_turn_frees(angles, shift, turn, share):
    """The platform may turn by `turn`: where the ball is a proof, no turned pose that is tried keeps out of it."""
    point = np.array(LINE["end"])
    farthest = int(np.linalg.norm(ROBOT.attachments, axis=1).argmax())
    attachment = point + ROBOT.attachments[farthest]
    centre = attachment + share * 0.1 * np.array(shift)
    task = {"path": LINE, "duration": 2, "tube": {"attitude": turn}, "steps": 20, "time_limit": 1e-3}
    planned = plan(ROBOT, task | ball(centre, 0.08, cables=None))
    if planned.status is not MotionStatus.INFEASIBLE:
        return
    row = int(np.abs(planned.audit.times - planned.audit.excess[0].time).argmin())
    tried = np.clip(np.array(angles) * turn / 0.3, -turn, turn)
    turned = Rotation.from_euler("ZYX", tried[::-1]).as_matrix()
    points = planned.audit.motion.pose[row, :3] + np.vstack([ROBOT.platform.com, ROBOT.attachments]) @ turned.T
    assert (np.linalg.norm(points - centre, axis=1) < 0.08).any()


def test_an_end_without_tensions_is_proven_by_a_linear_program():
    """Outside the anchors no tensions hold the platform: HiGHS finds none either, and the certificate is true."""
    line = {**LINE, "end": [0.5, 9, 1.2]}
    planned = plan(ROBOT, {"path": line, "duration": {"min": 1, "max": 20}, "tube": {"position": 0.2}, "steps": 20})
    assert planned.status is MotionStatus.INFEASIBLE
    certificate, pose = planned.certificate, np.array([*line["end"], 0, 0, 0])
    A, w = Dynamics(ROBOT).wrench_matrix(pose), Dynamics(ROBOT).required_wrench(pose, np.zeros(6), np.zeros(6))
    assert (
        linprog(np.zeros(ROBOT.m), A_eq=A, b_eq=w, bounds=list(zip(ROBOT.t_min, ROBOT.t_max, strict=True))).status == 2
    )
    along = A.T @ certificate.direction
    most = np.where(along > 0, along * ROBOT.t_max, along * ROBOT.t_min).sum()
    assert certificate.direction @ w - most == pytest.approx(certificate.shortfall, rel=1e-6)
    assert certificate.shortfall > 0
    assert planned.iterations == 0


def test_carriers_that_return_home_cannot_carry_a_load_away_on_cables_that_keep_their_lengths():
    """Two metres from home the cables would have to be longer by as much as geometry says."""
    line = {"kind": "line", "start": [0, 0, 0], "end": [2, 0, 0]}
    tube = {"position": "free", "attitude": "free", "ends": "exact"}
    task = {"path": line, "duration": {"min": 1.5, "max": 8}, "tube": tube, "base": {"kind": "free", "ends": "exact"}}
    planned = plan("multi-quadrotor-3", task)
    assert planned.status is MotionStatus.INFEASIBLE
    robot = load("multi-quadrotor-3")
    anchors = robot.carrier_home[robot.carrier_of_cable, :3] + robot.anchors
    lengths = np.linalg.norm(anchors - robot.attachments - line["end"], axis=1)
    worst = int(np.abs(lengths - robot.fixed_lengths).argmax())
    (excess,) = planned.audit.excess
    assert excess.about == f"cable {worst + 1}"
    assert excess.value == pytest.approx(lengths[worst])
    assert planned.iterations == 0


def test_a_wall_across_a_path_that_must_be_followed_is_a_proof_and_in_a_wide_tube_is_none():
    wall = {"limits": {"keep_out": [{"kind": "box", "min": [0.2, -1, 0], "max": [0.3, 1, 3], "cables": None}]}}
    task = {"path": LINE, "duration": {"min": 1, "max": 5}, "time_limit": 1e-3, "steps": 20} | wall
    assert plan(ROBOT, task | {"tube": {"position": 0.01}}).status is MotionStatus.INFEASIBLE
    late = plan(ROBOT, task | {"tube": {"position": 2.0}})
    assert late.status is MotionStatus.NOT_FOUND
    assert "time limit of 0.001 s is reached" in told(late).splitlines()[0]


def test_a_team_that_carries_its_load_on_an_exact_line_rests_at_its_ends_at_the_same_cost_on_every_mesh():
    """By the law of degree 7 the directions of the cables must move at rest, and the cost grew with the mesh."""
    home = load("multi-quadrotor-3").home.tolist()
    line = {"kind": "line", "start": home, "end": [home[0] + 2, *home[1:]]}
    plans = [
        plan("multi-quadrotor-3", {"path": line, "base": {"kind": "free"}, "duration": 4, "steps": steps})
        for steps in (25, 50)
    ]
    assert all(each.feasible for each in plans)
    assert plans[1].objective == pytest.approx(plans[0].objective, rel=0.05)
    assert np.abs(plans[1].trajectory["carrier_velocity"].values[[0, -1]]).max() < 1e-6
    tilt = np.arccos(np.cos(plans[1].trajectory["carrier_pose"].values[..., 3:5]).prod(axis=-1))
    assert tilt.max() < np.radians(20), "34 degrees, the limit, by the law of degree 7"
    assert plans[1].scenario.task.path.timing == "smoother"


def test_a_team_carries_its_load_along_exact_lines_and_legs_one_after_the_other():
    """By the usual law the snap jumps at the corner and where a part ends: none was found."""
    robot = load("multi-quadrotor-3")
    points = [(robot.home[:3] + offset).tolist() for offset in ([0, 0, 0], [0.3, 0, 0], [0.3, 0.2, 0.15])]
    legs, line = {"kind": "waypoints", "points": points}, {"kind": "line", "start": points[2], "end": points[0]}
    parts = [{"path": legs, "duration": 6}, {"path": line, "duration": 5}]
    phases = [part | {"name": name} for part, name in zip(parts, ("there", "back"), strict=True)]
    found = plan(robot, {"base": {"kind": "free"}, "time_limit": 30, "phases": phases})
    assert found.feasible
    assert found.tracking_error_max < 1e-9
    speed = found.scenario.task.path.at(np.linspace(2, 4, 401), 11.0).velocity
    assert np.linalg.norm(speed, axis=1).min() > 0.02  # it does not stop at the corner
    again = plan(robot, found.scenario.task)  # which says all that was chosen
    assert again.feasible
    assert [part.path.timing for part in again.scenario.task.path.parts] == ["smoother", "smoother"]


@pytest.mark.parametrize(("beyond", "proven"), [(0.001, True), (-0.001, False)])
def test_a_cable_of_fixed_length_must_reach_from_the_end_to_the_nearest_point_of_its_carriers_reach(beyond, proven):
    """The attachments are below one reach box: its nearest points are straight above them, at its lowest height."""
    data = load("wang-ctmrts").model_dump() | {"drive": "fixed-length"}
    data["carriers"] = [data["carriers"][0] | {"name": carrier["name"]} for carrier in data["carriers"]]
    data["cables"] = [cable | {"length": 1.2} for cable in data["cables"]]
    robot = Robot.model_validate(data)
    carrier = robot.carriers[0]
    end = [*carrier.home[:2], carrier.motion_limits.reach.min[2] - 1.2 - beyond]
    path = {"kind": "line", "start": [*carrier.home[:2], 0.1], "end": end}
    task = {"path": path, "duration": 5, "base": {"kind": "free"}, "tube": {"position": 0.01, "ends": "rest"}}
    proof = infeasible_ends(lay_out(robot, read_task(task)))
    about = [] if proof is None else [excess for excess in proof.excess if excess.limit == "cable_length"]
    assert bool(about) == proven
    if proven:
        assert about[0].value - about[0].bound == pytest.approx(beyond)
        assert "its reach" in str(about[0])


def pulls_from_reach(robot, pose):
    """Columns of the wrenches of unit pulls of a level platform towards the corners of all reach boxes."""
    columns = []
    for carrier, cable in zip(robot.carriers, robot.cables, strict=True):
        arm = np.array(cable.attachment)
        for corner in product(*zip(carrier.reach.min, carrier.reach.max, strict=True)):
            way = np.array(corner) - pose[:3] - arm
            columns.append(np.r_[way, np.cross(arm, way)] / np.linalg.norm(way))
    return np.array(columns).T


@pytest.mark.parametrize("height", [0.0, 8.0])
def test_carriers_may_be_anywhere_around_a_platform_whose_frame_is_elsewhere(height):
    """Frames of a platform far above its load change no physics: beside a ground anchor a team is feasible."""
    data = load("multi-quadrotor-4").model_dump()
    first, *others = data["carriers"]
    data["carriers"] = [{"name": first["name"], "kind": "ground", "home": first["home"]}, *others]
    platform, up = data["platform"], np.array([0, 0, height])
    platform["home"] = (*(np.array(platform["home"][:3]) + up).tolist(), 0, 0, 0)
    for part, key in ((platform, "com"), *((cable, "attachment") for cable in data["cables"])):
        part[key] = (np.array(part[key]) - up).tolist()
    path = {"kind": "rest", "pose": platform["home"]}
    task = {"path": path, "duration": 2, "base": {"kind": "free", "ends": "rest"}, "steps": 12}
    assert plan(Robot.model_validate(data), task).feasible


@pytest.mark.parametrize("name", ["wang-ctmrts-4", "wang-ctmrts-5"])
def test_ends_that_carriers_cannot_hold_from_within_their_reach_are_proven(name):
    """By a linear program for the forces of cables towards all corners of the boxes; a tilt is offered, if less."""
    robot, rng, proofs = load(name), np.random.default_rng(3), []
    for _ in range(6):
        way = rng.normal(size=3) * [1, 1, 0.6]
        end = np.array(robot.home[:3]) + way / np.linalg.norm(way) * rng.uniform(0.2, 0.7)
        path = {"kind": "line", "start": list(robot.home[:3]), "end": end.tolist()}
        task = read_task({"path": path, "duration": 4, "base": {"kind": "free", "ends": "rest"}, "steps": 12})
        proof = infeasible_ends(lay_out(robot, task))
        columns = pulls_from_reach(robot, end)
        can = linprog(np.zeros(columns.shape[1]), A_eq=columns, b_eq=[0, 0, robot.weight, 0, 0, 0])
        assert (proof is None) == can.success
        if proof is not None:
            direction = proof.certificate.direction
            assert direction[2] * robot.weight == pytest.approx(proof.certificate.shortfall)
            at = task.path.at(np.array([proof.certificate.time]), 4).pose[0]
            assert (direction @ pulls_from_reach(robot, at)).max() < 1e-9
            proofs.append(task)
    assert proofs
    soft = proofs[0].model_copy(update={"limits": TaskLimits(soft={"carrier_reach": 0.1})})
    assert infeasible_ends(lay_out(robot, soft)) is None  # carriers may then leave their boxes
    if name == "wang-ctmrts-5":
        (offer,) = plan(robot, proofs[0]).relaxations
        assert offer.plan.feasible
        tilt = np.abs(offer.plan.trajectory["pose"].values[:, 3:] - robot.home[3:]).max()
        assert offer.name == "tube.attitude"
        assert 0 < tilt <= offer.possible < 0.1  # rad; the level end has a proof that its forces are none


def hung(reach):
    """Return a point mass of 5 kg under four anchors, and a cycle about a place as far from their middle [m]."""
    cables = [
        {"carrier": "frame", "anchor": [x, y, 2.5], "attachment": [0, 0, 0], "t_min": 1, "t_max": 150}
        for x, y in ((2, 1), (2, -1), (-2, 1), (-2, -1))
    ]
    platform = {"mass": 5, "dof": ["x", "y", "z"], "home": [0, 0, 1, 0, 0, 0]}
    keys = {"name": "hung", "source": "here", "platform": platform, "cables": cables}
    robot = Robot.model_validate(keys | {"carriers": [{"name": "frame", "kind": "ground"}]})
    points = [[reach, 0.1, 1], [reach, -0.1, 1], [reach + 0.1, 0, 1.1]]
    path = {"kind": "waypoints", "points": [*points, points[0]]}
    return robot, {"path": path, "duration": 2, "tube": {"position": 0.1, "ends": "periodic"}, "steps": 30}


def mean_exists(planned):
    """Whether some tensions at poses all over the tube have the weight for their mean, by HiGHS (3 rows of forces)."""
    rng, robot, tube = np.random.default_rng(0), planned.scenario.robot, planned.scenario.task.tube
    poses = np.repeat(planned.scenario.motion(np.linspace(0, planned.duration, 25), None)[0].pose, 8, axis=0)
    way = rng.normal(size=(len(poses), 3))
    poses[:, :3] += tube.position * way / np.linalg.norm(way, axis=1, keepdims=True)
    lines = robot.anchors - poses[:, None, :3]
    u = lines / np.linalg.norm(lines, axis=2, keepdims=True)
    k, m = u.shape[:2]
    share, each = np.kron(np.eye(k), np.ones((m, 1))), np.eye(k * m)  # of the time, at each pose
    bounded = [np.hstack([sign * each, -sign * bound * share]) for sign, bound in ((1, 150), (-1, 1))]
    mean = np.hstack([u.reshape(-1, 3).T, np.zeros((3, k))])
    equal = np.vstack([mean, np.append(np.zeros(k * m), np.ones(k))])
    w = [0, 0, 5 * 9.81, 1]
    found = linprog(np.zeros(k * m + k), np.vstack(bounded), np.zeros(2 * k * m), equal, w, method="highs")
    return found.status == 0


def test_a_cycle_whose_mean_no_tensions_give_is_proven_infeasible():
    outside, inside = (plan(*hung(reach)) for reach in (2.4, 1.5))
    assert outside.status is MotionStatus.INFEASIBLE
    assert "in the mean over every cycle" in str(outside.audit.excess[0])
    assert 0 < outside.audit.excess[0].value < 5 * 9.81
    assert not mean_exists(outside)
    assert inside.feasible
    assert mean_exists(inside)


@pytest.mark.parametrize(("seconds", "status"), [(1.5, "infeasible"), (2.8, "feasible"), (8.0, "infeasible")])
def test_a_circle_beyond_the_anchors_exists_only_near_the_frequency_of_a_pendulum(seconds, status):
    """In a slower circle nothing pulls the mass out past the anchors; in a faster one nothing pulls it in enough."""
    cables = [
        {"carrier": "frame", "anchor": anchor, "attachment": [0, 0, 0], "t_min": 1, "t_max": 150}
        for anchor in ([2, 0, 3], [-1, 1.7, 3], [-1, -1.7, 3])
    ]
    robot = Robot.model_validate(hung(0)[0].model_dump() | {"cables": cables})
    circle = {"kind": "circle", "centre": [0, 0, 1], "radius": 1.5, "rate": 2 * np.pi / seconds}
    tube = {"position": 0.05, "ends": "periodic"}
    assert plan(robot, {"path": circle, "duration": seconds, "tube": tube, "steps": 30}).status == status


def varied(rng, count):
    """Return directions of wrenches (PLACES, 6), some constant, some with forces that are linear between nodes."""
    nodes = rng.normal(size=(count, 6)) + rng.choice([0, 1]) * rng.normal(size=(count, 6)) * [1, 1, 1, 0, 0, 0]
    nodes[:, 3:] = nodes[0, 3:]
    at = np.arange(PLACES) * count / PLACES
    found = np.stack([np.interp(at, np.arange(count + 1), np.append(row, row[0])) for row in nodes.T], axis=1)
    return found / np.linalg.norm(found, axis=1).max()


def test_no_direction_proves_a_cycle_infeasible_that_exists():
    """The wrench of the cables about a fixed point has the weight for its mean, whatever the cycle does."""
    points = [[0, 0, 1], [0.3, 0.1, 1.1], [0.1, 0.3, 1.2], [0, 0, 1]]
    tube = {"position": 0.05, "attitude": 0.1, "ends": "periodic"}
    task = {"path": {"kind": "waypoints", "points": points}, "duration": 1.5, "tube": tube, "steps": 40}
    found = plan(ROBOT, task)
    assert found.feasible
    motion, cycle, nodes = found.audit.motion, Cycle(found.scenario), PLACES // FEW
    dynamics, force = Dynamics(ROBOT), ROBOT.platform.mass * np.array(ROBOT.gravity)
    A = dynamics.wrench_matrix(motion.pose)
    com = motion.pose[:, :3] + Rotation.from_euler("xyz", motion.pose[:, 3:]).apply(ROBOT.platform.com)
    pull = np.einsum("nij,nj->ni", A, found.audit.tensions)
    about = pull[:, 3:] + np.cross(com, pull[:, :3] + force)
    times, total = found.audit.times, np.hstack([pull[:, :3] + force, about])
    assert np.abs(np.trapezoid(total, times, axis=0)).max() < 1e-3 * found.duration * np.linalg.norm(force)
    rng, at_nodes = np.random.default_rng(3), np.linspace(0, found.duration, nodes + 1)
    for _ in range(8):
        directions = varied(rng, nodes)
        assert cycle.shortfall(directions)[0] <= 0
        f = np.vstack([directions[::FEW, :3], directions[:1, :3]])
        along = np.stack([np.interp(times, at_nodes, row) for row in f.T], axis=1)
        bent = (np.roll(f[:-1], 1, axis=0) + np.roll(f[:-1], -1, axis=0) - 2 * f[:-1]) * nodes / found.duration
        there = np.stack([np.interp(at_nodes[:-1], times, row) for row in com.T], axis=1)
        momentum = ROBOT.platform.mass * (bent * there).sum()
        given = np.trapezoid((along * total[:, :3]).sum(axis=1), times)
        assert given == pytest.approx(momentum, abs=1e-3 * found.duration * np.linalg.norm(force))


@pytest.mark.parametrize("strength", [1e-6, 1.0])
@pytest.mark.parametrize(("turn", "yaw"), [(0.0, 0.0), (0.3, 0.0), (0.0, 0.8)])
def test_in_all_of_the_tube_cables_lack_at_least_the_bound_of_a_cycle(strength, turn, yaw):
    """By wrench matrices at poses of the tube, with a CoM far from the origin; with weak cables the weight decides."""
    keys = ROBOT.model_dump(mode="json")
    keys["platform"]["com"] = [0.3, -0.2, 0.4]
    for cable in keys["cables"]:
        cable |= {"t_min": 0, "t_max": strength * cable["t_max"]}
    robot, tube = Robot.model_validate(keys), {"position": 0.05, "attitude": turn, "ends": "periodic"}
    points = [[0, 0, 1, 0, 0, 0], [0.3, 0.1, 1.1, 0, 0, yaw], [0.1, 0.3, 1.2, 0, 0, -yaw], [0, 0, 1, 0, 0, 0]]
    task = {"path": {"kind": "waypoints", "points": points}, "duration": 1.5, "tube": tube}
    cycle, rng = Cycle(lay_out(robot, read_task(task))), np.random.default_rng(5)
    at_any_time = Cycle(lay_out(robot, read_task(task | {"duration": {"min": 1, "max": 2}})))
    force, weight, nodes = robot.platform.mass * np.array(robot.gravity), robot.weight, PLACES // FEW
    own = np.array([robot.platform.com])
    about = placed(cycle.poses, own)[:, 0].mean(axis=0)
    for trial in range(4):
        directions = varied(rng, nodes) if trial % 2 else np.tile(varied(rng, 1)[:1], (PLACES, 1))
        if trial == 1:  # along which the momentum takes most
            directions[:, :3], directions[:, 3:] = about - cycle.poses[:, :3] - own, 0.0
        f, c = directions[:, :3], directions[:, 3:] / robot.length
        least, momentum = np.full(PLACES, np.inf), 0.0
        bent = np.roll(f[::FEW], 1, axis=0) + np.roll(f[::FEW], -1, axis=0) - 2 * f[::FEW]
        for some in range(8):
            poses = cycle.poses + rng.uniform(-1, 1, cycle.poses.shape) * cycle.half
            if some == 0:  # in the middle, and where the momentum takes least
                poses = cycle.poses.copy()
                poses[::FEW, :3] -= np.sign(bent) * tube["position"]
            A = Dynamics(robot).wrench_matrix(poses)
            place = placed(poses, own)[:, 0] - about
            taken = robot.platform.mass * (nodes / 1.5) ** 2 * (bent * place[::FEW]).sum(axis=1).mean()
            momentum = taken if some == 0 else min(momentum, taken)
            com = place if turn or yaw else np.zeros_like(place)  # else about the CoM itself
            moments = A[:, 3:] + np.cross(com[:, None], A[:, :3].swapaxes(1, 2)).swapaxes(1, 2)
            x = np.einsum("nj,njm->nm", f, A[:, :3]) + np.einsum("nj,njm->nm", c, moments)
            gives = np.maximum(robot.t_min * x, robot.t_max * x).sum(axis=1)
            least = np.minimum(least, -(f @ force) - (np.cross(com, force) * c).sum(axis=1) - gives)
        assert cycle.shortfall(directions)[0] * weight <= least.mean() + momentum
        if not trial % 2:  # the platform may be anywhere most of the time
            assert at_any_time.shortfall(directions)[0] * weight <= least.min()


def test_no_motion_leaves_a_zone_faster_than_its_speeds_let_it_at_each_distance():
    """The time is the integral of ds over the bound, which rises by 10 1/s outside."""
    zone = {"centre": [0, 0, 1], "radius": 0.1, "speed": 0.05}
    s = (np.arange(40_000) + 0.5) * 1e-5
    seconds = float(np.sum(1e-5 / (0.05 + 10 * np.maximum(s - 0.1, 0))))
    path = {"kind": "line", "start": [0, 0, 1], "end": [0.4, 0, 1]}
    task = {"path": path, "tube": {"position": "free"}, "limits": {"zone_speed": [zone]}}
    found = plan("point-mass-3", task | {"duration": 0.9 * seconds})
    assert found.status == "infeasible"
    assert [excess.limit for excess in found.audit.excess] == ["zone_speed"]
    assert found.audit.excess[0].value == pytest.approx(0.05 / 0.9, rel=1e-6)
    assert plan("point-mass-3", task | {"duration": 1.3 * seconds}).feasible
