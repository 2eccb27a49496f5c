"""`Command`: what a controller orders for the time until its next step."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

__all__ = ["ANSWERS", "HOLD", "PLANNED", "SHIFTED", "SOFT", "Command"]

ANSWERS = ("as planned", "shifted plan", "soft wrench", "hold")
PLANNED, SHIFTED, SOFT, HOLD = range(4)
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
        planned"), with an earlier plan ("shifted plan"), with those that miss it by least ("soft wrench"), or with the
        last command ("hold").
    direction, shortfall
        Where no tensions inside the limits and rates give the required wrench: a direction along which they miss it,
        (..., 6), and by how much [N], (...); nan elsewhere, which is the default.
    actuation
        Commands of the actuators of each carrier, (..., c, a); None if no carrier has any.
    """

    tensions: np.ndarray
    carrier_pose: np.ndarray
    carrier_velocity: np.ndarray
    carrier_acceleration: np.ndarray
    answered: np.ndarray
    direction: np.ndarray = NOWHERE
    shortfall: np.ndarray = NOTHING
    actuation: np.ndarray | None = None
