"""What simulated sensors report: rates, delays, resolutions, differenced velocities and times of measurement."""

import numpy as np
import pytest

from towline import InputError, load, plan, simulate
from towline.control import ComputedTorque, Controller, Predictive
from towline.simulation import Noise
from towline.simulation.sensors import Sensors

PERIOD = 1e-3


class Listener(Controller):
    """Flies as computed torque does, and keeps what it is given."""

    def __init__(self, robot):
        self._inner, self.heard = ComputedTorque(robot), []

    def reset(self):
        self._inner.reset()
        self.heard.clear()

    def follow(self, references, period, start=0.0):
        self._inner.follow(references, period, start)

    def step(self, time, state, reference):
        self.heard.append((time, state))
        return self._inner.step(time, state, reference)


@pytest.fixture(scope="module")
def robot():
    return load("cogiro")


@pytest.fixture(scope="module")
def motion(robot):
    return plan(robot, {"path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.2, 1.2]}, "duration": 1.5})


def flown(robot, motion, **noise):
    listener = Listener(robot)
    run = simulate(robot, motion, listener, noise=noise)
    poses = np.stack([state.pose for _, state in listener.heard])
    velocities = np.stack([state.velocity for _, state in listener.heard])
    tensions = np.stack([state.tensions for _, state in listener.heard])
    return run, poses, velocities, tensions, [state.time for _, state in listener.heard]


@pytest.mark.parametrize(("rate", "delay"), [(50, 0.0), (50, 0.03), (400, 0.0004), (70, 0.0), (333, 0.01)])
def test_readings_are_held_between_samples_and_late(robot, motion, rate, delay):
    run, poses, _, _, times = flown(robot, motion, rate=rate, delay=delay, stamped=True)
    periods = np.arange(len(poses))
    sample = np.array([next(k for k in range(now, -1, -1) if k == 0 or is_sample(k, rate)) for now in periods])
    late = np.maximum(periods - np.ceil(delay / PERIOD - 1e-9).astype(int), 0)  # no reading is there before its delay
    np.testing.assert_array_equal(poses, run.record.motions[sample[late], 0, :6])
    np.testing.assert_allclose(times, PERIOD * sample[late], atol=1e-12)
    assert len(set(times)) == pytest.approx((run.times[-1] - delay) * rate, abs=2)


def is_sample(k, rate):
    """Whether a multiple of 1 / rate lies in the period that ends at k."""
    return np.floor(k * PERIOD * rate + 1e-9) > np.floor((k - 1) * PERIOD * rate + 1e-9)


def test_readings_are_whole_steps_next_to_the_truth(robot, motion):
    steps = {"resolution": 1e-3, "attitude_resolution": 0.01, "tension_resolution": 25.0}
    run, poses, _, tensions, times = flown(robot, motion, **steps)
    for read, true, step in (
        (poses[:, :3], run.record.motions[:, 0, :3], 1e-3),
        (poses[:, 3:], run.record.motions[:, 0, 3:6], 0.01),
        (tensions[1:], run.record.tensions[:-1], 25.0),
    ):
        np.testing.assert_allclose(read / step, np.round(read / step), atol=1e-9)
        assert np.abs(read - true).max() <= step / 2 + 1e-12
    assert set(times) == {None}


@pytest.mark.parametrize("rate", [None, 100])
def test_differenced_velocities_are_those_of_the_poses(robot, motion, rate):
    _, poses, velocities, _, _ = flown(robot, motion, differenced=True, rate=rate, position=1e-4)
    every = 1 if rate is None else round(1 / (rate * PERIOD))
    for k in (every, 5 * every, 77 * every if rate is None else 7 * every):
        expected = (poses[k] - poses[k - every]) / (every * PERIOD)
        np.testing.assert_allclose(velocities[k], expected, atol=1e-9)


def test_angles_that_pass_a_half_turn_have_no_jump_in_their_rate():
    sensors = Sensors(Noise(differenced=True), [0], PERIOD, 1)
    motions = np.zeros((2, 1, 2, 12))
    motions[:, 0, 0, 5] = np.pi - 1e-3, -np.pi + 1e-3
    reading = [sensors.report(k, motions[k], np.zeros((1, 1))) for k in (0, 1)][1]
    assert reading.motions[0, 0, 11] == pytest.approx(2e-3 / PERIOD)


def test_new_keys_do_not_change_the_noise_of_old_ones(robot):
    """The same seed gives the same numbers: a rate of one sample per period changes nothing."""
    noise = {"position": 1e-3, "velocity": 1e-2, "tension": 1.0, "position_bias": 1e-3}
    plain = simulate(robot, robot.home, duration=0.2, noise=noise, seed=3)
    rated = simulate(robot, robot.home, duration=0.2, noise={**noise, "rate": 1000}, seed=3)
    np.testing.assert_array_equal(plain.record.motions, rated.record.motions)


@pytest.mark.parametrize(("controller", "gain"), [(ComputedTorque, 0.5), (Predictive, 0.3)])
def test_a_known_delay_costs_little(robot, motion, controller, gain):
    """With the time of the measurement controllers predict from it; without, they fly by old states."""
    late, often = {"delay": 0.005}, {"period": 5e-3, "duration": 1.5}
    unknown = simulate(robot, motion, controller(robot), noise=late, **often)
    known = simulate(robot, motion, controller(robot), noise={**late, "stamped": True}, **often)
    slow = simulate(robot, motion, controller(robot), noise={"rate": 50, "delay": 0.03, "stamped": True}, **often)
    assert known.error.max() < gain * unknown.error.max()
    assert slow.passed
    assert slow.error.max() < 0.02


def test_many_runs_have_the_sensors_of_one(robot):
    noise = {"rate": 100, "delay": 0.004, "resolution": 1e-4, "stamped": True, "tension_resolution": 5}
    alone = [simulate(robot, robot.home, duration=0.3, noise=noise, seed=seed) for seed in (0, 1)]
    both = simulate(robot, robot.home, duration=0.3, noise=noise, runs=2)
    np.testing.assert_allclose(both["error_max"].values, [run.error.max() for run in alone], rtol=1e-9)


@pytest.mark.parametrize("noise", [{"rate": 0}, {"rate": np.nan}, {"resolution": -1}, {"stamped": "maybe"}])
def test_wrong_keys_are_one_line(robot, noise):
    with pytest.raises(InputError) as caught:
        simulate(robot, robot.home, duration=0.01, noise=noise)
    assert next(iter(noise)) in str(caught.value)
