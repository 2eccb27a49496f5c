"""The papers' own tasks: paper F's three motions, paper C's load in each drive mode, and how tensions alone drift."""

import numpy as np
import pytest

from towline.models import Dynamics, load
from towline.ocp import Task, plan
from towline.ocp.tasks.paths import Motion
from towline.studies.flying import plans as flying_plans
from towline.studies.towing import plans as towing_plans


def missing(robot, audited):
    """Largest missing wrench [N] of an audit's tensions, moments over the robot's length."""
    dynamics = Dynamics(robot)
    A = dynamics.wrench_matrix(audited.motion.pose, audited.carriers.pose)
    off = np.einsum("nij,nj->ni", A, audited.tensions) - dynamics.required_wrench(*audited.motion, *audited.carriers)
    off[:, 3:] /= robot.length
    return np.linalg.norm(off, axis=1).max()


@pytest.mark.parametrize("name", ["circle", "helix", "pitching"])
def test_paper_f_motions_are_planned(name):
    robot, task = load("wang-flying"), getattr(flying_plans, f"{name}_task")()
    found = plan(robot, task)
    assert found.feasible, found.report()
    seen = found.audit
    assert seen.rate >= 1000
    assert missing(robot, seen) < 1e-9
    assert seen.tensions.min() >= robot.t_min.min() - 1e-6
    if name == "pitching":
        in_base = found.scenario.off_path(seen.times, seen.motion, seen.carriers)
        np.testing.assert_allclose(in_base, 0, atol=1e-9)
        np.testing.assert_allclose(np.ptp(seen.carriers.pose[:, 0, 4]), 2 * flying_plans.PITCH, rtol=1e-4)
        # The surge belongs to the pitch: ddx = g tan(pitch), but for terms of fifth order and the spline's ends.
        pitch = seen.carriers.pose[500:-500, 0, 4]
        np.testing.assert_allclose(seen.carriers.acceleration[500:-500, 0, 0], 9.81 * np.tan(pitch), atol=5e-4)
    else:
        drift = (flying_plans.END - flying_plans.START) / 10 if name == "helix" else np.zeros(3)
        centre = (flying_plans.START if name == "helix" else np.array([50, 50, 100])) + seen.times[:, None] * drift
        arm = seen.motion.pose[:, :3] - centre
        np.testing.assert_allclose(np.linalg.norm(arm[:, :2], axis=1), 1, atol=1e-9)
        np.testing.assert_allclose(arm[:, 2], -1, atol=1e-9)
        away = np.linalg.norm(seen.carriers.pose[:, 0, :3] - centre, axis=1)
        assert 0.5 < away.max() < 2


def test_the_helix_is_impossible_on_the_straight_line():
    task = flying_plans.helix_task()
    paths = {"quad": task.base.around["quad"]}
    found = plan(load("wang-flying"), {**task.model_dump(mode="json"), "base": {"kind": "given", "paths": paths}})
    assert found.status == "infeasible"
    assert found.certificate.shortfall == pytest.approx(7.627, abs=1e-3)  # as under a hovering quadrotor


IN_LEAST_TIME = {
    "duration": {"min": 0.1, "max": 4.0},
    "objective": {"time": 0.01, "jerk": 30.0, "carrier_acceleration": 2.0, "carrier_offset": 0.5},
}
CASES = [
    ("wang-ctmrts", "fixed-length", "effort", 25),
    ("wang-ctmrts", "both", "time", 12),
    ("wang-ctmrts-4", "fixed-length", "effort", 25),
    ("wang-ctmrts-4", "variable-length", "time", 12),
    ("wang-ctmrts-5", "both", "effort", 25),
]


@pytest.mark.parametrize(("name", "drive", "aim", "steps"), CASES)
def test_paper_c_carries_its_load(name, drive, aim, steps):
    robot = towing_plans.robot(name, drive)
    task = towing_plans.task(robot, steps)
    if aim == "time":
        task = Task.model_validate(task.model_dump() | IN_LEAST_TIME)
    found = plan(robot, task)
    assert found.feasible, found.report()
    seen = found.audit
    assert missing(robot, seen) < 1e-3 * robot.weight
    assert seen.tensions.min() > 0
    assert seen.tensions.max() <= 500
    np.testing.assert_allclose(seen.motion.pose[[0, -1]], [task.path.start, task.path.end], atol=1e-9)
    np.testing.assert_allclose(seen.motion.velocity[[0, -1]], 0, atol=1e-9)
    for index, carrier in enumerate(robot.carriers):
        place = seen.carriers.pose[:, index, :3]
        assert (place >= np.array(carrier.reach.min) - 1e-6).all()
        assert (place <= np.array(carrier.reach.max) + 1e-6).all()
    if drive == "fixed-length":
        dynamics = Dynamics(robot)
        between = dynamics.cable_lengths(seen.motion.pose, seen.carriers.pose)
        np.testing.assert_allclose(between, 1.2, atol=1e-4)
        body, bases = found.scenario.motion(found.deviation.nodes, found.deviation)
        np.testing.assert_allclose(dynamics.cable_lengths(body.pose, bases.pose), 1.2, atol=1e-6)
    if aim == "time":
        assert found.scenario.duration < 1.0 < towing_plans.SECONDS
    assert found.audit.to_dict()["drift"]["window_position"] < 1e-4
    assert found.audit.drift.position < 1e-3
    assert "open-loop simulation" in found.report()


def test_drift_is_that_of_a_falling_mass():
    """Tensions that are too small by a known force: half a t^2 off after each window and after the whole."""
    from towline.ocp.audits.drift import drift

    robot = load("point-mass-3")
    task = {"path": {"kind": "rest", "pose": [0, 0, 1]}, "duration": 0.5}
    found = plan(robot, task)
    assert found.audit.drift is None  # three cables and three freedoms: it follows exactly
    seen = found.audit
    towed = drift(found.scenario, seen.times, seen.motion, seen.carriers, np.zeros_like(seen.tensions))
    assert towed.window == pytest.approx(0.1)
    assert towed.window_position == pytest.approx(9.81 / 2 * 0.1**2, rel=1e-9)
    assert towed.position == pytest.approx(9.81 / 2 * 0.5**2, rel=1e-9)
    assert towed.attitude == 0
    still = Motion(*(part.copy() for part in seen.motion))
    assert drift(found.scenario, seen.times, still, seen.carriers, seen.tensions).position < 1e-9


def test_drift_that_leaves_all_numbers_is_infinite_and_no_error():
    """A beam with little inertia about its length, spun by tensions far too large, on 4 cables of two quadrotors."""
    from towline.models import Robot
    from towline.ocp.audits.drift import drift
    from towline.ocp.tasks.lay_out import lay_out
    from towline.ocp.tasks.task import read_task

    quadrotor = {"kind": "quadrotor", "mass": 1.2, "inertia": [0.01, 0.01, 0.02, 0, 0, 0], "thrust_max": 40}
    quadrotor |= {"torque_max": [1, 1, 0.3]}
    sides = [("left", -1), ("right", 1)]
    cable = {"anchor": [0, 0, 0], "t_min": 0.5, "t_max": 60}
    beam = Robot.model_validate(
        {
            "name": "beam",
            "source": "a test",
            "platform": {"mass": 1, "inertia": [0.34, 0.004, 0.34, 0, 0, 0]},
            "carriers": [{**quadrotor, "name": name, "home": [0, side, 2.5, 0, 0, 0]} for name, side in sides],
            "cables": [
                {**cable, "carrier": name, "attachment": [0, side * y, 0.05]}
                for name, side in sides
                for y in (0.35, 0.95)
            ],
        }
    )
    line = {"kind": "line", "start": [0, 0, 1, 0, 0, 0], "end": [0.5, 0, 1, 0, 0, 0]}
    scenario = lay_out(beam, read_task({"path": line, "duration": 1.0, "base": {"kind": "free"}}))
    times = np.linspace(0, 1.0, 1001)
    spun = drift(scenario, times, *scenario.motion(times, None), np.full((1001, 4), 1e4))
    assert np.isinf([spun.window_position, spun.window_attitude]).all()
