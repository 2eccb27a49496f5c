"""Paper C's workspaces: three robots tow a load, with cables of fixed length, of variable length, or both (section 5).

As in the paper, 60 000 loops each draw a place and ask whether the cables can hold the load there:

- W1, fixed length: robot-ends anywhere in their boxes, any posture in (-1, 1) rad, cables of 1.2 m. The position
  follows: where three spheres about the robot-ends meet, the lower of the two points.
- W2, variable length: robot-ends in the middle of their boxes. The position is uniform in the box of Eq. 15, down to
  the ground; the lengths follow (Eq. 1).
- W3, both: robot-ends anywhere in their boxes, position uniform in the box of all of these.

A loop's share of accepted samples is not the volume of a workspace where the robot-ends move too: a position belongs to
it as soon as one of their placements will do. So volumes come from positions that are uniform in a box and, for each, a
search for a placement and a posture (`ExistsPlacement`), which can miss but not invent: the interval is that of the
positions found, and rises with the tries. From 96 to 1536 of them the volume of W2 stays, W3's grows by 6 %, and W1's,
whose robot-ends have to be at 1.2 m too, by a quarter.

The paper's own figures contradict each other in two ways, whatever the sizes of the boxes, which it does not print.
It says that W1 lies inside W2, but W1 reaches up to 1.38 m by its ranges and W2 to 1.18 m. And with the robot-ends at
the printed x and y and at 1 m, their least height, cables of 1.2 m hold the load at 0.37 m, while W1's least height is
printed as 0.6 m.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ...models import Robot
from ...models.robot import Box, MobileCarrier
from ...workspace import Condition, ExistsPlacement, ForceBalance, Places, make_ready
from ...workspace.three_cable_pose import three_cable_pose
from ...workspace.volume import Volume, volume
from .plans import DRIVES, Drive, robot

__all__ = ["PRINTED", "Loops", "in_prism", "loops", "placed_as_both", "reach", "volume_of"]

LOOPS = 60_000
POSTURE = 1.0  # [rad], the most of each angle
# Ranges of x, y and z in sections 5.1 to 5.3 [m].
PRINTED = {
    "fixed-length": ((1.15, 1.34), (0.7, 1.18), (0.6, 1.38)),
    "variable-length": ((0.31, 2.2), (0.45, 2.0), (0.0, 1.18)),
    "both": ((0.15, 2.3), (0.2, 2.2), (0.0, 1.38)),
}
SECTIONS = [0.6, 0.9, 1.2]  # heights of figure 4 [m]
TRIES = 256


@dataclass(frozen=True, eq=False)
class Loops:
    """What 60 000 loops of one system type found.

    Attributes
    ----------
    robot, places
        The system and where it was asked.
    held
        Where the condition holds, (n,) of bool.
    seconds
        Wall time of drawing and asking.
    """

    robot: Robot
    places: Places
    held: np.ndarray  # (n,)
    seconds: float

    @property
    def points(self) -> np.ndarray:
        """Positions of the platform where the condition holds, (k, 3) [m]."""
        return self.places.pose[self.held, :3]

    @property
    def ranges(self) -> np.ndarray:
        """Least and most of x, y and z, (3, 2) [m]."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)], axis=1)


def loops(drive: Drive, condition: Condition | None = None, count: int = LOOPS, seed: int = 0) -> Loops:
    """Draw places of one system type and ask whether a condition holds there; None: force balance, as the paper's.

    With `EquilibriumPosture` and fixed lengths the places that come back are where the load hangs.
    """
    system, asked = robot("wang-ctmrts", drive), condition or ForceBalance()
    make_ready(system)
    asked.holds(system, Places.at_home(system, system.home))
    start = time.perf_counter()
    places = _draw(system, count, np.random.default_rng([seed, DRIVES.index(drive)]))
    held = asked.holds(system, places)
    return Loops(system, places, held, time.perf_counter() - start)


def volume_of(drive: Drive, samples: int = 20_000, tries: int = TRIES, seed: int = 0) -> Volume:
    """Volume of the positions found where one system type can hold the load, in some placement and posture [m^3].

    No more than that of all of them, up to the interval; the more tries, the nearer.
    """
    system = robot("wang-ctmrts", drive)
    low, high = _box(system)
    rng = np.random.default_rng([seed, 3 + DRIVES.index(drive)])
    poses = np.zeros((samples, 6))
    poses[:, :3] = rng.uniform(low, high, (samples, 3))
    condition = ExistsPlacement(condition=ForceBalance(), tries=tries, turn=POSTURE)
    held = condition.holds(system, Places.at_home(system, poses))
    return volume(int(held.sum()), samples, float(np.prod(high - low)))


def placed_as_both(places: Places) -> np.ndarray:
    """Whether places are in W3 by its definition: above the ground, robot-ends in their boxes, forces balanced."""
    system = robot("wang-ctmrts", "both")
    low, high = reach(system)
    ends = places.carriers[:, :, :3]
    within = np.all((ends >= low - 1e-12) & (ends <= high + 1e-12), axis=(1, 2)) & (places.pose[:, 2] > 0)
    return within & ForceBalance().holds(system, places)


def in_prism(system: Robot, points: np.ndarray) -> np.ndarray:
    """Whether points (n, 3) [m] are in the prism below the three robot-ends at home, (n,) of bool.

    The prism that section 5 speaks of: the shares of the corners are positive, and the plane through them is above.
    """
    ends = system.carrier_home[:, :3]
    corners = np.vstack([ends[:, :2].T, np.ones(3)])
    shares = np.linalg.solve(corners, np.vstack([points[:, :2].T, np.ones(len(points))]))  # (3, n)
    return (shares >= 0).all(axis=0) & (points[:, 2] < shares.T @ ends[:, 2])


def _draw(system: Robot, count: int, rng: np.random.Generator) -> Places:
    """Places of one system type, uniform in what its drive moves."""
    carriers = np.tile(system.carrier_home, (count, 1, 1))
    if system.drive != "variable-length":
        carriers[:, :, :3] = rng.uniform(*reach(system), carriers[:, :, :3].shape)
    angles = rng.uniform(-POSTURE, POSTURE, (count, 3))
    if system.fixed_lengths is not None:
        places = three_cable_pose(system, angles, carriers, system.fixed_lengths)
        return Places(np.concatenate([places, angles], axis=1), carriers)
    low, high = _box(system)
    return Places(np.concatenate([rng.uniform(low, high, (count, 3)), angles], axis=1), carriers)


def reach(system: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Corners of the reach boxes, (3, 3) each [m]."""
    boxes: list[Box] = [carrier.reach for carrier in system.carriers if isinstance(carrier, MobileCarrier)]
    return np.array([box.min for box in boxes]), np.array([box.max for box in boxes])


def _box(system: Robot) -> tuple[np.ndarray, np.ndarray]:
    """The box of Eq. 15, of all places that the robot-ends may have, down to the ground: corners (3,) each [m]."""
    ends = [system.carrier_home[:, :3]] if system.drive == "variable-length" else list(reach(system))
    low, high = np.min(ends, axis=(0, 1)), np.max(ends, axis=(0, 1))
    low[2] = 0.0
    return low, high
