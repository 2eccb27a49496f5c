"""Sets of winds, boxes and discs, and the few winds that decide whether tensions exist in all of them.

The air pushes the platform alone: carriers and cables feel no wind here. With V = wind - velocity of the CoM the force
(`models.rigid_body.aerodynamic_wrench`) is, per half the pressure area, X = C_d V_x |V_x|, Y = C_d V_y |V_y|,
Z = C_l (V_x^2 + V_y^2); V_z plays no part. The wrenches that tensions inside their limits can give are a convex set: if
it holds some forces it holds their convex hull. With lift,

    Z = C_l / C_d (|X| + |Y|)

is linear on each of the parts into which X = 0 and Y = 0 cut the plane.

**A box.** X and Y rise with V_x and V_y, so over a box of winds they fill a rectangle. Every force that a wind of the
box makes lies in the convex hull of those at the corners of these parts: the box's own corners, and the winds that have
a component of the CoM's velocity, V_x = 0 or V_y = 0, where the box holds them. So tensions exist for every wind of the
box if and only if they exist for these (at most nine) winds, and no reserve is needed. Without lift Z is zero and the
four corners do. With the form "printed" X is never negative, Z is linear in X and Y, and the same winds give the
corners of the rectangle.

**A disc.** V fills a disc of radius s about c = -v, where v is the velocity of the CoM. In the quadrant V_1, V_2 >= 0,
with the axes in their directions there, V_1 is at most a = s + c_1 and V_2 at most b = s + c_2. With c+ = max(c, 0),
the part of the disc in the quadrant also lies in the ellipse about V = 0 with the semi-axes a' = a + c_2+ / 2 and
b' = b + c_1+ / 2: along every unit vector n with n_1, n_2 >= 0 the ellipse reaches farther, as the mean of squares is
at least the square of the mean:

    sqrt(n_1^2 a'^2 + n_2^2 b'^2) >= n_1^2 a' + n_2^2 b' >= s + n_1 c_1 + n_2 c_2,

the latter since n^2 >= n - (1 - n^2) / 2 for c > 0, and n^2 <= n for c < 0. In |X| and |Y| the ellipse is a triangle,
whose two corners are cut off at a^2 and b^2. So the forces lie in the hull of the forces of two winds a quadrant:
V_1 = a with V_2^2 = b'^2 (1 - a^2 / a'^2), and the same with both axes exchanged; V_2 is zero for c_2 <= 0. Where b < 0
the disc does not reach the quadrant; V_2 is b then. These eight winds are as fast as s along one axis. With lift, or
with the form "printed", the ninth is the one nearest to the CoM's velocity along both axes. At rest the winds are in
the disc, so that they decide exactly. While the platform moves some are faster than any of the disc: if tensions
exist in them, they exist in the disc, but if not, nothing is proven. Winds of the disc itself, `WindDisc.possible`,
have to prove it.
"""

from itertools import product
from typing import Any, ClassVar, TypeAlias

import casadi as ca
import numpy as np
from pydantic import Field

from ...models import Robot
from ...models.part import Box, Part, Positive, Vector3
from ...models.platform import Aero
from ...models.rigid_body import com_velocity

# Which value of a coordinate: the box's smallest, its largest, or the CoM's velocity.
LOW, HIGH, ALONG = range(3)
SMOOTHED = 1e-3  # [m/s]: a speed is the root of its square plus the square of this, which has derivatives at rest
TINY = 1e-12  # [m/s]
RING = 16  # winds on the edge of a disc

# Additive recurrence of the plastic number's three-dimensional kin: the fractions of k times these fill a box evenly
# (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences").
_STEPS = 1.0 / 1.2207440846057596 ** np.arange(1, 4)


class WindBox(Box):
    """All winds from min to max, constant or not: tensions exist in every one of them."""

    unit: ClassVar[str] = "m/s"

    min: Vector3 = Field(description="corner in {G} [m/s]")
    max: Vector3 = Field(description="corner in {G} [m/s]")

    @property
    def middle(self) -> Vector3:
        """Return the wind of the planned tensions, in {G} [m/s]."""
        x, y, z = ((low + high) / 2 for low, high in zip(self.min, self.max, strict=True))
        return x, y, z

    def count(self, aero: Aero) -> int:
        """Return the number of winds that decide whether tensions exist in all winds of the set."""
        return len(self._choices(aero))

    def decisive(self, aero: Aero, moving: Any, smoothed: float = 0.0) -> list[Any]:
        """Return the winds that decide at a velocity of the CoM (3, 1), as (3, 1) expressions [m/s]."""
        winds = []
        for choice in self._choices(aero):
            # The force has a continuous derivative by the clipped wind, since it grows with the square of what clips.
            values = [
                (self.min[i], self.max[i], _clipped(moving[i], self.min[i], self.max[i]))[which]
                for i, which in enumerate(choice)
            ]
            winds.append(ca.vertcat(*values, self.middle[2]))
        return winds

    def possible(self, aero: Aero, moving: np.ndarray) -> list[np.ndarray]:
        """Return winds of the set (n, 3), among them the worst, at velocities of the CoM (n, 3): the decisive ones."""
        return _evaluated(self, aero, moving)

    def inner(self, count: int) -> np.ndarray:
        """Return winds that fill the box evenly, (count, 3) [m/s]; every fourth lies on a face."""
        index = np.arange(1, count + 1)
        share = (0.5 + index[:, None] * _STEPS) % 1.0
        faces = np.flatnonzero(index % 4 == 0)
        axis = (index[faces] // 4) % 3
        share[faces, axis] = np.round(share[faces, axis])
        low, high = np.array(self.min), np.array(self.max)
        return low + share * (high - low)

    def _choices(self, aero: Aero) -> list[tuple[int, int]]:
        """Return which value each of x and y has in the decisive winds: LOW, HIGH or ALONG."""
        kinks = _has_kinks(aero)
        x, y, _ = (
            [LOW] if low == high else [LOW, HIGH] + [ALONG] * kinks
            for low, high in zip(self.min, self.max, strict=True)
        )
        return list(product(x, y))


class WindDisc(Part):
    """All horizontal winds up to a speed, from any side, constant or not: tensions exist in every one of them."""

    speed: Positive = Field(description="largest speed of the wind, which may come from any side [m/s]")

    @property
    def middle(self) -> Vector3:
        """Return the wind of the planned tensions, in {G} [m/s]."""
        return 0.0, 0.0, 0.0

    def count(self, aero: Aero) -> int:
        """Return the number of winds that decide whether tensions exist in all winds of the set."""
        return 8 + _has_kinks(aero)

    def decisive(self, aero: Aero, moving: Any, smoothed: float = 0.0) -> list[Any]:
        """Return the winds that decide at a velocity of the CoM (3, 1), as (3, 1) expressions [m/s]."""
        speed, winds = self.speed, []
        for along, forth, aside in product((0, 1), (1, -1), (1, -1)):
            across = 1 - along
            c = -forth * moving[along], -aside * moving[across]
            ahead, half = ((each + ca.sqrt(each**2 + smoothed**2)) / 4 for each in c)  # c+ / 2
            a = ca.fmax(speed + c[0], 0.0)
            wide = ca.fmax(speed + c[1], 0.0) + ahead
            share = ca.sqrt(half * (2 * a + half)) / ca.fmax(a + half, TINY)  # the root of 1 - a^2 / a'^2
            values: list[Any] = [0.0, 0.0, 0.0]
            values[along] = forth * speed
            values[across] = moving[across] + aside * (wide * share + ca.fmin(speed + c[1], 0.0))
            winds.append(ca.vertcat(*values))
        nearest = (_clipped(moving[i], -speed, speed) for i in range(2))
        return [*winds, ca.vertcat(*nearest, 0.0)] if _has_kinks(aero) else winds

    def possible(self, aero: Aero, moving: np.ndarray) -> list[np.ndarray]:
        """Return winds of the disc, (n, 3) each, at velocities of the CoM (n, 3): all round, and against the motion."""
        angles = np.arange(RING) * 2 * np.pi / RING
        ring = self.speed * np.stack([np.cos(angles), np.sin(angles), np.zeros(RING)], axis=1)
        flat = moving * [1.0, 1.0, 0.0]
        pace = np.linalg.norm(flat, axis=1, keepdims=True)
        against = -self.speed * flat / np.maximum(pace, 1e-12)
        still = flat * np.minimum(1.0, self.speed / np.maximum(pace, 1e-12))
        return [*np.repeat(ring[:, None], len(moving), axis=1), against, -against, still]

    def inner(self, count: int) -> np.ndarray:
        """Return winds that fill the disc evenly, (count, 3) [m/s]."""
        share = (0.5 + np.arange(1, count + 1)[:, None] * _STEPS[:2]) % 1.0
        radius, angle = self.speed * np.sqrt(share[:, 0]), 2 * np.pi * share[:, 1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)], axis=1)


WindSet: TypeAlias = WindBox | WindDisc


def _clipped(value: Any, low: float, high: float) -> Any:
    return ca.fmin(ca.fmax(value, low), high)


def _has_kinks(aero: Aero) -> bool:
    return aero.lift > 0 or aero.form == "printed"


def as_wind(values: np.ndarray) -> Vector3:
    """Return the values (3,) as plain numbers."""
    x, y, z = (float(value) for value in values)
    return x, y, z


def decisive_winds(winds: WindSet, robot: Robot, pose: Any, velocity: Any) -> list[Any]:
    """Return the winds that decide at a motion of the platform in {G}, (6, 1) each, as (3, 1) expressions [m/s]."""
    aero = robot.platform.aero
    return [] if aero is None else winds.decisive(aero, com_velocity(robot, pose, velocity), SMOOTHED)


def decisive_winds_at(winds: WindSet, robot: Robot, pose: np.ndarray, velocity: np.ndarray) -> list[np.ndarray]:
    """Return the winds that decide at many instants, (n, 3) each, from poses and velocities (n, 6)."""
    aero = robot.platform.aero
    return [] if aero is None else _evaluated(winds, aero, _com_velocities(robot, pose, velocity))


def possible_winds_at(winds: WindSet, robot: Robot, pose: np.ndarray, velocity: np.ndarray) -> list[np.ndarray]:
    """Return winds of the set among which the worst is, or nearly so, (n, 3) each, from poses and velocities (n, 6)."""
    aero = robot.platform.aero
    return [] if aero is None else winds.possible(aero, _com_velocities(robot, pose, velocity))


def _com_velocities(robot: Robot, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    symbols = ca.SX.sym("pose", 6), ca.SX.sym("velocity", 6)
    function = ca.Function("com_velocity", [*symbols], [com_velocity(robot, *symbols)])
    return function.map(len(pose))(ca.DM(pose.T), ca.DM(velocity.T)).full().T


def _evaluated(winds: WindSet, aero: Aero, moving: np.ndarray) -> list[np.ndarray]:
    """Return the decisive winds at velocities of the CoM (n, 3), (n, 3) each."""
    symbol = ca.SX.sym("moving", 3)
    function = ca.Function("winds", [symbol], winds.decisive(aero, symbol))
    return [value.full().T for value in function.map(len(moving)).call([ca.DM(moving.T)])]
