"""`sample`: the workspace of a robot under a condition, from some thousand samples to 10^9."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__
from ..errors import InputError
from ..models import Robot
from ..netcdf import Contents, save_netcdf
from ..writing import whole_folder
from .checkpoint import Checkpoint, open_checkpoint
from .condition import Condition, condition_from
from .counts import Job, Question
from .domain import Domain
from .execution import Run, executor
from .outcome import Outcome
from .refinement import Refinement
from .region import Region
from .sampling import CHUNK, Sampler, check_sampling, whole

if TYPE_CHECKING:
    import xarray as xr

KEEP = ("accepted", "all", "none")
MOST_POINTS = 10_000_000
LARGEST_JOB = 8  # chunks
OF_THIS_RUN = ("seconds", "poses_per_s", "workers")  # what a file does not have: it is the same whoever computed it

Progress = Callable[[int, int, int], None]


def sample(
    robot: Robot,
    condition: Condition | Mapping[str, Any],
    region: Region | Mapping[str, Any] | None = None,
    samples: int = 60_000,
    method: str = "random",
    seed: int = 0,
    *,
    size: float | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    keep: str = "accepted",
    points_max: int = 1_000_000,
) -> xr.Dataset:
    """Sample where a condition holds; the result is the same to the last bit for every number of workers.

    Memory does not grow with the number of samples: beyond `points_max` of them only counts are kept.

    Parameters
    ----------
    robot
        From `load` or `Robot.model_validate`.
    condition
        From `workspace`, or as a mapping with a `kind`.
    region
        Where to look, a `Region` or a mapping of its keys; None: a box about home and anchors, the rest at home.
    samples
        How many. A grid has at most as many, refinement asks for at most as many.
    method
        random; sobol or halton (low discrepancy); grid; adaptive: cells whose corners differ are halved.
    seed
        Of the random streams, and of the scrambling of sobol and halton.
    size
        Of adaptive: edge at which cells are small enough [m]; None: as the samples allow.
    workers
        Processes of this machine, each using one processor; 1: this process.
    scheduler
        Address of a Dask scheduler whose workers do it instead (extra `cluster`).
    checkpoint
        File that the answers are appended to as they come.
    resume
        Whether to go on with the checkpoint if it is there. It has to be of the same run.
    progress
        Called with (samples done, samples in all, samples accepted); in all is an upper bound for adaptive.
    keep
        Which samples are in the dataset: accepted, all or none.
    points_max
        How many of them at most, the first ones in the order of the samples.

    Returns
    -------
    Dataset with the variables
        position (point, axis) [m]
            Of the samples kept; likewise attitude (point, angle) [rad] and carrier_position (point, carrier, axis) [m]
            where those vary, and accepted (point) if all are kept.
        tried, reached (x, y, z)
            Samples in each of 32 x 32 x 32 cells of the box of positions, and those of them that were accepted.
        bounds (end, axis) [m]
            Of the accepted positions; nan where there are none.
        volume, volume_interval (end) [m^3]
            Share of the samples that was accepted times the volume of the box, the mean over what varies beside the
            position, with the interval of Clopper and Pearson at 95 %: an area or a length of a box without thickness
            along some axes. With `lengths`: of the cells reached, no interval; a grid has none either. Adaptive:
            between the cells that lie inside, and these with those that the boundary passes through.
        boundary (cell, axis) [m], cell_edges (axis) [m]
            Of adaptive: centres of the smallest cells with corners that differ, and their edges.

    Its attributes are what was asked, `samples` and `accepted`, and of this run `seconds` and `poses_per_s`.

    Raises
    ------
    InputError
        If an argument is wrong, the region is empty, the checkpoint cannot be written, is damaged or of another run, or
        there is no such scheduler. No file was changed then.
    SolverError
        If workers end before their work, or the extra `cluster` is not there.
    """
    start = time.perf_counter()
    if not isinstance(robot, Robot):
        raise InputError(f"robot: is {robot!r}; accepted: a Robot, as load('wang-flying') returns it")
    condition = condition_from(dict(condition) if isinstance(condition, Mapping) else condition)
    region = _region(region)
    check_sampling(method, samples, seed)
    whole("workers", workers, 1, 1024)
    whole("points_max", points_max, 0, MOST_POINTS)
    if keep not in KEEP:
        raise InputError(f"keep: {keep!r} is unknown; accepted: {', '.join(KEEP)}")
    if resume and checkpoint is None:
        raise InputError("resume: needs a checkpoint; accepted: the path of one")
    if size is not None and method != "adaptive":
        raise InputError(f"size: method {method!r} has no cells to halve; accepted: None, or method adaptive")
    domain = Domain.of(robot, region)
    refinement = Refinement(domain, samples, size) if method == "adaptive" else None
    sampler = None if refinement else Sampler(method, samples, seed, tuple(domain.extent.tolist()))
    # One place, for wrong input that the condition alone can see, before a file or a worker is there.
    condition.holds(robot, domain.places(np.full((1, len(domain.extent)), 0.5))[0])
    asked = {
        "robot": robot.name,
        "condition": json.dumps(condition.model_dump(mode="json"), sort_keys=True),
        "region": json.dumps(region.model_dump(mode="json"), sort_keys=True),
        "method": method,
        "seed": int(seed),
    }
    wanted = int(samples) if sampler is None else sampler.samples
    outcome = Outcome(domain, points_max if keep != "none" else 0)
    packed = Question(robot, condition, domain, sampler, keep, wanted).packed()
    header = _header(robot, {**asked, "samples": wanted, "size": size})
    opened = open_checkpoint(Path(checkpoint), header, resume) if checkpoint is not None else nullcontext()
    with executor(packed, workers, scheduler) as run, opened as stored:
        work = _Work(run, outcome, stored, progress, wanted)
        if refinement is None:
            assert sampler is not None
            work.through(sampler)
        else:
            work.refine(refinement)
    found = outcome.dataset(keep, method, refinement)
    seconds = time.perf_counter() - start
    found.attrs = {
        **asked,
        "samples": outcome.tried,
        "accepted": outcome.accepted,
        "keep": keep,
        "towline": __version__,
        "seconds": seconds,
        "poses_per_s": outcome.tried / seconds,
        "workers": "cluster" if scheduler is not None else str(workers),
    }
    return found


def save(found: xr.Dataset, file: str | os.PathLike[str]) -> Path:
    """Save what `sample` found, whole or not at all: as NetCDF, or as a Zarr folder if the path ends in .zarr.

    `xarray.load_dataset` reads the one, `xarray.open_zarr` the other (extra `cluster`). What is of the run and not of
    the result, as the seconds it took, is left out: equal results are equal NetCDF files.

    Raises
    ------
    InputError
        If the place cannot be written to, or is a Zarr folder that is there already.
    """
    path = Path(file)
    lasting = found.copy(deep=False)
    lasting.attrs = {name: value for name, value in found.attrs.items() if name not in OF_THIS_RUN}
    if path.suffix == ".zarr":
        return _save_zarr(lasting, path)
    compressed = [str(name) for name, variable in lasting.data_vars.items() if variable.size > CHUNK]
    return save_netcdf(Contents.of(lasting), path, compressed)


def _save_zarr(found: xr.Dataset, path: Path) -> Path:
    if find_spec("zarr") is None:
        raise InputError(f"{path}: zarr is not installed; accepted: pip install 'towline[cluster]', or a path to .nc")
    with whole_folder(path) as temporary:
        found.to_zarr(temporary, mode="w", zarr_format=2, consolidated=True)
    return path


class _Work:
    """Goes through the chunks of a run: what the checkpoint has is taken from it, what comes is added to it."""

    def __init__(
        self, run: Run, outcome: Outcome, checkpoint: Checkpoint | None, progress: Progress | None, wanted: int
    ):
        self._run, self._outcome, self._checkpoint = run, outcome, checkpoint
        self._progress, self._wanted = progress, wanted

    def through(self, sampler: Sampler) -> None:
        """Go through all chunks of a sampler."""
        together = _together(sampler.chunks)

        def jobs() -> Iterator[Job]:
            for first in range(0, sampler.chunks, together):
                chunks = range(first, min(first + together, sampler.chunks))
                yield self._job(first, [sampler.size(chunk) for chunk in chunks], None)

        for _ in self._answers(jobs(), 0):
            pass

    def refine(self, refinement: Refinement) -> None:
        """Go through all levels of a refinement."""
        levels = refinement.levels()
        units = next(levels)
        first = 0
        while True:
            pieces = np.split(units, range(CHUNK, len(units), CHUNK))

            def jobs(pieces: list[np.ndarray] = pieces, first: int = first) -> Iterator[Job]:
                together = _together(len(pieces))
                for start in range(0, len(pieces), together):
                    some = tuple(pieces[start : start + together])
                    yield self._job(first + start, [len(piece) for piece in some], some)

            flags = np.concatenate(list(self._answers(jobs(), first)))
            first += len(pieces)
            try:
                units = levels.send(flags)
            except StopIteration:
                break

    def _job(self, first: int, sizes: list[int], units: tuple[np.ndarray, ...] | None) -> Job:
        known = [self._checkpoint.answer(first + i, n) if self._checkpoint else None for i, n in enumerate(sizes)]
        return Job(first, tuple(known), units, self._outcome.has_room)

    def _answers(self, jobs: Iterator[Job], first: int) -> Iterator[np.ndarray]:
        """Flags (n,) of the samples, chunk after chunk."""
        chunk = first
        for count in self._run(jobs):
            self._outcome.add(count)
            for size, answer in zip(count.sizes, count.answers, strict=True):
                if self._checkpoint:
                    self._checkpoint.append(chunk, size, answer)
                chunk += 1
                yield np.unpackbits(np.frombuffer(answer, np.uint8), count=size).astype(bool)
            if self._progress is not None:
                self._progress(self._outcome.tried, self._wanted, self._outcome.accepted)


def _together(chunks: int) -> int:
    """Chunks in a job: few enough that all workers have some, enough that sending them is little."""
    return min(LARGEST_JOB, max(1, chunks // 64))


def _region(region: Region | Mapping[str, Any] | None) -> Region:
    if isinstance(region, Region):
        return region
    return Region.model_validate({} if region is None else region)


def _header(robot: Robot, asked: dict[str, Any]) -> dict[str, Any]:
    """All that decides on the answers."""
    import scipy

    data = hashlib.sha256(robot.model_dump_json().encode()).hexdigest()
    versions = {"towline": __version__, "numpy": np.__version__, "scipy": scipy.__version__}
    return {**asked, "robot": f"{robot.name} {data[:16]}", "chunk": CHUNK, **versions}
