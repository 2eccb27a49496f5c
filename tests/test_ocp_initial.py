"""Motions that start from a measured state of a robot that moves."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline.base.errors import InputError
from towline.models import load
from towline.ocp import MotionStatus, plan

from .told import told

ROBOT = load("ipanema-1")
LINE = {"kind": "line", "start": [0, 0, 1], "end": [0.5, 0.3, 1.2]}
TASK = {"path": LINE, "duration": 2, "tube": {"position": 0.3, "attitude": 0.3}, "steps": 40}
offsets = st.tuples(*[st.floats(-0.05, 0.05)] * 3)
speeds = st.tuples(*[st.floats(-0.2, 0.2)] * 3)


@settings(max_examples=6, deadline=None)
@given(offset=offsets, angles=offsets, speed=speeds, turning=speeds)
def test_the_motion_starts_as_measured_and_ends_at_rest(offset, angles, speed, turning):
    """Pose and speed at the start by differences of the audited poses; the end is the path's, at rest."""
    pose = [*(np.array(LINE["start"]) + offset), *angles]
    planned = plan(ROBOT, TASK, initial={"pose": pose, "velocity": [*speed, *turning]})
    assert planned.feasible
    times, poses = planned.audit.times, planned.audit.motion.pose
    step = times[1] - times[0]
    np.testing.assert_allclose(poses[0], pose, atol=1e-7)
    rates = (-11 * poses[0] + 18 * poses[1] - 9 * poses[2] + 2 * poses[3]) / (6 * step)
    np.testing.assert_allclose(rates, [*speed, *turning], atol=1e-5)
    np.testing.assert_allclose(poses[-1, :3], LINE["end"], atol=1e-7)
    assert np.abs(poses[-1] - poses[-2]).max() < 1e-6


def test_a_plan_continues_another_from_its_middle():
    """From the state of a plan at half time, acceleration included, the rest is planned without a jump."""
    first = plan(ROBOT, TASK)
    half = len(first.audit.times) // 2
    pose, velocity, acceleration = (part[half] for part in first.audit.motion)
    state = {"pose": list(pose), "velocity": list(velocity), "acceleration": list(acceleration)}
    line = {**LINE, "start": list(pose[:3])}
    then = plan(ROBOT, TASK | {"path": line, "duration": 1.5, "initial": state})
    assert then.feasible
    np.testing.assert_allclose(then.audit.motion.acceleration[0], acceleration, atol=1e-7)
    np.testing.assert_allclose(then.audit.motion.velocity[0], velocity, atol=1e-7)


def test_carriers_start_as_measured():
    robot = load("wang-ctmrts-6")
    home = np.array(robot.carrier_home)
    there, moving = home.copy(), np.zeros_like(home)
    there[:, 0] += 0.01
    moving[:, 1] = 0.02
    line = {"kind": "line", "start": list(robot.home[:3]), "end": [robot.home[0] + 0.2, *robot.home[1:3]]}
    task = {
        "path": line,
        "duration": 4,
        "tube": {"position": 0.1, "attitude": 0.3},
        "base": {"kind": "free"},
        "steps": 20,
    }
    state = {"pose": list(robot.home), "carrier_pose": there.tolist(), "carrier_velocity": moving.tolist()}
    planned = plan(robot, task, initial=state)
    assert planned.feasible
    np.testing.assert_allclose(planned.audit.carriers.pose[0], there, atol=1e-7)
    np.testing.assert_allclose(planned.audit.carriers.velocity[0], moving, atol=1e-6)
    assert np.abs(planned.audit.carriers.velocity[-1]).max() < 1e-6


def test_whole_turns_of_the_measured_angles_do_not_count():
    planned = plan(ROBOT, TASK, initial={"pose": [0, 0, 1, 0, 0, 2 * np.pi - 0.01]})
    assert planned.feasible
    assert np.abs(planned.audit.motion.pose[:, 5]).max() < 0.1


def test_a_proof_shows_the_motion_that_starts_as_measured():
    """A point mass that falls at 3 g: no cable pushes it down, and the audit shows the shortfall of that instant."""
    line = {"kind": "line", "start": [0, 0, 1], "end": [0.3, 0.1, 1.1]}
    state = {"pose": [0, 0, 1.05, 0, 0, 0], "acceleration": [0, 0, -30, 0, 0, 0]}
    task = {"path": line, "duration": 2, "tube": {"position": 0.2}, "steps": 20}
    planned = plan("point-mass-3", task, initial=state)
    assert planned.status is MotionStatus.INFEASIBLE
    assert not planned.audit.passed
    assert planned.audit.violation[0] == pytest.approx(planned.certificate.shortfall, rel=1e-6)
    assert planned.infeasible_spans


def test_a_start_outside_the_tube_is_proven_impossible():
    planned = plan(ROBOT, TASK, initial={"pose": [0.4, 0, 1, 0, 0, 0]})
    assert planned.status is MotionStatus.INFEASIBLE
    assert (
        "tube.position of the platform must be at most 0.3 m but is 0.4 m at t = 0.000 s"
        in told(planned).splitlines()[0]
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"initial": {"pose": [0, 0, 1, 0, 0, 0.5]}, "tube": {"position": 0.1}},
            "initial: yaw of the platform must be",
        ),
        (
            {"initial": {"pose": [0, 0, 1, 0, 0, 0], "carrier_pose": [[0] * 6] * 2}},
            "initial.carrier_pose must have a row for",
        ),
        ({"initial": {"pose": [0, 0, 1, 0, 0, 0], "carrier_velocity": [[0] * 6]}}, "initial.carrier_velocity must"),
        ({"initial": {"pose": [0, 1]}}, "initial.pose"),
        ({"initial": {"pose": [0, 0, float("nan"), 0, 0, 0]}}, "initial.pose"),
    ],
)
def test_what_does_not_fit_is_one_line(change, message):
    with pytest.raises(InputError, match=message) as caught:
        plan(ROBOT, TASK | change)
    assert "\n" not in str(caught.value)
