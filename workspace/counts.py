"""`Counts`: numbers of tried and accepted samples per cell, and the first samples; counts can be added.

The result does not depend on the process, to the last bit. Chunks with known flags, from a checkpoint, are counted
again without evaluating the condition.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base import processors
from ..base.display import Displayed
from .condition import Condition
from .domain import THINNEST, Domain
from .metrics import metric_values
from .places import Places
from .sampling import Sampler

RESOLUTION = 32  # cells along each axis


class Counts:
    """Numbers of samples so far. They are added in the order of the samples, so the result does not depend on timing.

    - `tried`: number of samples.
    - `low`, `high`: bounds of the accepted positions, (3,) [m]; infinite if there are none.
    - `samples`, `flags`: arrays of the samples that are kept, (n, k) as returned by `Domain.numbers` and their metrics,
      and True for each accepted one.
    - `left`: number of further samples that may be kept.
    """

    def __init__(self, domain: Domain, points_max: int = sys.maxsize):
        low, high = domain.box
        self.tried, self.left = 0, points_max
        # samples tried and accepted in each cell of the box of positions, (2, nx, ny, nz); an axis along which the box
        # has no thickness has one cell. Samples without a valid configuration are in no cell.
        self.cells = np.zeros((2, *np.where(high - low > THINNEST, RESOLUTION, 1)), dtype=np.int64)
        self.low, self.high = np.full(3, np.inf), np.full(3, -np.inf)
        self.samples: list[np.ndarray] = []
        self.flags: list[np.ndarray] = []

    @property
    def accepted(self) -> int:
        """Return the number of accepted samples."""
        return int(self.cells[1].sum())

    def count(self, domain: Domain, places: Places, exists: np.ndarray, held: np.ndarray) -> None:
        """Count samples from their configurations and two flags (n,): valid, and accepted."""
        position = places.pose[:, :3]
        index = _cell(position, domain, self.cells.shape[1:])
        for cells, some in zip(self.cells, (index[exists], index[held]), strict=True):
            cells += np.bincount(some, minlength=cells.size).reshape(cells.shape)
        if held.any():
            self.low = np.minimum(self.low, position[held].min(axis=0))
            self.high = np.maximum(self.high, position[held].max(axis=0))
        self.tried += len(places)

    def keep_samples(self, samples: np.ndarray, flags: np.ndarray) -> None:
        """Keep samples (n, k) and their flags (n,), up to the storage limit."""
        self.samples.append(samples[: self.left])
        self.flags.append(flags[: self.left])
        self.left -= len(self.samples[-1])

    def add(self, other: Counts) -> None:
        """Add the counts of the samples that come next."""
        self.tried += other.tried
        self.cells += other.cells
        self.low, self.high = np.minimum(self.low, other.low), np.maximum(self.high, other.high)
        for samples, flags in zip(other.samples, other.flags, strict=True):
            self.keep_samples(samples, flags)


def _cell(position: np.ndarray, domain: Domain, cells: tuple[int, ...]) -> np.ndarray:
    """Return the index of the cell of each position, (n,); positions outside the box are moved to its border."""
    low, high = domain.box
    index = np.zeros(len(position), dtype=np.int32)
    for axis, count in enumerate(cells):
        along = np.zeros_like(index)
        if count > 1:
            along = ((position[:, axis] - low[axis]) * (count / (high[axis] - low[axis]))).astype(np.int32)
        index = index * count + np.clip(along, 0, count - 1)
    return index


@dataclass(frozen=True)
class Counter(Displayed):
    """Count where a condition holds among the samples of a domain."""

    condition: Condition
    domain: Domain
    sampler: Sampler | None  # none if the points of each chunk are given
    keep: str  # samples that are kept: accepted, all or none
    samples: int  # maximum number of samples of the run
    metrics: tuple[str, ...] = ()  # of the samples that are kept

    def count(
        self, first: int, known: Sequence[bytes | None], points: Sequence[np.ndarray] | None, keep: bool
    ) -> tuple[Counts, list[bytes]]:
        """Count some chunks, one after the other, with one processor.

        - `first`: number of the first chunk.
        - `known`: known bits of each chunk, else None.
        - `points`: points of each chunk in the unit cube (n, d); default: the sampler's.
        - `keep`: True to keep samples, not only count them.

        Returns the counts, and which samples of each chunk are accepted, one bit per sample.
        """
        counts, flags = Counts(self.domain), []
        with processors.at_most(1):
            for offset, bits in enumerate(known):
                if points is not None:
                    units = points[offset]
                else:
                    assert self.sampler is not None
                    units = self.sampler.units(first + offset)
                places, exists = self.domain.places(units)
                if bits is None:
                    held = np.asarray(self.condition.holds(self.domain.robot, places), dtype=bool) & exists
                else:
                    held = np.unpackbits(np.frombuffer(bits, np.uint8), count=len(units)).astype(bool)
                counts.count(self.domain, places, exists, held)
                if keep and self.keep != "none":
                    rows = slice(None) if self.keep == "all" else held
                    kept = places.only(rows)
                    values = [metric_values(name, self.domain.robot, kept) for name in self.metrics]
                    counts.keep_samples(np.column_stack([self.domain.numbers(kept), *values]), held[rows])
                flags.append(np.packbits(held).tobytes())
        return counts, flags
