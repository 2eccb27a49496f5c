"""Capacity margins of many wrenches at once, and their derivatives with respect to the wrench matrix.

`capacity_margin` projects one wrench and certifies it; here the least reserve along the normals of the facets is
computed for thousands, by the Gale dual of A in the numeric core, and from the facets themselves where A is close to a
matrix of lower rank.
"""

from functools import lru_cache
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from .. import core
from ..core import MARGIN_CABLES, ROWS
from .available_wrench import facets

_BESIDE = 1e-9  # of the wrench, or of 1 N: this far from the plane of a flat set, a wrench is not in it


class Reserves(NamedTuple):
    """Reserves along single normals, and what their derivatives are made of; K rows.

    The derivative of a value is direction tensions' with respect to A, -direction with respect to w, and
    max(pull, 0) and min(pull, 0) with respect to t_max and t_min.
    """

    value: np.ndarray  # (K,) [N]
    direction: np.ndarray  # (K, n), outward normal of length one
    tensions: np.ndarray  # (K, m), at the nearest point of the facet's plane [N]
    pull: np.ndarray  # (K, m), of each cable along the normal


def margins(
    A: np.ndarray, w: np.ndarray, t_min: np.ndarray, t_max: np.ndarray, every: np.ndarray | None = None
) -> np.ndarray:
    """Return signed distances of wrenches from the boundary of the available wrench set, (N,) [N].

    Inside, they are positive and equal to `capacity_margin`, also for a flat set. Outside, they are negative bounds:
    the distance is at least as large, and equal if a facet is closest. Where A is not finite, the margin is -inf.

    - `A`: (N, n, m), rows of one unit [N per N].
    - `w`: required wrenches, (N, n), or one for all, (n,) [N].
    - `t_min`, `t_max`: finite limits, (m,) each [N].
    - `every`: filled with what `all_reserves` returns, (N, K) [N].
    """
    _, n, m = A.shape
    result = np.full(len(A), np.nan)
    if len(A) and n <= m and n <= ROWS and m <= MARGIN_CABLES and (t_min < t_max).all():
        core.margins(np.ascontiguousarray(A), np.ascontiguousarray(w), t_min, t_max, result, every)
    unsure = np.flatnonzero(np.isnan(result))
    result[unsure] = -np.inf
    real = unsure[np.isfinite(A[unsure]).all(axis=(1, 2))]
    if real.size:
        result[real], along, full = _by_facets(A[real], w if w.ndim == 1 else w[real], t_min, t_max)
        if every is not None:
            every[real] = np.inf
            every[real, 0] = result[real]
            if along.shape[1] == every.shape[1]:
                every[real[full]] = along[full]
    return result


def all_reserves(A: np.ndarray, w: np.ndarray, t_min: np.ndarray, t_max: np.ndarray) -> np.ndarray:
    """Return the reserves along all normals that may belong to facets, (N, K) [N]; the least is the margin.

    Arguments as for `margins`. Normal k is orthogonal to the k-th subset of n - 1 columns in lexicographic
    order; the reserve may be infinite where these depend on each other. Of a flat set, and with a cable that has no
    choice, only the margin is given, as the first.
    """
    _, n, m = A.shape
    found = np.full((len(A), comb(m, n - 1)), np.inf)
    margins(A, w, t_min, t_max, found)
    return found


def reserves(A: np.ndarray, w: np.ndarray, t_min: np.ndarray, t_max: np.ndarray, normal: np.ndarray) -> Reserves:
    """Return the reserves along one normal of each A, with their derivatives.

    - `A`, `w`, `t_min`, `t_max`: as for `margins`.
    - `normal`: number of the normal in `all_reserves`, (N,).
    """
    _, n, m = A.shape
    inside = subsets_inside(n, m)[normal]
    Q, R = np.linalg.qr(np.take_along_axis(A, inside[:, None, :], axis=2), mode="complete")  # columns of the facets
    direction = Q[:, :, -1]
    pull = np.einsum("ki,kim->km", direction, A)
    np.put_along_axis(pull, inside, 0.0, axis=1)
    along = np.einsum("ki,...i->k", direction, w) if w.ndim == 1 else np.einsum("ki,ki->k", direction, w)
    ahead = np.maximum(pull * t_max, pull * t_min).sum(axis=1) - along
    behind = np.maximum(-pull * t_max, -pull * t_min).sum(axis=1) + along
    sign = np.where(ahead <= behind, 1.0, -1.0)
    direction, pull, value = sign[:, None] * direction, sign[:, None] * pull, np.minimum(ahead, behind)
    tensions = np.where(pull > 0.0, t_max, t_min)
    np.put_along_axis(tensions, inside, 0.0, axis=1)
    left = w + value[:, None] * direction - np.einsum("kim,km->ki", A, tensions)
    R = R[:, : n - 1]
    usable = np.abs(np.diagonal(R, axis1=1, axis2=2)).min(axis=1, initial=np.inf) > 0.0
    R[~usable] = np.eye(n - 1)
    inner = np.linalg.solve(R, np.einsum("kij,ki->kj", Q[:, :, : n - 1], left)[..., None])[..., 0]
    np.put_along_axis(tensions, inside, inner, axis=1)
    return Reserves(value, direction, tensions, pull)


@lru_cache(maxsize=16)
def subsets_inside(n: int, m: int) -> np.ndarray:
    """Return the columns inside each facet, (K, n - 1)."""
    return np.array(list(combinations(range(m), n - 1)), dtype=np.intp).reshape(comb(m, n - 1), n - 1)


def _by_facets(
    A: np.ndarray, w: np.ndarray, t_min: np.ndarray, t_max: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the margins, the reserves along all normals, and whether the set is not flat."""
    walls = facets(A, t_min, t_max)
    w = np.broadcast_to(w, walls.offset.shape)
    along = np.einsum("nki,ni->nk", walls.normals, w)
    along = np.minimum(walls.high - along, along - walls.low)
    inside = along.min(axis=1)
    beside = np.linalg.norm(np.einsum("nij,nj->ni", walls.outside, w - walls.offset), axis=1)
    outside = beside > _BESIDE * np.maximum(np.linalg.norm(w, axis=1), _BESIDE)
    margin = np.where(outside, -np.hypot(beside, np.minimum(inside, 0.0)), inside)
    return margin, along, np.logical_not(walls.outside.any(axis=(1, 2)))
