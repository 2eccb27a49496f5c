"""Samplers: points of the unit cube in independent chunks, so that any process can compute any chunk.

Random streams are counter-based (Salmon et al. 2011): Philox keyed by seed and chunk. Sobol's sequence (scipy's) is
scrambled by the seed and advanced to the start of the chunk. A grid has the midpoints of equal cells.
"""

import threading
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.display import Displayed
from ..base.inputs import one_of, whole_number

CHUNK = 16_384  # a power of two, as Sobol's sequence likes; about 15 ms of work
METHODS = ("random", "sobol", "grid", "adaptive")
MOST = 10**12  # samples
MOST_SOBOL = 2**32


@dataclass(frozen=True)
class Sampler(Displayed):
    """Points of the unit cube of as many dimensions as `extent` has."""

    method: str  # random, sobol or grid
    requested: int  # number of samples that was requested; a grid has at most this many, `samples`
    seed: int
    # Ranges of the quantities, (d,) [m, rad]; the cells of a grid are about equally long in all of them.
    extent: tuple[float, ...]

    @cached_property
    def cells(self) -> tuple[int, ...]:
        """Return the cells of the grid along each quantity; empty for other methods."""
        return cells_of(np.array(self.extent), self.requested) if self.method == "grid" else ()

    @property
    def samples(self) -> int:
        """Return the number of samples."""
        return int(np.prod(self.cells)) if self.cells else self.requested

    def units(self, chunk: int) -> np.ndarray:
        """Return the points of a chunk, (n, d), between 0 and 1."""
        count, dimension = min(CHUNK, self.samples - chunk * CHUNK), len(self.extent)
        if self.method == "random":
            key = np.array([self.seed, chunk], dtype=np.uint64)
            return np.random.Generator(np.random.Philox(key=key)).random((count, dimension))
        if self.method == "grid":
            index = np.unravel_index(np.arange(chunk * CHUNK, chunk * CHUNK + count), self.cells)
            return (np.stack(index, axis=1) + 0.5) / np.array(self.cells)
        return _sobol(dimension, self.seed).points(chunk * CHUNK)[:count]


def chunks_of(samples: int) -> int:
    """Return the number of chunks for a number of samples."""
    return -(-samples // CHUNK)


def cells_of(extent: np.ndarray, most: int) -> tuple[int, ...]:
    """Return the cells along each axis: about equally long, at least one each, and at most `most` in total."""
    counts = np.ones(len(extent), dtype=np.int64)
    # From the shortest axis on: where it takes less than one cell, the others share what is left.
    order = np.argsort(extent, kind="stable")
    left = float(most)
    for position, axis in enumerate(order):
        rest = order[position:]
        # With d axes left: the edge of a cube of which `left` fill their box; the root may be off by an ulp.
        edge = float(np.exp((np.log(extent[rest]).sum() - np.log(left)) / len(rest)))
        counts[axis] = max(1, int(extent[axis] / edge * (1 + 1e-12)))
        left /= counts[axis]
    return tuple(int(count) for count in counts)


class _Sobol:
    """Chunks of a scrambled Sobol sequence; advancing is cheap, going back restarts from the first point."""

    def __init__(self, dimension: int, seed: int):
        from scipy.stats import qmc

        self._engine: Any = qmc.Sobol(dimension, bits=32, rng=seed)  # above 32 bits scipy cannot advance
        self._at = 0

    def points(self, start: int) -> np.ndarray:
        """Return the `CHUNK` points from index `start` on."""
        if start < self._at:
            self._engine.reset()
            self._at = 0
        if start > self._at:
            self._engine.fast_forward(start - self._at)
        self._at = start + CHUNK
        return self._engine.random(CHUNK)


_own = threading.local()  # a sequence serves one thread at a time


def _sobol(dimension: int, seed: int) -> _Sobol:
    key = dimension, seed
    if getattr(_own, "key", None) != key:
        _own.key, _own.sequence = key, _Sobol(dimension, seed)
    return _own.sequence


def check_sampling(method: str, samples: int, seed: int) -> None:
    """Check the arguments of a sampler; raise InputError if one is wrong."""
    one_of("method", method, METHODS)
    whole_number("samples", samples, 1, MOST_SOBOL if method == "sobol" else MOST)
    whole_number("seed", seed, 0, 2**63 - 1)
