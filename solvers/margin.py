r"""The distance of the required wrench from the boundary of the available wrench set: `capacity_margin`.

The available wrench set is a zonotope, the sum of one segment per cable. Each of its facets is parallel to rank - 1
columns of A, so the normals are among the directions d orthogonal to rank - 1 columns, and the facet lies at the
support value h(d): hyperplane shifting (Bouchard, Gosselin, Moore 2010; Gouttefarde, Krut 2010). No other direction of
length one gives a smaller h(d) - d . w than the distance, so too many candidates do no harm, and degenerate ones
neither.
"""

from typing import NamedTuple

import numpy as np

from ..base.display import record
from ..base.inputs import required
from ..base.tolerances import NEGLIGIBLE, OPTIMALITY, RANK
from ..core import solve_packed
from .box_least_squares import Projection, project
from .certificate import certificate_along
from .exact_arithmetic import exact_optimum
from .margins import subsets_inside
from .problem import Array, TensionProblem
from .status import OPTIMAL


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
