"""`check_pulleys`: whether the cables of a robot can run over their pulleys at home."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import points

if TYPE_CHECKING:
    from .robot import Robot

__all__ = ["check_pulleys"]


def check_pulleys(robot: Robot) -> None:
    """Refuse an attachment on the swivel axis of its pulley, or inside the sheave.

    Raises
    ------
    ValueError
        Naming the attachment.
    """
    offsets = robot.home_attachments - robot.home_anchors
    turned = points.rotations(robot.carrier_home[robot.carrier_of_cable, 3:])
    axes = np.einsum("mij,mj->mi", turned, robot.pulley_axes)
    up = np.sum(offsets * axes, axis=1)
    across = np.linalg.norm(offsets - up[:, None] * axes, axis=1)
    outside = (across > 1e-9) & (across**2 - 2 * across * robot.pulley_radii + up**2 > 0)
    for index in np.flatnonzero((robot.pulley_radii > 0) & ~outside):
        raise ValueError(
            f"cables[{index}].attachment must lie off the swivel axis and outside the sheave of its pulley at "
            f"home, got {robot.cables[index].attachment}"
        )
