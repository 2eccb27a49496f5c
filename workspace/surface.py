"""Convert the counts of a workspace to a surface coloured by capacity margin, with cutting planes along the axes."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.display import Displayed
from ..models import Robot
from .boundary_mesh import Mesh, boundary_of_values
from .condition import Places
from .conditions.margin import Margin
from .domain import Domain
from .region import Region

if TYPE_CHECKING:
    import xarray as xr

ENOUGH = 3  # samples of a block of cells, on average
MOST_BLOCKS = 24  # along an axis
BANDS = 8  # of colour


@dataclass(frozen=True, eq=False)
class Surface(Displayed):
    """The boundary of a workspace, and the margins inside it."""

    mesh: Mesh  # the boundary
    axes: tuple[np.ndarray, ...]  # coordinates of the grid's points along each axis of {G} [m]
    shares: np.ndarray  # accepted fraction of the samples at each point of the grid
    # Capacity margin at rest at each point of the grid with attitude and carriers at home [N], at least 0.
    margins: np.ndarray

    @property
    def largest(self) -> float:
        """Return the largest margin of an accepted point [N]."""
        return float(self.margins[self.shares > 0.5].max(initial=0.0))

    def bands(self, most: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return vertices (n, 3) [m] and faces (k, 3) of `BANDS` parts of the surface, from small to large margins.

        Parts with a coordinate above `most` (3,) [m] are left out, and the planes through `most` close the cuts.
        """
        vertices, faces = self.mesh.vertices, self.mesh.faces
        pieces = [(vertices, faces[np.all(vertices[faces] <= most + 1e-9, axis=(1, 2))])]
        pieces += [self._cut(axis, most) for axis in range(3) if most[axis] < vertices[:, axis].max(initial=-np.inf)]
        every = np.concatenate([points for points, _ in pieces])
        starts = np.cumsum([0, *(len(points) for points, _ in pieces)])
        corners = np.concatenate([part + start for (_, part), start in zip(pieces, starts, strict=False)])
        level = _at(self.margins, self.axes, every)[corners].mean(axis=1) / (self.largest or 1.0)
        band = np.clip((BANDS * level).astype(int), 0, BANDS - 1)
        return [_compact(every, corners[band == number]) for number in range(BANDS)]

    def _cut(self, axis: int, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices and faces of the plane across an axis at `most`, where it is inside."""
        others = [k for k in range(3) if k != axis]
        low, high = self.mesh.vertices.min(axis=0), self.mesh.vertices.max(axis=0)
        lines = [np.linspace(low[k], high[k], 3 * len(self.axes[k])) for k in others]
        points = np.empty((len(lines[0]), len(lines[1]), 3))
        points[..., others[0]], points[..., others[1]] = np.meshgrid(*lines, indexing="ij")
        points[..., axis] = most[axis]
        inside = (_at(self.shares, self.axes, points) > 0.5) & (points <= most + 1e-9).all(axis=-1)
        number = np.arange(inside.size).reshape(inside.shape)
        corners = (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
        quads = np.stack(corners, axis=-1).reshape(-1, 4)
        quads = quads[inside.ravel()[quads].all(axis=1)]
        return points.reshape(-1, 3), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def surface(dataset: xr.Dataset, robot: Robot, within: float = np.inf) -> Surface | None:
    """Return the surface of a dataset of `workspace.sample`; None if it has none.

    It has none if it is flat, if it has no usable counts or cells, if a coordinate of a cell is above `within` [m], or
    if no cell has at least half of its samples accepted.

    Cells are joined into blocks that have enough samples. The surface encloses the blocks in which at least half of
    the samples are accepted, or any sample if attitudes or carriers vary. Raises `InputError` if scikit-image is
    not installed.
    """
    if not _has_counts(dataset, within):
        return None
    tried, reached = (dataset[name].to_numpy().astype(float) for name in ("tried", "reached"))
    if min(tried.shape) < 4 or not reached.any():
        return None
    joined = 1
    while -(-max(tried.shape) // joined) > MOST_BLOCKS or tried.sum() * joined**3 < ENOUGH * tried.size:
        joined += 1
        if min(tried.shape) < 4 * joined:  # here, because a file may state that no sample was tried at all
            return None
    axes, ends = [], []
    for name in "xyz":
        places = dataset[name].to_numpy().astype(float)
        edge = places[1] - places[0]
        axes.append(places[0] + edge * (joined * np.arange(-(-len(places) // joined)) + (joined - 1) / 2))
        ends.append((places[0] - edge / 2, places[-1] + edge / 2))  # the last block may be of fewer cells
    tried, reached = (_joined(counts, joined) for counts in (tried, reached))
    shares = (reached > 0).astype(float) if _varies(dataset, robot) else reached / np.maximum(tried, 1.0)
    mesh = _boundary(shares, axes, np.array(ends))
    if not len(mesh.faces):  # nowhere are half of the samples accepted
        return None
    poses = np.tile(robot.home, (shares.size, 1))
    poses[:, :3] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    margins = Margin().margins(robot, Places.at_home(robot, poses)).reshape(shares.shape)
    return Surface(mesh, tuple(axes), shares, np.maximum(np.nan_to_num(margins, nan=0.0, posinf=0.0), 0.0))


def _has_counts(dataset: xr.Dataset, within: float) -> bool:
    """Return whether a file has finite counts in evenly spaced cells, with no coordinate above `within` [m]."""
    if any(name not in dataset or dataset[name].dims != ("x", "y", "z") for name in ("tried", "reached")):
        return False
    values = [dataset[name].to_numpy() for name in ("tried", "reached", "x", "y", "z") if name in dataset.variables]
    if len(values) < 5 or any(value.dtype.kind not in "iuf" or not np.isfinite(value).all() for value in values):
        return False
    steps = [np.diff(axis) for axis in values[2:]]
    even = all(len(step) == 0 or ((step > 0.99 * step[0]).all() and (step < 1.01 * step[0]).all()) for step in steps)
    return even and all(np.abs(axis).max(initial=0.0) <= within for axis in values[2:])


def _varies(dataset: xr.Dataset, robot: Robot) -> bool:
    """Return whether attitudes or carriers of the samples vary, from the region of a file if it has no samples."""
    if "attitude" in dataset or "carrier_position" in dataset:
        return True
    try:
        domain = Domain.of(robot, Region.model_validate(json.loads(dataset.attrs["region"])))
    except (KeyError, TypeError, ValueError, RecursionError):  # the file of another program
        return False
    return domain.attitude_varies or domain.carriers_vary


def _boundary(shares: np.ndarray, axes: list[np.ndarray], ends: np.ndarray) -> Mesh:
    """Return the surface where half of the samples are accepted, closed at the faces of the box of all samples.

    `ends` (3, 2) are the limits of the box [m].
    """
    edges = np.array([axis[1] - axis[0] for axis in axes])
    low, high = (np.array([axis[end] for axis in axes]) for end in (0, -1))
    beyond = boundary_of_values(np.pad(shares - 0.5, 1, mode="edge"), low - edges, high + edges)
    return Mesh(np.clip(beyond.vertices, *ends.T), beyond.faces)


def _joined(counts: np.ndarray, by: int) -> np.ndarray:
    """Return the sums of blocks of `by` counts along each axis."""
    for axis in range(3):
        counts = np.add.reduceat(counts, np.arange(0, counts.shape[axis], by), axis=axis)
    return counts


def _at(values: np.ndarray, axes: tuple[np.ndarray, ...], points: np.ndarray) -> np.ndarray:
    """Return values of a grid at points (..., 3), linear between its points."""
    from scipy.interpolate import RegularGridInterpolator

    outside: Any = None  # extrapolate; the type stubs accept numbers only
    return RegularGridInterpolator(axes, values, bounds_error=False, fill_value=outside)(points)


def _compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices that faces use, and the faces with these vertices renumbered."""
    used, numbers = np.unique(faces, return_inverse=True)
    return vertices[used], numbers.reshape(faces.shape)
