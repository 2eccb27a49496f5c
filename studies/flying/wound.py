"""The elastic plant with the lengths of a motion commanded: the paper's steady winding, without any control."""

from typing import NamedTuple

import numpy as np

from ...models import Dynamics, Robot
from ...ocp.tasks.paths import Motion
from ...plant import Plant
from ...plant.reading import Reading
from .cable import constants
from .plans import solved

PERIOD = 1e-3  # of the commanded lengths [s]
FLIGHT = PERIOD * np.arange(10_001)  # [s]


class Wound(NamedTuple):
    """A run, or a batch of them: what the plant's states are, and the tensions (..., n, m) [N]."""

    states: Reading
    tensions: np.ndarray


def wind_up(
    robot: Robot,
    body: Motion,
    carriers: Motion | None = None,
    wind: np.ndarray | None = None,
    wrench: np.ndarray | None = None,
    lengths: np.ndarray | None = None,
) -> Wound:
    """Command lengths every `PERIOD` and let the plant move from the first pose and velocity of a motion on.

    The cables are elastic. Motions of platform and carriers are in {G}, (n, 6) and (n, c, 6) each; default: carriers at
    home. The wind is the velocity of the air in {G} [m/s], (..., n - 1, 3); default: no air. The wrench [N, N m] acts
    on the platform, (..., n - 1, 6); default: none. Lengths are unstrained [m], (n, m); default: the distances from
    anchor to attachment, the paper's Eq. 5.
    """
    plant, dynamics = Plant(robot), Dynamics(robot)
    count = len(body.pose)
    still = np.zeros((count, len(robot.carriers), 6))
    bases = Motion(still + robot.carrier_home, still, still) if carriers is None else carriers
    wound = dynamics.cable_lengths(body.pose, bases.pose) if lengths is None else lengths
    start = plant.start(
        body.pose[0], body.velocity[0], carrier_pose=bases.pose[0], carrier_velocity=bases.velocity[0], lengths=wound[0]
    )
    commands = plant.command(
        wound[1:],
        carrier_pose=bases.pose[:-1],
        carrier_velocity=bases.velocity[:-1],
        carrier_acceleration=bases.acceleration[:-1],
        wind=wind,
        wrench=wrench,
    )
    run = plant.run(start, commands, PERIOD)
    return Wound(plant.read(run.states), run.tensions)


def unstrained(robot: Robot, body: Motion) -> np.ndarray:
    """Return the lengths that have the steady tensions of a motion under a resting carrier, (n, m) [m]."""
    dynamics = Dynamics(robot)
    T = solved(dynamics.wrench_matrix(body.pose), dynamics.required_wrench(*body))
    return dynamics.cable_lengths(body.pose) / (1 + T / constants(robot)[0])
