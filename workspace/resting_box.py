"""The largest box of positions about home at which tensions hold the platform at rest: where a first path may lead."""

from typing import NamedTuple

import numpy as np

from ..models import Robot
from ..models.diagnosis import too_weak
from .condition import Places
from .feasibility import feasible, rest_wrench
from .region import room, surrounding_box

ROUNDING = 1e-9  # [m]
STEPS = 10  # from the middle of the grid to each of its sides


class RestingBox(NamedTuple):
    """Positions of the platform at which it can rest in its home attitude, its tensions inside their limits."""

    # corners in {G}, (3,) [m]; infinite where nothing bounds the box. A locked coordinate has its home value in both.
    low: np.ndarray
    high: np.ndarray
    # the position about which the box was grown, (3,) [m]: home, or the nearest sample at which it can rest
    centre: np.ndarray
    samples: int  # how many positions were tried; 0 where none is needed, since carriers move along with the platform
    spacing: np.ndarray  # distance of neighbouring samples in the box along each axis, (3,) [m]
    resting: np.ndarray  # the samples about home and anchors at which it can rest, (k, 3) in {G} [m]


def resting_box(robot: Robot) -> RestingBox | None:
    """Return the largest box along the axes of {G} about home on whose grid of samples the platform can rest, or None.

    All of it is above the floor and in the room of the robot's file, with the body of the platform.
    Carriers stay at home. Where cables keep their lengths, the carriers move along with the platform instead, and the
    box is where their reach allows this.

    A first grid covers the surroundings of home and anchors, a second one the box that the first has found. Between
    samples nothing is checked. If the platform cannot rest at home, the box is about the nearest sample at which it
    can.
    """
    if robot.fixed_lengths is not None:
        return _moved_along(robot)
    low, high = surrounding_box(robot, {})
    centre = robot.home[:3]
    if robot.dof_mask[2]:  # a platform that hangs can be lower than home: down to the floor, which is probably at z = 0
        low[2] = min(low[2], 0.0 if centre[2] > 0 else centre[2] - (high[2] - low[2]) / 2)
    lowest, highest = room(robot)
    low, high = np.maximum(np.minimum(low, centre), lowest), np.minimum(np.maximum(high, centre), highest)
    axes = _grid(robot, np.minimum(low, centre), centre, np.maximum(high, centre))
    able = _can_rest(robot, axes)
    resting = _nodes(axes)[able]
    if not len(resting):
        return None
    centre = resting[np.argmin(np.linalg.norm(resting - centre, axis=1))]
    low, high = largest_box(able, axes, centre, around=1)
    axes = _grid(robot, low, centre, high)
    finer = _can_rest(robot, axes) | (_nodes(axes) == centre).all(axis=-1)  # as the first grid has found
    low, high = largest_box(finer, axes, centre)
    spacing = np.array([np.diff(a).max(initial=0.0) for a in axes])
    return RestingBox(low, high, centre, able.size + finer.size, spacing, resting)


def largest_box(
    able: np.ndarray, axes: list[np.ndarray], centre: np.ndarray, around: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the box of largest volume that contains a node and only nodes that are able.

    - `able`: flags of the nodes of a grid, (nx, ny, nz); the flag of `centre` is true.
    - `axes`: coordinates of the nodes along each axis, rising. An axis with one node is left out of the volume.
    - `centre`: the node, (3,).
    - `around`: how many nodes more to go on every side, where there are so many.
    """
    middle = [int(np.argmin(abs(axis - at))) for axis, at in zip(axes, centre, strict=True)]
    firsts = [np.arange(at, -1, -1) for at in middle]
    lasts = [np.arange(at, len(axis)) for axis, at in zip(axes, middle, strict=True)]
    # The last of all first along z: of boxes without a volume the narrowest and highest is found.
    firsts[2], lasts[2] = firsts[2][::-1], lasts[2][::-1]
    # Counts of nodes that are not able, in all boxes that begin at the grid's corner, then in boxes about the middle.
    unable = np.pad((~able).cumsum(0).cumsum(1).cumsum(2), ((1, 0),) * 3)
    for first, last in zip(firsts, lasts, strict=True):
        unable = np.moveaxis(unable[last + 1] - unable[first][:, None], (0, 1), (-2, -1))
    widths = [
        axis[last] - axis[first][:, None] if len(axis) > 1 else np.ones((1, 1))
        for axis, first, last in zip(axes, firsts, lasts, strict=True)
    ]
    volume = np.where(unable == 0, np.einsum("ab,cd,ef->abcdef", *widths), -1.0)
    best = np.unravel_index(int(np.argmax(volume)), volume.shape)
    low = [a[max(f[i] - around, 0)] for a, f, i in zip(axes, firsts, best[::2], strict=True)]
    high = [a[min(k[i] + around, len(a) - 1)] for a, k, i in zip(axes, lasts, best[1::2], strict=True)]
    return np.array(low), np.array(high)


def _moved_along(robot: Robot) -> RestingBox | None:
    """Return where the platform can rest with its carriers moved along, if it can rest at home."""
    here = Places.at_home(robot, robot.home)
    held = all(carrier.moves for carrier in robot.carriers) and not too_weak(robot)
    if not held or not feasible(robot, here, rest_wrench(robot)[None])[0]:
        return None
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    for carrier in robot.carriers:
        reach = carrier.motion_limits.reach
        if reach is not None:
            low = np.maximum(low, np.subtract(reach.min, carrier.home[:3]))
            high = np.minimum(high, np.subtract(reach.max, carrier.home[:3]))
    moving, home = robot.dof_mask[:3] > 0, robot.home[:3]
    lowest, highest = room(robot)
    low, high = np.maximum(home + low, lowest), np.minimum(home + high, highest)
    low, high = np.where(moving, low, home), np.where(moving, high, home)
    return RestingBox(low, high, home, 0, np.zeros(3), np.zeros((0, 3)))


def _grid(robot: Robot, low: np.ndarray, centre: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Return the coordinates of a grid along each axis that can move, from `low` to `high`, `centre` included."""
    return [
        np.unique(np.concatenate([np.linspace(a, c, STEPS + 1), np.linspace(c, b, STEPS + 1)])) if free else c[None]
        for a, c, b, free in zip(low, centre, high, robot.dof_mask[:3] > 0, strict=True)
    ]


def _nodes(axes: list[np.ndarray]) -> np.ndarray:
    """Return the nodes of a grid, (nx, ny, nz, 3)."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def _can_rest(robot: Robot, axes: list[np.ndarray]) -> np.ndarray:
    """Return at which nodes of a grid the platform can rest, (nx, ny, nz) of bool."""
    nodes = _nodes(axes)
    poses = np.tile(robot.home, (*nodes.shape[:3], 1))
    poses[..., :3] = nodes
    able = feasible(robot, Places.at_home(robot, poses.reshape(-1, 6)), rest_wrench(robot)[None])
    lowest, highest = room(robot)
    inside = ((nodes >= lowest - ROUNDING) & (nodes <= highest + ROUNDING)).all(axis=-1)
    return able.reshape(nodes.shape[:3]) & inside
