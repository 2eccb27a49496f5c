"""References as users have them: with angles that jump by a turn, and with what is no number."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline.control import ANSWERS, ComputedTorque, Predictive, Reference, State
from towline.control.carrier_references import Freed
from towline.control.trajectory import read_trajectory
from towline.models import Dynamics, load
from towline.simulation import simulate

RATE, PERIOD = 1.0, 1e-3  # [rad/s], [s]


def turning(robot, time, wrapped):
    """Return the reference of a team that turns about the load's axis with RATE, past half a turn."""
    yaw, still = np.pi - 0.05 + RATE * time, np.zeros(6)
    pose, velocity = robot.home.copy(), RATE * np.eye(6)[5]
    pose[5] = yaw - 2 * np.pi * (wrapped and yaw > np.pi)
    c, s = np.cos(yaw), np.sin(yaw)
    arms = (robot.carrier_home[:, :3] - robot.home[:3]) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    carriers = np.stack([robot.carrier_home, *np.zeros((2, *robot.carrier_home.shape))])
    carriers[0, :, :3] = robot.home[:3] + arms
    carriers[1, :, :3] = RATE * np.cross([0, 0, 1], arms)
    carriers[2, :, :3] = -(RATE**2) * arms * [1, 1, 0]
    return Reference(pose, velocity, still, *carriers)


def test_announced_angles_may_jump_by_a_turn():
    """The same motion with yaw between half turns has the same commands."""
    robot, commands = load("multi-quadrotor-3"), []
    for wrapped in (False, True):
        references = [turning(robot, PERIOD * k, wrapped) for k in range(100)]
        controller = Predictive(robot)
        controller.follow(references, PERIOD)
        steps = [controller.step(PERIOD * k, State(*r[:2], *r[3:5]), r) for k, r in enumerate(references)]
        commands.append([np.concatenate([each.tensions, each.carrier_acceleration.ravel()]) for each in steps])
    np.testing.assert_allclose(commands[1], commands[0], atol=1e-4)


@pytest.mark.parametrize("kind", [ComputedTorque, Predictive])
@pytest.mark.parametrize("field", ["pose", "carrier_pose", "carrier_acceleration", "tensions"])
@pytest.mark.parametrize("first", [True, False])
def test_a_reference_that_is_no_number_leaves_nothing_behind(kind, field, first):
    """The answer to it is to hold, and those to the next ones are numbers again."""
    robot = load("wang-ctmrts-4")
    state = State(robot.home, np.zeros(6), robot.carrier_home, 0 * robot.carrier_home)
    good = Reference(
        robot.home, *np.zeros((2, 6)), robot.carrier_home, *(0 * robot.carrier_home,) * 2, np.full(4, 40.0)
    )
    controller = kind(robot)
    if not first:
        controller.step(0.0, state, good)
    bad = good._replace(**{field: np.full_like(getattr(good, field), np.nan)})
    command = controller.step(0.1, state, bad)
    assert ANSWERS[command.answered] == "hold"
    assert np.isfinite(command.tensions).all()
    for k in range(1, 4):
        command = controller.step(0.1 + PERIOD * k, state, good)
        assert ANSWERS[command.answered] != "hold"
        for part in (command.tensions, command.carrier_pose, command.carrier_velocity, command.carrier_acceleration):
            assert np.isfinite(part).all()


def test_a_flight_past_half_a_turn_is_a_reference():
    """Attitudes of a flight are measured between half turns; between its samples they turn on."""
    robot = load("wang-flying")
    flown = simulate(robot, robot.home, duration=0.1).trajectory.copy(deep=True)
    time = flown["time"].values
    flown["pose"].values[:, 5] = np.where(time < 0.05, np.pi - 0.05 + time, -np.pi - 0.05 + time)
    flown["velocity"].values[:, 5], flown["acceleration"].values[:, 5] = RATE, 0.0
    platform, _ = read_trajectory(robot, flown, None).at(np.linspace(0, 0.099, 400))
    np.testing.assert_allclose(platform[1][:, 5], RATE, rtol=1e-6)


def test_a_team_that_should_not_leave_its_reference_still_corrects_its_load(stable_at_home):
    """With the weight of 1 mm tensions went from limit to limit, and the load was lost by metres."""
    robot = load("multi-quadrotor-3")
    line = {"kind": "line", "start": [0, 0, 0], "end": [0.05, 0.03, 0.04]}
    flight = simulate(robot, line, Predictive(robot, reach=(0, 0)), duration=1.0, period=2e-3)
    assert flight.passed
    assert flight.answered["as planned"] == 500
    assert flight.trajectory["tracking_error"].max() < 0.02


def test_what_pushes_a_quadrotor_sideways_turns_its_thrust_against_the_push():
    """A velocity that nothing explains is a force of K m v; the torque is that of the angle by which it turns F."""
    robot = load("multi-quadrotor-3")
    still = np.zeros(6), np.zeros(6), robot.carrier_home, *np.zeros((2, 3, 6))
    reference, moved = Reference(robot.home, *still, np.full(3, 8.7)), np.zeros((3, 6))
    moved[0, :2] = 0.02, -0.03
    torques = []
    for observer in (0.0, 10.0):
        controller = ComputedTorque(robot, reach=(0, 0), observer=observer)
        for time, velocity in ((0.0, 0 * moved), (1e-9, moved)):
            state = State(robot.home, np.zeros(6), robot.carrier_home, velocity, np.full(3, 8.7))
            command = controller.step(time, state, reference)
        torques.append(command.actuation[0, 1:])
    mass, inertia = robot.carriers[0].mass, np.array(robot.carriers[0].inertia[:3])
    force = 10.0 * mass * moved[0, :3]
    np.testing.assert_allclose(controller.disturbance_of_carriers[0, 0], force, atol=1e-6)
    R = Rotation.from_euler("xyz", robot.carrier_home[0, 3:]).as_matrix()
    anchors, attachments = Dynamics(robot).points(robot.home, robot.carrier_home)
    along = (anchors - attachments)[0] / np.linalg.norm((anchors - attachments)[0])
    thrust = 8.7 * along - mass * (np.array(robot.gravity) + 2 * 5.0 * moved[0, :3])
    turned = [R.T @ np.cross(R[:, 2], F / np.linalg.norm(F)) for F in (thrust, thrust - force)]
    np.testing.assert_allclose(torques[1] - torques[0], inertia * 1600 * (turned[1] - turned[0]), rtol=2e-3, atol=1e-9)


def test_a_carrier_at_the_side_of_its_box_is_expected_to_stay_there():
    box = np.full((1, 3), -0.1), np.full((1, 3), 0.1)
    freed = Freed(np.array([[0.5, 0.0, 0.0, 0.0, 0.0, 0.0]]), 5.0, box)
    freed.now(0.0, np.zeros((2, 12)), np.array([[0.09], [1.0], [0.0]]))
    freed.write_carriers(np.zeros(1), np.zeros(1), np.zeros(6), np.zeros((1, 3, 6)))
    place, rate = freed.now(0.02, np.zeros((2, 12)), np.zeros((3, 1)))
    assert (place, rate) == (0.1, 0.0)
