"""Count accepted samples chunk by chunk, in any process: `Counter`.

The result does not depend on the process, to the last bit. Chunks with known flags, from a checkpoint, are counted
again without evaluating the condition.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..base import processors
from ..base.display import Displayed
from .condition import Condition
from .counts import Counts
from .domain import Domain
from .sampling import Sampler


@dataclass(frozen=True)
class Counter(Displayed):
    """Count where a condition holds among the samples of a domain.

    Attributes
    ----------
    sampler
        None if the points of each chunk are given.
    keep
        Samples that are kept: accepted, all or none.
    samples
        Maximum number of samples of the run.
    """

    condition: Condition
    domain: Domain
    sampler: Sampler | None
    keep: str
    samples: int

    def count(
        self, first: int, known: Sequence[bytes | None], points: Sequence[np.ndarray] | None, keep: bool
    ) -> tuple[Counts, list[bytes]]:
        """Count some chunks, one after the other, with one processor.

        Parameters
        ----------
        first
            Number of the first chunk.
        known
            Known bits of each chunk, else None.
        points
            Points of each chunk in the unit cube (n, d); default: the sampler's.
        keep
            True to keep samples, not only count them.

        Returns
        -------
        The counts, and which samples of each chunk are accepted, one bit per sample.
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
                    counts.keep(self.domain.numbers(places.only(rows)), held[rows])
                flags.append(np.packbits(held).tobytes())
        return counts, flags
