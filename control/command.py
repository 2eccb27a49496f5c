"""`Command`: what a controller orders for the time until its next step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.display import record

ANSWERS = ("as planned", "shifted plan", "soft wrench", "hold", "not as modelled")
PLANNED, SHIFTED, SOFT, HOLD, OTHERWISE = range(5)
NOWHERE, NOTHING = np.full(6, np.nan), np.array(np.nan)
NOWHERE.flags.writeable = NOTHING.flags.writeable = False


class Command(NamedTuple):
    """A command. Arrays have the leading dimension of the state.

    Attributes
    ----------
    tensions
        (..., m) [N], inside their limits and within the limit of their rates; little for a cable that counts as cut.
    carrier_pose, carrier_velocity, carrier_acceleration
        Where carriers are to be, (..., c, 6); those with thrusts of their own follow `actuation` instead.
    answered
        (...), how the step was answered, an index of `ANSWERS`: with the tensions that give the required wrench ("as
        planned"), with an earlier plan ("shifted plan"), with those that miss it by least ("soft wrench"), with the
        last command ("hold"), or by computed torque, because the robot does not move as a controller predicts ("not
        as modelled").
    direction, shortfall
        Where no tensions inside the limits and rates give the required wrench: a direction along which they miss it,
        (..., 6), and by how much [N], (...); nan elsewhere, which is the default. Where tensions would, but a carrier
        that flies lacks thrust for them, only by how much.
    actuation
        Commands of the actuators of each carrier, (..., c, a); None if no carrier has any.
    unexplained
        Mean acceleration of the platform that was not predicted, (...) [m/s^2], angles times the robot's length; nan
        from controllers that do not predict.
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

    __repr__ = record
