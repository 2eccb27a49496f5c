"""Default bandwidths by what sensors permit: against a loop of plain NumPy with delay and noise."""

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from towline import InputError, load, plan, simulate
from towline.control import ComputedTorque, FaultTolerant, Predictive
from towline.control.bandwidths import HELD, SWINGING, TEAM, TOWING, bandwidths_for, correcting
from towline.models import Robot
from towline.simulation import Noise

from .warm import towline as run

G = 9.81


def grows(w, K, delay, told, steps=3000, dt=2e-3):
    """Return whether x'' = u + d diverges with u = -w^2 x - 2 w v - d_estimated of a state that is `delay` late [s].

    The state is predicted over the `told` delay with the commands sent since, and observed when it was measured.
    """
    late, ahead = round(delay / dt), round(told / dt)
    states, sent, x, v, explained, estimate = [(1.0, 0.0)] * late, np.zeros(max(late, ahead)), 1.0, 0.0, 0.0, 0.0
    largest, left = np.zeros(steps), np.arange(ahead - 1, -1, -1.0)
    for k in range(steps):
        late_x, late_v = states[0]
        estimate = K * (late_v - explained)
        acting = sent[len(sent) - ahead :] + estimate
        then_x = late_x + ahead * dt * late_v + dt**2 * (left @ acting)
        u = -(w**2) * then_x - 2 * w * (late_v + dt * acting.sum()) - estimate
        explained += dt * (sent[len(sent) - late] + estimate)
        sent = np.append(sent[1:], u)
        v += dt * u
        x += dt * v
        states = [*states[1:], (x, v)]
        largest[k] = abs(x)
    return bool(largest[-steps // 4 :].max() > largest[: steps // 4].max())


def test_a_push_is_corrected_although_the_delay_is_told_too_long():
    """By 30 %, with states and commands held for 4 ms, which makes the loop less stable than that of the next test."""
    controller = ComputedTorque("cogiro", sensors={"delay": 0.06})
    pushed = {"noise": {"delay": 0.042}, "events": ["push 5 0 0 at 0.2 for 0.2"], "seed": 1}
    error = simulate("cogiro", load("cogiro").home, controller, duration=3.0, period=4e-3, **pushed).error
    assert error[100:200].max() > 1e-5
    assert error[-100:].max() < 1e-2 * error.max()


@pytest.mark.parametrize("delay", [0.15, 0.2, 0.25])
def test_a_loop_with_the_permitted_bandwidths_is_stable_and_one_that_is_refused_is_not(delay):
    """Also if the known delay, over which states are predicted, is wrong by 30 %; 80 % of it counts."""
    robot, late = load("multi-quadrotor-3"), 0.8 * delay  # without winches: nothing but the delay is late
    w, K, *_ = bandwidths_for(robot, TEAM, {"delay": delay}, 0.0, attitude=1.0)
    assert w[0] / K == pytest.approx(TEAM.bandwidth / TEAM.observer)
    assert (w[0] + K) * late == pytest.approx(1.0)
    for true in (0.7 * delay, delay, 1.3 * delay):
        assert not grows(w[0], K, true, delay)
    assert grows(4 * w[0], 4 * K, 0.7 * delay, delay)
    with pytest.raises(
        InputError, match=r"bandwidth and observer must be at most .* rad/s with a state that is .* late, got"
    ):
        bandwidths_for(robot, TEAM, {"delay": delay}, 0.0, 3 / (28 * late) * 8, 3 / (28 * late) * 20)


@settings(deadline=None, max_examples=30)
@given(st.floats(1e-5, 1e-2), st.floats(1e-4, 0.3))
def test_noise_accelerates_by_a_twentieth_of_gravity_at_most(position, velocity):
    """By 0.03 of gravity if winches have to follow it, but bandwidths of a tenth of the defaults are permitted."""
    robot = load("multi-quadrotor-4")
    sensors = {"position": position, "velocity": velocity}
    if 0.01 * TEAM.bandwidth**2 * position + 0.1 * (2 * TEAM.bandwidth + TEAM.observer) * velocity > 0.05 * G:
        with pytest.raises(InputError, match="noise of"):
            bandwidths_for(robot, TEAM, sensors, 0.0)
        return
    w, K, *_ = bandwidths_for(robot, TEAM, sensors, 0.0)
    by_noise = w[0] ** 2 * position + (2 * w[0] + K) * velocity
    leaning = robot.fixed_lengths.mean() / G * (w[0] ** 4 * position + 4 * w[0] ** 3 * velocity)
    assert by_noise <= 0.05 * G * (1 + 1e-9)
    assert leaning <= 0.15 * G * (1 + 1e-9)
    assert w[0] == TEAM.bandwidth or by_noise == pytest.approx(0.05 * G) or leaning == pytest.approx(0.15 * G)
    w, K, _, lead, _ = bandwidths_for(load("the-cable-robot-simulator"), TEAM, sensors, 0.0)
    by_noise = w[0] ** 2 * position + (2 * w[0] + K) * velocity
    assert by_noise <= 0.03 * G * (1 + 1e-9) or w[0] == pytest.approx(0.1 * TEAM.bandwidth)
    assert lead == pytest.approx(1.0) or (by_noise < 0.03 * G and w[0] == TEAM.bandwidth)


def test_slow_winches_keep_the_lead_without_which_loops_are_unstable():
    """Noise alone would leave all of 0.3 s, with which loops of 11 rad/s, and an observer as fast, move by 18 mm."""
    robot, sensors = load("cogiro"), {"position": 1e-3, "velocity": 5e-3}
    controller, slow = ComputedTorque(robot, sensors=sensors, tension_lag=0.3), {"winch_lag": 0.3}
    flown = simulate(robot, robot.home, controller, duration=2.0, period=4e-3, noise=sensors, mismatch=slow)
    assert flown.error.max() < 1e-3


def test_bandwidths_without_sensors_are_the_usual_ones_and_good_sensors_permit_more():
    robot, few = load("cogiro"), load("wang-ctmrts-4")
    for sensors, factor in ((None, 1.0), ({}, 2.0), (Noise(position=1e-5, velocity=1e-5), 2.0)):
        w, K, attitude, *_ = bandwidths_for(robot, HELD, sensors, 0.0)
        np.testing.assert_allclose(w, factor * HELD.bandwidth)
        assert (K, attitude) == (factor * HELD.observer, 40.0)
        np.testing.assert_allclose(bandwidths_for(few, SWINGING, sensors, 0.0)[0], SWINGING.bandwidth)


def test_carriers_that_lean_their_cables_have_time_to_accelerate():
    """From rest to rest over a distance d within 2 / w, they accelerate by d w^2, forwards and back."""
    team, towing = (load(name).model_dump(mode="json") for name in ("multi-quadrotor-3", "wang-ctmrts-6"))
    for carrier in team["carriers"] + towing["carriers"]:
        carrier["acceleration_max"] = 0.7
    for data, most, strongest, least in ((team, TEAM, 0.5, 0.5), (team, TEAM, 5.0, 0.7), (towing, TOWING, 5.0, 0.7)):
        robot = Robot.model_validate(data)
        height = np.mean(robot.home_anchors[:, 2] - robot.home_attachments[:, 2])
        slower = correcting(robot, strongest)
        assert slower.bandwidth**2 * 0.05 * height == pytest.approx(least)
        assert slower.observer / most.observer == pytest.approx(slower.bandwidth / most.bandwidth)
        assert correcting(robot.model_copy(update={"gravity": (0.0, 0.0, 0.0)}), strongest) == most
    assert correcting(load("flycrane"), 1e-3) == TEAM  # whose carriers move with the load
    assert correcting(load("point-mass-3"), 1e-3) == TOWING  # whose carriers stay


def turns_more_and_more(h, lag, delay, period, told, steps=4000, dt=1e-3):
    """Return whether phi'' = u diverges with u' = (-2 h phi' - h^2 phi - u) / lag of states late and held [s].

    The states are predicted over a `told` time by what the drives have given since. It is the last state plus what the
    integral of u, and the integral of this integral, have gained.
    """
    late, ahead, hold = round(delay / dt), round(told / dt), max(1, round(period / dt))
    phi, rate, u, left, largest = 1.0, 0.0, 0.0, np.exp(-dt / max(lag, 1e-9)), np.zeros(steps)
    states, gained, held = [(1.0, 0.0)] * (1 + late), [(0.0, 0.0)] * (1 + ahead), (1.0, 0.0)
    for k in range(steps):
        held = (phi, rate) if k % hold == 0 else held
        states, (then_turned, then_faster), (turned, faster) = [*states[1:], held], gained[0], gained[-1]
        seen, turning = states[0]
        seen += ahead * dt * (turning - then_faster) + turned - then_turned
        wanted = -2 * h * (turning + faster - then_faster) - h**2 * seen
        given = wanted + (u - wanted) * left
        mean = 0.5 * (u + given) if lag else wanted
        phi, rate, u = phi + dt * rate + dt**2 / 2 * mean, rate + dt * mean, given
        gained = [*gained[1:], (turned + dt * faster + dt**2 / 2 * mean, faster + dt * mean)]
        largest[k] = abs(phi)
    return bool(largest[-steps // 4 :].max() > largest[: steps // 4].max())


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 15), st.integers(0, 20), st.integers(0, 40))
def test_attitude_loops_with_the_permitted_bandwidth_are_stable_and_refused_ones_are_not(lag, delay, period):
    """Even if the age over which carriers are predicted is wrong by 30 %, or lacks the time for which they are held."""
    robot, late = load("multi-quadrotor-3"), (1e-3 * lag, 1e-3 * delay, 1e-3 * period)
    sensors = {"delay": late[1]} | ({"rate": 1 / late[2]} if period else {})
    told = [factor * known for factor in (0.7, 1.0, 1.3) for known in (late[1], late[1] + late[2] / 2)]
    try:
        h = bandwidths_for(robot, TEAM, sensors, late[0]).attitude
    except InputError:  # slower than a team can be
        return
    assert not any(turns_more_and_more(h, *late, each) for each in told)
    if h < 40.0:
        assert turns_more_and_more(2.5 * h, *late, 0.0)
        assert period or any(turns_more_and_more(2.5 * h, *late, each) for each in told)
        with pytest.raises(InputError, match="attitude must be at most"):
            bandwidths_for(robot, TEAM, sensors, late[0], attitude=2.5 * h)


def keeps_turning(h, lag, most, rate, dt=1e-3):
    """Return how far a carrier turns in the last of 3 s [rad], from a rate [rad/s] on, by limited accelerations.

    Commands lead so that 15 ms of the lag remain, inside the limits. The law is that of core/control/thrusts.c.
    """
    angle, given, known, far = 0.0, 0.0, 0.0, np.zeros(3000)
    share, linear = 1 - np.exp(-dt / lag), 2 * most / h**2
    for k in range(3000):
        far_off = abs(angle) > linear
        back = math.sqrt(most * (abs(angle) - linear / 2)) if far_off else h / 2 * abs(angle)
        wanted = 2 * h * (-math.copysign(back, angle) - rate)
        wanted = min(max(wanted, -most), most)
        sent = min(max(known + lag / 0.015 * (wanted - known), -most), most)
        known += share * (sent - known)
        given += share * (sent - given)
        rate, angle = rate + dt * given, angle + dt * rate
        far[k] = abs(angle)
    return far[2000:].max()


@pytest.mark.parametrize("lag", [0.08, 0.1])
def test_carriers_with_a_known_lag_stop_after_large_turns_too(lag):
    """Torques of a library's quadrotor, 150 rad/s^2, at whose limits commands cannot lead."""
    h = bandwidths_for(load("multi-quadrotor-3"), TEAM, None, lag).attitude
    assert h == pytest.approx(2 / lag)
    assert max(keeps_turning(h, lag, 150.0, rate) for rate in (1.0, 6.0)) < 1e-3
    assert max(keeps_turning(40.0, lag, 150.0, rate) for rate in (1.0, 6.0)) > 0.5


def test_attitude_loops_are_as_fast_as_rotors_and_sensors_permit():
    robot = load("multi-quadrotor-3")
    assert bandwidths_for(robot, TEAM, None, 0.01).attitude == 40.0
    told, exact = {"delay": 0.03}, {"delay": 0.03, "stamped": True}  # the carriers' turning is predicted
    assert bandwidths_for(robot, TEAM, told, 0.0).attitude == pytest.approx(0.75 * 0.647 / (0.6 * 0.03))
    assert bandwidths_for(robot, TEAM, exact, 0.0).attitude == 40.0
    # 0.06 s of which a lead leaves 0.015 s, and 0.6 of the delay
    with pytest.raises(InputError, match=r"attitude must be at most 22.9 rad/s if carriers turn 0.036 s late, got 40"):
        ComputedTorque(robot, attitude=40.0, sensors={"delay": 0.035}, rotor_lag=0.06)


@pytest.mark.parametrize("make", [ComputedTorque, Predictive])
@pytest.mark.parametrize(
    ("late", "least"), [({"delay": 0.046}, 18), ({"rate": 15}, 15), ({"rate": 15, "delay": 0.03, "stamped": True}, 15)]
)
def test_a_team_is_not_started_with_sensors_that_leave_its_attitude_loops_too_slow(make, late, least):
    with pytest.raises(InputError, match=rf"sensors must permit attitude loops of {least} rad/s, got carriers"):
        make("multi-quadrotor-4", sensors=late)


@pytest.mark.parametrize(("rate", "rotor_lag"), [(None, 0.0), (100, 0.0), (None, 0.02)])
def test_a_refused_delay_is_told_the_largest_one(rate, rotor_lag):
    def start(delay):
        rotors = {"rotor_lag": rotor_lag}
        return ComputedTorque(
            "multi-quadrotor-4", sensors={"delay": delay, **({"rate": rate} if rate else {})}, **rotors
        )

    with pytest.raises(InputError, match="a delay of at most") as refused:
        start(0.05)
    most = float(re.search(r"at most ([\d.]+) s would", str(refused.value))[1])
    start(0.99 * most)
    with pytest.raises(InputError, match="attitude loops of 18"):
        start(1.01 * most)


@pytest.mark.parametrize(
    ("make", "name", "told", "factor"),
    [
        (Predictive, "multi-quadrotor-4", {"delay": 0.0449}, 1.3),
        (ComputedTorque, "multi-quadrotor-4", {"delay": 0.0449}, 1.3),
        (Predictive, "multi-quadrotor-3", {"rate": 25, "delay": 0.03, "stamped": True}, 1.0),
        (ComputedTorque, "multi-quadrotor-6", {"rate": 25, "delay": 0.03, "stamped": True}, 1.0),
        (ComputedTorque, "multi-quadrotor-6", {"rate": 50, "delay": 0.03, "stamped": True}, 1.0),
    ],
)
def test_a_team_with_the_latest_sensors_that_are_permitted_corrects_a_push(make, name, told, factor, monkeypatch):
    """Even if the true delay is `factor` times as long. With longer delays it is refused, by the test above."""
    if name == "multi-quadrotor-3":
        monkeypatch.setattr("towline.control.predictive.grows", lambda *_: False)  # to save its simulation
    robot, noise = load(name), told | {"delay": factor * told["delay"]}
    force = 0.02 * robot.weight * np.array([0.6, 0.8, 0.0])
    push = [{"kind": "push", "at": 0.2, "duration": 0.3, "force": force.tolist()}]
    team = simulate(robot, robot.home, make(robot, sensors=told), duration=3.0, period=5e-3, noise=noise, events=push)
    assert team.handed_over is None
    assert team.answered["as planned"] == len(team.error)
    assert 1e-4 < team.error.max() < 0.03
    assert team.error[-20:].max() < 0.5 * team.error.max()


@pytest.mark.parametrize("make", [ComputedTorque, Predictive, FaultTolerant])
@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        (
            {"delay": 1.0},
            "sensors must permit at least 10 % of the default bandwidths, .* rad/s, got a state that is 1 s late",
        ),
        ({"velocity": 100.0}, "sensors must permit at least 10 % of .* got noise of 0 m and 100 m/s"),
        ({"delay": -1}, "sensors: delay must be"),
        ({"dealy": 1}, "dealy"),
        (7, "sensors"),
        ("late", "sensors"),
        ({"delay": float("nan")}, "delay"),
    ],
)
def test_sensors_with_which_a_robot_would_be_lost_are_refused_in_one_line(make, sensors, message):
    with pytest.raises(InputError, match=message) as error:
        make("multi-quadrotor-4", sensors=sensors)
    assert "\n" not in str(error.value)


def test_differences_of_coarse_poses_leave_room_for_tensions():
    """With default gains this noise needs more than the tensions have, which `Predictive` notices and gives up for."""
    robot, coarse = load("wang-flying"), {"resolution": 2e-4, "attitude_resolution": 4e-4, "differenced": True}
    coarse["rate"] = 100
    conditions = {"duration": 0.3, "noise": coarse, "wind": (3, 2, 0.5), "gusts": 1.0}
    usual, told = (Predictive(robot, sensors=sensors) for sensors in (None, coarse))
    assert simulate(robot, robot.home, usual, **conditions).handed_over is not None
    calm = simulate(robot, robot.home, told, **conditions)
    assert calm.handed_over is None
    assert calm.error.max() < 5e-3


def test_known_noise_that_varies_as_noise_does_is_no_reason_to_hand_over():
    """Bandwidths leave two standard deviations inside the limits; the variance in a tenth of a second varies by 10 %.

    Noise of three times the known one is a reason: its commands are cut off in one of two steps.
    """
    robot, known = load("wang-flying"), {"position": 5e-4, "attitude": 5e-4, "velocity": 0.014, "attitude_rate": 0.014}
    louder = known | {"velocity": 0.042, "attitude_rate": 0.042}
    for noise, seed, is_good in ((known, 0, True), (known, 1, True), (known, 2, True), (louder, 0, False)):
        run = simulate(robot, robot.home, Predictive(robot, sensors=known), duration=0.6, noise=noise, seed=seed)
        assert (run.handed_over is None) == is_good
        assert run.error.max() < 4e-3 or not is_good


def test_the_command_line_gives_its_controllers_the_sensors(tmp_path):
    path = {"kind": "line", "start": [-1, 0, 1.5], "end": [0.5, 0, 1.5]}
    plan("cogiro", {"path": path, "duration": 2.0}).save(tmp_path / "line.nc")
    noise = {"rate": 50, "delay": 0.03, "stamped": True}
    (tmp_path / "late.yaml").write_text(json.dumps(noise))
    printed = json.loads(run("simulate", "cogiro", "line.nc", "--noise", "late.yaml", "--json", cwd=tmp_path).stdout)
    own = simulate("cogiro", tmp_path / "line.nc", ComputedTorque("cogiro", 20.0, observer=20.0), noise=noise)
    assert printed["error_rms"] == own.to_dict()["error_rms"]
    (tmp_path / "late.yaml").write_text("{delay: 2}")
    refused = run("simulate", "cogiro", "line.nc", "--noise", "late.yaml", cwd=tmp_path, code=2)
    assert "sensors must permit at least 10 % of the default bandwidths" in refused.stderr
