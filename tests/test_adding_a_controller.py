"""The page on adding a controller: its example flies, and what it does is a spring and a damper."""

import re
from pathlib import Path

import numpy as np
import pytest

from towline import simulate

PAGE = (Path(__file__).parent.parent / "docs" / "adding-a-controller.md").read_text()
HERE = [0, 0, -1, 0, 0, 0]


@pytest.fixture(scope="module")
def example():
    names = {}
    exec(code(), names)
    return names


def code():
    (text,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    return text


def test_the_controller_has_15_lines():
    start, end = code().index("class"), code().index("robot = load")
    assert len([line for line in code()[start:end].splitlines() if line.strip()]) <= 15


def test_the_example_flies(example):
    assert example["run"].passed
    assert example["run"].answered["as planned"] == 1000


def test_a_constant_push_moves_it_as_far_as_the_spring_gives(example):
    """Without an integral or an observer the offset at rest is F / (m k); it comes as of two equal poles at -10 / s."""
    robot, force = example["robot"], 0.12  # [N]
    pushed = [force, 0, 0, 0, 0, 0]
    flight = simulate(robot, HERE, example["SpringAndDamper"](robot), duration=0.8, disturbance=pushed)
    times = flight.times
    wanted = force / (robot.platform.mass * 100.0) * (1 - (1 + 10 * times) * np.exp(-10 * times))
    np.testing.assert_allclose(flight.trajectory["pose"].values[:, 0], wanted, atol=1e-5)


def test_its_flights_side_by_side_are_those_alone(example):
    controller, noise = example["SpringAndDamper"](example["robot"]), {"position": 1e-3}
    many = simulate(example["robot"], HERE, controller, noise=noise, duration=0.1, runs=2, seed=3)
    alone = [simulate(example["robot"], HERE, controller, noise=noise, duration=0.1, seed=seed) for seed in (3, 4)]
    errors = [float(flight.error.max()) for flight in alone]
    np.testing.assert_allclose(many["error_max"].values, errors, rtol=1e-9)
    assert errors[0] != errors[1]
