"""Chunks of samples, computed wherever there is a processor: a `Job` in, a `JobResult` out.

The result for the same samples is the same to the last bit whichever process computes it. Chunks whose flags are known
already, from a checkpoint, are counted again without evaluating the condition.
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .. import processors
from ..models import Robot
from ..solvers import compiled
from .condition import Condition
from .domain import THINNEST, Domain
from .feasibility import load_kernels
from .sampling import Sampler

RESOLUTION = 32  # cells of the counts along each axis
WORTH_KERNELS = 500_000  # samples of a run: the first kernels on a machine take a minute, saving 20 us a sample


@dataclass(frozen=True)
class RunSettings:
    """The settings that all jobs of a run share.

    Attributes
    ----------
    sampler
        None if each job brings its points.
    keep
        accepted, all or none.
    samples
        Of the run, the maximum.
    """

    robot: Robot
    condition: Condition
    domain: Domain
    sampler: Sampler | None
    keep: str
    samples: int

    def packed(self) -> bytes:
        """Return the settings as bytes, to be sent to other processes."""
        return pickle.dumps(self)


@dataclass(frozen=True)
class Job:
    """Some chunks, one after the other.

    Attributes
    ----------
    first
        Number of the first chunk.
    known
        Of each chunk: the packed flags where they are known already, else None.
    units
        Points of the unit cube (n, d) of each chunk; default: the sampler's.
    keep
        Whether the samples are returned and not only their counts.
    """

    first: int
    known: tuple[bytes | None, ...]
    units: tuple[np.ndarray, ...] | None
    keep: bool


@dataclass(frozen=True)
class JobResult:
    """Counts, bounds and samples of a job.

    Attributes
    ----------
    sizes, flags
        Of each chunk: how many samples, and which of them were accepted, one bit a sample.
    low, high
        Bounds of the accepted positions, (3,) [m]; infinite where there are none.
    counts
        Samples tried and accepted in each cell of the box of positions, (2, *cells).
    samples
        Numbers kept of each sample, (n, k), as `width_of` counts them.
    accepted
        Whether each kept sample was accepted, (n,).
    """

    sizes: tuple[int, ...]
    flags: tuple[bytes, ...]
    low: np.ndarray  # (3,)
    high: np.ndarray  # (3,)
    counts: np.ndarray
    samples: np.ndarray  # (n, k)
    accepted: np.ndarray  # (n,)


def cells_of_counts(domain: Domain) -> tuple[int, int, int]:
    """Return how many cells the box of positions has along each axis: one where it has no thickness."""
    low, high = domain.box
    nx, ny, nz = np.where(high - low > THINNEST, RESOLUTION, 1).tolist()
    return nx, ny, nz


def evaluate(packed: bytes, job: Job) -> JobResult:
    """Evaluate the condition at the samples of a job, with one processor.

    Parameters
    ----------
    packed
        From `RunSettings.packed`.
    """
    settings = _settings(packed)
    domain = settings.domain
    cells = cells_of_counts(domain)
    counts = np.zeros((2, int(np.prod(cells))), dtype=np.uint32)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    sizes, flags, samples, accepted = [], [], [], []
    with processors.at_most(1):
        for offset, known in enumerate(job.known):
            units = job.units[offset] if job.units else _sampler(settings).units(job.first + offset)
            places, exists = domain.places(units)
            if known is None:
                held = np.asarray(settings.condition.holds(settings.robot, places), dtype=bool) & exists
            else:
                held = np.unpackbits(np.frombuffer(known, np.uint8), count=len(units)).astype(bool)
            position = places.pose[:, :3]
            cell = _cell(position, domain, cells)
            for row, some in enumerate((cell[exists], cell[held])):
                counts[row] += np.bincount(some, minlength=counts.shape[1]).astype(np.uint32)
            if held.any():
                low = np.minimum(low, position[held].min(axis=0))
                high = np.maximum(high, position[held].max(axis=0))
            if job.keep and settings.keep != "none":
                rows = slice(None) if settings.keep == "all" else held
                samples.append(_row(places.pose[rows], places.carriers[rows], domain))
                accepted.append(held[rows])
            sizes.append(len(units))
            flags.append(np.packbits(held).tobytes())
    kept = np.vstack(samples) if samples else np.empty((0, width_of(domain)))
    marks = np.concatenate(accepted) if accepted else np.empty(0, dtype=bool)
    return JobResult(tuple(sizes), tuple(flags), low, high, counts.reshape(2, *cells), kept, marks)


def width_of(domain: Domain) -> int:
    """Return how many numbers are kept of a sample: position, and attitude and carriers' positions if they vary."""
    return 3 + 3 * domain.attitude_varies + 3 * len(domain.robot.carriers) * domain.carriers_vary


def _row(pose: np.ndarray, carriers: np.ndarray, domain: Domain) -> np.ndarray:
    """Return what is kept of each sample, (n, k)."""
    parts = [pose if domain.attitude_varies else pose[:, :3]]
    if domain.carriers_vary:
        parts.append(carriers[:, :, :3].reshape(len(pose), 3 * carriers.shape[1]))
    return np.hstack(parts) if len(parts) > 1 else parts[0]


def _cell(position: np.ndarray, domain: Domain, cells: tuple[int, int, int]) -> np.ndarray:
    """Return the index of the cell that each position is in, (n,); positions outside of the box go to its border."""
    low, high = domain.box
    index = np.zeros(len(position), dtype=np.int32)
    for axis, count in enumerate(cells):
        along = np.zeros_like(index)
        if count > 1:
            along = ((position[:, axis] - low[axis]) * (count / (high[axis] - low[axis]))).astype(np.int32)
        index = index * count + np.clip(along, 0, count - 1)
    return index


def prepare(packed: bytes) -> None:
    """Compile the kernels of a large run once, before its processes start: each would compile them for itself."""
    settings: RunSettings = pickle.loads(packed)
    if settings.samples >= WORTH_KERNELS:
        compiled.keep()


def _sampler(settings: RunSettings) -> Sampler:
    if settings.sampler is None:
        raise ValueError("a job without points needs a sampler")
    return settings.sampler


@lru_cache(maxsize=2)
def _settings(packed: bytes) -> RunSettings:
    """Unpack once for all jobs of a run, and load the kernels for a large run; the bits do not depend on it."""
    settings: RunSettings = pickle.loads(packed)
    if settings.samples >= WORTH_KERNELS:
        load_kernels(settings.robot)
    return settings
