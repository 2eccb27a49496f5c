"""`Polyhedron`: the convex hull of points, as its faces and edges; `read_stl`: points from an STL file."""

import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..base.inputs import InputError, printable
from ..base.reading import read_bytes
from .part import LARGEST

MOST_FACES = 200  # what a distance costs grows with them
FLAT = 1e-9  # of the largest extent: thinner bodies have no inside
SAME_PLANE = 1e-6  # difference of unit normals, and of distances relative to the size: files have 7 digits
LARGEST_FILE = 50_000_000  # [bytes], of text with as many triangles
MOST = 250_000  # triangles
HEADER = 84  # bytes of a binary file before its triangles
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")  # in small letters
MARK = b"\xef\xbb\xbf"  # with which some editors begin a text in UTF-8


class Polyhedron(NamedTuple):
    """A convex body between planes."""

    normals: np.ndarray  # outward, of length one, one row a face, (f, 3) [-]
    offsets: np.ndarray  # distance of each face's plane from the origin along its normal, (f,) [m]
    edges: np.ndarray  # the two ends of each edge, (e, 2, 3) [m]
    corners: np.ndarray  # (k, 3) [m]

    @property
    def size(self) -> float:
        """Return the diagonal of the box around the corners [m]."""
        return float(np.linalg.norm(np.ptp(self.corners, axis=0)))

    def beyond(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (..., 3) are beyond the plane of each face, (..., f) [m]; all negative inside."""
        return points @ self.normals.T - self.offsets


@lru_cache(maxsize=64)
def polyhedron(points: tuple[tuple[float, float, float], ...]) -> Polyhedron:
    """Return the convex hull of points [m], computed once; `convex_hull` has the errors."""
    return convex_hull(np.array(points, dtype=float))


def convex_hull(points: np.ndarray) -> Polyhedron:
    """Return the convex hull of points (n, 3) [m]; faces that lie in one plane up to `SAME_PLANE` are one.

    Raises `ValueError` if the points lie in one plane, or the hull has more than `MOST_FACES` faces.
    """
    from scipy.spatial import ConvexHull  # loads for longer than most tasks take, which need none

    places = np.unique(points, axis=0)
    middle = places.mean(axis=0)
    arms = places - middle
    sizes = np.linalg.svd(arms, compute_uv=False) if len(arms) > 3 else np.zeros(3)
    if sizes[2] <= FLAT * sizes[0]:
        raise ValueError(f"must span a body, got {len(places)} different points in one plane or less")
    hull = ConvexHull(arms)
    size = float(np.linalg.norm(arms, axis=1).max())
    face_of, firsts = _faces_of(hull.equations / [1, 1, 1, size])
    normals = hull.equations[firsts, :3]
    corners = arms[hull.vertices]
    offsets = (corners @ normals.T).max(axis=0)  # the plane of the first triangle may cut off what others have
    edges = _edges(hull.simplices, hull.neighbors, face_of)
    return Polyhedron(normals, offsets + normals @ middle, places[edges], places[hull.vertices])


def _faces_of(planes: np.ndarray) -> tuple[np.ndarray, list[int]]:
    """Return the number of the face of each triangle, (n,), and a triangle of each, from their planes (n, 4)."""
    face_of, firsts = np.zeros(len(planes), dtype=int), list[int]()
    for triangle, plane in enumerate(planes):
        same = np.flatnonzero(np.abs(planes[firsts] - plane).max(axis=1) < SAME_PLANE)
        face_of[triangle] = same[0] if same.size else len(firsts)
        if not same.size:
            firsts.append(triangle)
            if len(firsts) > MOST_FACES:
                raise ValueError(f"must have a convex hull of at most {MOST_FACES} faces, got more")
    return face_of, firsts


def _edges(triangles: np.ndarray, neighbours: np.ndarray, face_of: np.ndarray) -> np.ndarray:
    """Return the pairs of points (e, 2) between triangles of different faces."""
    edges = []
    for triangle, (ends, beside) in enumerate(zip(triangles, neighbours, strict=True)):
        for opposite in range(3):  # the neighbour of that number shares the other two points
            if triangle < beside[opposite] and face_of[triangle] != face_of[beside[opposite]]:
                edges.append(np.delete(ends, opposite))
    return np.array(edges)


def read_stl(path: Path) -> np.ndarray:
    """Return the corners of all triangles of a file, (n, 3, 3), in the file's unit, which STL does not state.

    Raises `InputError` if it cannot be read, is cut off or has no triangles, or coordinates that are not finite;
    one line that names the file.
    """
    where, content = printable(path.name), read_bytes(path, "an STL file", LARGEST_FILE)
    count = int.from_bytes(content[HEADER - 4 : HEADER], "little") if len(content) >= HEADER else 0
    begins = content[:HEADER].removeprefix(MARK).lstrip()
    if begins[:5].lower() == b"solid" and len(content) != HEADER + RECORD.itemsize * count:
        triangles = _from_text(content.lower(), where)
    else:
        triangles = _from_binary(content, count, where)
    if not len(triangles):
        raise InputError(f"{where} must have triangles, got none")
    wrong = np.flatnonzero(~(np.abs(triangles) <= LARGEST).all(axis=(1, 2)))
    if wrong.size:
        raise InputError(
            f"{where} must have finite coordinates up to {LARGEST:g}, got others in triangle {wrong[0] + 1}"
        )
    return triangles


def _from_binary(content: bytes, count: int, where: str) -> np.ndarray:
    size = HEADER + RECORD.itemsize * count
    if len(content) < HEADER:
        raise InputError(f"{where} must be an STL file, got {len(content)} bytes, fewer than its header has")
    if size > LARGEST_FILE:  # four bytes of anything else are a number too
        raise InputError(f"{where} must be an STL file, got other content")
    if len(content) < size:
        stated = f"the {count} triangles that its header states, {size} bytes"
        raise InputError(f"{where} must have {stated}, got {len(content)} bytes")
    _check_count(count, where)
    with np.errstate(invalid="ignore"):  # of a signalling nan, which is refused with the others
        return np.frombuffer(content, RECORD, count, HEADER)["corners"].astype(float)


def _from_text(content: bytes, where: str) -> np.ndarray:
    _check_count(content.count(b"vertex") // 3, where)
    vertices = VERTEX.findall(content)
    if b"endsolid" not in content or len(vertices) % 3 or len(vertices) != content.count(b"vertex"):
        raise InputError(f"{where} must be an STL file, got text that is cut off after {len(vertices)} vertices")
    try:
        return np.array(vertices, dtype="S32").astype(float).reshape(-1, 3, 3)
    except ValueError:
        raise InputError(f"{where} must have numbers as coordinates, got a vertex with another word") from None


def _check_count(count: int, where: str) -> None:
    """Raise InputError if there are so many triangles that reading them takes too much time and memory."""
    if count > MOST:
        raise InputError(f"{where} must have at most {MOST} triangles, got {count}")
