"""Adaptive refinement of the boundary: cells with differing corners are halved along each axis, level by level.

The corners of all cells lie on a lattice, twice as fine on each level; known corners are not evaluated again. A cell
with equal corners is treated as all inside or all outside, so parts thinner than the first cells can be missed.
"""

from collections.abc import Generator
from itertools import product

import numpy as np

from ..base.inputs import InputError, number, whole_number
from .domain import Domain
from .sampling import cells_of

AT_ONCE = 2**16  # cells
FIRST_CELLS = 16  # along each axis, where the axes are equally long and the samples suffice
MOST = 2_000_000  # samples: some 400 bytes each
SMALLEST, LARGEST = 1e-9, 1e9  # [m], edge of a cell


class Refinement:
    """Halve cells level by level.

    - `inside`, `mixed`: fractions of the box in cells with all corners accepted, and in cells with differing corners.
    - `cells`: lower corners of the mixed cells as points of the unit cube, (n, d).
    - `edges`: edges of the smallest cells, in the unit cube, (d,).
    """

    def __init__(self, domain: Domain, samples: int, size: float | None):
        if domain.position_from_lengths or (domain.varying >= 3).any():
            raise InputError("region must vary in positions only with method adaptive, got other quantities")
        if size is not None:
            number("size", size, SMALLEST, LARGEST, also=" [m], or None")
        whole_number("samples with method adaptive", samples, 1, MOST)
        # accepted fraction of the box, with the fraction of accepted corners for each mixed cell
        self.inside = self.mixed = self.estimate = 0.0
        self._extent, self._samples, self._size = domain.extent, samples, size
        d = len(self._extent)
        self._corners = np.array(list(product((0, 1), repeat=d)), dtype=np.int64)  # (2^d, d)
        self._count = np.array(_first_cells(self._extent, samples), dtype=np.int64)
        self.cells, self.edges = np.empty((0, d)), 1.0 / self._count
        self._known, self._flags = np.empty(0, dtype=np.int64), np.empty(0, dtype=bool)

    def levels(self) -> Generator[np.ndarray, np.ndarray, None]:
        """Yield points to evaluate, (n, d) of the unit cube, and receive whether each was accepted, (n,) of bool."""
        cells = np.stack(np.unravel_index(np.arange(self._count.prod()), self._count), axis=1)
        used = 0
        while True:
            corners = np.unique(np.concatenate([np.unique(self._keys(some)) for some in _pieces(cells)]))
            new = np.setdiff1d(corners, self._known, assume_unique=True)
            del corners
            if used and used + len(new) > self._samples:
                # As fine as the samples allow; the mixed cells of the level before stay.
                return
            used += len(new)
            flags = yield np.stack(np.unravel_index(new, self._count + 1), axis=1) / self._count
            order = np.argsort(merged := np.concatenate([self._known, new]))
            self._known, self._flags = merged[order], np.concatenate([self._flags, flags])[order]
            hits = np.concatenate([self._hits(some) for some in _pieces(cells)])
            share = float(1.0 / self._count.prod())
            differ = (hits > 0) & (hits < len(self._corners))
            self.inside += share * int((hits == len(self._corners)).sum())
            self.mixed = share * int(differ.sum())
            self.estimate = self.inside + share * float(hits[differ].sum()) / len(self._corners)
            self.cells, self.edges = cells[differ] / self._count, 1.0 / self._count
            if not differ.any() or (self._size is not None and (self._extent * self.edges <= self._size).all()):
                return
            if self._count.max() > 2**19:  # three such indices fill a key
                return
            cells = cells[differ]
            # No other corner is one of a cell to come.
            keep = np.unique(np.concatenate([np.unique(self._keys(some)) for some in _pieces(cells)]))
            self._known, self._flags = keep, self._flags[np.searchsorted(self._known, keep)]
            cells = self._halve(cells)

    def _keys(self, cells: np.ndarray) -> np.ndarray:
        """Return the numbers on the lattice of the corners of cells (n, d), (n, 2^d)."""
        corners = cells[:, None, :] + self._corners
        return np.asarray(np.ravel_multi_index(tuple(np.moveaxis(corners, -1, 0)), tuple(self._count + 1)))

    def _hits(self, cells: np.ndarray) -> np.ndarray:
        """Return the number of accepted corners of cells (n, d), (n,)."""
        return self._flags[np.searchsorted(self._known, self._keys(cells))].sum(axis=1, dtype=np.int8)

    def _halve(self, cells: np.ndarray) -> np.ndarray:
        """Return the halves of cells (n, d) on the next, finer lattice; flags that are known move to it."""
        known = np.stack(np.unravel_index(self._known, self._count + 1), axis=1) * 2
        self._count = self._count * 2
        # Twice the indices in the same order: the keys stay sorted.
        self._known = np.ravel_multi_index(tuple(known.T), tuple(self._count + 1))
        return (2 * cells[:, None, :] + self._corners).reshape(-1, cells.shape[1])


def _pieces(cells: np.ndarray) -> list[np.ndarray]:
    """Return cells (n, d) in parts: all their corners at once would take most of the memory."""
    return [cells[start : start + AT_ONCE] for start in range(0, max(len(cells), 1), AT_ONCE)]


def _first_cells(extent: np.ndarray, samples: int) -> tuple[int, ...]:
    """Return the cells of the first level, with no more corners than samples."""
    most = FIRST_CELLS ** len(extent)
    while True:
        cells = cells_of(extent, most)
        if np.prod(np.array(cells) + 1) <= samples:
            return cells
        if most == 1:
            raise InputError(f"samples must be at least {2 ** len(extent)}, the corners of a cell, got {samples}")
        most = most // 2
