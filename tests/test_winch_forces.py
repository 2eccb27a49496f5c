"""Motors of winches in simulations: their forces give commanded tensions, with inertia, friction and elastic cables."""

from typing import Any

import numpy as np
import pytest

from towline import load, simulate
from towline.core._core import winch_forces
from towline.models import Robot
from towline.plant import Plant, layout
from towline.plant.steps import winding_time

WINCH = {"inertia": 3.0, "friction": 20.0, "speed_max": 50, "force_max": 1e5}
LIFT: dict[str, Any] = {
    "name": "lift",
    "source": "a test",
    "platform": {"mass": 4.0, "dof": ["z"], "home": [0, 0, 1, 0, 0, 0]},
    "carriers": [{"name": "frame", "kind": "ground"}],
    "cables": [
        {"carrier": "frame", "anchor": [0, 0, 3], "attachment": [0, 0, 0], "t_min": 0, "t_max": 1e4, "winch": WINCH}
    ],
}


def with_winches(name, winch=None, **keys):
    data = load(name).model_dump()
    data["cables"] = [cable | {"winch": WINCH | (winch or {})} | keys for cable in data["cables"]]
    return Robot.model_validate(data)


def motors(plant, state, tensions, period=1e-3, **command):
    """Return the motors' forces for tensions, and the command with them."""
    row = plant.command(np.asarray(tensions, dtype=float), **command)
    winch_forces(plant.record, plant.settings, state, row, period)
    return row[layout.COMMANDS : layout.COMMANDS + plant.robot.m].copy(), row


@pytest.mark.parametrize(("speed", "sign"), [(0.3, 1), (-0.3, -1), (0.0, 1)])
def test_a_motor_that_lifts_carries_load_inertia_and_friction(speed, sign):
    """By hand: under the tension t a mass m rises with a = t / m - g, and its motor needs t + J a plus friction."""
    plant = Plant(Robot.model_validate(LIFT), drive="forces")
    state = plant.start(velocity=[0, 0, speed, 0, 0, 0], tensions=[50.0])
    assert plant.read(state).length_rates == pytest.approx([-speed])
    a = 50.0 / 4 - 9.81
    assert motors(plant, state, [50.0])[0] == pytest.approx([50 + 3 * a + sign * 20])


@pytest.mark.parametrize("name", ["caroca-pulleys", "planar-4", "wang-flying-quadrotor", "wang-ctmrts-6"])
def test_the_forces_make_the_tensions_of_a_moving_robot_as_commanded(name):
    """The plant finds tensions of cables that do not stretch from the constraints, not by inverse dynamics."""
    robot, rng = with_winches(name, stiffness=None, damping=None), np.random.default_rng(3)
    plant, wind = Plant(robot, drive="forces"), [3, -1, 0.5] if robot.platform.aero else None
    velocity = rng.normal(size=6) * robot.dof_mask
    moving = 0.3 * rng.normal(size=(len(robot.carriers), 6))
    t = rng.uniform(200, 300, robot.m)
    state = plant.start(velocity=velocity, carrier_velocity=moving, tensions=t)
    others = {
        "carrier_pose": robot.carrier_home,
        "carrier_velocity": moving,
        "wind": wind,
        "wrench": [9, -5, 2, 0, 1, 0],
    }
    others["carrier_acceleration"] = rng.normal(size=moving.shape)
    row = motors(plant, state, t, 1e-6, **others)[1]
    np.testing.assert_allclose(plant.run(state, row[None], 1e-4).tensions[0], t, rtol=1e-7)


@pytest.mark.parametrize("mass", [1e9, 4.0, 0.1])
@pytest.mark.parametrize(("EA", "inertia", "damping"), [(1e4, 3.0, 0), (1e6, 3.0, 0), (1e6, 0.2, 0), (1e4, 3.0, 10)])
def test_the_tension_of_an_elastic_cable_reaches_its_command_without_oscillation(EA, inertia, damping, mass):
    """By hand: e - e* = (1 + w t) exp(-w t) (e0 - e*), with w = 400 rad/s or that of winch and cable, for any load."""
    data = LIFT | {"platform": LIFT["platform"] | {"mass": mass}, "gravity": [0, 0, 0]}
    own = {"stiffness": EA, "damping": damping or None, "winch": WINCH | {"inertia": inertia, "friction": 0.0}}
    data["cables"] = [data["cables"][0] | own]
    plant, period = Plant(Robot.model_validate(data), drive="forces"), 2e-5
    state = plant.start(tensions=[100.0])
    w = max(400, np.sqrt(EA / 2 / inertia))
    for k in range(1, int(4 / w / period)):
        row = motors(plant, state, [150.0], period)[1]
        state = plant.step(state, row, period)
        tension = plant.run(state, row[None], 1e-9).tensions[0, 0]
        t = k * period  # the tension is K e + C de/dt
        decayed = (1 + w * t - 2 * damping / EA * w**2 * t) * np.exp(-w * t)
        assert tension == pytest.approx(150 - 50 * decayed, abs=0.04 * 50)


def test_held_forces_do_not_fight_the_damper_of_a_cable():
    """Of 75 ms of damping, as a robot's file may have; fed back as fast as an elastic cable's it rang with 100 N."""
    cable = LIFT["cables"][0] | {"stiffness": 3e4, "damping": 1100.0, "winch": WINCH | {"inertia": 20.0}}
    plant = Plant(Robot.model_validate(LIFT | {"cables": [cable]}), drive="forces")
    state, tensions = plant.start(tensions=[39.24]), []
    for wanted in 39.24 + 5.0 * (np.arange(200) > 20):
        row = motors(plant, state, [wanted])[1]
        tensions.append(plant.run(state, row[None], 1e-6).tensions[0, 0])
        state = plant.step(state, row, 1e-3)
    np.testing.assert_allclose(tensions[:20], 39.24, atol=0.1)
    np.testing.assert_allclose(tensions[40:], 44.24, atol=0.1)
    assert max(tensions) < 44.24 + 0.2


@pytest.mark.parametrize("keys", [{}, {"stiffness": 2e4}, {"stiffness": 2e5, "damping": 50}])
@pytest.mark.parametrize("inertia", [0.1, 10.0])
def test_winches_with_friction_and_inertia_do_not_change_a_motion(keys, inertia):
    """Motors that pulled with the tensions themselves would leave 5 kg under three cables 0.1 m behind."""
    robot = with_winches("point-mass-3", {"inertia": inertia, "friction": 5.0}, **keys)
    circle = {"kind": "circle", "centre": [0, 0, 1], "radius": 0.3, "rate": 1.5}
    run = simulate(robot, circle, duration=0.8)
    assert run.passed, run.failures
    assert run.error.max() < 1e-3
    slow = simulate(robot, circle, duration=0.8, period=0.02)  # of the controller; the drives work faster
    assert slow.error.max() < 5e-3


def test_drives_work_faster_than_a_light_winch_on_a_stiff_cable_swings():
    """By hand: a winch of 0.01 kg and 4 kg on 1 MN / 2 m; forces are held for 0.4 of the inverse of that frequency."""
    cable = LIFT["cables"][0] | {"stiffness": 1e6, "winch": WINCH | {"inertia": 0.01}}
    plant = Plant(Robot.model_validate(LIFT | {"cables": [cable]}), drive="forces")
    assert winding_time(plant) == pytest.approx(0.4 / np.sqrt(1e6 / 2 * (1 / 4 + 1 / 0.01)))
    assert winding_time(Plant(Robot.model_validate(LIFT), drive="forces")) == 1e-3


def test_elastic_cables_of_a_fixed_length_have_it_under_the_planned_tension():
    """If they had it unstrained, they would be slack at first, and the load of three quadrotors would fall."""
    data = load("multi-quadrotor-3").model_dump()
    data["cables"] = [cable | {"stiffness": 2e3, "damping": 10} for cable in data["cables"]]
    robot = Robot.model_validate(data)
    run = simulate(robot, robot.home, duration=0.3)
    assert run.slack_s == 0
    np.testing.assert_allclose(run.record.tensions[0], run.record.commanded[0], rtol=1e-3)
    assert run.error.max() < 1e-4
