"""A push that has ended leaves nothing: loads that hang from fewer cables than degrees of freedom return."""

import numpy as np
import pytest

from towline.control import ComputedTorque, Predictive, Reference
from towline.models import Robot, load
from towline.simulation import simulate

from .slung_load import MASS, slung
from .soak.mujoco_plant import Hardware, World


@pytest.mark.parametrize("name", ["multi-quadrotor-3", "multi-quadrotor-4", "slung"])
def test_a_load_returns_after_a_push(name):
    """Carriers once stayed where the push had moved them along their cables, and the load hung 70 to 90 mm too high."""
    robot = slung(dof=["x", "y", "z"]) if name == "slung" else load(name)
    push = f"push {0.2 * robot.weight} 0 0 at 0.2 for 0.5"
    flown = simulate(robot, robot.home, events=[push], duration=6, period=0.004)
    off = np.linalg.norm(flown.trajectory["pose"].values[:, :3] - robot.home[:3], axis=1)
    assert off.max() > 0.1  # it was pushed
    assert off[-1] < 0.006


@pytest.mark.parametrize(
    ("name", "recovers", "most"), [("multi-quadrotor-3", True, 0.03), ("multi-quadrotor-4", False, 0.07)]
)
def test_predictive_control_of_a_team_is_given_up_after_a_push_only_if_it_does_not_recover(
    name, recovers, most, monkeypatch
):
    """Quadrotors turn later than predicted, so that tensions are off their commands, as their sensors report.

    All of this difference was once unexplained: computed torque took over, which let the load of three go 48 mm in
    place of 24. The load of four pitches, and would be 0.24 m off and go on if predictive control did.
    """
    monkeypatch.setattr("towline.control.predictive.grows", lambda *_: False)  # to save its simulation
    robot = load(name)
    controller, push = Predictive(robot), f"push {0.12 * robot.weight} 0 0 at 0.2 for 0.5"
    flown = simulate(robot, robot.home, controller, events=[push], duration=1.4, period=0.002)
    assert (controller.handed_over is None) == recovers
    assert 0.015 < flown.error.max() < most


def test_a_load_that_may_spin_below_its_cable_is_flown_by_predictions():
    """Nothing holds the attitude of a load that hangs at its CoM, so its spin was taken for an unstable loop."""
    controller = Predictive(slung(inertia=[1e-2, 2e-2, 1e-2, 0, 0, 0]))
    assert controller.handed_over is None
    np.testing.assert_allclose(controller.uncontrolled[:, :3], 0.0, atol=1e-9)  # the quadrotor can push it anywhere
    assert np.linalg.matrix_rank(controller.uncontrolled[:, 3:]) == 3


def test_a_quadrotor_that_was_turned_far_stops_turning_in_time_with_late_rotors():
    """At rates that its torque does not brake it turned too far for good, and kept the load 0.3 m to 0.7 m off.

    Its rotors begin with the first command, so that the first turn looks much later than they are. Where that was
    believed, all loops were slowed down, and the load was 58 mm off.
    """
    pytest.importorskip("mujoco", reason="the extra 'mujoco' is not installed")
    robot, period = slung(dof=["x", "y", "z"], inertia=[1e-3, 1e-3, 1e-3, 0, 0, 0]), 1e-3
    controller, still, tension = ComputedTorque(robot), np.zeros((1, 6)), np.array([9.81 * MASS])
    reference = Reference(robot.home, *np.zeros((2, 6)), robot.carrier_home, still, still, tension)
    motion = np.zeros((2, 12))
    motion[:, :6] = robot.home, robot.carrier_home[0]
    motion[1, 3:5] = 0.7, -0.5
    world = World(robot, Hardware(damping=50.0, rotor_lag=0.03), motion, tension, period)
    off = []
    for step in range(700):
        world.run(controller.step(step * period, world.state(), reference), np.zeros(6))
        off.append(np.linalg.norm(world.motions()[0, :3] - robot.home[:3]))
    assert 0.01 < max(off) < 0.045  # 0.15 m and growing with a rate of h e / 2 for each e
    assert controller._platform["attitude"][0] == 40
    assert off[-1] < 0.9 * max(off)


def test_a_load_whose_six_cables_nearly_meet_at_its_axis_is_turned_by_its_carriers():
    """Cables turned it about this axis with all their strength, and predictive control was 1.2 m off in this push."""
    data, rng = load("wang-ctmrts-6").model_dump(mode="json"), np.random.default_rng(5)
    for carrier in data["carriers"]:
        for k in range(2):
            carrier["home"][k] += 0.05 * load("wang-ctmrts-6").length * rng.uniform(-1, 1)
    robot = Robot.model_validate(data)
    push = f"push {0.05 * robot.weight} {-0.03 * robot.weight} 0 at 0.2 for 0.3"
    errors = []
    for controller in (Predictive(robot), ComputedTorque(robot)):
        run = simulate(robot, robot.home, controller, events=[push], duration=1.2, period=0.004)
        errors.append(run.error.max())
        if isinstance(controller, Predictive):
            assert run.answered["as planned"] == len(run.error)
            assert run.record.tensions.max() < 0.6 * robot.weight  # 0.2 at rest, and once 5
    assert errors[0] < errors[1] < 0.02


def test_carriers_of_long_cables_do_not_overshoot_after_a_push(monkeypatch):
    """With the bandwidth of short cables carriers accelerated beyond their limits, and were three times as far off."""
    monkeypatch.setattr("towline.control.predictive.grows", lambda *_: False)  # to save its simulation
    data, length = load("multi-quadrotor-3").model_dump(mode="json"), 5.0
    for cable, carrier in zip(data["cables"], data["carriers"], strict=True):
        along = np.subtract(carrier["home"][:3], cable["attachment"])
        carrier["home"][:3] = (cable["attachment"] + length / cable["length"] * along).tolist()
        cable["length"] = length
    robot = Robot.model_validate(data)
    push = f"push {0.1 * robot.weight} 0 0 at 0.2 for 0.5"
    off = []
    for given in ({}, {"bandwidth": 8.0, "observer": 20.0}):
        run = simulate(robot, robot.home, Predictive(robot, **given), events=[push], duration=1.7, period=0.002)
        off.append(run.error.max())
    # A free load would be 0.1 g 0.5 s / 2 (0.5 s + 2 1 s) = 0.61 m off by then.
    assert off[0] < 0.05
    assert off[0] < 0.5 * off[1]
