"""`Command`: the output of a controller until its next step."""

from typing import NamedTuple

import numpy as np

from ..base.display import record

ANSWERS = ("as planned", "shifted plan", "soft wrench", "hold", "not as modelled", "off the reference")
PLANNED, SHIFTED, SOFT, HOLD, OTHERWISE, OFF = range(6)
NOWHERE, NOTHING = np.full(6, np.nan), np.array(np.nan)
NOWHERE.flags.writeable = NOTHING.flags.writeable = False


class Command(NamedTuple):
    """A command. Arrays have the leading dimension of the state.

    Attributes:
        tensions: (..., m) [N], inside their limits and rate limits; small for a cable that is treated as cut.
        carrier_pose, carrier_velocity, carrier_acceleration: Commanded motion of the carriers, (..., c, 6). Flying
            carriers follow `actuation` instead.
        answered: (...), status of the step, an index of `ANSWERS`. "as planned": the tensions give the required
            wrench; "shifted plan": they are from an earlier solution; "soft wrench": they have the closest wrench;
            "hold": the measured state or the reference contained nan, so the command moves to the planned tensions;
            "not as modelled": computed torque took over, because the robot does not move as predicted; "off the
            reference": the tensions give the required wrench, but the platform is farther away from its reference than
            a simulation passes with by default (0.05 m, or 5 % of the mean cable length if that is less), or turned by
            more than 0.5 rad.
        direction, shortfall: If no tensions inside the limits and rates give the required wrench: the direction of the
            missing wrench, (..., 6), and its size [N], (...); otherwise nan (default). If tensions exist but a flying
            carrier has too little thrust for them, or does not turn as commanded because its actuators were at their
            limits for most of the last 0.1 s, only the size.
        actuation: Commands to the actuators of each carrier, (..., c, a); None if no carrier has any.
        unexplained: Mean acceleration of the platform that was not predicted, (...) [m/s^2], angles times the robot's
            length; nan from controllers that do not predict.
        lengths: Unstrained lengths for winches that take them, (..., m) [m], instead of the tensions, which are then
            those that are expected; default: None.
        released: Cables that their carriers release, (..., m) of bool; default: None.
    """

    tensions: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    carrier_acceleration: np.ndarray
    answered: np.ndarray
    direction: np.ndarray = NOWHERE
    shortfall: np.ndarray = NOTHING
    actuation: np.ndarray | None = None
    unexplained: np.ndarray = NOTHING
    lengths: np.ndarray | None = None
    released: np.ndarray | None = None

    __repr__ = record
