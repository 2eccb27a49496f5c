"""Planning: paths and integrators by differences, plans judged by code that is not the planner."""

import json
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import linprog, lsq_linear

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.models.parsing import parse_yaml, to_yaml
from towline.ocp import MotionStatus, Task, plan, read_task
from towline.ocp.audits.audit import audit
from towline.ocp.audits.excess import Excess
from towline.ocp.audits.violation import relative_violation
from towline.ocp.search import search
from towline.ocp.tasks.deviation import Deviation
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.paths import CirclePath, LinePath, RestPath, SamplePath, WaypointPath
from towline.statics.equilibria import equilibria

GRAVITY = 9.81
HOVER = [50, 50, 100, 0, 0, 0]
CIRCLE = {"kind": "circle", "centre": [50, 50, 99], "radius": 1, "rate": 0.2 * np.pi}
FREE = {"kind": "free", "around": {"quad": {"kind": "rest", "pose": HOVER}}, "acceleration_max": 3, "ends": "periodic"}
SAMPLE_TIMES = tuple(np.linspace(0, 4, 9))

PATHS = {
    "rest": RestPath(kind="rest", pose=(1, 2, 3)),
    "smooth line": LinePath(kind="line", start=(0, 0, 1), end=(1, -2, 3, 0.1, 0.2, -0.3)),
    "smoother line": LinePath(kind="line", start=(0, 0, 1), end=(1, -2, 3), timing="smoother"),
    "uniform line": LinePath(kind="line", start=(0, 0, 1), end=(1, -2, 3), timing="uniform"),
    "helix": CirclePath(kind="circle", centre=(1, 2, 3), radius=0.5, rate=-0.7, phase=0.3, drift=(0.1, 0.2, 0.3)),
    "waypoints": WaypointPath(kind="waypoints", points=((0, 0, 1), (1, 0, 2, 0, 0, 0.5), (1, 1, 1))),
    "timed waypoints": WaypointPath(kind="waypoints", points=((0, 0, 1), (1, 0, 2), (1, 1, 1)), times=(0, 1, 4)),
    "spline": WaypointPath(kind="waypoints", points=((0, 0, 1), (1, 0, 2, 0, 0, 0.5), (1, 1, 1)), shape="spline"),
    "samples": SamplePath(
        kind="samples", times=SAMPLE_TIMES, poses=tuple((np.sin(t), t, 1, 0, 0, 0.2 * t) for t in SAMPLE_TIMES)
    ),
}


@pytest.mark.parametrize("name", PATHS)
def test_path_derivatives_by_differences(name):
    path, step = PATHS[name], 1e-4
    times = np.linspace(0.05, 3.95, 41)
    before, at, after = (path.at(times + shift, 4.0) for shift in (-step, 0, step))
    np.testing.assert_allclose(at.velocity, (after.pose - before.pose) / (2 * step), atol=1e-6)
    np.testing.assert_allclose(at.acceleration, (after.velocity - before.velocity) / (2 * step), atol=1e-5)


def test_paths_go_where_they_are_told():
    ends = PATHS["waypoints"].at(np.array([0.0, 4.0]), 4.0)
    np.testing.assert_allclose(ends.pose[:, :3], [[0, 0, 1], [1, 1, 1]], atol=1e-12)
    np.testing.assert_allclose(ends.velocity, 0, atol=1e-12)
    np.testing.assert_allclose(ends.acceleration, 0, atol=1e-9)
    corner = PATHS["timed waypoints"].at(np.array([1.0]), 4.0).pose[0, :3]
    assert 0 < np.linalg.norm(corner - [1, 0, 2]) <= 0.01 * np.sqrt(3)  # of the span of the points
    line = PATHS["smooth line"].at(np.array([0.0, 4.0]), 4.0)
    np.testing.assert_allclose(line.pose, [[0, 0, 1, 0, 0, 0], [1, -2, 3, 0.1, 0.2, -0.3]], atol=1e-12)
    np.testing.assert_allclose(line.velocity, 0, atol=1e-12)
    radius = np.linalg.norm((PATHS["helix"].at(np.array([1.0]), 4.0).pose[0, :3] - [1.1, 2.2, 3.3])[:2])
    assert radius == pytest.approx(0.5)


def judge(robot, trajectory, margin=0.0, residual=1e-6):
    """Judge a plan's dataset with nothing of ocp/: balance, limits, and that poses, velocities, accelerations agree."""
    dynamics = Dynamics(robot)
    data = {name: trajectory[name].values for name in trajectory}
    A = dynamics.wrench_matrix(data["pose"], data["carrier_pose"])
    w = dynamics.required_wrench(data["pose"], data["velocity"], data["acceleration"])
    error = np.einsum("nij,nj->ni", A, data["tensions"]) - w
    error[:, 3:] /= robot.length
    assert np.linalg.norm(error, axis=1).max() <= residual
    assert (data["tensions"] >= robot.t_min + margin - 1e-6).all()
    assert (data["tensions"] <= robot.t_max - margin + 1e-6).all()
    times = trajectory["time"].values
    for prefix in ("", "carrier_"):
        for value, rate in (("pose", "velocity"), ("velocity", "acceleration")):
            differences = np.gradient(data[prefix + value], times, axis=0, edge_order=2)[2:-2]
            scale = np.abs(data[prefix + rate]).max()
            assert np.abs(differences - data[prefix + rate][2:-2]).max() < 0.02 * scale + 0.005


def support(A, direction, low, high):
    """Support value of {A t} along `direction`, by linear programming."""
    return -linprog(-(direction @ A), bounds=np.stack([low, high], axis=1)).fun


def names(seen):
    """Of the limits that an audit saw passed."""
    return {excess.limit for excess in seen.excess}


@pytest.fixture(scope="module")
def circle_free():
    return plan(load("wang-flying"), {"name": "circle", "path": CIRCLE, "base": FREE})


def test_hovering_circle_is_infeasible_with_a_certificate():
    robot = load("wang-flying")
    found = plan(robot, {"path": CIRCLE, "base": {"kind": "hold", "poses": {"quad": HOVER}}})
    assert found.status is MotionStatus.INFEASIBLE
    assert found.tension_min is None
    certificate = found.certificate
    angle = 0.2 * np.pi * certificate.time
    pose = np.array([50 + np.cos(angle), 50 + np.sin(angle), 99, 0, 0, 0])
    acceleration = -((0.2 * np.pi) ** 2) * np.array([np.cos(angle), np.sin(angle), 0, 0, 0, 0])
    dynamics = Dynamics(robot)
    A = dynamics.wrench_matrix(pose, [HOVER])
    w = dynamics.required_wrench(pose, np.zeros(6), acceleration)
    direction = np.array(certificate.direction)
    short = direction @ w - support(A, direction, robot.t_min, robot.t_max)
    assert certificate.shortfall == pytest.approx(short, rel=1e-6)
    # No other time of the circle is worse: the distance to the available wrenches, by another solver.
    scale = np.array([1, 1, 1, robot.length, robot.length, robot.length])
    distances = []
    for time in np.linspace(0, 10, 301):
        angle = 0.2 * np.pi * time
        pose = np.array([50 + np.cos(angle), 50 + np.sin(angle), 99, 0, 0, 0])
        acceleration = -((0.2 * np.pi) ** 2) * np.array([np.cos(angle), np.sin(angle), 0, 0, 0, 0])
        A = dynamics.wrench_matrix(pose, [HOVER]) / scale[:, None]
        w = dynamics.required_wrench(pose, np.zeros(6), acceleration) / scale
        fit = lsq_linear(A, w, (robot.t_min, robot.t_max), method="bvls")
        distances.append(np.sqrt(2 * fit.cost))
    assert max(distances) == pytest.approx(certificate.shortfall, rel=1e-4)


def test_free_base_follows_the_circle(circle_free):
    robot = load("wang-flying")
    assert circle_free.feasible
    assert circle_free.tracking_error_max < 0.01
    assert circle_free.audit.to_dict()["worst_violation"] < 1e-6
    trajectory = circle_free.trajectory
    judge(robot, trajectory)
    base = trajectory["carrier_acceleration"].values[:, 0, :3]
    assert np.linalg.norm(base, axis=1).max() <= 3 + 1e-9
    radius = np.linalg.norm(trajectory["pose"].values[:, :2] - 50, axis=1)
    np.testing.assert_allclose(radius, 1, atol=1e-12)
    np.testing.assert_allclose(trajectory["carrier_pose"][0], trajectory["carrier_pose"][-1], atol=1e-6)


def test_saved_plan_holds_what_the_design_promises(circle_free, tmp_path):
    file = circle_free.save(tmp_path / "plans" / "circle.nc")
    assert [path.name for path in file.parent.iterdir()] == ["circle.nc"]
    saved = xr.load_dataset(file)
    assert saved["pose"].dims == ("time", "coordinate")
    assert saved["carrier_acceleration"].dims == ("time", "carrier", "coordinate")
    assert saved["tensions"].dims == ("time", "cable")
    assert saved["tensions"].attrs["units"] == "N"
    assert saved["time"].attrs["units"] == "s"
    assert list(saved["coordinate"].values) == ["x", "y", "z", "roll", "pitch", "yaw"]
    assert parse_yaml(saved.attrs["robot"], Robot, "saved") == load("wang-flying")
    assert parse_yaml(saved.attrs["task"], Task, "saved") == circle_free.scenario.task
    assert json.loads(saved.attrs["report"])["feasible"] is True
    xr.testing.assert_equal(saved, circle_free.trajectory)
    with pytest.raises(InputError, match="cannot be written"):
        circle_free.save("/proc/nowhere/plan.nc")


def test_largest_radius_under_a_hovering_base():
    """Between 0.20 m (0.35 N) and 0.25 m (-0.17 N) the smallest tension passes zero."""
    robot = load("wang-flying")
    for radius, feasible in ((0.18, True), (0.25, False)):
        found = plan(robot, {"path": {**CIRCLE, "centre": [0, 0, -1], "radius": radius}})
        assert found.feasible is feasible
    found = plan(robot, {"path": {**CIRCLE, "centre": [0, 0, -1], "radius": 0.1}})
    assert found.tension_min == pytest.approx(1.32, abs=0.01)
    judge(robot, found.trajectory)


def test_margin_is_kept_between_nodes(circle_free):
    robot = load("wang-flying")
    found = plan(robot, {"path": CIRCLE, "base": FREE, "margin": 1.0})
    assert found.feasible
    assert found.margin >= 1.0 - 1e-6
    judge(robot, found.trajectory, margin=1.0)
    assert circle_free.margin < 1.0


def test_mobile_robots_carry_the_load_inside_their_reach():
    robot = load("wang-ctmrts")
    path = {"kind": "line", "start": [1.2, 0.9, 0.3], "end": [1.35, 1.05, 0.6]}
    found = plan(
        robot, {"path": path, "duration": 3, "base": {"kind": "free", "ends": "rest"}, "margin": 5, "steps": 15}
    )
    assert found.feasible, found.report()
    judge(robot, found.trajectory, margin=5, residual=1e-3 * robot.weight)
    for index, carrier in enumerate(robot.carriers):
        position = found.trajectory["carrier_pose"].values[:, index, :3]
        assert (position >= np.array(carrier.reach.min) - 1e-6).all()
        assert (position <= np.array(carrier.reach.max) + 1e-6).all()
        speed = np.linalg.norm(found.trajectory["carrier_velocity"].values[:, index, :3], axis=1)
        assert speed.max() <= carrier.speed_max + 1e-6
        assert speed[[0, -1]] == pytest.approx(0, abs=1e-6)
        acceleration = np.linalg.norm(found.trajectory["carrier_acceleration"].values[:, index, :3], axis=1)
        assert acceleration.max() <= carrier.acceleration_max + 1e-6


def test_resting_mobile_robots_cannot_hold_the_load_level():
    """Three cables and six equations: with the robot-ends fixed the wrench is outside the range of A."""
    robot = load("wang-ctmrts")
    found = plan(robot, {"path": {"kind": "rest", "pose": list(robot.home)}, "duration": 1, "steps": 10})
    assert found.status is MotionStatus.INFEASIBLE
    assert found.certificate.binding.tolist() == []


def test_a_load_too_heavy_for_three_cables_is_not_feasible():
    """Nearly in the range of A, so that the equations are missed by little, but far beyond the limits."""
    data = load("wang-ctmrts").model_dump(mode="json")
    for cable in data["cables"]:
        cable["t_max"] = 20
    robot = Robot.model_validate(data)
    rest = equilibria(robot, np.full(3, 1.25))[0].pose + np.array([0, 0, 1e-6, 0, 0, 0])
    found = plan(robot, {"path": {"kind": "rest", "pose": list(rest)}, "duration": 0.1})
    assert found.status is MotionStatus.INFEASIBLE
    assert found.audit.to_dict()["worst_violation"] > 30
    assert found.certificate.shortfall > 30
    assert found.certificate.binding.tolist() == [0, 1, 2]


def test_circle_in_the_frame_of_a_moving_and_pitching_base():
    """Paper F's VI.C: the base flies and pitches as given; the platform circles with r = 0.15 m in {A}."""
    robot = load("wang-flying")
    times = np.linspace(0, 10, 41)
    poses = [(2 * t, t, 100 + 0.5 * t, 0, 0.02 * np.sin(0.2 * np.pi * t), 0) for t in times]
    base = {"kind": "given", "paths": {"quad": {"kind": "samples", "times": list(times), "poses": poses}}}
    path = {**CIRCLE, "centre": [0, 0, -1], "radius": 0.15, "frame": "quad"}
    found = plan(robot, {"path": path, "base": base})
    assert found.feasible, found.report()
    judge(robot, found.trajectory)
    pitch = found.trajectory["pose"].values[:, 4]
    np.testing.assert_allclose(pitch, found.trajectory["carrier_pose"].values[:, 0, 4], atol=1e-12)


def test_tube_makes_a_path_possible_that_is_not():
    robot = load("wang-flying")
    path = {**CIRCLE, "centre": [0, 0, -1], "radius": 0.25}
    assert not plan(robot, {"path": path}).feasible
    found = plan(robot, {"path": path, "tube": {"position": 0.1}})
    assert found.feasible, found.report()
    assert 0.001 < found.tracking_error_max <= 0.1
    judge(robot, found.trajectory)
    off = (
        found.trajectory["pose"].values[:, :3]
        - Task.model_validate({"path": path}).path.at(found.trajectory["time"].values, 10.0).pose[:, :3]
    )
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), found.trajectory["tracking_error"].values, atol=1e-9)


def test_tilting_base_in_the_carriers_frame_stays_inside_its_tilt():
    """A base that may tilt, and a platform path in its frame: both transcriptions meet the same audit in {G}."""
    robot = load("wang-flying")
    path = {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -1.2], "frame": "quad"}
    base = {"kind": "free", "tilt_max": 0.1, "acceleration_max": 2, "turn_acceleration_max": 2, "speed_max": 1}
    found = plan(robot, {"path": path, "duration": 3, "steps": 40, "base": base, "tube": {"attitude": 0.05}})
    assert found.feasible, found.report()
    judge(robot, found.trajectory)
    tilt = found.trajectory["carrier_pose"].values[:, 0, 3:5]
    assert (np.cos(tilt).prod(axis=1) >= np.cos(0.1) - 1e-9).all()


@pytest.mark.parametrize("steps", [40, 78])
def test_a_carrier_that_cannot_follow_the_platform_is_found_on_each_mesh(steps):
    """The platform turns at 0.63 m/s; from a guess whose carrier did so too, about every tenth mesh had no plan."""
    base = {**FREE, "ends": "rest", "speed_max": 0.1, "acceleration_max": 0.1}
    assert plan(load("wang-flying"), {"path": CIRCLE, "base": base, "steps": steps}).feasible


@pytest.mark.parametrize(
    ("ends", "margin", "status"),
    [
        ("exact", 0, MotionStatus.INFEASIBLE),  # the quadrotor is given at the ends, 1 m beside the platform
        ("rest", 29, MotionStatus.NOT_FOUND),  # [N]: all tensions are from 29.5 to 31 N
    ],
)
def test_no_plan_is_told_with_the_worst_time_of_the_closest_motion(ends, margin, status):
    robot = load("wang-flying")
    found = plan(robot, {"path": CIRCLE, "base": {**FREE, "ends": ends}, "margin": margin, "steps": 12})
    assert found.status is status
    motion, carriers = found.scenario.motion(np.array([found.certificate.time]), found.deviation)
    dynamics = Dynamics(robot)
    A = dynamics.wrench_matrix(motion.pose, carriers.pose)[0]
    w = dynamics.required_wrench(*motion)[0]
    direction = np.array(found.certificate.direction)
    short = direction @ w - support(A, direction, robot.t_min + margin, robot.t_max - margin)
    assert short == pytest.approx(found.certificate.shortfall, rel=1e-6)
    assert short > 0


def test_redundant_ground_robot_and_wind():
    robot = load("ipanema-1")
    path = {"kind": "waypoints", "points": [[0, 0, 1], [0.5, 0.3, 1.2], [-0.4, 0.2, 0.9]]}
    found = plan(robot, {"path": path, "duration": 6, "margin": 1})
    assert found.feasible
    judge(robot, found.trajectory, margin=1)
    flying = load("wang-flying")
    still = plan(flying, {"path": {**CIRCLE, "centre": [0, 0, -1], "radius": 0.1}})
    windy = plan(flying, {"path": {**CIRCLE, "centre": [0, 0, -1], "radius": 0.1}, "wind": [2, 0, 0]})
    assert windy.tension_min < still.tension_min


def test_a_slow_base_finds_the_conical_pendulum():
    """A base that hardly moves can still do it: from L = g / omega^2 = 24.8 m above, the load circles by itself."""
    robot = load("wang-flying")
    found = plan(robot, {"path": CIRCLE, "base": {**FREE, "speed_max": 0.02, "ends": "free"}, "steps": 40})
    assert found.feasible, found.report()
    judge(robot, found.trajectory)
    height = found.trajectory["carrier_pose"].values[:, 0, 2] - 99
    assert height.mean() == pytest.approx(GRAVITY / (0.2 * np.pi) ** 2, rel=0.35)


def test_a_wide_tube_is_used_when_the_path_itself_is_impossible():
    """Resting at the centre is inside the tube; the planner must find that, whatever its mesh."""
    path = {"kind": "circle", "centre": [0, 0, -1], "radius": 1, "rate": 1}
    for steps in (8, 25, 40):
        found = plan(load("wang-flying"), {"path": path, "tube": {"position": 1.2}, "steps": steps})
        assert found.feasible, found.report()
        assert found.tracking_error_max <= 1.2 + 1e-7


def test_limits_hold_between_nodes_also_for_a_curved_reference():
    circle = {"kind": "circle", "centre": [0, 0, 0], "radius": 1, "rate": 0.628318}
    base = {"kind": "free", "acceleration_max": 0.3, "ends": "periodic", "around": {"quad": circle}}
    path = {**circle, "centre": [0, 0, -1]}
    found = plan(load("wang-flying"), {"path": path, "steps": 50, "base": base})
    assert found.feasible, found.report()
    acceleration = found.trajectory["carrier_acceleration"].values[:, 0, :3]
    assert np.linalg.norm(acceleration, axis=1).max() <= 0.3 * (1 + 1e-6)


def test_rest_is_rest_also_beside_a_moving_reference():
    line = {"kind": "line", "start": [0, 0, 0], "end": [2, 0, 0], "timing": "uniform"}
    path = {"kind": "line", "start": [0, 0, -1], "end": [2, 0, -1]}
    base = {"kind": "free", "ends": "rest", "around": {"quad": line}}
    found = plan(load("wang-flying"), {"path": path, "duration": 4, "base": base})
    assert found.feasible, found.report()
    np.testing.assert_allclose(found.trajectory["carrier_velocity"].values[[0, -1]], 0, atol=1e-6)


def test_robots_on_the_ground_have_flat_reach_boxes():
    """Three vehicles tow a raft, and none leaves the plane: neither their heights nor the program's rows move."""
    box = {"min": [-9, -9, 0], "max": [9, 9, 0]}
    places = {"front": (5, 0), "left": (-3, 4), "right": (-3, -4)}
    vehicle = {"kind": "mobile", "reach": box, "speed_max": 2, "acceleration_max": 1}
    raft = {"mass": 50, "inertia": [9, 9, 9, 0, 0, 0], "dof": ["x", "y", "yaw"], "home": [0] * 6}
    cable = {"anchor": [0, 0, 0], "t_min": 1, "t_max": 300}
    ends = {"front": [1, 0.1, 0], "left": [-1, -0.2, 0], "right": [-1, 0.2, 0]}
    file = {
        "name": "raft",
        "source": "a test",
        "gravity": [0, 0, 0],
        "platform": raft,
        "carriers": [vehicle | {"name": name, "home": [x, y, 0, 0, 0, 0]} for name, (x, y) in places.items()],
        "cables": [cable | {"carrier": name, "attachment": end} for name, end in ends.items()],
        "drive": "both",
    }
    robot = Robot.model_validate(file)
    assert all(carrier.free_coordinates("both") == (0, 1) for carrier in robot.carriers)
    line = {"kind": "line", "start": [0, 0, 0], "end": [3, 0, 0]}
    found = plan(robot, {"path": line, "duration": 10, "steps": 20, "base": {"kind": "free"}})
    assert found.feasible, found.report()
    np.testing.assert_allclose(found.trajectory["carrier_pose"].values[..., 2:], 0.0, atol=1e-12)


def test_carriers_limits_count_whatever_the_base_does():
    """Held or given far outside their reach boxes, or too fast: no such plan is feasible."""
    robot = load("wang-ctmrts")
    rest = {"kind": "rest", "pose": [1.261, 0.961, 0.4]}
    far = {"robot1": [22, 0.45, 1.2, 0, 0, 0], "robot2": [1.275, 20.27, 1.2, 0, 0, 0]}
    found = plan(robot, {"path": rest, "duration": 1, "base": {"kind": "hold", "poses": far}, "tube": {"attitude": 1}})
    assert not found.feasible
    assert "carrier_reach" in names(found.audit)
    turned = {"robot1": [2.2, 0.45, 1.2, 0, 0, 0.5]}
    found = plan(robot, {"path": rest, "duration": 1, "base": {"kind": "hold", "poses": turned}})
    assert "carrier_attitude" in names(found.audit)
    fast = {"kind": "line", "start": [2.1, 0.45, 1.2], "end": [2.3, 0.45, 1.2], "timing": "uniform"}
    found = plan(robot, {"path": rest, "duration": 0.1, "base": {"kind": "given", "paths": {"robot1": fast}}})
    told = "carrier_speed of robot1 must be at most 1 m/s but is 2 m/s at t = 0.000 s"
    assert told in [str(excess) for excess in found.audit.excess]


def test_turning_in_place_is_not_infinitely_fast():
    points = [[0, 0, 1, 0, 0, 0], [0.1, 0, 1, 0, 0, 0], [0.1, 0, 1, 0, 0, 0.05], [0.2, 0, 1, 0, 0, 0.05]]
    path = WaypointPath(kind="waypoints", points=points)
    assert np.abs(path.at(np.linspace(0, 10, 1001), 10.0).velocity).max() < 0.5


def test_an_unconverged_motion_is_not_feasible(circle_free):
    """The audit looks at tube and ends too, which only a converged program keeps."""
    scenario = lay_out(load("wang-flying"), read_task({"path": CIRCLE, "base": {**FREE, "ends": "rest"}}))
    seen = audit(scenario, circle_free.deviation)
    assert "base.ends" in names(seen)
    narrow = {"path": {**CIRCLE, "centre": [0, 0, -1]}, "tube": {"position": 0.5}}
    scenario = lay_out(load("wang-flying"), read_task(narrow))
    nodes = np.linspace(0, 10, 5)
    outside = Deviation(nodes, np.full((5, 3), 0.4), np.zeros((5, 3)), np.zeros((5, 3)), np.ones((5, 6)))
    assert "tube.position" in names(audit(scenario, outside))


def test_drive_modes_of_three_robots():
    """Paper C's three types: lengths fixed, lengths changing at fixed robot-ends, both."""
    data = load("wang-ctmrts").model_dump(mode="json")
    for cable in data["cables"]:
        cable["length"] = 1.2
    path = {"kind": "line", "start": [1.2, 0.92, 0.65], "end": [1.3, 1.0, 0.75]}
    task = {"path": path, "duration": 3, "base": {"kind": "free", "ends": "rest"}, "margin": 1, "steps": 15}
    fixed = Robot.model_validate({**data, "drive": "fixed-length"})
    found = plan(fixed, task)
    assert found.feasible, found.report()
    judge(fixed, found.trajectory, margin=1, residual=1e-3 * fixed.weight)
    values = found.trajectory
    lengths = Dynamics(fixed).cable_lengths(values["pose"].values, values["carrier_pose"].values)
    np.testing.assert_allclose(lengths, 1.2, atol=1e-4)
    held = plan(fixed, {**task, "base": {"kind": "hold"}})
    assert "cable_length" in names(held.audit)
    with pytest.raises(InputError, match=r"its carriers stay .drive: variable-length."):
        plan(Robot.model_validate({**data, "drive": "variable-length"}), task)


def test_without_gravity():
    """A robot in space is held from all sides or not at all; nothing divides by its weight."""
    data = load("ipanema-1").model_dump(mode="json")
    robot = Robot.model_validate({**data, "gravity": [0, 0, 0]})
    found = plan(
        robot, {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.2, 0, 1.1]}, "duration": 2, "margin": 5}
    )
    assert found.feasible
    judge(robot, found.trajectory, margin=5)
    flying = Robot.model_validate({**load("wang-flying").model_dump(mode="json"), "gravity": [0, 0, 0]})
    task = {"path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 1, "steps": 10}
    assert not plan(flying, task).feasible
    # With the ring at the height of the attachments the crossed cables pull outwards on all sides.
    found = plan(flying, {**task, "base": {"kind": "free"}})
    assert found.feasible, found.report()
    judge(flying, found.trajectory, residual=found.audit.tolerance)  # flat crossed cables do not span all wrenches
    np.testing.assert_allclose(found.trajectory["carrier_pose"].values[:, 0, 2], -1 + 0.03 + 0.07, atol=1e-6)


def test_what_cannot_move_does_not_move():
    """A planar robot is not sent out of its plane, nor a point mass turned."""
    for name, end in (
        ("planar-4", [0, 0.3, 0, 0, 0, 0]),
        ("planar-4", [0, 0, 0, 0, 0, 0.5]),
        ("point-mass-3", [0, 0, 0, 1, 0, 0]),
    ):
        robot = load(name)
        path = {"kind": "line", "start": list(robot.home), "end": list(robot.home + np.array(end))}
        found = plan(robot, {"path": path, "duration": 2})
        assert not found.feasible
        assert "dof" in names(found.audit)
    robot = load("planar-4")
    path = {"kind": "line", "start": list(robot.home), "end": list(robot.home + np.array([0.1, 0, 0.1, 0, 0.05, 0]))}
    assert plan(robot, {"path": path, "duration": 2}).feasible


@pytest.mark.parametrize("size", [1.0, 1e-5])
def test_few_cables_do_not_excuse_missed_limits(size):
    """What three cables cannot follow is tolerated; a limit that is missed by a little is not."""
    data = load("point-mass-3").model_dump(mode="json")
    data["cables"] = data["cables"][:1]
    data["cables"][0]["anchor"] = [0, 0, 2]
    data["platform"]["home"] = [0, 0, 1, 0, 0, 0]
    rest = {"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 0.5}
    weight = size * load("point-mass-3").weight
    data["platform"]["mass"] *= size
    for limits, feasible in (
        ({"t_max": weight * (1 - 5e-4)}, False),
        ({"t_min": weight * (1 + 5e-4)}, False),
        ({}, True),
    ):
        data["cables"][0] |= {"t_min": 0, "t_max": 200 * size, **limits}
        assert plan(Robot.model_validate(data), rest).feasible is feasible
    off = {**rest, "path": {"kind": "rest", "pose": [0.0009, 0, 1]}}
    data["cables"][0] |= {"t_min": 0, "t_max": 200 * size}
    assert not plan(Robot.model_validate(data), off).feasible


def test_variable_length_robots_stay():
    data = load("wang-ctmrts-6").model_dump(mode="json")
    robot = Robot.model_validate({**data, "drive": "variable-length"})
    start = list(robot.carrier_home[0, :3])
    moved = {robot.carriers[0].name: {"kind": "line", "start": start, "end": [start[0] + 0.02, *start[1:]]}}
    path = {"kind": "rest", "pose": list(robot.home)}
    found = plan(robot, {"path": path, "duration": 0.1, "base": {"kind": "given", "paths": moved}})
    assert "drive" in names(found.audit)


def test_saved_samples_are_audited_and_equally_spaced():
    path = {"kind": "line", "start": [0, 0, -1], "end": [0, 0, -1.1]}
    for rate, duration in ((100, 1.2345), (5000, 0.1), (30, 2)):
        found = plan(load("wang-flying"), {"path": path, "duration": duration, "output_rate": rate})
        times = found.trajectory["time"].values
        assert np.ptp(np.diff(times)) < 1e-12
        assert times[[0, -1]] == pytest.approx([0, duration])
        assert len(times) == round(duration * rate) + 1
        assert found.audit.rate >= 1000


def test_an_infeasible_plan_too_is_audited_throughout():
    found = plan(load("wang-flying"), {"path": CIRCLE, "base": {"kind": "hold", "poses": {"quad": HOVER}}, "steps": 7})
    assert found.audit.to_dict()["rate_hz"] == 1000
    assert found.certificate.shortfall == pytest.approx(7.627487150, abs=1e-8)


def test_what_progress_raises_stops_the_planner():
    """It ends the search and is not taken for a failure that calls for another try; real signals: `test_interrupt`."""

    def impatient(iteration, *_):
        if iteration == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        plan(load("wang-flying"), {"path": CIRCLE, "base": FREE}, impatient)


def test_audit_sees_between_the_nodes():
    """A path that is inside at its five nodes and far outside between them is not called feasible."""
    robot = load("wang-flying")
    outside = 0.9
    points = [[0, 0, -1]] + [[x, 0, -1] for x in (outside, 0, outside, 0, outside, 0, outside, 0)]
    task = {"path": {"kind": "waypoints", "points": points, "times": list(range(9))}, "steps": 4}
    assert plan(robot, task).status is MotionStatus.INFEASIBLE


def test_audits_of_long_motions_see_a_jerk_of_a_few_milliseconds(monkeypatch):
    """With instants 10 ms apart, as of motions that last 2000 s, and accelerations by 25 samples a ms."""
    monkeypatch.setattr("towline.ocp.audits.audit.MANY_SAMPLES", 0)
    robot, start = load("cogiro"), 10.0033  # [s]
    points = [robot.home[:3] + offset for offset in ([0, 0, 0], [0.5, 0, 0], [0.5, 0, 1e-4], [0, 0.5, 0.2])]
    path = {"kind": "waypoints", "points": np.array(points).tolist(), "times": [0, start, start + 8e-3, 20]}
    task = {"path": path, "duration": 20, "limits": {"platform_acceleration": 5}, "output_rate": 10}
    scenario = lay_out(robot, read_task(task))
    seen = audit(scenario, None)
    assert 2000 <= np.count_nonzero(np.diff(seen.times) > 9e-3) + 20 < 2021
    (excess,) = (each for each in seen.excess if each.limit == "platform_acceleration")
    during = scenario.motion(np.linspace(start, start + 8e-3, 201), None)[0].acceleration[:, :3]
    assert excess.value == pytest.approx(np.linalg.norm(during, axis=1).max(), rel=2e-3)


def test_audit_sees_carriers_out_of_their_limits(circle_free):
    scenario = circle_free.scenario
    good = circle_free.deviation
    fast = Deviation(good.nodes, good.q, good.v, 10 * good.a, good.tensions)
    seen = audit(scenario, fast)
    assert "carrier_acceleration" in names(seen)
    assert not seen.passed


WRONG = {
    "frame": ({"path": {**CIRCLE, "frame": "drone"}}, "path.frame must be one of world, quad, got 'drone'"),
    "carrier": (
        {"path": CIRCLE, "base": {"kind": "hold", "poses": {"drone": HOVER}}},
        "base.poses must name carriers of the robot .quad., got 'drone'",
    ),
    "margin": ({"path": CIRCLE, "margin": 30}, "margin must be at most 29.75 N, .*got 30 N"),
    "duration": (
        {"path": {"kind": "rest", "pose": [0, 0, -1]}},
        "duration must be a number > 0 .s. or a range, got nothing",
    ),
    "too long": (
        {"path": {"kind": "waypoints", "points": [[0, 0, -1], [0, 0, -2]], "times": [0, 1]}, "duration": 2},
        "duration must be at most 1 s, where the times of path end, got 2 s",
    ),
    "too short": (
        {"path": {"kind": "waypoints", "points": [[0, 0, -1], [0, 0, -2]], "times": [0, 3]}, "duration": 2},
        "duration must be at least 3 s, where the times of path end, got 2 s",
    ),
    "for ever": (
        {"path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 1e5},
        "duration must be at most 10000 s, .*got 100000 s",
    ),
    "phases for an hour": (
        {"phases": [{"name": "long", "path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 3600}]},
        "duration must be at most 1000 s with phases, .*got 3600 s",
    ),
    "at an anchor": (
        {"path": {"kind": "rest", "pose": [0.395, -0.216506350946, -0.1]}, "duration": 1},
        "attachment of cable 1 coincide at t = 0.000 s",
    ),
    "tilt in degrees": (
        {"path": CIRCLE, "base": {"kind": "free", "tilt_max": 10}},
        r"base.tilt_max must be less than 1.5, got 10 \(in radians; 10 degrees are 0.1745\)",
    ),
    "path without kind": (
        {"path": CIRCLE, "base": {"kind": "free", "around": {"quad": {"pose": [0, 0, 0]}}}},
        "base.around.quad.kind is missing: one of circle, feed, line, rest, return, samples, sequence, timed,",
    ),
    "same point twice": (
        {"path": {"kind": "waypoints", "points": [[0, 0, -1], [0, 0, -1], [0, 0, -2]]}, "duration": 2},
        r"path: points\[1\] must differ from points\[0\]",
    ),
    "kind": ({"path": {"kind": "spiral"}}, "path.kind must be one of .*, got 'spiral'"),
    "times": (
        {"path": {"kind": "waypoints", "points": [[0, 0, -1], [0, 0, -2]], "times": [0, 0]}},
        r"path.times must increase, got times\[1\] = 0 s after 0 s",
    ),
    "NaN": ({"path": {**CIRCLE, "radius": float("nan")}}, "path.radius must be .*got nan"),
    "key": ({"path": CIRCLE, "marign": 1}, "marign is not a known key, did you mean 'margin'"),
    "key of limits": ({"path": CIRCLE, "keep_out": []}, r"keep_out is not .*, did you mean 'limits\.keep_out'\?"),
    "key of some paths": ({"path": CIRCLE, "blend": 1}, r"blend is not a known key, did you mean 'path\.blend'\?"),
    "key of the task": (
        {"path": {**CIRCLE, "margin": 1}},
        r"path\.margin is .*, did you mean 'margin' at the top level\?",
    ),
    "steps": ({"path": CIRCLE, "steps": 1}, "steps must be greater than or equal to 4, got 1"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_tasks_are_one_line(case):
    task, message = WRONG[case]
    with pytest.raises(InputError, match=message) as caught:
        plan(load("wang-flying"), task)
    assert "\n" not in str(caught.value)


def test_tasks_that_do_not_fit_the_robot():
    with pytest.raises(InputError, match="base must be left out, got kind free: the carriers of robot 'ipanema-1'"):
        plan(load("ipanema-1"), {"path": CIRCLE, "base": {"kind": "free"}})
    with pytest.raises(InputError, match=r"has no platform\.aero"):
        plan(load("ipanema-1"), {"path": CIRCLE, "wind": [1, 0, 0]})
    with pytest.raises(InputError, match="which is of kind ground"):
        plan(load("ipanema-1"), {"path": CIRCLE, "base": {"kind": "given", "paths": {"frame": CIRCLE}}})


def test_robots_are_loaded_by_name_and_wrong_types_are_one_line():
    task = {"path": {"kind": "line", "start": [0, 0, -1], "end": [0, 0, -1.1]}, "duration": 1}
    assert plan("wang-flying", task).feasible
    for arguments in ((7, task), ("no-such-robot", task), ("wang-flying", 7), ("wang-flying", task, 7)):
        with pytest.raises(InputError) as error:
            plan(*arguments)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="start"):
        plan("wang-flying", task, start=7)


def test_task_files(tmp_path):
    task = Task.model_validate({"path": CIRCLE, "base": FREE})
    file = tmp_path / "circle.yaml"
    file.write_text(to_yaml(task))
    assert read_task(file) == task
    with pytest.raises(InputError, match=r"none\.yaml: no such file"):
        read_task(tmp_path / "none.yaml")


def test_progress_is_told():
    told = []
    plan(load("wang-flying"), {"path": CIRCLE, "base": FREE, "steps": 20}, lambda *state: told.append(state))
    iterations, objectives, infeasibilities = zip(*told, strict=True)
    assert list(iterations) == list(range(len(told)))
    assert infeasibilities[-1] < 1e-6
    assert np.isfinite(objectives).all()


def test_layout_names_owners():
    scenario = lay_out(load("wang-flying"), read_task({"path": CIRCLE, "base": FREE, "tube": {"attitude": 0.1}}))
    assert scenario.owners() == [(None, 3), (None, 4), (None, 5), (0, 0), (0, 1), (0, 2)]


def test_the_best_audited_motion_is_returned_not_the_last(monkeypatch):
    """Refinements need not get better: here the second solution misses least, by 1 %, and the direct motion most."""
    shares = iter([0.05, 0.01, 0.2, 0.3, 0.4, 0.5])
    audited = []

    def harsh(scenario, deviation):
        whole = audit(scenario, deviation)
        value = 2.0 * (1 + next(shares))
        excess = [Excess("platform_speed", "platform", 0.0, value, 2.0, "m/s")]
        audited.append(replace(whole, excess=excess))
        return audited[-1]

    monkeypatch.setattr(search, "audit", harsh)
    found = plan(load("wang-flying"), {"path": CIRCLE, "base": FREE, "steps": 10})
    assert found.status is MotionStatus.NOT_FOUND
    assert len(audited) == 6
    assert found.audit is audited[1]
    assert len(found.deviation.nodes) == 2 * 10 + 1


def test_violations_of_different_limits_are_compared_by_their_shares():
    found = plan(load("wang-flying"), {"path": CIRCLE, "base": FREE, "steps": 20})
    scenario, robot = found.scenario, found.scenario.robot
    assert relative_violation(scenario, found.audit) == 0

    def share(*excess):
        return relative_violation(scenario, replace(found.audit, excess=[Excess("limit", "platform", 0.0, *excess)]))

    assert share(2.2, 2.0, "m/s") == pytest.approx(0.1)
    assert share(0.5, 2.0, "m", "at least") == pytest.approx(0.75)
    assert share(0.01, 0.0, "m", "exactly") == pytest.approx(0.01 / robot.length)
    assert share(np.nan, 1.0, "N") == np.inf
    short = np.full_like(found.audit.violation, 0.3 * robot.force_scale)
    assert relative_violation(scenario, replace(found.audit, violation=short)) == pytest.approx(0.3)
