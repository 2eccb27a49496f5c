"""The boundary of a workspace as a mesh of triangles: marching cubes (scikit-image) on a grid, saved as STL."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ..base.display import Displayed
from ..base.inputs import InputError, finite_array, required, whole_number
from ..base.writing import whole_file
from ..models.files import AnyRobot, as_robot
from ..models.polyhedron import HEADER, RECORD
from .condition import Condition, Places

MOST_CELLS = 512  # along an edge: 10^8 poses at once


@dataclass(frozen=True, eq=False)
class Mesh(Displayed):
    """Triangles, counter-clockwise when seen from outside."""

    vertices: np.ndarray  # vertices in {G}, (n, 3) [m]
    faces: np.ndarray  # indices of vertices, (k, 3); empty if the workspace is

    @property
    def volume(self) -> float:
        """Return the enclosed volume [m^3], by the divergence theorem."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6.0)

    def save(self, path: str | Path) -> Path:
        """Save as binary STL in metres atomically; raise InputError if it cannot be written."""
        corners = self.vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sizes = np.linalg.norm(normals, axis=1, keepdims=True)
        records = np.zeros(len(corners), dtype=RECORD)
        records["normal"], records["corners"] = normals / np.where(sizes > 0, sizes, 1.0), corners
        count = len(records).to_bytes(4, "little")
        with whole_file(Path(path)) as temporary:
            temporary.write_bytes(b"towline workspace, metres".ljust(HEADER - 4) + count + records.tobytes())
        return Path(path)


def boundary(
    robot: AnyRobot,
    condition: Condition,
    low: ArrayLike,
    high: ArrayLike,
    cells: int = 48,
    attitude: ArrayLike | None = None,
) -> Mesh:
    """Compute the boundary of the positions where a condition holds, at one attitude, with the carriers at home.

    Args:
        robot, condition: The robot, and the condition that holds inside the boundary.
        low, high: Corners of the box of positions, (3,) in {G} [m].
        cells: Cells along the longest edge of the box. The mesh is accurate to about half the size of a cell.
        attitude: (roll, pitch, yaw) [rad]; default: the attitude at home.

    Raises:
        InputError: If an argument has a wrong type or value, or the box is flat.
    """
    robot = as_robot(robot)
    required("condition", condition, Condition)
    low, high = finite_array("low", low, (3,)), finite_array("high", high, (3,))
    if not (high > low).all():
        raise InputError(f"low must be below high in all three numbers, got {low.tolist()} and {high.tolist()}")
    whole_number("cells", cells, 2, MOST_CELLS)
    angles = robot.home[3:] if attitude is None else finite_array("attitude", attitude, (3,))
    counts = np.maximum(np.ceil((high - low) / ((high - low).max() / cells)).astype(int), 1) + 1
    axes = [np.linspace(*ends) for ends in zip(low, high, counts, strict=True)]
    poses = np.empty((int(np.prod(counts)), 6))
    poses[:, :3] = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    poses[:, 3:] = angles
    held = condition.holds(robot, Places.at_home(robot, poses))
    return boundary_of_values(held.reshape(counts) - 0.5, low, high)


def boundary_of_values(values: np.ndarray, low: np.ndarray, high: np.ndarray) -> Mesh:
    """Compute the zero level set of values on a grid, positive inside; it is closed at the faces of the box.

    `values`: (a, b, c), at points evenly spaced from `low` to `high`, ends included, two or more along each axis.
    """
    try:
        from skimage.measure import marching_cubes
    except ImportError:
        raise InputError("boundary needs scikit-image: pip install 'towline[mesh]'") from None
    if not (values > 0).any():
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.intp))
    spacing = (np.asarray(high) - low) / (np.array(values.shape) - 1)
    # A layer of cells outside the box counts as outside, so that the mesh is closed.
    padded = np.pad(values, 1, constant_values=float(min(values.min(), -values.max())))
    vertices, faces, _, _ = marching_cubes(padded, 0.0, spacing=tuple(spacing), gradient_direction="ascent")
    # Vertices in the layer are moved back to the box.
    return Mesh(np.clip(vertices - spacing + low, low, high), faces.astype(np.intp))
