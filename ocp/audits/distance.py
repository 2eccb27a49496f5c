"""Distances of many wrenches from what tensions inside their limits can give, without a compiled kernel.

The nearest tensions of each instant solve a least-squares problem with bounds, here by block principal pivoting
(Portugal, Judice, Vicente, "A comparison of block pivoting and interior-point algorithms for linear least squares
problems with nonnegative variables", 1994) on all instants at once. Along the motion the cables at their limits change
rarely, so every `STRIDE`-th instant is solved first and its cables at limits are the start of its neighbours.

No distance is believed without proof: with the direction d from the nearest wrench A t to w, |w - A t| is an upper
bound of the distance and d . w - h(d) (see `solvers.certificate`) a lower bound. Only where both agree is a distance
returned.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...base.tolerances import ORTHOGONAL

__all__ = ["Distances", "distances"]

STRIDE = 64
MOST_PIVOTS = 60  # of the instants that are solved first; the others start close and have a quarter
AGREEMENT = 1e-9  # relative difference of the bounds up to which a distance is proven
DECISIVE = 1e-7  # of |w| + sum |a_i| |t_i|: a shorter distance is left to the exact solver
PATIENCE = 3  # pivots of all cables at once that may bring nothing
RANK = 1e-10  # singular values below this part of the largest are zero

FREE, AT_LOW, AT_HIGH = 0, -1, 1


class Distances(NamedTuple):
    """Distances of required wrenches from the available ones.

    Attributes
    ----------
    proven
        Where the distance is proven to be positive and known to ten digits, (n,).
    distance
        [N], (n,); nan where not proven.
    """

    proven: np.ndarray  # (n,)
    distance: np.ndarray  # (n,)


def distances(A: np.ndarray, w: np.ndarray, low: np.ndarray, high: np.ndarray) -> Distances:
    """Return the distances of wrenches w (n, 6) from {A t : low <= t <= high}, A (n, 6, m), all scaled to newtons.

    `low` and `high` are (m,); an infinite bound is never reached. It is quick where neighbouring rows are similar.
    """
    n, _, m = A.shape
    if not n:
        return Distances(np.zeros(0, dtype=bool), np.zeros(0))
    coarse = np.arange(0, n, STRIDE)
    state = np.zeros((len(coarse), m), dtype=np.int8)
    _, first = _nearest(A[coarse], w[coarse], low, high, state, MOST_PIVOTS)
    near = np.minimum((np.arange(n) + STRIDE // 2) // STRIDE, len(coarse) - 1)
    tensions, _ = _nearest(A, w, low, high, first[near], MOST_PIVOTS // 4)
    residual = w - _times(A, tensions)
    upper = np.linalg.norm(residual, axis=1)
    direction = residual / np.where(upper > 0, upper, 1.0)[:, None]
    lower = np.einsum("ni,ni->n", direction, w) - _support(A, direction, low, high)
    columns = np.linalg.norm(A, axis=1)
    size = np.linalg.norm(w, axis=1) + (columns * np.abs(tensions)).sum(axis=1)
    proven = (lower > DECISIVE * size) & (upper - lower <= AGREEMENT * upper)
    return Distances(proven, np.where(proven, upper, np.nan))


def _nearest(
    A: np.ndarray, w: np.ndarray, low: np.ndarray, high: np.ndarray, state: np.ndarray, pivots: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return tensions (n, m) inside the limits, the nearest ones in most rows, and which limits they are at, (n, m).

    `state` (n, m) is where the search starts: FREE, AT_LOW or AT_HIGH for each cable.
    """
    state = state.copy()
    tensions = np.empty(state.shape)
    left = np.arange(len(A))
    fewest, patience = np.full(len(A), state.shape[1] + 1), np.full(len(A), PATIENCE)
    for _ in range(pivots):
        here, matrix = state[left], A[left]
        fixed = np.where(here == AT_LOW, low, np.where(here == AT_HIGH, high, 0.0))
        rest = w[left] - _times(matrix, fixed)
        free = here == FREE
        t = fixed + np.where(free, _least_squares(matrix * free[:, None, :], rest), 0.0)
        tensions[left] = t
        gradient = np.einsum("nij,ni->nj", matrix, _times(matrix, t) - w[left])
        noise = 1e-9 * np.linalg.norm(matrix, axis=1) * np.linalg.norm(rest, axis=1)[:, None]
        below, above = free & (t < low), free & (t > high)
        # A cable at its lower limit stays there if more tension would lead farther from w, and conversely.
        release = ((here == AT_LOW) & (gradient < -noise)) | ((here == AT_HIGH) & (gradient > noise))
        change = below | above | release
        # Changing all cables at once can go round in circles: where it brings nothing, only the last one is changed.
        count = change.sum(axis=1)
        better = count < fewest[left]
        fewest[left] = np.minimum(count, fewest[left])
        patience[left] = np.where(better, PATIENCE, patience[left] - 1)
        last = np.arange(change.shape[1]) == change.shape[1] - 1 - np.argmax(change[:, ::-1], axis=1)[:, None]
        single = (patience[left] < 0)[:, None] & ~last
        below, above, release = below & ~single, above & ~single, release & ~single
        unsolved = count > 0
        here = np.where(below, AT_LOW, np.where(above, AT_HIGH, np.where(release, FREE, here))).astype(np.int8)
        state[left[unsolved]] = here[unsolved]
        left = left[unsolved]
        if not left.size:
            break
    return np.clip(tensions, low, high), state


def _least_squares(A: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return the t (n, m) of least norm with A t nearest to w (n, 6); columns of zeros get zero."""
    return (np.linalg.pinv(A, rcond=RANK) @ w[..., None])[..., 0]


def _times(A: np.ndarray, t: np.ndarray) -> np.ndarray:
    return (A @ t[..., None])[..., 0]


def _support(A: np.ndarray, direction: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the most that tensions inside the limits give along each direction, (n,) [N]."""
    pull = np.einsum("nij,ni->nj", A, direction)
    limit = np.where(pull > 0, high, low)
    # A cable without a limit gives any amount, unless its pull is the rounding of its own wrench.
    endless = ~np.isfinite(limit)
    gives = np.abs(pull) > ORTHOGONAL * np.linalg.norm(A, axis=1)
    return np.where(endless, np.where(gives, np.inf, 0.0), pull * np.where(endless, 0.0, limit)).sum(axis=1)
