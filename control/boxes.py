"""`boxes`: the positions that may be commanded to carriers; `stay_inside` keeps motions inside them."""

import numpy as np

from ..models.robot import Robot


def boxes(robot: Robot) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the smallest and largest coordinates of the carriers' reach, (c, 3) each [m]; None if it is unlimited."""
    each = [carrier.motion_limits.reach for carrier in robot.carriers]
    if not any(each):
        return None
    low = np.array([(-np.inf,) * 3 if box is None else box.min for box in each])
    return low, np.array([(np.inf,) * 3 if box is None else box.max for box in each])


def stay_inside(carriers: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
    """Clip the carriers' motions, (N, c, 3, 6), to their boxes, (c, 3) [m]."""
    place = carriers[:, :, 0, :3]
    outside = (place < low) | (place > high)
    if outside.any():
        np.clip(place, low, high, out=place)
        carriers[:, :, 1, :3][outside] = carriers[:, :, 2, :3][outside] = 0.0
