r"""The feasible tensions as a polytope in the null space of the wrench matrix: its corners.

$$
s = Q^T b + N^T \lambda, \qquad lower \le s \le upper, \qquad \lambda \in R^{m - rank}
$$

An interval for m - rank = 1, a polygon for 2 (Mikelsons et al. 2008; Lamaury and Gouttefarde 2013, which walk along the
lines from corner to corner; with at most some tens of lines NumPy meets all of them pairwise in less time than Python
walks once), a polytope beyond, from Qhull.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ....base.tolerances import AT_LIMIT
from ..method import Array, StandardForm

# How far a corner may lie beyond a limit, relative to the size of s.
_SLACK = 1e-12

# Lines that meet at a smaller angle have their corner nowhere.
_PARALLEL = 1e-13

# In units of s, which is of order one: where a missing limit is put. A corner out there means there is no bound.
FAR = 1e8

EMPTY = "the lines of the limits enclose nothing"  # why a method has no point


def corners(form: StandardForm) -> Array | None:
    """Return the corners of the feasible tensions in the null space, shape (corners, m - rank).

    Polygons come in order around their middle; corners may be repeated. No rows if nothing is feasible, or if m - rank
    > 2 and the feasible tensions have no interior: then w is on the very boundary of the available wrench set.

    Returns None if the feasible tensions are unbounded.
    """
    freedom = form.N.shape[0]
    base = form.b @ form.Q
    open_low, open_high = np.isinf(form.lower), np.isinf(form.upper)
    largest = max(np.abs(form.lower[~open_low]).max(initial=0.0), np.abs(form.upper[~open_high]).max(initial=0.0))
    far = FAR * (1.0 + largest)
    low, high = np.where(open_low, -far, form.lower) - base, np.where(open_high, far, form.upper) - base
    vertices = _by_qhull(form.N, low, high) if freedom > 2 else meet(form.N, low, high)
    s = base + vertices @ form.N
    if ((s < -0.1 * far) & open_low).any() or ((s > 0.1 * far) & open_high).any():
        return None
    if freedom == 2 and vertices.shape[0] > 2:
        around = vertices - vertices.mean(axis=0)
        vertices = vertices[np.argsort(np.arctan2(around[:, 1], around[:, 0]))]
    return vertices


def simplex_centroid(points: Array) -> Array:
    """Return the centroid of a convex polytope from its corners, shape (m - rank,); of a flat one, of its extent."""
    freedom = points.shape[1]
    if freedom == 0:
        return np.zeros(0)
    middle = points.mean(axis=0)
    around = points - middle
    if freedom == 1:
        return 0.5 * (points.min(axis=0) + points.max(axis=0))
    if freedom == 2:
        following = np.roll(around, -1, axis=0)
        simplices = np.stack([around, following], axis=1)  # (corners, 2, 2), each with the middle a triangle
    else:
        from scipy.spatial import ConvexHull

        simplices = around[ConvexHull(around, qhull_options="QJ").simplices]
    volumes = np.abs(np.linalg.det(simplices))
    size = np.abs(around).max()
    if volumes.sum() > 1e-13 * size**freedom and size > 0.0:
        # The centroid of a simplex is the mean of its corners, of which one is the middle.
        return middle + volumes @ simplices.sum(axis=1) / ((freedom + 1) * volumes.sum())
    along = np.linalg.svd(around, full_matrices=False)[2][0]
    reach = around @ along
    return middle + 0.5 * (reach.min() + reach.max()) * along


def meet(N: Array, low: Array, high: Array, zero: Array | None = None) -> Array:
    """Meet the lines N^T lambda = low and = high with each other and keep what is inside them.

    Args:
        N: Null space, shape (m - rank, k), with m - rank = 0, 1 or 2.
        low, high: Limits of N^T lambda, shape (k,), finite.
        zero: One more value of each row to meet at, shape (k,), or None.

    Returns:
        The points, shape (points, m - rank).
    """
    freedom = N.shape[0]
    lines = [low, high] if zero is None else [low, high, zero]
    normals, offsets = np.concatenate([N.T] * len(lines)), np.concatenate(lines)
    if freedom == 0:
        vertices = np.zeros((1, 0))
    elif freedom == 1:
        moves = np.abs(normals[:, 0]) > _PARALLEL
        vertices = (offsets[moves] / normals[moves, 0])[:, None]
    else:
        i, j = np.array(list(combinations(range(offsets.size), 2))).T
        cross = normals[i, 0] * normals[j, 1] - normals[i, 1] * normals[j, 0]
        crossing = np.abs(cross) > _PARALLEL
        i, j, cross = i[crossing], j[crossing], cross[crossing]
        x = (offsets[i] * normals[j, 1] - offsets[j] * normals[i, 1]) / cross
        y = (normals[i, 0] * offsets[j] - normals[j, 0] * offsets[i]) / cross
        vertices = np.stack([x, y], axis=1)
    return vertices[inside(vertices @ N, low, high)]


def inside(s: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Return which of the points s, shape (points, k), are inside the limits, but for rounding."""
    slack = _SLACK * (1.0 + np.abs(s).max(axis=1, initial=0.0))[:, None]
    return ((s >= low - slack) & (s <= high + slack)).all(axis=1)


def _by_qhull(N: Array, low: Array, high: Array) -> Array:
    """Return the corners of a polytope with an interior, else none."""
    from scipy.optimize import linprog
    from scipy.spatial import HalfspaceIntersection, QhullError

    rows = np.concatenate([N.T, -N.T])
    limits = np.concatenate([high, -low])
    widths = np.linalg.norm(rows, axis=1)
    rows, limits, widths = rows[widths > _PARALLEL], limits[widths > _PARALLEL], widths[widths > _PARALLEL]
    ball = linprog(
        np.r_[np.zeros(N.shape[0]), -1.0],
        A_ub=np.column_stack([rows, widths]),
        b_ub=limits,
        bounds=(None, None),
        method="highs",
    )
    none = np.zeros((0, N.shape[0]))
    if ball.x is None or ball.x[-1] <= AT_LIMIT:
        return none
    try:
        vertices = HalfspaceIntersection(np.column_stack([rows, -limits]), ball.x[:-1]).intersections
    except QhullError:
        return none
    return vertices if np.isfinite(vertices).all() else none
