"""Delays and lags of winches that no controller was told: the loop is measured, and its bandwidths are lowered."""

import numpy as np
import pytest

from towline import load, simulate
from towline.control import ComputedTorque, Controller, Predictive

USUAL = 10.0  # [rad/s]: bandwidths of `ComputedTorque`, of the error and of the observer


def pushed(robot, controller, noise=None, mismatch=None, size=0.05, duration=5.0):
    push = [f"push {size * robot.force_scale} 0 0 at 0.3 for 0.2"]
    options = {"noise": noise, "mismatch": mismatch, "events": push, "period": 2e-3}
    return simulate(robot, robot.home, controller, duration=duration, tolerance=1.0, **options)


def measured(controller):
    """T + 2.4 C / T of core/control/step.c [s]."""
    return float(controller._platform["lag"][0])


def grows(bandwidth, delay=0.0, lag=0.0):
    """Whether a free unit mass is unstable, with an observer of the same bandwidth.

    Commands: u = -b^2 x - 2 b v - d, of positions x and velocities v that are late; d = b (v - integral of (u + d)).
    """
    dt, x, v, z, given = 1e-3, 0.0, 1.0, 0.0, 0.0
    late, sizes = [(0.0, 0.0)] * round(delay / dt), []
    for _ in range(8000):
        late.append((x, v))
        at, rate = late.pop(0)
        found = bandwidth * (rate - z)
        u = -(bandwidth**2) * at - 2 * bandwidth * rate - found
        z += dt * (u + found)
        given = u if lag == 0 else given + (1 - np.exp(-dt / lag)) * (u - given)
        x, v = x + dt * v + dt * dt * given / 2, v + dt * given
        sizes.append(abs(v))
    return max(sizes[-2000:]) > max(sizes[2000:4000])


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
@pytest.mark.parametrize(("name", "most"), [("planar-4", 0.03), ("cogiro", 0.05), ("wang-flying", 0.07)])
def test_a_robot_whose_states_are_unknowingly_60_ms_late_returns_after_a_push(name, most, kind):
    """Both went up to 0.9 m off in growing oscillations: the usual loops are unstable."""
    assert grows(USUAL, delay=0.06)
    robot = load(name)
    run = pushed(robot, kind(robot), {"delay": 0.06})
    assert run.error.max() < most
    assert run.error[-250:].max() < 1e-3


@pytest.mark.parametrize(
    ("noise", "mismatch", "late"),
    [
        ({"delay": 0.06}, None, 0.06 * (1 + 2.4 / 2)),
        (None, {"winch_lag": 0.1}, 0.1),
        ({"delay": 0.02}, {"winch_lag": 0.08}, 0.1 + 2.4 * (0.08 * 0.02 + 0.02**2 / 2) / 0.1),
    ],
)
def test_the_lag_is_measured_and_bandwidths_are_what_it_permits(noise, mismatch, late):
    """For a delay D: T = D, C = D^2 / 2; for a lag: T = lag, C = 0."""
    robot = load("planar-4")
    controller = ComputedTorque(robot)
    run = pushed(robot, controller, noise, mismatch)
    assert measured(controller) == pytest.approx(late, rel=0.25)
    both = (noise or {}).get("delay", 0.0), (mismatch or {}).get("winch_lag", 0.0)
    lowered = 0.89 / 2 / measured(controller)
    assert grows(USUAL, *both)
    assert not grows(1.5 * lowered, *both)
    assert run.error[-250:].max() < 2e-3


@pytest.mark.parametrize("name", ["planar-4", "cogiro", "wang-flying", "ipanema-2"])
@pytest.mark.parametrize(
    ("noise", "mismatch"),
    [
        ({"delay": 0.02}, {"mass": 1.3}),
        ({"delay": 0.06, "stamped": True}, None),
        ({"rate": 50}, {"winch_lag": 0.02}),
        ({"position": 5e-4, "attitude": 1e-3, "velocity": 5e-3, "attitude_rate": 1e-2}, {"tension_gain": 0.85}),
    ],
)
def test_bandwidths_stay_where_the_loop_has_a_margin(name, noise, mismatch):
    robot = load(name)
    controller = ComputedTorque(robot)
    pushed(robot, controller, noise, mismatch, size=0.08, duration=1.5)
    assert measured(controller) == 0


class Recorded(Controller):
    """Pass states on, of which one in `missing` has no pose, and record the controller's memory of the platform."""

    def __init__(self, controller, missing=10**9):
        self.controller, self.missing, self.steps, self.memory = controller, missing, 0, []

    def step(self, time, state, reference):
        self.steps += 1
        known = state._replace(pose=np.full(6, np.nan)) if self.steps % self.missing == 0 else state
        command = self.controller.step(time, known, reference)
        self.memory.append(self.controller._platform[0].copy())
        return command


def test_orders_count_while_no_state_is_measured():
    robot = load("planar-4")
    controller = ComputedTorque(robot)
    pushed(robot, Recorded(controller, missing=4), {"delay": 0.06}, duration=3.0)
    assert measured(controller) == pytest.approx(0.06 * 2.2, rel=0.25)


def test_what_is_known_of_a_disturbance_does_not_jump_when_bandwidths_are_lowered():
    robot, gain = load("planar-4"), 200.0
    record = Recorded(ComputedTorque(robot, integral=gain))
    steady = [0.1 * robot.weight, *[0.0] * 5]
    push = [f"push {0.05 * robot.force_scale} 0 0 at 1.0 for 0.2"]
    options = {"disturbance": steady, "events": push, "period": 2e-3, "tolerance": 1.0, "duration": 3.0}
    simulate(robot, robot.home, record, noise={"delay": 0.06}, **options)
    lag, integral, found = (
        np.array([one[name] for one in record.memory]) for name in ("lag", "integral", "disturbance")
    )
    first = np.flatnonzero(lag)[0]
    part = np.minimum(0.89 / 2 / USUAL / np.where(lag > 0, lag, 1e-9), 1.0)
    known = np.stack([gain * part**3 * integral[:, 0] * robot.platform.mass, found[:, 0]])
    changes = np.abs(np.diff(known))
    assert part[first] < 0.6  # a jump would be of 40 % at least
    assert (changes[:, first - 1] < 0.05 * np.abs(known[:, first - 1]) + changes[:, first - 2]).all()
