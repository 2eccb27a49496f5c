"""`Scene`: a robot at some instants, as pictures, views and films show it; and regions to keep out of, in files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..base.netcdf import Contents, Variable, numbers_of

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Scene:
    """A robot at k instants; everything in {G} [m]."""

    title: str
    anchors: np.ndarray  # (k, m, 3)
    attachments: np.ndarray  # likewise
    # Origins of the carriers' frames (k, c, 3), and their names; ground carriers are not among them.
    carriers: np.ndarray
    names: list[str]  # likewise
    bodies: list[np.ndarray]  # for each carrier the indices of its cables; three or more anchors are drawn as a body
    boxes: list[tuple[np.ndarray, np.ndarray]]  # corners (low, high) of reach boxes
    tensions: np.ndarray  # (k, m) [N], nan where there are none
    t_min: np.ndarray  # (m,) [N]
    t_max: np.ndarray  # likewise
    # Circles in which rotors turn, (k, r, p, 3); default: none.
    rotors: np.ndarray = field(default_factory=lambda: np.zeros((1, 0, 2, 3)))
    # Points of the platform's surface, (k, n, 3), whose hull is drawn; default: the attachments.
    surface: np.ndarray | None = None
    cut: np.ndarray | None = None  # which cables have been cut, (k, m); None if none are
    # Origin of the platform's frame (n, 3) over times [s] of their own, fine enough for a smooth trail; default: none.
    path: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    path_times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    path_missing: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))  # where no tensions give the motion
    # For each region to keep out of, the lines that outline it, (n, 3) each; default: none.
    obstacles: list[list[np.ndarray]] = field(default_factory=list)

    @property
    def platform(self) -> np.ndarray:
        """Return the points whose hull is drawn as the platform, (k, n, 3)."""
        return self.attachments if self.surface is None else self.surface

    @property
    def points(self) -> np.ndarray:
        """Return all points of the robot and of its path at all instants, (n, 3)."""
        parts = (self.anchors, self.attachments, self.platform, self.path, self.carriers, self.rotors, *self.boxes)
        return np.vstack([np.reshape(part, (-1, 3)) for part in parts])

    @property
    def standing(self) -> np.ndarray:
        """Return the indices of the cables whose anchors never move."""
        return np.setdiff1d(np.arange(self.anchors.shape[1]), np.concatenate([np.zeros(0, int), *self.bodies]))


def outline_variables(regions: Sequence[Sequence[np.ndarray]]) -> dict[str, Variable]:
    """Return the lines (n, 3) in {G} [m] of each region as variables; none without regions."""
    lines = [(number, line) for number, region in enumerate(regions, 1) for line in region]
    if not lines:
        return {}
    points = np.concatenate([np.append(line, np.full((1, 3), np.nan), axis=0) for _, line in lines])
    numbers = np.repeat([number for number, _ in lines], [len(line) + 1 for _, line in lines])
    about = "lines along the regions to keep out of in G, nan after each line"
    return {
        "keep_out": Variable(("outline", "axis"), points, {"units": "m", "long_name": about}),
        "keep_out_region": Variable(("outline",), numbers, {"long_name": "region of each point, from 1"}),
    }


def outlines_from(dataset: xr.Dataset | Contents, where: str) -> list[list[np.ndarray]]:
    """Return the lines of each region that a dataset, named `where` in errors, has; none without regions.

    Raises `InputError` if its variables are no outlines.
    """
    contents = dataset if isinstance(dataset, Contents) else Contents.of(dataset)
    if contents.get("keep_out") is None:
        return []
    points = numbers_of(contents, "keep_out", (-1, 3), where, gaps=True)
    numbers = numbers_of(contents, "keep_out_region", (len(points),), where)
    gaps = np.isnan(points[:, 0])
    regions: dict[float, list[np.ndarray]] = {}
    for rows in np.split(np.arange(len(points)), np.flatnonzero(gaps) + 1):
        if len(line := points[rows[~gaps[rows]]]):
            regions.setdefault(float(numbers[rows[0]]), []).append(line)
    return list(regions.values())
