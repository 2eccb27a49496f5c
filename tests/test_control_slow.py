"""Loops with steps that are far apart: gains and stages for commands that are held so long, and comparisons."""

import warnings

import numpy as np
import pytest

from towline import load, simulate
from towline.base.errors import InputError
from towline.control import ComputedTorque, Predictive, Reference, State
from towline.models.points import rotations
from towline.statics.distribution import tensions

pytestmark = pytest.mark.usefixtures("stable_at_home")
PERIODS = [0.05, 0.1, 0.15]


def pushed(robot, controller, period):
    """A push of 3 % of the weight for 0.2 s or one period, at rest at home."""
    lasting = max(0.2, period)
    events = [f"push {0.03 * robot.force_scale * 0.2 / lasting} 0 0 at 0.4 for {lasting}"]
    return simulate(robot, robot.home, controller, duration=4.0, period=period, events=events, tolerance=100.0)


def is_stable(gain, damping, period):
    """Whether a held acceleration -gain x - damping v, for a period, lets a mass come to rest."""
    held = np.array([[1, period], [0, 1]]) - np.outer([period**2 / 2, period], [gain, damping])
    return np.abs(np.linalg.eigvals(held)).max() < 1 - 1e-9


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
@pytest.mark.parametrize("name", ["cogiro", "planar-4"])
def test_default_gains_hold_a_robot_in_slow_loops(name, kind, period):
    """A free mass would go 0.03 g 0.2 s 0.2 s / 2 = 6 mm during the push, and go on with 0.06 m/s."""
    run = pushed(load(name), kind(load(name)), period)
    assert run.error.max() < 0.006
    assert run.error[-5:].max() < 1e-3
    assert run.answered["as planned"] == len(run.error)


def test_the_bandwidth_is_lowered_where_held_commands_would_make_the_loop_unstable():
    robot = load("cogiro")
    for period in (0.05, 0.07, 0.08, 0.1, 0.2):
        controller = ComputedTorque(robot)
        pushed(robot, controller, period)
        gain, damping = controller._settings["kp"][0], controller._settings["kd"][0]
        assert is_stable(1.5 * gain, 1.5 * damping, period)  # with room for tensions that are too large
        assert controller._settings["observer"] == pytest.approx(damping / 2)
        assert (gain == 100.0) == (period <= 0.06)
        assert is_stable(100.0, 20.0, period) == (period < 0.1)  # what it would be otherwise
    with pytest.warns(UserWarning, match=r"bandwidth must be at most 6.67 rad/s for steps 0.15 s apart") as told:
        run = pushed(robot, ComputedTorque(robot, bandwidth=10.0), 0.15)
    assert len(told) == 1
    assert run.error[-5:].max() > 0.1  # as the warning says
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pushed(robot, ComputedTorque(robot, bandwidth=6.0), 0.15)


@pytest.mark.parametrize(
    ("name", "kind", "period"),
    [
        *(
            (name, ComputedTorque, period)
            for name in ("multi-quadrotor-3", "multi-quadrotor-6", "flycrane")
            for period in (0.03, 0.1)
        ),
        ("multi-quadrotor-4", Predictive, 0.04),
        ("multi-quadrotor-6", Predictive, 0.1),
    ],
)
def test_teams_hold_their_load_in_slow_loops(name, kind, period):
    """Attitude loops of 40 rad/s are unstable then: teams tumbled, 30 m off after 4 s with steps of 0.1 s."""
    robot = load(name)
    controller = kind(robot)
    run = pushed(robot, controller, period)
    attitude = float(controller._settings["attitude"])
    assert is_stable(attitude**2, 2 * attitude, period)
    assert not is_stable(40.0**2, 2 * 40.0, period)
    assert run.error.max() < 0.03  # a free mass: 0.03 g (0.2 s)^2 / 2 in the push, and 60 mm/s after it
    assert run.error[-round(0.5 / period) :].max() < 4e-3
    assert run.answered["as planned"] == len(run.error)


@pytest.mark.parametrize(("kind", "period"), [(ComputedTorque, 0.2), (Predictive, 0.12), (Predictive, 0.2)])
def test_towing_robots_hold_their_load_in_slow_loops(kind, period):
    """Carriers that correct errors with 6 rad/s made the loop unstable, half a metre off after 12 s."""
    run = pushed(load("wang-ctmrts"), kind(load("wang-ctmrts")), period)
    assert run.error.max() < 0.015
    assert run.error[-5:].max() < 5e-3
    assert run.answered["as planned"] == len(run.error)


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
def test_a_light_carrier_is_free_to_turn_during_slow_steps(kind):
    """Winches that kept their rates for 10 ms tied a quadrotor to its platform, 13 times as heavy to turn: it tumbled.

    A critically damped error of bandwidth b goes J / (m b e) after an impulse J, and less if it lasts for a while.
    """
    robot = load("wang-flying-quadrotor")
    force, lasting = np.array([0.5, 0.3]), 0.1
    events = [f"push {force[0]} {force[1]} 0 at 0.2 for {lasting}"]
    run = simulate(robot, robot.home, kind(robot), duration=2.0, period=0.01, events=events, tolerance=0.1)
    assert run.error.max() < np.linalg.norm(force) * lasting / (robot.platform.mass * 10.0 * np.e)
    assert run.error[-20:].max() < 1e-5
    assert run.answered["as planned"] == len(run.error)


def test_tensions_cannot_be_commanded_to_winches_of_cables_that_do_not_stretch():
    """No length belongs to a tension. Before, the report raised a ValueError of NumPy."""
    with pytest.raises(InputError, match=r"drive must not be 'lengths' for commanded tensions .* of cables\[0\]"):
        simulate("wang-ctmrts-4", load("wang-ctmrts-4").home, duration=0.01, drive="lengths")


def test_all_bandwidths_of_a_team_are_lowered_by_the_same_factor_and_restored():
    robot = load("multi-quadrotor-3")
    controller = ComputedTorque(robot)
    usual = {name: controller._settings[name].copy() for name in ("attitude", "place", "observer", "kd", "kp")}
    pushed(robot, controller, 0.05)
    for name, value in usual.items():
        np.testing.assert_allclose(controller._settings[name], value * (15 / 40) ** (1 + (name == "kp")), rtol=1e-6)
    controller.reset()
    for name, value in usual.items():
        np.testing.assert_array_equal(controller._settings[name], value)
    with pytest.warns(UserWarning, match=r"bandwidth must be at most 0.562 rad/s for steps 0.05 s apart"):
        pushed(robot, ComputedTorque(robot, bandwidth=1.5), 0.05)


def test_given_stages_that_are_shorter_than_the_steps_are_warned_of():
    robot = load("planar-4")
    with pytest.warns(UserWarning, match=r"stage must be at least 0.06 s, the time between steps") as told:
        pushed(robot, Predictive(robot, stage=0.015), 0.06)
    assert len(told) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pushed(robot, Predictive(robot, stage=0.06), 0.06)
        pushed(robot, Predictive(robot, stage=0.015, bandwidth=10.0, observer=10.0), 0.06)


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
def test_reset_and_single_late_steps_leave_the_usual_gains(kind):
    robot = load("planar-4")
    fresh, used, late = kind(robot), kind(robot), kind(robot)
    pushed(robot, used, 0.2)
    expected = pushed(robot, fresh, 0.005)
    np.testing.assert_array_equal(pushed(robot, used, 0.005).record.motions, expected.record.motions)
    motions = expected.record.motions[0]
    state = State(motions[0, :6], motions[0, 6:], motions[1:, :6], motions[1:, 6:])
    for gaps in ([0.0, 0.005, 0.15, 0.005, 0.15, 0.005], [0.0, 0.15, 0.15, 0.005, 0.005]):
        late.reset()
        late.follow(expected.references, 0.2)
        for time in np.cumsum(gaps):
            late.step(float(time), state, expected.references[0])
        assert late._longest == fresh._longest
        np.testing.assert_array_equal(late._settings["kp"], fresh._settings["kp"])
        assert kind is ComputedTorque or late._steps[0] == fresh._steps[0]


@pytest.mark.parametrize("period", [0.1, 0.15, 0.2])
@pytest.mark.parametrize("name", ["cogiro", "nist-robocrane", "caroca"])
def test_slow_loops_are_compared_with_the_model(name, period):
    """Silent along lines with gusts of 2 % of the weight; a cut cable is noticed in two steps."""
    robot = load(name)
    for seed in range(3):
        random = np.random.default_rng(seed)
        along = random.normal(size=3)
        far = 0.1 * np.ptp(robot.home_anchors, axis=0).max() * along / np.linalg.norm(along)
        line = {"kind": "line", "start": robot.home[:3].tolist(), "end": (robot.home[:3] + far).tolist()}
        push = 0.01 * robot.force_scale * np.r_[random.normal(size=3), 0, 0, 0]
        controller = Predictive(robot)
        run = simulate(robot, line, controller, duration=4.0, period=period, disturbance=push, tolerance=0.1)
        assert controller.handed_over is None
        assert run.passed
    controller = Predictive(robot)
    simulate(robot, robot.home, controller, duration=2.0, period=period, events=["cut 1 at 1.0"])
    assert controller.handed_over is not None
    assert 1.0 < controller.handed_over.time < 1.0 + 3.01 * period


def test_carriers_are_predicted_by_their_thrusts_and_torques_so_that_late_states_leave_attitude_loops_stable():
    """A delay of 40 ms makes loops of 40 rad/s, phi'' = -2 h phi' - h^2 phi, unstable: it permits 0.647 / 0.04 = 16.

    Loops of 16 rad/s left the team 60 mm off after this push.
    """
    robot, controller = load("multi-quadrotor-3"), ComputedTorque(load("multi-quadrotor-3"))
    noise, events = {"delay": 0.04, "stamped": True}, ["push 2 1 0 at 0.2 for 0.2"]
    run = simulate(robot, robot.home, controller, duration=8.0, period=5e-3, noise=noise, events=events)
    assert run.error.max() < 0.06
    assert run.error[-200:].max() < 4e-3
    assert controller._platform["attitude"][0] == 40


def test_attitude_loops_are_slowed_down_for_states_that_are_held():
    """At 20 Hz, with steps of 5 ms: loops of 40 rad/s would bear states that are held for 1 / 40 s."""
    robot, controller = load("multi-quadrotor-3"), ComputedTorque(load("multi-quadrotor-3"))
    simulate(robot, robot.home, controller, duration=1.5, period=5e-3, noise={"rate": 20, "stamped": True})
    assert controller._platform["attitude"][0] < 20


@pytest.mark.parametrize(("lag", "delay", "period"), [(0.03, 0.005, 5e-3), (0.0, 0.03, 2e-3), (0.01, 0.01, 1e-2)])
def test_attitude_loops_keep_a_margin_for_lag_delay_and_steps_together(lag, delay, period):
    """A lag of 15 ms and a delay of 5 ms permit 39.5 rad/s, but with steps of 5 ms nothing would be left.

    A loop with the time T = lag + D and C = lag D + D^2 / 2 is stable for h (T + 4 C / T) < 2 (core/control/turning.c),
    and a command that is held for a period is half of it late. A known delay D, over which states are predicted, is 0.6
    of it if it may be wrong by 30 %. The loops around it are slower.
    """
    robot = load("multi-quadrotor-3")
    controller = ComputedTorque(robot, rotor_lag=lag, sensors={"delay": delay})
    simulate(robot, robot.home, controller, duration=3 * period, period=period, noise={"delay": delay})
    h, left, late = float(controller._platform["attitude"][0]), min(lag, 0.015), 0.6 * delay + period / 2
    T, C = left + late, left * late + late**2 / 2
    assert 1.2 < 2 / (h * (T + 4 * C / T)) < 1.7
    assert controller._settings["carrier_bandwidth"] <= (1 + 1e-9) * h / 6


def body_rates(motions):
    """The angular velocities in their own axes, (n, 3), of bodies with motions (n, 12)."""
    (roll, pitch), (dr, dp, dy) = motions[:, 3:5].T, motions[:, 9:].T
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.stack([dr - sp * dy, cr * dp + sr * cp * dy, cr * cp * dy - sr * dp], axis=1)


def test_what_carriers_are_ordered_does_not_move_them_before_they_turn():
    """A late state of a team at rest is one that has moved by the thrusts, torques and tensions sent since.

    By Newton's and Euler's laws for carriers that have hardly turned yet, and whose cables end at their CoM.
    """
    robot, nothing = load("multi-quadrotor-3"), np.zeros(6)
    still, rest = np.zeros_like(robot.carrier_home), tensions(robot, robot.home).tensions
    away, most = np.array([0.05, 0, 0, 0, 0, 0]), 0.0
    reference = Reference(robot.home + away, nothing, nothing, robot.carrier_home + away, still, still, rest)
    controller, rates, speeds = Predictive(robot, sensors={"delay": 0.03}), np.zeros((3, 3)), np.zeros((3, 3))
    inertia = np.array([carrier.body.inertia[:3] for carrier in robot.carriers])
    axes = rotations(robot.carrier_home[:, 3:])[:, :, 2]
    along = robot.home_attachments - robot.home_anchors
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    for k in range(8):
        command = controller.step(2e-3 * k, State(robot.home, nothing, robot.carrier_home, still, rest), reference)
        most, now = max(most, np.abs(command.carrier_acceleration).max()), controller._measured[0, 1:]
        np.testing.assert_allclose(body_rates(now), rates, atol=1e-2 * np.abs(rates).max() + 1e-12)
        np.testing.assert_allclose(now[:, 6:9], speeds, atol=2e-2 * np.abs(speeds).max() + 1e-12)
        rates = rates + 2e-3 * command.actuation[:, 1:] / inertia
        force = command.actuation[:, :1] * axes + command.tensions[:, None] * along
        speeds = speeds + 2e-3 * (force / robot.carriers[0].body.mass + robot.gravity)
    assert most > 0.1
    assert np.abs(rates).max() > 0.01
