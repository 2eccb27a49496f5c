"""What comes of some chunks of samples, computed wherever there is a processor: a `Job` in, a `Counts` out.

A count of the same samples is the same to the last bit whoever computes it, and one whose answers are known already
(from a checkpoint) is computed from them without asking the condition.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .. import processors
from ..models import Robot
from .balance import make_ready
from .condition import Condition
from .domain import THINNEST, Domain
from .sampling import Sampler

RESOLUTION = 32  # cells of the counts along each axis
WORTH_A_KERNEL = 100_000  # samples: to load one takes a second or two, and saves some microseconds a sample


@dataclass(frozen=True)
class Question:
    """What all jobs of a run share."""

    robot: Robot
    condition: Condition
    domain: Domain
    sampler: Sampler | None  # none: each job brings its points
    keep: str  # accepted, all or none
    samples: int  # of the run, at most

    def packed(self) -> bytes:
        """As bytes, to be sent."""
        return pickle.dumps(self)


@dataclass(frozen=True)
class Job:
    """Some chunks, one after the other.

    Attributes
    ----------
    first
        Number of the first chunk.
    answers
        Of each chunk: the packed flags where they are known already, else None.
    units
        Points of the unit cube (n, d) of each chunk; None: the sampler's.
    keep
        Whether the samples are wanted and not only their counts.
    """

    first: int
    answers: tuple[bytes | None, ...]
    units: tuple[np.ndarray, ...] | None
    keep: bool


@dataclass(frozen=True)
class Counts:
    """What came of a job.

    Attributes
    ----------
    sizes, answers
        Of each chunk: how many samples, and the packed flags that tell which were accepted.
    low, high
        Bounds of the accepted positions, (3,) [m]; infinite where there are none.
    counts
        Samples tried and accepted in each cell of the box of positions, (2, *cells).
    samples
        What is kept of each sample, (n, k), see `width_of`; and whether it was accepted, (n,).
    """

    sizes: tuple[int, ...]
    answers: tuple[bytes, ...]
    low: np.ndarray
    high: np.ndarray
    counts: np.ndarray
    samples: np.ndarray
    accepted: np.ndarray


def cells_of_counts(domain: Domain) -> tuple[int, int, int]:
    """How many cells the box of positions has along each axis: one where it has no thickness."""
    low, high = domain.box
    nx, ny, nz = np.where(high - low > THINNEST, RESOLUTION, 1).tolist()
    return nx, ny, nz


def count(packed: bytes, job: Job) -> Counts:
    """Work on a job, with one processor."""
    question = _question(packed)
    domain = question.domain
    cells = cells_of_counts(domain)
    counts = np.zeros((2, int(np.prod(cells))), dtype=np.uint32)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    sizes, answers, samples, flags = [], [], [], []
    with processors.at_most(1):
        for offset, known in enumerate(job.answers):
            units = job.units[offset] if job.units else _sampler(question).units(job.first + offset)
            places, exists = domain.places(units)
            if known is None:
                held = np.asarray(question.condition.holds(question.robot, places), dtype=bool) & exists
            else:
                held = np.unpackbits(np.frombuffer(known, np.uint8), count=len(units)).astype(bool)
            position = places.pose[:, :3]
            at = _cell(position, domain, cells)
            for row, some in enumerate((at[exists], at[held])):
                counts[row] += np.bincount(some, minlength=counts.shape[1]).astype(np.uint32)
            if held.any():
                low = np.minimum(low, position[held].min(axis=0))
                high = np.maximum(high, position[held].max(axis=0))
            if job.keep and question.keep != "none":
                rows = slice(None) if question.keep == "all" else held
                samples.append(_row(places.pose[rows], places.carriers[rows], domain))
                flags.append(held[rows])
            sizes.append(len(units))
            answers.append(np.packbits(held).tobytes())
    kept = np.vstack(samples) if samples else np.empty((0, width_of(domain)))
    marks = np.concatenate(flags) if flags else np.empty(0, dtype=bool)
    return Counts(tuple(sizes), tuple(answers), low, high, counts.reshape(2, *cells), kept, marks)


def width_of(domain: Domain) -> int:
    """How many numbers are kept of a sample: position, attitude if it varies, carriers' positions if they vary."""
    return 3 + 3 * domain.attitude_varies + 3 * len(domain.robot.carriers) * domain.carriers_vary


def _row(pose: np.ndarray, carriers: np.ndarray, domain: Domain) -> np.ndarray:
    """What is kept of each sample, (n, k)."""
    parts = [pose if domain.attitude_varies else pose[:, :3]]
    if domain.carriers_vary:
        parts.append(carriers[:, :, :3].reshape(len(pose), 3 * carriers.shape[1]))
    return np.hstack(parts) if len(parts) > 1 else parts[0]


def _cell(position: np.ndarray, domain: Domain, cells: tuple[int, int, int]) -> np.ndarray:
    """Index of the cell that each position is in, (n,); what the lengths leave outside of the box is in its border."""
    low, high = domain.box
    index = np.zeros(len(position), dtype=np.int32)
    for axis, count in enumerate(cells):
        along = np.zeros_like(index)
        if count > 1:
            along = ((position[:, axis] - low[axis]) * (count / (high[axis] - low[axis]))).astype(np.int32)
        index = index * count + np.clip(along, 0, count - 1)
    return index


def _sampler(question: Question) -> Sampler:
    if question.sampler is None:
        raise ValueError("a job without points needs a sampler")
    return question.sampler


@lru_cache(maxsize=2)
def _question(packed: bytes) -> Question:
    """Unpack, once for all jobs of a run, and get ready for many of them."""
    question: Question = pickle.loads(packed)
    if question.samples >= WORTH_A_KERNEL:
        make_ready(question.robot)
    return question
