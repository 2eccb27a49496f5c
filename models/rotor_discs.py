"""`rotor_discs`: the circles in which the rotors of carriers turn, as figures and films draw them."""

import numpy as np

from .points import placed
from .robot import Robot

ROUND = np.linspace(0.0, 2 * np.pi, 33)


def rotor_discs(robot: Robot, carriers: np.ndarray) -> np.ndarray:
    """Return a circle with the radius of each carrier that has rotors, (k, r, p, 3) in {G} [m].

    Parameters
    ----------
    carriers
        Poses of all carriers, (k, c, 6) [m, rad].
    """
    which = [index for index, carrier in enumerate(robot.carriers) if carrier.drawing.rotors]
    circle = np.stack([np.cos(ROUND), np.sin(ROUND), np.zeros_like(ROUND)], axis=1)
    circles = [placed(carriers[:, index], robot.carrier_radius[index] * circle) for index in which]
    return np.stack(circles, axis=1) if which else np.zeros((len(carriers), 0, len(ROUND), 3))
