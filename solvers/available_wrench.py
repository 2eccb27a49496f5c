"""The available wrench set as half-spaces, for many wrench matrices at once: `facets`.

The set {A t : t_min <= t <= t_max} is a zonotope. The normals of its facets are orthogonal to rank - 1 columns of A,
and the facets lie at the support values along them: hyperplane shifting (Bouchard, Gosselin, Moore 2010; Gouttefarde,
Krut 2010). `solvers.capacity_margin` has the nearest of them for one wrench; here are all of them for many matrices.
"""

from dataclasses import dataclass
from math import comb

import numpy as np

from .. import core
from ..base.display import Displayed
from ..core import CABLES, ROWS, full_rank

RANK = 1e-9  # relative: directions that the cables hardly reach are none; twelve-digit geometry makes such


@dataclass(frozen=True)
class Facets(Displayed):
    """Half-spaces of N available wrench sets.

    w is available if and only if low <= normals @ w <= high and outside @ (w - offset) = 0.
    """

    # (N, K, n), of length one. Directions that are no facet's are among them; they do no harm, as each of them bounds
    # the set where it ends.
    normals: np.ndarray
    low: np.ndarray  # the minimum and the maximum along each normal, (N, K) [N]
    high: np.ndarray  # (N, K)
    # Projection on the wrenches that no tensions can give, (N, n, n); zero where A has n independent columns.
    outside: np.ndarray
    offset: np.ndarray  # A wrench of the set's plane, (N, n) [N]


def facets(A: np.ndarray, t_min: np.ndarray, t_max: np.ndarray) -> Facets:
    """Describe the available wrench sets of many wrench matrices by half-spaces.

    - `A`: (N, n, m), rows of one unit: moments divided by a length [N per N]. Where its columns do not span R^n the
      half-spaces are those inside their span.
    - `t_min`, `t_max`: finite limits, (m,) each [N]. A cable with equal ones has no choice and shifts the set.

    There are K = C(m, n - 1) normals: 56 for eight cables and six equations.
    """
    moving = t_min < t_max
    columns, low, high = A[:, :, moving], t_min[moving], t_max[moving]
    offset = A[:, :, ~moving] @ t_min[~moving]
    count, n, _ = A.shape
    outside = np.zeros((count, n, n))
    # Points of one rank are described together, so that a flat set here or there does not slow down the others.
    described = []
    for rows, basis in _by_rank(columns):
        inside = columns[rows] if basis is None else basis.transpose(0, 2, 1) @ columns[rows]
        normals, least, most = _full(inside, low, high)
        if basis is not None:
            normals = normals @ basis.transpose(0, 2, 1)
            outside[rows] = np.eye(n) - basis @ basis.transpose(0, 2, 1)
        described.append((rows, normals, least, most))
    normals, least, most = _together(described, count, n)
    if not moving.all():
        shift = np.einsum("nki,ni->nk", normals, offset)
        least, most = least + shift, most + shift
    return Facets(normals, least, most, outside, offset)


def spans(A: np.ndarray) -> np.ndarray:
    """Return whether the columns of each A (N, n, m) span R^n, (N,) of bool."""
    count, n, m = A.shape
    if n > ROWS or m > CABLES:
        sigma = np.linalg.svd(A, compute_uv=False)
        return (m >= n) & (sigma[:, -1] > RANK * sigma[:, 0])
    full = np.zeros(count)
    if A.size:
        full_rank(n, RANK, np.ascontiguousarray(A), full)
    return full > 0


def _by_rank(columns: np.ndarray) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Return rows of equal rank, and an orthonormal basis (k, n, rank) of their columns' span; None for all of R^n."""
    full = spans(columns)
    groups: list[tuple[np.ndarray, np.ndarray | None]] = [(np.flatnonzero(full), None)] if full.any() else []
    flat = np.flatnonzero(~full)
    if flat.size:
        U, sigma, _ = np.linalg.svd(columns[flat])
        ranks = (sigma > RANK * sigma.max(axis=1, initial=np.finfo(float).tiny, keepdims=True)).sum(axis=1)
        groups += [(flat[ranks == rank], U[ranks == rank][:, :, :rank]) for rank in np.unique(ranks)]
    return groups


def _full(columns: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normals (N, K, n) and minimum and maximum along them (N, K), of columns (N, n, m) that span R^n."""
    count, n, m = columns.shape
    if n == 0:
        return np.zeros((count, 1, 0)), np.zeros((count, 1)), np.zeros((count, 1))
    number = comb(m, n - 1)
    normals, least, most = np.empty((count, number, n)), np.empty((count, number)), np.empty((count, number))
    core.facets(np.ascontiguousarray(columns), low, high, normals, least, most)
    return normals, least, most


def _together(
    described: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]], count: int, n: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Put groups of different numbers of facets into common arrays; the first facet fills up what is left."""
    most_facets = max(normals.shape[1] for _, normals, _, _ in described)
    arrays = np.empty((count, most_facets, n)), np.empty((count, most_facets)), np.empty((count, most_facets))
    for rows, *group in described:
        for array, values in zip(arrays, group, strict=True):
            array[rows] = values[:, :1]
            array[rows, : values.shape[1]] = values
    return arrays
