"""`short_cables`: where winches reel in almost all of a cable."""

import numpy as np

from ...base.text import quantity
from .instants import Instants

SHORT = 0.05  # of a cable's length at home


def short_cables(seen: Instants) -> list[str]:
    """Return a sentence if cables get shorter than `SHORT` of their length at home; none if their lengths are fixed."""
    robot = seen.robot
    if robot.fixed_lengths is not None:
        return []
    at_home = seen.dynamics.cable_lengths(robot.home)
    lengths = seen.dynamics.cable_lengths(seen.pose, seen.carriers)
    shares = lengths / at_home
    short = np.flatnonzero(shares.min(axis=0) < SHORT)
    if not short.size:
        return []
    row, cable = np.unravel_index(int(shares.argmin()), shares.shape)
    others = f", and so do {short.size - 1} more cables" if short.size > 2 else ", and so does one more"
    tows = robot.carriers[robot.carrier_of_cable[cable]].tows
    fixed = ", and with drive: fixed-length in the robot's file no winch reels it in" * tows
    return [
        f"cable {cable + 1} gets as short as {quantity(1e3 * lengths[row, cable], 'mm', 3)} at t = "
        f"{seen.times[row]:.3f} s, {quantity(100 * shares[row, cable], '%', 2)} of its "
        f"{quantity(at_home[cable], 'm', 3)} at home{others * (short.size > 1)}; limits.cable_length would keep it "
        f"longer{fixed}"
    ]
