"""A box of winds, and the few extreme winds that decide whether tensions exist for all.

The air pushes the platform alone: carriers and cables feel no wind here. With V = wind - velocity of the CoM the force
(`models.wind`) is, per half the pressure area, X = C_d V_x |V_x|, Y = C_d V_y |V_y|, Z = C_l (V_x^2 + V_y^2); V_z plays
no part. X and Y rise with V_x and V_y, so over a box of winds they fill a rectangle, and

    Z = C_l / C_d (|X| + |Y|)

is linear on each of the parts into which X = 0 and Y = 0 cut it. So every force that a wind of the box makes lies in
the convex hull of those at the corners of these parts: the box's own corners, and the winds that have a component of
the CoM's velocity, V_x = 0 or V_y = 0, where the box holds them. The wrenches that tensions inside their limits can
give are a convex set: if it holds the hull's corners it holds the hull. So tensions exist for every wind of the box if
and only if they exist for these (at most nine) winds, and no reserve is needed. Without lift Z is zero and the four
corners do. With the form "printed" X is never negative, Z is linear in X and Y, and the same winds give the corners of
the rectangle.
"""

from itertools import product
from typing import Any, Self

import casadi as ca
import numpy as np
from pydantic import Field, model_validator

from ...models import Robot
from ...models.part import Part, Vector3
from ...models.platform import Aero
from ...models.rigid_body import com_velocity

# Which value of a coordinate: the box's smallest, its largest, or that of the CoM's velocity.
LOW, HIGH, ALONG = range(3)

# Additive recurrence of the plastic number's three-dimensional kin: the fractions of k times these fill a box evenly
# (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences").
_STEPS = 1.0 / 1.2207440846057596 ** np.arange(1, 4)


class WindBox(Part):
    """All winds from min to max, constant or not: tensions exist in every one of them."""

    min: Vector3 = Field(description="corner in {G} [m/s]")
    max: Vector3 = Field(description="corner in {G} [m/s]")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min must be at most max, {high:g} m/s along {axis}, got {low:g} m/s")
        return self

    @property
    def middle(self) -> Vector3:
        """Return the wind of the planned tensions, in {G} [m/s]."""
        x, y, z = ((low + high) / 2 for low, high in zip(self.min, self.max, strict=True))
        return x, y, z


def as_wind(values: np.ndarray) -> Vector3:
    """Return the values (3,) as plain numbers."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def choices(box: WindBox, aero: Aero) -> list[tuple[int, int]]:
    """Return which value each of x and y has in the decisive winds: LOW, HIGH or ALONG."""
    kinks = aero.lift > 0 or aero.form == "printed"
    x, y, _ = (
        [LOW] if low == high else [LOW, HIGH] + [ALONG] * kinks for low, high in zip(box.min, box.max, strict=True)
    )
    return list(product(x, y))


def decisive_winds(box: WindBox, robot: Robot, pose: Any, velocity: Any) -> list[Any]:
    """Return the winds that decide at a motion of the platform in {G}, (6, 1) each, as (3, 1) expressions [m/s]."""
    aero = robot.platform.aero
    if aero is None:
        return []
    moving = com_velocity(robot, pose, velocity)
    winds = []
    for choice in choices(box, aero):
        # The force has a continuous derivative by the clipped wind, since it grows with the square of what clips.
        values = [
            (box.min[i], box.max[i], ca.fmin(ca.fmax(moving[i], box.min[i]), box.max[i]))[which]
            for i, which in enumerate(choice)
        ]
        winds.append(ca.vertcat(*values, box.middle[2]))
    return winds


def decisive_winds_at(box: WindBox, robot: Robot, pose: np.ndarray, velocity: np.ndarray) -> list[np.ndarray]:
    """Return the winds that decide at many instants, (n, 3) each, from poses and velocities (n, 6)."""
    symbols = ca.SX.sym("pose", 6), ca.SX.sym("velocity", 6)
    function = ca.Function("winds", [*symbols], decisive_winds(box, robot, *symbols))
    values = function.map(len(pose)).call([ca.DM(pose.T), ca.DM(velocity.T)])
    return [value.full().T for value in values]


def inner_winds(box: WindBox, count: int) -> np.ndarray:
    """Return winds that fill the box evenly, (count, 3) [m/s]; every fourth lies on a face."""
    index = np.arange(1, count + 1)
    share = (0.5 + index[:, None] * _STEPS) % 1.0
    faces = np.flatnonzero(index % 4 == 0)
    axis = (index[faces] // 4) % 3
    share[faces, axis] = np.round(share[faces, axis])
    low, high = np.array(box.min), np.array(box.max)
    return low + share * (high - low)
