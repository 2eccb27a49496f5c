"""`Scene`: a robot at some instants, as pictures, views and films show it; and regions to keep out of, in files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..base.netcdf import Contents, Variable, numbers_of

if TYPE_CHECKING:
    import xarray as xr

FLAT = 1e-6  # of the largest singular value: thinner bodies are drawn as a plane or a line
SAME_PLANE = 1e-6  # difference of unit normals, and of distances relative to the size of the body


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


def faces(points: np.ndarray) -> list[np.ndarray]:
    """Return the corners of each face of the convex hull of `points` (k, 3) as indices, in order around the face.

    A flat body has one face, a body that is a line or a point has none.
    """
    from scipy.spatial import ConvexHull

    rank, axes = extent(points)
    arms = points - points.mean(axis=0) if len(points) else points
    if rank < 2:
        return []
    if rank == 2:
        return [ConvexHull(arms @ axes[:2].T).vertices]
    # Qhull cuts each face into triangles; triangles in one plane become one face again.
    hull = ConvexHull(arms)
    size = float(np.linalg.norm(arms, axis=1).max())
    planes: list[tuple[np.ndarray, set[int]]] = []
    for equation, triangle in zip(hull.equations / [1, 1, 1, size], hull.simplices, strict=True):
        for plane, corners in planes:
            if np.abs(plane - equation).max() < SAME_PLANE:
                corners.update(triangle.tolist())
                break
        else:
            planes.append((equation, set(triangle.tolist())))
    return [_around(arms, np.array(sorted(corners)), plane[:3]) for plane, corners in planes]


def outline(points: np.ndarray) -> np.ndarray:
    """Return the corners (c, 2) of the convex hull of points (k, 2), in order; a line has its two ends, a point one."""
    from scipy.spatial import ConvexHull

    rank, axes = extent(points)
    if rank == 2:
        return points[ConvexHull(points).vertices]
    along = points @ axes[0]
    return points[[int(along.argmin()), int(along.argmax())]] if rank == 1 else points[:1]


def extent(points: np.ndarray) -> tuple[int, np.ndarray]:
    """Return in how many dimensions points (k, d) extend, and the axes (d, d) of their extent, longest first."""
    if not len(points):
        return 0, np.eye(points.shape[1])
    _, sizes, axes = np.linalg.svd(points - points.mean(axis=0))
    return int((sizes > FLAT * max(float(sizes[0]), 1e-9)).sum()), axes


def _around(points: np.ndarray, corners: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the corners of a convex face in order of their angle about its centre."""
    arms = points[corners] - points[corners].mean(axis=0)
    first = arms[np.linalg.norm(arms, axis=1).argmax()]
    return corners[np.argsort(np.arctan2(arms @ np.cross(normal, first), arms @ first))]
