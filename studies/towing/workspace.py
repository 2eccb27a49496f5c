"""Paper C's workspaces: three robots tow a load, with cables of fixed length, of variable length, or both (section 5).

As in the paper, 60 000 loops each draw a pose and check whether the cables can hold the load there:

- W1, fixed length: robot-ends anywhere in their boxes, any posture in (-1, 1) rad, cables of 1.2 m. The position
  follows: where three spheres about the robot-ends meet, the lower of the two points.
- W2, variable length: robot-ends in the middle of their boxes. The position is uniform in the box of Eq. 15, down to
  the ground; the lengths follow (Eq. 1).
- W3, both: robot-ends anywhere in their boxes, position uniform in the box of all of these.

The share of accepted loops is not the volume of a workspace where the robot-ends move too: a position belongs to it if
one placement of the robot-ends holds the load. So volumes come from positions that are uniform in a box and, for each,
a search for a placement and a posture (`ExistsPlacement`). The search can miss positions but accepts none wrongly, so
the volume grows with the tries: from 96 to 1536 tries not at all for W2, by 6 % for W3 and by a quarter for W1, whose
robot-ends must be at 1.2 m too.

The paper does not print the widths of the boxes. With inferred ones a statement may be reproduced, but it differs or is
impossible only if it does for any widths. The paper's own figures contradict each other in two such ways.
It states that W1 lies inside W2, but by its ranges W1 extends up to 1.38 m and W2 to 1.18 m. And with the robot-ends at
the printed x and y and at 1 m, their lowest height, cables of 1.2 m hold the load at 0.37 m, while the lowest height of
W1 is printed as 0.6 m.
"""

from dataclasses import dataclass

import numpy as np

from ...models import Robot
from ...workspace import ExistsPlacement, ForceBalance, Places
from ...workspace.domain import three_cable_pose
from ...workspace.region import reach_boxes
from ...workspace.volume import Volume, volume
from .plans import DRIVES, Drive, robot

LOOPS = 60_000
POSTURE = 1.0  # [rad], largest of each angle
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
    """Results of the loops of one system type."""

    robot: Robot
    places: Places  # the poses that were checked
    held: np.ndarray  # whether forces balance at each, (n,) of bool

    @property
    def points(self) -> np.ndarray:
        """Return the positions of the platform where forces balance, (k, 3) [m]."""
        return self.places.pose[self.held, :3]

    @property
    def ranges(self) -> np.ndarray:
        """Return the smallest and largest x, y and z, (3, 2) [m]."""
        return np.stack([self.points.min(axis=0), self.points.max(axis=0)], axis=1)


def loops(drive: Drive, count: int = LOOPS, seed: int = 0, widths: bool = True) -> Loops:
    """Draw poses of one system type and check whether forces balance there, as in the paper.

    Without `widths` the robot-ends have the printed x and y and any of the printed heights, which all boxes contain,
    however wide.
    """
    system, rng = robot("wang-ctmrts", drive), np.random.default_rng([seed, DRIVES.index(drive)])
    carriers = np.tile(system.carrier_home, (count, 1, 1))
    if drive != "variable-length":
        ends = rng.uniform(*reach(system), carriers[:, :, :3].shape)
        moved = slice(0, 3) if widths else slice(2, 3)
        carriers[:, :, moved] = ends[:, :, moved]
    angles = rng.uniform(-POSTURE, POSTURE, (count, 3))
    if system.fixed_lengths is not None:
        positions = three_cable_pose(system, angles, carriers, system.fixed_lengths)
    else:
        positions = rng.uniform(*_box(system), (count, 3))
    places = Places(np.concatenate([positions, angles], axis=1), carriers)
    return Loops(system, places, ForceBalance().holds(system, places))


def volume_of(drive: Drive, samples: int = 20_000, tries: int = TRIES) -> Volume:
    """Return the volume of positions where one system type can hold the load in some placement and posture [m^3].

    A search for these can miss some, so this is a lower bound up to its interval; it rises with `tries`.
    """
    system = robot("wang-ctmrts", drive)
    low, high = _box(system)
    rng = np.random.default_rng([0, 3 + DRIVES.index(drive)])
    poses = np.zeros((samples, 6))
    poses[:, :3] = rng.uniform(low, high, (samples, 3))
    condition = ExistsPlacement(condition=ForceBalance(), tries=tries, turn=POSTURE)
    held = condition.holds(system, Places.at_home(system, poses))
    return volume(int(held.sum()), samples, float(np.prod(high - low)))


def placed_as_both(places: Places) -> np.ndarray:
    """Return whether poses are in W3 by definition: above the ground, robot-ends in their boxes, forces balanced."""
    system = robot("wang-ctmrts", "both")
    low, high = reach(system)
    ends = places.carriers[:, :, :3]
    within = np.all((ends >= low - 1e-12) & (ends <= high + 1e-12), axis=(1, 2)) & (places.pose[:, 2] > 0)
    return within & ForceBalance().holds(system, places)


def in_prism(system: Robot, points: np.ndarray) -> np.ndarray:
    """Return whether points (n, 3) [m] are in the prism of section 5 below the three robot-ends at home, (n,) of bool.

    There the barycentric coordinates are positive, and the plane through the robot-ends is above.
    """
    ends = system.carrier_home[:, :3]
    corners = np.vstack([ends[:, :2].T, np.ones(3)])
    shares = np.linalg.solve(corners, np.vstack([points[:, :2].T, np.ones(len(points))]))  # (3, n)
    return (shares >= 0).all(axis=0) & (points[:, 2] < shares.T @ ends[:, 2])


def reach(system: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the reach boxes, (3, 3) each [m]."""
    boxes = reach_boxes(system).values()
    return np.array([box.min for box in boxes]), np.array([box.max for box in boxes])


def _box(system: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return corners of the box of Eq. 15 about all positions of the robot-ends, down to the ground, (3,) each [m]."""
    ends = [system.carrier_home[:, :3]] if system.drive == "variable-length" else list(reach(system))
    low, high = np.min(ends, axis=(0, 1)), np.max(ends, axis=(0, 1))
    low[2] = 0.0
    return low, high
