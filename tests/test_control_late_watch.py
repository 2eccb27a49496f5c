"""The watch of `Predictive` with states that come late: a delay delays what it finds, and changes nothing else."""

import numpy as np
import pytest

from towline import load, plan, simulate, tensions
from towline.control import ComputedTorque, Controller, Predictive, Reference, State
from towline.models import Robot

LATE = {"delay": 0.02, "stamped": True}


def test_a_push_is_as_unexplained_as_without_the_delay():
    """A push of 1.4 m/s^2 remains unknown for 20 ms more. This alone would exceed the bound, but the model is right."""
    robot, seen = load("cogiro"), {}
    push = [{"kind": "push", "at": 0.1, "force": [1.4 * robot.platform.mass, 0, 0]}]
    for delay, noise in ((0, None), (20, LATE)):
        run = simulate(robot, robot.home, Predictive(robot), duration=0.25, events=push, noise=noise)
        assert run.handed_over is None
        seen[delay] = run.trajectory["unexplained"].values[100 + delay : 230 + delay]
    assert seen[0].max() > 0.1 * 1.4  # it is watched
    assert seen[20][:110] == pytest.approx(seen[0][:110], rel=0.02, abs=2e-3)


def test_soft_cables_and_late_states_are_no_reason_to_give_predictions_up():
    """At a stop, which reverses the forces; computed torque, which needs no prediction, is less exact."""
    soft = load("ipanema-2").model_dump(mode="json")
    for cable in soft["cables"]:
        cable |= {"stiffness": 25e3, "damping": 50.0}
    robot = Robot.model_validate(soft)
    ends = [np.add(robot.home[:3], [x, 0, 0]).tolist() for x in (-0.2, 0.2)]
    motion = plan(robot, {"path": {"kind": "line", "start": ends[0], "end": ends[1]}, "duration": 1.2})
    ahead, usual = (
        simulate(robot, motion, kind(robot), events=["stop at 0.6"], noise=LATE | {"rate": 50}, duration=0.8)
        for kind in (Predictive, ComputedTorque)
    )
    assert ahead.handed_over is None
    assert np.sqrt((ahead.error**2).mean()) < np.sqrt((usual.error**2).mean())


def test_a_lost_rotor_is_noticed_within_fifty_milliseconds_and_the_delay():
    robot = load("multi-quadrotor-4")
    noise = LATE | {"delay": 0.01}
    run = simulate(robot, robot.home, Predictive(robot), duration=0.2, events=["lose quad1 at 0.1"], noise=noise)
    assert 0.11 < run.handed_over <= 0.16


@pytest.mark.parametrize("known", ["measured", "planned", "neither"])
@pytest.mark.parametrize("make", [ComputedTorque, Predictive])
def test_a_first_state_that_is_late_is_not_that_of_a_falling_robot(make, known):
    robot = load("wang-flying")
    rest = tensions(robot, robot.home).tensions
    still, nothing = np.zeros_like(robot.carrier_home), np.zeros(6)
    state = State(robot.home, nothing, robot.carrier_home, still, rest if known == "measured" else None)
    planned = None if known == "neither" else rest
    reference = Reference(robot.home, nothing, nothing, robot.carrier_home, still, still, planned)
    now = make(robot)
    same = [now.step(time, state, reference).tensions for time in (1.0, 1.01, 1.02)]
    for late in (make(robot), make(robot, sensors={"delay": 0.03})):
        for step, time in enumerate((1.0, 1.01, 1.02)):
            seen = None if late._known_age else time - 0.03
            command = late.step(time, state._replace(time=seen), reference)
            assert np.abs(command.tensions - same[step]).max() < 1e-3 * robot.force_scale


class Sparse(Controller):
    """Passes states on, of which those that are not `seen` at their number have no pose."""

    def __init__(self, controller, seen):
        self.controller, self.seen = controller, seen

    def reset(self):
        self.controller.reset()
        self.steps = 0

    def step(self, time, state, reference):
        self.steps += 1
        known = state if self.seen(self.steps) else state._replace(pose=np.full(6, np.nan))
        return self.controller.step(time, known, reference)


def test_a_missing_state_is_no_disturbance():
    """With 30 % of them missing, observers took as much of the mass times the acceleration, 3 N, for a disturbance."""
    robot, line = load("planar-4"), {"kind": "line", "start": [0, 0, 0.75], "end": [0.2, 0, 0.85]}
    missing, controller = np.random.default_rng(3).random(1000) < 0.3, ComputedTorque(robot)
    run = simulate(robot, plan(robot, {"path": line, "duration": 0.8}), Sparse(controller, lambda k: not missing[k]))
    assert run.error.max() < 2e-4  # 4.7 mm
    assert np.abs(controller.disturbance).max() < 0.01 * robot.weight


@pytest.mark.parametrize("name", ["planar-4", "multi-quadrotor-3"])
def test_a_disturbance_is_found_by_every_fifth_state(name):
    robot, every = load(name), {}
    carriers = [0.5, 0, 0] if name.startswith("multi") else [0, 0, 0]
    events = [f"push {robot.carriers[0].name} 0.5 0 0 at 0"] if any(carriers) else []
    push = 0.03 * robot.weight
    for one_in in (1, 5):
        controller = every[one_in] = ComputedTorque(robot)
        sparse = Sparse(controller, lambda k, one_in=one_in: k % one_in == 0)
        simulate(robot, robot.home, sparse, disturbance=[push, *[0] * 5], events=events, duration=0.8)
    assert every[5].disturbance[0, 0] == pytest.approx(push, rel=0.05)
    for found in ("disturbance", "disturbance_of_carriers"):
        first, other = (getattr(one, found) for one in every.values())
        np.testing.assert_allclose(other, first, atol=0.05 * push)
    np.testing.assert_allclose(every[5].disturbance_of_carriers[0, 0], carriers, atol=0.1)


def test_a_cut_is_noticed_though_states_are_missing_for_a_third_of_the_window_again_and_again():
    """8 of 30 states, 16 ms: a window of 50 ms without such a gap never came, and the platform fell over unnoticed."""
    robot, good = load("wang-ctmrts"), load("planar-4")
    push = [{"kind": "push", "at": 0.1, "duration": 0.2, "force": [0.03 * good.weight, 0, 0]}]
    for its, events, cut in ((robot, ["cut 1 at 0.3"], 0.3), (good, push, None)):
        controller = Predictive(its)
        sparse = Sparse(controller, lambda k: k % 30 >= 8)
        simulate(its, its.home, sparse, duration=0.5, period=2e-3, events=events)
        if cut is None:
            assert controller.handed_over is None
        else:
            assert cut < controller.handed_over.time <= cut + 0.05
