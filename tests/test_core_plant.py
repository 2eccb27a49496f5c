"""The plant in C: no warning, nothing for sanitizers to find in any numbers, and the bits of the extension."""

import subprocess

import numpy as np
import pytest

from towline import Dynamics, load
from towline.core import run_plant, sense
from towline.plant import Plant

from .c_programs import program_of, sources_of, watched_objects

NONSENSE = [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300]
ROWS, STEPS, KEEP, SUBSTEPS, PERIOD = 8, 30, 4, 2, 2e-3


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """Return a program that runs a plant, which sanitizers watch."""
    return program_of(tmp_path_factory, "core_plant.c", watched_objects(tmp_path_factory, sources_of("plant")))


def plant_of(name, drive, stiffness):
    """A plant of a robot, with winches where forces are commanded."""
    robot = load(name)
    if drive == "forces":
        winch = {"inertia": 0.5, "friction": 3.0, "speed_max": 4.0, "force_max": 2 * float(robot.t_max.max())}
        cables = [cable.model_dump() | {"winch": winch} for cable in robot.cables]
        robot = type(robot).model_validate(robot.model_dump() | {"cables": cables})
    return Plant(robot, drive=drive, stiffness=stiffness, damping=None if stiffness is None else 0.0)


@pytest.mark.parametrize(
    ("name", "drive", "stiffness"),
    [
        ("cogiro", "lengths", 1e5),
        ("wang-flying-quadrotor", "tensions", None),
        ("multi-quadrotor-3", "lengths", 0.0),
        ("caroca-pulleys", "rates", 0.0),
        ("wang-ctmrts-4", "lengths", 1e4),
        ("ipanema-1", "forces", 1e5),
    ],
)
def test_any_numbers_are_safe_and_good_ones_have_the_same_bits(program, name, drive, stiffness):
    """States and commands near home, half of them with a number that is none, infinite, huge or tiny."""
    plant, rng = plant_of(name, drive, stiffness), np.random.default_rng(5)
    states = np.tile(plant.start(), (ROWS, 1)) + 1e-3 * rng.normal(size=(ROWS, plant.size))
    cables = {
        "lengths": 0.99 * Dynamics(plant.robot).cable_lengths(plant.robot.home),
        "rates": np.zeros(plant.robot.m),
        "forces": 0.2 * plant.robot.t_max,
        "tensions": 0.2 * plant.robot.t_max,
    }
    command = plant.command(np.minimum(cables[drive], 1e4))
    commands = np.tile(command, (ROWS, STEPS, 1)) + 1e-3 * rng.normal(size=(ROWS, STEPS, len(command)))
    commands[..., 0] = 0.0  # no air
    for row in range(0, ROWS, 2):
        array = (states, commands)[row // 2 % 2][row]
        array.flat[rng.integers(array.size)] = rng.choice(NONSENSE)
    kept = 1 + STEPS // KEEP
    history, tensions = np.zeros((ROWS, kept, plant.size)), np.zeros((ROWS, kept, plant.robot.m))
    run_plant(plant.record, plant.settings, states, commands, history, tensions, None, STEPS, PERIOD, SUBSTEPS, KEEP)
    motions = np.zeros((ROWS, kept, 1 + len(plant.robot.carriers), 12))
    lengths = np.zeros((ROWS, kept, 2, plant.robot.m))
    sense(plant.record, history, motions, lengths)
    arguments = [str(value) for value in (ROWS, STEPS, KEEP, SUBSTEPS, PERIOD)]
    given = b"".join(
        np.ascontiguousarray(array).tobytes() for array in (plant.record, plant.settings, states, commands)
    )
    done = subprocess.run([program, *arguments], input=given, capture_output=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr.decode()
    numbers = np.frombuffer(done.stdout)
    expected = np.concatenate([array.ravel() for array in (history, tensions, lengths)])
    np.testing.assert_array_equal(numbers, expected)
    assert np.isfinite(history[1::2]).all()


def test_no_rows_are_no_work():
    plant = Plant("cogiro")
    states, commands = np.empty((0, plant.size)), np.empty((0, 1, len(plant.command(np.ones(plant.robot.m)))))
    history, tensions = np.empty((0, 2, plant.size)), np.empty((0, 2, plant.robot.m))
    run_plant(plant.record, plant.settings, states, commands, history, tensions, None, 1, 1e-3, 1, 1)
