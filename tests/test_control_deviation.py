"""No controller says "as planned" far from its reference: gains of zero, rates of zero, references that jump."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from towline import Dynamics, load, simulate
from towline.control import ANSWERS, ComputedTorque, Controller, LengthControl, Predictive, Reference, State
from towline.control.deviation import FAR, MOST, TURNED, Deviation

PLANNED, OFF = ANSWERS.index("as planned"), ANSWERS.index("off the reference")
COGIRO = load("cogiro")


def longest(robot):
    """Return the distance beyond which a platform is away, from the cables' lengths."""
    return min(FAR * np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean(), MOST)


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6), st.sampled_from([0.0, 2 * np.pi, -2 * np.pi]))
def test_one_and_many_poses_are_judged_alike(offset, turns):
    deviation, pose, wanted = Deviation(COGIRO), COGIRO.home + np.array(offset), COGIRO.home.copy()
    wanted[3:] += turns
    turned = Rotation.from_euler("ZYX", pose[:2:-1]).inv() * Rotation.from_euler("ZYX", COGIRO.home[:2:-1])
    far = np.linalg.norm(offset[:3]) > longest(COGIRO) or turned.magnitude() > TURNED
    assert bool(deviation.are_far(pose, wanted)) == far
    assert deviation.are_far(pose[None], wanted[None]).tolist() == [far]
    # The core knows it too.
    controller, still = ComputedTorque(COGIRO), np.zeros_like(COGIRO.carrier_home)
    at = np.zeros(6), np.zeros(6), COGIRO.carrier_home, still
    controller.step(0.0, State(pose, np.zeros(6), *at[2:]), Reference(wanted, *at, still))
    assert controller._are_far == far


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
    run = simulate(robot, robot.home, kind(robot, **gains), duration=1.2, period=2e-3, disturbance=push)
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
    for k, (x, yaw, status) in enumerate(
        [(0.04, 0.0, PLANNED), (0.06, 0.0, OFF), (0.0, 0.6, OFF), (0.0, 6.2, PLANNED)]
    ):
        pose = COGIRO.home + np.array([x, 0, 0, 0, 0, yaw])
        tensions = np.full(COGIRO.m, 300.0)
        reference = Reference(pose, np.zeros(6), np.zeros(6), COGIRO.carrier_home, still, still, tensions)
        # So far apart that the motion of this state, which stays where it is, is not compared with the model.
        # Its time says that it is no old reading that is held.
        answered = controller.step(0.3 * k, state._replace(time=0.3 * k), reference).answered
        assert answered in (status, ANSWERS.index("soft wrench"))


def test_no_robot_is_metres_off_as_planned():
    """FAST's cables are 300 m long, of which 5 % would be too far."""
    fast = load("fast")
    assert Deviation(fast).are_far(fast.home + 0.06 * np.eye(6)[0], fast.home)


def test_predictive_control_does_not_call_an_overload_as_planned():
    """With its CoM off, a linear program finds no tensions that hold the platform; the program of a step has always."""
    robot, off = load("wang-ctmrts-6"), -0.0172
    com = tuple((np.array(robot.platform.com) + off).tolist())
    actual = Dynamics(robot.model_copy(update={"platform": robot.platform.model_copy(update={"com": com})}))
    w = np.asarray(actual.required_wrench(robot.home, np.zeros(6), np.zeros(6)))
    bounds = np.stack([robot.t_min, robot.t_max], axis=1)
    assert linprog(np.zeros(6), A_eq=actual.wrench_matrix(robot.home), b_eq=w, bounds=bounds).status == 2
    controller = Predictive(robot)
    run = simulate(robot, robot.home, controller, duration=0.8, period=4e-3, mismatch={"com": off})
    assert controller.handed_over is None
    assert run.error.max() > 0.1
    growing = np.append(np.diff(run.error) > 0, False) & (run.error > 0.03)
    assert growing.sum() > 50
    assert (run.record.answered[growing] != PLANNED).all()
    assert run.answered["soft wrench"] > 50


def test_a_platform_that_no_tensions_hold_is_overloaded_before_it_is_a_centimetre_away():
    """The lowest tensions of FAST's cables lift its cabin: the stages of a step end 0.1 m and more above its home."""
    fast = load("fast")
    dynamics, weight = Dynamics(fast), fast.weight
    w = np.asarray(dynamics.required_wrench(fast.home, np.zeros(6), np.zeros(6))) / weight
    bounds = np.stack([fast.t_min, fast.t_max], axis=1) / weight
    assert linprog(np.zeros(6), A_eq=dynamics.wrench_matrix(fast.home), b_eq=w, bounds=bounds).status == 2
    run = simulate(fast, fast.home, Predictive(fast), duration=0.3, period=5e-3)
    assert run.error.max() > 0.09
    assert (run.record.answered[run.error[: len(run.record.answered)] > 0.01] == ANSWERS.index("soft wrench")).all()


def test_rows_of_a_batch_have_their_own_status():
    controller, still = ComputedTorque(COGIRO), np.zeros((2, 1, 6))
    poses = np.stack([COGIRO.home, COGIRO.home + 1.5 * np.eye(6)[0]])
    carriers = np.stack([COGIRO.carrier_home] * 2)
    reference = Reference(COGIRO.home, np.zeros(6), np.zeros(6), COGIRO.carrier_home, still[0], still[0], None)
    given = controller.step(0.0, State(poses, np.zeros((2, 6)), carriers, still), reference)
    assert given.answered[0] == PLANNED
    assert given.answered[1] != PLANNED


TEAMS = ("multi-quadrotor-3", "multi-quadrotor-4", "multi-quadrotor-6", "flycrane")
PUSH = np.array([0.04, 0.02, 0, 0, 0, 0])  # of the weight


@pytest.mark.parametrize("name", TEAMS)
@pytest.mark.parametrize(("late", "share"), [({"rate": 20}, 0.9), ({"delay": 0.05}, 0.5)])
def test_carriers_that_oscillate_at_their_limits_are_reported_before_the_load_is_away(name, late, share):
    """By states that are late or held without a time: h delay > 0.647, h period > 1.

    For the delay the attitude loops are then slowed down, so that carriers are at their limits for a part of the time.
    """
    robot = load(name)
    run = simulate(robot, robot.home, noise=late, disturbance=PUSH * robot.weight, duration=0.6)
    reported = np.flatnonzero(run.record.answered[: run.lasted] != PLANNED)
    assert reported.size
    assert run.error[: reported[0] + 1].max() < 0.025
    within = run.record.answered[reported[0] : run.lasted] != PLANNED
    assert within.mean() > share


@pytest.mark.parametrize("name", TEAMS[::3])
def test_attitude_loops_are_slowed_down_for_an_unknown_delay_before_they_oscillate(name):
    """For 25 ms the usual bandwidth of 40 rad/s would be unstable, and carriers would soon be at their limits."""
    robot = load(name)
    push = PUSH * robot.weight
    late, on_time = (
        simulate(robot, robot.home, noise={"delay": delay}, disturbance=push, duration=1.0) for delay in (0.025, 0.0)
    )
    assert (late.record.answered == PLANNED).all()
    assert late.error.max() < 2 * on_time.error.max()
    assert np.abs(late.record.motions[-200:, 1:, 9:]).max() < 0.2  # [rad/s]; at the limits it is 6


@pytest.mark.parametrize("name", TEAMS[::3])
def test_noise_is_no_reason_to_report_that_carriers_are_at_their_limits(name):
    robot = load(name)
    noise = {"position": 1e-3, "attitude": 1e-3, "velocity": 1e-2, "attitude_rate": 1e-2}
    for late in ({}, {"delay": 0.01}, {"rate": 50}):
        run = simulate(robot, robot.home, noise=noise | late, disturbance=PUSH * robot.weight, duration=0.6)
        assert (run.record.answered[: run.lasted] == PLANNED).mean() > 0.99


class Blind(Controller):
    """A controller whose sensors fail in the last `steps` of each so many steps."""

    def __init__(self, controller, steps, each=30):
        self.controller, self.steps, self.each, self.count = controller, steps, each, 0

    def reset(self):
        self.controller.reset()

    def follow(self, *coming):
        self.controller.follow(*coming)

    def step(self, time, state, reference):
        self.count += 1
        if self.count % self.each >= self.each - self.steps:
            state = state._replace(pose=np.full(6, np.nan))
        return self.controller.step(time, state, reference)


@pytest.mark.parametrize(
    ("period", "blind", "each"),
    [(2e-3, 1, 15), (1e-3, 15, 60), (5e-3, 3, 8), (0.01, 1, 4), (0.06, 0, 30), (0.08, 0, 30)],
)
@pytest.mark.parametrize("what", ["nothing", "cut 1 at 0.2", "push 49 0 0 at 0.2"])
def test_predictions_are_compared_with_rare_states_and_between_failures_of_sensors(period, blind, each, what):
    robot = load("wang-ctmrts")
    controller, events = Predictive(robot), [] if what == "nothing" else [what]
    run = simulate(robot, robot.home, Blind(controller, blind, each), period=period, duration=0.6, events=events)
    if what == "nothing":
        assert controller.handed_over is None
        return
    assert controller.handed_over is not None
    assert controller.handed_over.time < 0.2 + 0.25
    silent = np.isin(run.record.answered[: run.lasted], [PLANNED, ANSWERS.index("shifted plan")])
    assert run.error[: run.lasted][silent].max() < 0.025


@pytest.mark.parametrize(("period", "blind"), [(0.3, 0), (0.03, 1)])
def test_motions_that_are_not_compared_with_the_model_are_warned_of_once(period, blind):
    robot = load("cogiro")
    with pytest.warns(UserWarning, match="the motion was not compared with the model of Predictive for 0.") as warned:
        simulate(robot, robot.home, Blind(Predictive(robot), blind, 3), period=period, duration=2.0)
    assert len(warned) == 1


class Sensed(Controller):
    """A controller whose tension sensors report a number from 0.1 s to 0.4 s, all of them or those of some cables."""

    def __init__(self, controller, reported, cables=slice(None)):
        self.controller, self.reported, self.cables, self.drive = controller, reported, cables, controller.drive

    def reset(self):
        self.controller.reset()

    def follow(self, *coming):
        self.controller.follow(*coming)

    def step(self, time, state, reference):
        if 0.1 <= time < 0.4:
            pulls = np.array(state.tensions)
            pulls[self.cables] = self.reported
            state = state._replace(tensions=pulls)
        return self.controller.step(time, state, reference)


@pytest.mark.parametrize("make", [ComputedTorque, Predictive])
@pytest.mark.parametrize("name", ["cogiro", "wang-ctmrts"])
def test_a_robot_is_held_while_all_tension_sensors_fail_which_is_reported_at_once(make, name):
    """Its cables pull all the time, so that it moves as with sensors that work."""
    robot, given = load(name), {"duration": 0.6, "period": 4e-3}
    usual = simulate(robot, robot.home, make(robot), **given)
    for reported in (-1.0, 0.0):
        run = simulate(robot, robot.home, Sensed(make(robot), reported), **given)
        soft = np.flatnonzero(run.record.answered[: run.lasted] != PLANNED)
        np.testing.assert_array_equal(soft, np.arange(26, 100))  # one reading may be that before the first command
        assert set(run.record.answered[soft].tolist()) == {ANSWERS.index("soft wrench")}
        np.testing.assert_allclose(run.record.motions[:, 0, :3], usual.record.motions[:, 0, :3], atol=2e-5)


@pytest.mark.parametrize("make", [ComputedTorque, Predictive])
@pytest.mark.parametrize("name", ["cogiro", "wang-flying"])
def test_sensors_of_all_cables_but_one_that_fail_are_reported_before_the_load_falls(make, name):
    """These cables are treated as cut, and the last one cannot hold the platform."""
    robot = load(name)
    run = simulate(robot, robot.home, Sensed(make(robot), -1.0, slice(1, None)), duration=0.3)
    silent = np.isin(run.record.answered[: run.lasted], [PLANNED, ANSWERS.index("shifted plan")])
    assert run.error[: run.lasted][silent].max() < 3e-3
    assert run.error.max() > 0.05


def test_failed_sensors_of_one_robot_of_a_batch_change_no_other_row():
    robot = load("cogiro")
    one, many = ComputedTorque(robot), ComputedTorque(robot)
    still, pull = np.zeros_like(robot.carrier_home), np.full(robot.m, 300.0)
    reference = Reference(robot.home, np.zeros(6), np.zeros(6), robot.carrier_home, still, still, pull)
    rows = np.stack([pull, 0 * pull])
    for k in range(3):
        alone = one.step(0.01 * k, State(robot.home, np.zeros(6), robot.carrier_home, still, rows[0]), reference)
        both = many.step(
            0.01 * k,
            State(*(np.stack([part, part]) for part in (robot.home, np.zeros(6), robot.carrier_home, still)), rows),
            reference,
        )
        rows = both.tensions.copy()
        rows[1] = 0.0
        np.testing.assert_allclose(both.tensions[0], alone.tensions, rtol=1e-12)
        assert both.answered[0] == alone.answered
    assert both.answered[1] == ANSWERS.index("soft wrench")
