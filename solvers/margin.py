"""Margins of the required wrench to the boundary of the available wrench set: `capacity_margin`, and of many at once.

The available wrench set is a zonotope, the sum of one segment per cable. Each of its facets is parallel to rank - 1
columns of A, so the normals are among the directions d orthogonal to rank - 1 columns, and the facet lies at the
support value h(d): hyperplane shifting (Bouchard, Gosselin, Moore 2010; Gouttefarde, Krut 2010). No other direction of
length one gives a smaller h(d) - d . w than the distance, so too many candidates do no harm, and degenerate ones
neither.

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
from ..base.display import record
from ..base.inputs import required
from ..base.tolerances import NEGLIGIBLE, OPTIMALITY, RANK
from ..core import MARGIN_CABLES, ROWS, solve_packed
from .available_wrench import facets
from .box_least_squares import Projection, project
from .certificate import certificate_along
from .exact_arithmetic import exact_optimum
from .problem import Array, TensionProblem
from .solution import OPTIMAL

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


class Margin(NamedTuple):
    """Signed distance of w to the boundary of the available wrench set.

    Attributes:
        value: The distance [N], moments divided by the problem's length: positive inside, negative outside.
        gradient: d value / d w, shape (n,): force entries are numbers, moment entries in 1/m. If two facets are equally
            near, it is the gradient for one of them; the value has a kink there.
        direction: Outward direction d to the nearest boundary point (inside) or from it to w (outside), shape (n,), in
            the form of `Certificate.direction`. Then gradient = -direction. Zeros if there is no boundary.
    """

    value: float
    gradient: Array  # (n,)
    direction: Array  # (n,)

    __repr__ = record


def capacity_margin(problem: TensionProblem) -> Margin:
    """Return the capacity margin of a wrench, its gradient and the direction of least reserve.

    If w is outside the available wrench set, the value is negative. Its magnitude is the distance from w to the set,
    which is the certificate's shortfall, except for a singular problem, whose certificate counts only the part outside
    the range of A. If w is inside, every facet is checked: all subsets of rank - 1 cables, 56 for m = 8 and 792 for
    m = 12 with six equations. Cables with t_min = t_max are left out.

    If the set is flat (the rank of the other cables is below n), it has no interior in the space of all wrenches. The
    margin of a wrench in the set, within `TensionProblem.tolerance`, is then measured in the subspace of the wrenches
    that the robot can give at all; a wrench that is not in this subspace is outside, with a negative value.

    Args:
        problem: The problem; its t_ref and weights play no part. Without a boundary (limits infinite in every
            direction) the value is infinite, and 0 if the set is a single wrench.

    Returns:
        The margin.
    """
    closest, residual = _given(required("problem", problem, TensionProblem)) or project(problem)
    distance = float(np.sqrt(residual @ residual))
    if distance > problem.tolerance(closest) and not _is_distance(problem, Projection(closest, residual), distance):
        closest, residual = exact_optimum(problem, closest)
        distance = float(np.sqrt(residual @ residual))
    if distance > problem.tolerance(closest):
        return _margin(problem, -distance, residual / distance)
    moving = problem.t_min < problem.t_max
    columns = problem.scaled_A[:, moving]  # (n, k)
    U, sigma, _ = np.linalg.svd(columns, full_matrices=False)
    rank = int(np.count_nonzero(sigma > RANK * sigma[0])) if sigma.size else 0
    if rank == 0:
        return _margin(problem, 0.0, np.zeros(problem.n))
    basis = U[:, :rank]  # (n, rank)
    normals = _normals(basis.T @ columns) @ basis.T  # (candidates, n)
    pull = normals @ problem.scaled_A  # (candidates, m)
    # Support value less demand, from where a point of the set is known: no tension is far from it. A cable without a
    # limit has any amount of reserve, unless its pull is rounding; with one, the reserve is known at any size.
    space = np.where(pull > 0.0, problem.t_max - closest, problem.t_min - closest)
    pull[~np.isfinite(space) & (np.abs(pull) <= NEGLIGIBLE * problem.column_norms)] = 0.0
    with np.errstate(invalid="ignore"):
        reserve = np.where(pull != 0.0, pull * space, 0.0).sum(axis=1)
    nearest = int(np.argmin(reserve))
    if not np.isfinite(reserve[nearest]):
        return _margin(problem, np.inf, np.zeros(problem.n))
    return _margin(problem, float(reserve[nearest]), normals[nearest])


def _given(problem: TensionProblem) -> Projection | None:
    """Return the tensions of least norm that give w, if the core finds some: in a thousandth of a projection's time."""
    packed, tensions, m = problem.packed.copy(), np.empty(problem.m), problem.m
    packed[-2 * m - 1 : -1] = np.r_[np.clip(0.0, problem.t_min, problem.t_max), np.ones(m)]  # no t_ref, no weights
    if solve_packed(packed, tensions) != OPTIMAL:
        return None
    return Projection(tensions, problem.scaled_w - problem.scaled_A @ tensions)


def _is_distance(problem: TensionProblem, projection: Projection, distance: float) -> bool:
    """Return whether a certificate confirms the distance of w to its projection: no wrench of the set is nearer."""
    certificate = certificate_along(problem, problem.row_scale * projection.residual, projection)
    return certificate is not None and certificate.shortfall > (1.0 - OPTIMALITY) * distance


def _margin(problem: TensionProblem, value: float, direction: Array) -> Margin:
    in_rows = problem.row_scale * direction
    return Margin(value, 0.0 - in_rows, in_rows)


def _normals(columns: Array) -> Array:
    """Return unit vectors orthogonal to each rank - 1 of the columns, both signs, shape (candidates, rank)."""
    rank, k = columns.shape
    subsets = subsets_inside(rank, k)
    chosen = np.zeros((len(subsets), rank, rank))
    # Columns of length one, so that a short one affects where its facet is.
    lengths = np.linalg.norm(columns, axis=0)
    unit = columns / np.where(lengths > 0.0, lengths, 1.0)
    chosen[:, : rank - 1] = unit.T[subsets]
    normals = np.linalg.svd(chosen)[2][:, -1]
    return np.concatenate([normals, -normals])
