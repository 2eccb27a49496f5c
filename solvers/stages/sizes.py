"""Sizes of the blocks of the one array on which the kernels of `horizon` work."""

import numpy as np
from numpy.typing import NDArray

from . import layout

__all__ = ["padded", "places"]


def padded(size: int) -> int:
    """Return the next multiple of eight."""
    return -(-size // 8) * 8


def places(N: int, n: int, m: int, p: int) -> tuple[NDArray[np.int64], int]:
    """Return sizes and places of blocks, shape (layout.BLOCKS,), and how many numbers the array has.

    Parameters
    ----------
    N, n, m, p
        Stages, states, controls and soft rows.
    """
    w = n + m
    wp, np_, mp, pp = padded(w), padded(n), padded(m), padded(p)
    pairs = 2 * N * (mp + pp)
    at = np.zeros(layout.BLOCKS, dtype=np.int64)
    for place, size in (
        (layout.STAGES, N),
        (layout.N, n),
        (layout.M, m),
        (layout.P, p),
        (layout.W, w),
        (layout.NP, np_),
        (layout.MP, mp),
        (layout.PP, pp),
        (layout.WP, wp),
        (layout.PAIRS, pairs),
    ):
        at[place] = size
    points, states, controls, rows = (N + 1) * wp, (N + 1) * np_, N * mp, N * pp
    iterate = 2 * points + 2 * pairs
    # Tiles and vectors reach beyond rows and blocks: at least a tile of rows, and eight numbers more.
    high, wide = max(n, layout.TILE), max(w, layout.TILE)
    sizes = {
        layout.HESSIAN: (N + 1) * w * wp + layout.TILE * wp,
        layout.GRADIENT: points,
        layout.DYNAMICS: N * n * wp + 8,
        layout.OFFSET: states,
        layout.START: np_,
        layout.LOWEST: controls,
        layout.HIGHEST: controls,
        layout.ROWS: N * p * wp + 8,
        layout.LIMIT: rows,
        layout.WEIGHT: rows,
        layout.SQUARE: rows,
        layout.POINT: points,
        layout.COSTATE: points,
        layout.SLACK: pairs,
        layout.MULTIPLIER: pairs,
        layout.BEST: iterate,
        layout.D_POINT: points,
        layout.D_COSTATE: points,
        layout.D_SLACK: pairs,
        layout.D_MULTIPLIER: pairs,
        layout.MASK: pairs,
        layout.LOW: controls,
        layout.HIGH: controls,
        layout.CHANGES: controls,
        layout.PRODUCT: pairs,
        layout.LEFT: points,
        layout.MODIFIED: points + 8,
        layout.GAP: states,
        layout.VALUE: rows,
        layout.FACTOR: N * (m * wp + 8),
        layout.INVERSE: controls,
        layout.COST: (N + 1) * (high * np_ + 8),
        layout.COST_GAP: states,
        layout.COST_GRADIENT: states,
        layout.REDUCED: controls,
        layout.STEEP: rows,
        layout.SHIFT: rows,
        layout.OFF_ROW: rows,
        layout.T_WORK: high * wp + 8,
        layout.M_WORK: wide * wp + 8,
        layout.S_WORK: wide * wp + 8,
        layout.R_WORK: p * wp + 8,
        layout.V_WORK: max(3 * wp, pp),
        layout.FREE: wp,
        layout.WORST: wp,
        layout.SCALE: wp,
        layout.WORST_GAP: np_,
        layout.SCALE_GAP: np_,
        layout.WORST_PAIR: mp,
        layout.SCALE_CONTROL: mp,
        layout.CURVATURE: mp,
        layout.RANGE: mp,
        layout.WORST_ROW: pp,
        layout.SCALE_ROW: pp,
        layout.SCALE_FORCE: pp,
    }
    end = 0
    for block, size in sizes.items():
        at[block], end = end, end + padded(size)
    return at, end + 8
