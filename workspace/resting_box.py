"""The largest box of positions about home at which tensions hold the platform at rest: where a first path may lead."""

from typing import NamedTuple

import numpy as np

from ..models import Robot
from .feasibility import feasible, rest_wrench
from .places import Places
from .region import surrounding_box

STEPS = 10  # from the middle of the grid to each of its sides


class RestingBox(NamedTuple):
    """Positions of the platform at which it can rest in its home attitude, its tensions inside their limits.

    Attributes
    ----------
    low, high
        Corners in {G}, (3,) [m]; infinite where nothing bounds the box. A locked coordinate is that of home in both.
    centre
        The position about which the box was grown, (3,) [m]: home, or the nearest sample at which it can rest.
    samples
        How many positions were tried; 0 where none is needed, since carriers move along with the platform.
    spacing
        Distance of neighbouring samples in the box along each axis, (3,) [m].
    """

    low: np.ndarray
    high: np.ndarray
    centre: np.ndarray
    samples: int
    spacing: np.ndarray


def resting_box(robot: Robot) -> RestingBox | None:
    """Return the largest box along the axes of {G} about home on whose grid of samples the platform can rest, or None.

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
    return RestingBox(low, high, centre, able.size + finer.size, np.array([np.diff(a).max(initial=0.0) for a in axes]))


def largest_box(
    able: np.ndarray, axes: list[np.ndarray], centre: np.ndarray, around: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the box of largest volume that contains a node and only nodes that are able.

    Parameters
    ----------
    able
        Flags of the nodes of a grid, (nx, ny, nz); that of `centre` is true.
    axes
        Coordinates of the nodes along each axis, rising. An axis with one node is left out of the volume.
    centre
        The node, (3,).
    around
        How many nodes more to go on every side, where there are so many.
    """
    x, y, z = (int(np.argmin(abs(axis - at))) for axis, at in zip(axes, centre, strict=True))
    # Of each column: how many nodes below and above the middle are able; -1 if that in the middle is not.
    down = np.cumprod(able[:, :, z::-1], axis=2).sum(axis=2) - 1
    up = np.cumprod(able[:, :, z:], axis=2).sum(axis=2) - 1
    # The same of rectangles of columns, by how many nodes they reach to each side of the middle.
    lower, upper = _least_of_rectangles(down, x, y), _least_of_rectangles(up, x, y)
    steps = np.indices(lower.shape)
    nodes = [(x - steps[0], x + steps[1]), (y - steps[2], y + steps[3]), (z - lower, z + upper)]
    inside = (lower >= 0) & (upper >= 0)
    widths = [
        axis[np.where(inside, last, 0)] - axis[np.where(inside, first, 0)]
        for axis, (first, last) in zip(axes, nodes, strict=True)
        if len(axis) > 1
    ]
    volume = np.where(inside, np.prod(widths, axis=0), -1.0)
    best = np.unravel_index(int(np.argmax(volume)), volume.shape)
    ends = [(max(int(first[best]) - around, 0), int(last[best]) + around) for first, last in nodes]
    low = np.array([axis[first] for axis, (first, _) in zip(axes, ends, strict=True)])
    high = np.array([axis[min(last, len(axis) - 1)] for axis, (_, last) in zip(axes, ends, strict=True)])
    return low, high


def _least_of_rectangles(columns: np.ndarray, x: int, y: int) -> np.ndarray:
    """Return the least value in every rectangle about (x, y), by the nodes to its left, right, front and back."""

    def quadrant(part: np.ndarray) -> np.ndarray:
        return np.minimum.accumulate(np.minimum.accumulate(part, axis=0), axis=1)

    left, right = columns[x::-1], columns[x:]
    return np.minimum(
        np.minimum(quadrant(left[:, y::-1])[:, None, :, None], quadrant(left[:, y:])[:, None, None, :]),
        np.minimum(quadrant(right[:, y::-1])[None, :, :, None], quadrant(right[:, y:])[None, :, None, :]),
    )


def _moved_along(robot: Robot) -> RestingBox | None:
    """Return where the platform can rest with its carriers moved along, if it can rest at home."""
    here = Places.at_home(robot, robot.home)
    if not all(carrier.moves for carrier in robot.carriers) or not feasible(robot, here, rest_wrench(robot)[None])[0]:
        return None
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    for carrier in robot.carriers:
        reach = carrier.motion_limits.reach
        if reach is not None:
            low = np.maximum(low, np.subtract(reach.min, carrier.home[:3]))
            high = np.minimum(high, np.subtract(reach.max, carrier.home[:3]))
    moving, home = robot.dof_mask[:3] > 0, robot.home[:3]
    return RestingBox(np.where(moving, home + low, home), np.where(moving, home + high, home), home, 0, np.zeros(3))


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
    return able.reshape(nodes.shape[:3])
