"""No controller says "as planned" far from its reference: gains of zero, rates of zero, references that jump."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from towline import load, simulate
from towline.control import ANSWERS, ComputedTorque, LengthControl, Predictive, Reference, State
from towline.control.deviation import FAR, TURNED, Deviation

PLANNED, OFF = ANSWERS.index("as planned"), ANSWERS.index("off the reference")
COGIRO = load("cogiro")


def longest(robot):
    """Return the distance beyond which a platform is away, from the cables' lengths."""
    return FAR * np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean()


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.sampled_from([0.0, 2 * np.pi, -2 * np.pi]))
def test_one_and_many_poses_are_judged_alike(offset, turns):
    deviation, pose, wanted = Deviation(COGIRO), COGIRO.home + np.array(offset), COGIRO.home.copy()
    wanted[3:] += turns
    angles = np.abs(np.angle(np.exp(1j * np.array(offset[3:]))))
    far = np.linalg.norm(offset[:3]) > longest(COGIRO) or angles.max() > TURNED
    assert deviation.is_far(pose, wanted) == far
    assert deviation.are_far(pose[None], wanted[None]).tolist() == [far]


CASES = {
    "gains of zero": (ComputedTorque, {"bandwidth": 0.0, "observer": 0.0}),
    "tensions that may not change": (Predictive, {"rate": 0.0}),
    "small gains": (ComputedTorque, {"bandwidth": 0.05, "observer": 0.01}),
}


@pytest.mark.parametrize("case", CASES)
def test_a_bad_run_is_not_silent(case):
    kind, gains = CASES[case]
    robot = load("wang-flying")
    push = [0.3 * robot.force_scale, 0, 0, 0, 0, 0]
    run = simulate(robot, robot.home, kind(robot, **gains), duration=1.2, disturbance=push)
    far = run.error > longest(robot)
    assert far.sum() > 1
    assert (run.trajectory["answered"].values[: len(far)][far] != PLANNED).all()
    assert not run.passed
    assert "off the reference" in run.report()


@pytest.mark.parametrize(
    "make", [ComputedTorque, Predictive, lambda robot: LengthControl(robot, stiffness=1e5, most=10)]
)
def test_a_reference_that_jumps_is_reported_until_it_is_reached(make):
    controller, still = make(COGIRO), np.zeros_like(COGIRO.carrier_home)
    state = State(COGIRO.home, np.zeros(6), COGIRO.carrier_home, still)
    for k, (x, yaw, status) in enumerate([(0.9, 0.0, PLANNED), (1.5, 0.0, OFF), (0.0, 0.6, OFF), (0.0, 6.2, PLANNED)]):
        pose = COGIRO.home + np.array([x, 0, 0, 0, 0, yaw])
        tensions = np.full(COGIRO.m, 300.0)
        reference = Reference(pose, np.zeros(6), np.zeros(6), COGIRO.carrier_home, still, still, tensions)
        assert controller.step(0.1 * k, state, reference).answered in (status, ANSWERS.index("soft wrench"))


def test_rows_of_a_batch_have_their_own_status():
    controller, still = ComputedTorque(COGIRO), np.zeros((2, 1, 6))
    poses = np.stack([COGIRO.home, COGIRO.home + 1.5 * np.eye(6)[0]])
    carriers = np.stack([COGIRO.carrier_home] * 2)
    reference = Reference(COGIRO.home, np.zeros(6), np.zeros(6), COGIRO.carrier_home, still[0], still[0], None)
    given = controller.step(0.0, State(poses, np.zeros((2, 6)), carriers, still), reference)
    assert given.answered[0] == PLANNED
    assert given.answered[1] != PLANNED


def test_a_team_with_a_bandwidth_of_zero_can_be_controlled():
    """Its loop at home is simulated at construction, for a time that a bandwidth of zero does not determine."""
    assert Predictive("multi-quadrotor-3", bandwidth=0.0).robot.name == "multi-quadrotor-3"
