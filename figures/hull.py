"""Compute the faces of the convex hull of a body, for pictures."""

import numpy as np

FLAT = 1e-6  # of the largest singular value: thinner bodies are drawn as a plane or a line
SAME_PLANE = 1e-6  # difference of unit normals, and of distances relative to the size of the body


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
