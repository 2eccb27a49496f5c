"""Teams at home: what a push leaves decays in the whole loop of controller, carriers' own loops and plant."""

import numpy as np
import pytest

from towline import simulate
from towline.control import ComputedTorque, Predictive, Reference, State
from towline.models import load
from towline.plant import Plant
from towline.statics.distribution import tensions

PERIOD, SECONDS, PUSH = 4e-3, 8.0, 1e-4  # [s], [s], of the weight


def decay(robot, controller):
    """Return how much smaller the largest distance from home is in the last 3 s than in the 3 s before."""
    plant, still = Plant(robot, drive="lengths"), np.zeros_like(robot.carrier_home)
    at_rest = np.asarray(tensions(robot, robot.home, method="soft-wrench").tensions)
    reference = Reference(robot.home, np.zeros(6), np.zeros(6), robot.carrier_home, still, still, at_rest)
    scale = np.repeat([1.0, robot.length], 3)
    push = PUSH * robot.weight * scale * np.random.default_rng(0).normal(size=6)
    state, pulls, off = plant.start(tensions=at_rest), at_rest, []
    for k in range(round(SECONDS / PERIOD)):
        now = plant.read(state)
        off.append(np.append(scale * (now.pose - robot.home), (now.carrier_pose - robot.carrier_home)[:, :3]))
        measured = State(now.pose, now.velocity, now.carrier_pose, now.carrier_velocity, pulls)
        command = controller.step(PERIOD * k, measured, reference)
        wrench = push if PERIOD * k < 0.05 else None
        row = plant.command(robot.fixed_lengths, command.actuation, *command[1:4], wrench=wrench)
        run = plant.run(state, row[None], PERIOD)
        state, pulls = run.states[-1], run.tensions.mean(axis=0)
    sizes, part = np.linalg.norm(off, axis=1), round(3.0 / PERIOD)
    return sizes[-part:].max() / sizes[-2 * part : -part].max()


@pytest.mark.parametrize("name", ["multi-quadrotor-3", "multi-quadrotor-6"])
def test_teams_come_to_rest(name):
    """Slower than the carriers' own loops: 0.13 rad/s is a decay by a third in 3 s."""
    robot = load(name)
    assert decay(robot, ComputedTorque(robot)) < 0.8


def test_a_hand_over_in_a_push_is_no_worse_than_computed_torque_alone():
    """Predictions order rear carriers to fall faster than gravity; without the cone they turned over (187 mm)."""
    robot = load("multi-quadrotor-4")
    push = [{"kind": "push", "at": 0.05, "force": [0.15 * robot.weight, 0, 0]}]
    ahead, usual = (
        simulate(robot, robot.home, kind(robot), duration=0.9, events=push) for kind in (Predictive, ComputedTorque)
    )
    assert ahead.handed_over is not None
    assert ahead.error.max() < usual.error.max()
    cosines = np.cos(ahead.trajectory["carrier_pose"].values[..., 3:5]).prod(axis=-1)
    most = np.arctan(1.5 * np.tan(robot.carriers[0].tilt_max))  # of the force for which a carrier turns
    assert np.arccos(cosines.min()) < 1.15 * most  # and what the attitude loop overshoots


def test_carriers_that_tilt_little_in_plans_withstand_as_much():
    """`tilt_max` is a limit of plans: as a limit of the cone too, it made the error in this push larger."""
    robot = load("multi-quadrotor-3")
    push = [{"kind": "push", "at": 0.1, "force": [-0.2 * robot.weight, 0, 0]}]
    gentle = tuple(carrier.model_copy(update={"tilt_max": 0.2}) for carrier in robot.carriers)
    flights = (
        simulate(its, robot.home, ComputedTorque(its), duration=0.9, events=push)
        for its in (robot, robot.model_copy(update={"carriers": gentle}))
    )
    usual, little = (flight.error.max() for flight in flights)
    assert little == pytest.approx(usual, rel=1e-6)
