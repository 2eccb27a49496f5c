"""How robots are seen in pictures and films: in perspective, from the front, a little from the side and above.

A robot in a vertical plane is seen flat, along y.
"""

from __future__ import annotations

import numpy as np

from . import style

ALONG = np.array([0.45, -1.0, 0.45]) / np.linalg.norm([0.45, -1.0, 0.45])  # from the robot to the camera
AWAY = 2.2  # of the robot's size: distance of the camera
BELOW = 0.03  # of the robot's size: how far the floor is below its lowest point, if it has no post
CELLS = 10  # of the floor along the robot's size, about
FLAT = 1e-6  # of the robot's size
FLOOR = "#e2e2e2"


class Perspective:
    """The projection of points onto a picture.

    - `low`, `high`, `size`: corners and diagonal of the box around what is shown, in {G} [m].
    - `floor`, `cell`: height of the floor, and edge of its cells [m].
    """

    def __init__(self, points: np.ndarray, standing: bool = False):
        """Show points (k, 3) [m]; a robot `standing` on posts has its floor at z = 0 if that is below and near."""
        self.low, self.high = points.min(axis=0), points.max(axis=0)
        self.size = max(float(np.linalg.norm(self.high - self.low)), 1e-6)
        self.flat = bool(self.high[1] - self.low[1] < FLAT * self.size)  # True if it is in a vertical plane
        lowest = float(self.low[2])
        self.floor = lowest - BELOW * self.size
        if standing and lowest < self.size:
            self.floor = min(lowest if lowest > 0 else self.floor, 0.0)
        self.cell = cell_of(self.size)
        right = np.cross([0.0, 0.0, 1.0], ALONG)
        self._right = right / np.linalg.norm(right)
        self._up = np.cross(ALONG, self._right)
        self._centre = (self.low + self.high) / 2

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Return the places in the picture, (..., 2), of points (..., 3) [m]."""
        if self.flat:
            return points[..., [0, 2]]
        arms = points - self._centre
        scale = AWAY * self.size / np.maximum(AWAY * self.size - arms @ ALONG, 0.1 * self.size)
        return np.stack([arms @ self._right, arms @ self._up], axis=-1) * scale[..., None]

    def depth(self, points: np.ndarray) -> float:
        """Return the mean distance of points (k, 3) from the camera, along its axis [m]."""
        return float(AWAY * self.size - ((points - self._centre) @ ALONG).mean())

    def fit(self, ax: style.Axes, air: float) -> None:
        """Draw the floor, and show what is shown with some `air` around it, a share of its size; no axes in space."""
        corners = np.array(np.meshgrid(*np.stack([self.low, self.high], axis=1))).reshape(3, -1).T
        grid = floor_grid(self.low, self.high, self.cell, self.floor)
        shown = self(corners if self.flat else np.vstack([corners, *grid]))
        low, high = shown.min(axis=0), shown.max(axis=0)
        margin = air * float((high - low).max())
        ax.set_aspect("equal", adjustable="box")
        ax.set_xlim(low[0] - margin, high[0] + margin)
        ax.set_ylim(low[1] - margin, high[1] + margin)
        if self.flat:
            return
        ax.set_axis_off()
        ax.set_xticks([])
        ax.set_yticks([])
        for line in grid:
            ax.plot(*self(line).T, color=FLOOR, linewidth=0.5)


def cell_of(size: float) -> float:
    """Return the edge of the floor's cells for something of a size [m]: 1, 2 or 5 times a power of ten."""
    wanted = size / CELLS
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(step for step in (1, 2, 5) if step * power <= wanted * (1 + 1e-9)))


def floor_grid(low: np.ndarray, high: np.ndarray, cell: float, floor: float) -> list[np.ndarray]:
    """Return the lines (2, 3) of the grid at the height `floor` under a box with the corners low and high, (3,) [m]."""
    first, last = np.floor(low[:2] / cell) * cell, np.ceil(high[:2] / cell) * cell
    lines = []
    for axis in (0, 1):
        for at in np.arange(first[axis], last[axis] + 0.5 * cell, cell):
            lines.append(np.array([[*first, floor], [*last, floor]]))
            lines[-1][:, axis] = at
    return lines
