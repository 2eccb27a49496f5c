"""Lengths of cables: `short_cables`, reeled in almost wholly, and `fixed_cables`, elastic ones that can go slack."""

import numpy as np

from ...base.text import quantity
from .instants import Instants

SHORT = 0.05  # of a cable's length at home
SLACK = -1e-6  # of the weight: less tension than that is slack


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


def fixed_cables(seen: Instants, tensions: np.ndarray) -> list[str]:
    """Return a sentence if the lengths of cables of fixed length do not keep the planned tensions, (n, m) [N].

    Lengths are such that the first tensions are as planned. From then on cables in a motion as planned have the
    tensions t that give the required wrench with the least elastic energy of their changes:

        min  (t - t_0)' diag(l / EA) (t - t_0)    s.t.  A t = A t_plan
    """
    robot = seen.robot
    stiffness = np.array([cable.stiffness or 0.0 for cable in robot.cables])
    if robot.fixed_lengths is None or not stiffness.all() or not np.isfinite(tensions).all():
        return []
    root = np.sqrt(robot.fixed_lengths / stiffness)
    A = robot.wrench_scale[:, None] * seen.dynamics.wrench_matrix(seen.pose, seen.carriers) / root
    A = A[:, np.flatnonzero(robot.dof_mask)]
    change = np.linalg.pinv(A, 1e-6) @ (A @ (root * (tensions - tensions[0]))[..., None])
    kept = tensions[0] + change[..., 0] / root
    row, cable = np.unravel_index(int(kept.argmin()), kept.shape)
    if kept[row, cable] >= SLACK * robot.force_scale:
        return []
    planned = quantity(tensions[row, cable], "N", 2)
    return [
        f"cable {cable + 1} can go slack at t = {seen.times[row]:.3f} s, where {planned} are planned: the lengths of "
        "cables of fixed length determine how they share the load; a larger margin could keep them taut"
    ]
