"""`sample`: evaluate a condition at 10^3 to 10^9 places of a robot; `save`: write the result."""

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
from ..inputs import file_path, flag, one_of, required, shown, whole_number
from ..models import Robot
from ..netcdf import Contents, save_netcdf
from ..writing import whole_folder
from .checkpoint import Checkpoint, open_checkpoint
from .condition import Condition, condition_from
from .domain import Domain
from .execution import Evaluate, executor
from .jobs import Job, RunSettings
from .refinement import Refinement
from .region import Region
from .sampling import CHUNK, Sampler, check_sampling
from .totals import Totals

if TYPE_CHECKING:
    import xarray as xr

KEEP = ("accepted", "all", "none")
MOST_WORKERS = 1024
MOST_POINTS = 10_000_000
LARGEST_JOB = 8  # chunks
OF_THIS_RUN = ("seconds", "poses_per_s", "workers")  # left out of files, which are the same whoever computed them

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
    """Sample the places where a condition holds.

    The result is the same to the last bit for every number of workers. Memory does not grow with the number of samples:
    beyond `points_max` of them only counts are kept.

    Parameters
    ----------
    robot
        From `load` or `Robot.model_validate`.
    condition
        A `Condition`, or a mapping with its `kind` and keys.
    region
        A `Region`, or a mapping of its keys; default: a box about home and anchors, everything else at home.
    samples
        Number of samples. A grid and adaptive refinement have at most this many.
    method
        random; sobol or halton (low discrepancy); grid; adaptive: cells whose corners differ are halved.
    seed
        Of the random streams, and of the scrambling of sobol and halton.
    size
        Of adaptive: edge below which cells are not halved any more [m]; default: as small as the samples allow.
    workers
        Processes of this machine, each using one processor; 1: this process.
    scheduler
        Address of a Dask scheduler whose workers are used instead (extra `cluster`).
    checkpoint
        File to which results are appended as they come.
    resume
        Whether to continue the checkpoint if the file exists. It must be of the same run.
    progress
        Function that is called with (samples done, samples in total, samples accepted); the total is an upper bound for
        adaptive.
    keep
        Which samples the dataset contains: accepted, all or none.
    points_max
        Maximum number of samples that it contains, the first ones in the order of the samples.

    Returns
    -------
    Dataset with the variables
        position (point, axis) [m]
            Of the samples kept; attitude (point, angle) [rad] and carrier_position (point, carrier, axis) [m] where
            those vary; accepted (point) if all samples are kept.
        tried, reached (x, y, z)
            Samples in each of 32 x 32 x 32 cells of the box of positions, and those of them that were accepted.
        bounds (end, axis) [m]
            Of the accepted positions; nan where there are none.
        volume, volume_interval (end) [m^3]
            Share of accepted samples times the volume of the box, with the interval of Clopper and Pearson at 95 %. It
            is the mean over everything that varies beside the position, and an area or a length if the box has no
            thickness along some axes. With `lengths` it is the volume of the cells reached, without an interval; a grid
            has no interval either. Adaptive: from the cells that lie inside, to these and those that the boundary
            passes through.
        boundary (cell, axis) [m], cell_edges (axis) [m]
            Of adaptive: centres of the smallest cells with corners that differ, and their edges.

    Its attributes are the arguments, `samples` and `accepted`, and of this run `seconds` and `poses_per_s`.

    Raises
    ------
    InputError
        If an argument is wrong, the region is empty, the checkpoint cannot be written, is damaged or of another run, or
        there is no such scheduler. No file has been changed then.
    SolverError
        If workers end before their work is done, or the extra `cluster` is not installed.
    """
    start = time.perf_counter()
    required("robot", robot, Robot)
    condition = condition_from(dict(condition) if isinstance(condition, Mapping) else condition)
    region = _region(region)
    check_sampling(method, samples, seed)
    whole_number("workers", workers, 1, MOST_WORKERS)
    whole_number("points_max", points_max, 0, MOST_POINTS)
    one_of("keep", keep, KEEP)
    if scheduler is not None and not (isinstance(scheduler, str) and scheduler):
        raise InputError(f"scheduler must be the address of a Dask scheduler or None, got {shown(scheduler)}")
    file = None if checkpoint is None else file_path("checkpoint", checkpoint, "a path or None")
    flag("resume", resume)
    if progress is not None and not callable(progress):
        raise InputError(f"progress must be a function or None, got {shown(progress)}")
    if resume and file is None:
        raise InputError("checkpoint must be a path if resume is True, got None")
    if size is not None and method != "adaptive":
        raise InputError(f"size must be None unless method is adaptive, got {shown(size)}")
    domain = Domain.of(robot, region)
    refinement = Refinement(domain, samples, size) if method == "adaptive" else None
    sampler = None if refinement else Sampler(method, samples, seed, tuple(domain.extent.tolist()))
    # At one place, for wrong input that only the condition can detect, before there is a file or a worker.
    condition.holds(robot, domain.places(np.full((1, len(domain.extent)), 0.5))[0])
    requested = {
        "robot": robot.name,
        "condition": json.dumps(condition.model_dump(mode="json"), sort_keys=True),
        "region": json.dumps(region.model_dump(mode="json"), sort_keys=True),
        "method": method,
        "seed": int(seed),
    }
    total = int(samples) if sampler is None else sampler.samples
    totals = Totals(domain, points_max if keep != "none" else 0)
    packed = RunSettings(robot, condition, domain, sampler, keep, total).packed()
    header = _header(robot, {**requested, "samples": total, "size": size})
    opened = open_checkpoint(file, header, resume) if file is not None else nullcontext()
    with executor(packed, workers, scheduler) as evaluate, opened as stored:
        work = _Work(evaluate, totals, stored, progress, total)
        if refinement is None:
            assert sampler is not None
            work.sample(sampler)
        else:
            work.refine(refinement)
    result = totals.dataset(keep, method, refinement)
    seconds = time.perf_counter() - start
    result.attrs = {
        **requested,
        "samples": totals.tried,
        "accepted": totals.accepted,
        "keep": keep,
        "towline": __version__,
        "seconds": seconds,
        "poses_per_s": totals.tried / seconds,
        "workers": "cluster" if scheduler is not None else str(workers),
    }
    return result


def save(result: xr.Dataset, file: str | os.PathLike[str]) -> Path:
    """Save a result of `sample`, whole or not at all: as NetCDF, or as a Zarr folder if the path ends in .zarr.

    `xarray.load_dataset` reads the one, `xarray.open_zarr` the other (extra `cluster`). Attributes of the run, such as
    the seconds it took, are left out: equal results are equal NetCDF files.

    Raises
    ------
    InputError
        If an argument has a wrong type, the file cannot be written, or is a Zarr folder that exists already.
    """
    import xarray as xr

    required("result", result, xr.Dataset)
    path = file_path("file", file)
    lasting = result.copy(deep=False)
    lasting.attrs = {name: value for name, value in result.attrs.items() if name not in OF_THIS_RUN}
    if path.suffix == ".zarr":
        return _save_zarr(lasting, path)
    compressed = [str(name) for name, variable in lasting.data_vars.items() if variable.size > CHUNK]
    return save_netcdf(Contents.of(lasting), path, compressed)


def _save_zarr(result: xr.Dataset, path: Path) -> Path:
    if find_spec("zarr") is None:
        raise InputError(f"file must end in .nc unless zarr is installed (pip install 'towline[cluster]'), got {path}")
    with whole_folder(path) as temporary:
        result.to_zarr(temporary, mode="w", zarr_format=2, consolidated=True)
    return path


class _Work:
    """Evaluate the chunks of a run: those that the checkpoint has are read from it, the others are appended to it."""

    def __init__(
        self, evaluate: Evaluate, totals: Totals, checkpoint: Checkpoint | None, progress: Progress | None, total: int
    ):
        self._evaluate, self._totals, self._checkpoint = evaluate, totals, checkpoint
        self._progress, self._total = progress, total

    def sample(self, sampler: Sampler) -> None:
        """Evaluate all chunks of a sampler."""
        together = _together(sampler.chunks)

        def jobs() -> Iterator[Job]:
            for first in range(0, sampler.chunks, together):
                chunks = range(first, min(first + together, sampler.chunks))
                yield self._job(first, [sampler.size(chunk) for chunk in chunks], None)

        for _ in self._flags(jobs(), 0):
            pass

    def refine(self, refinement: Refinement) -> None:
        """Evaluate all levels of a refinement."""
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

            flags = np.concatenate(list(self._flags(jobs(), first)))
            first += len(pieces)
            try:
                units = levels.send(flags)
            except StopIteration:
                break

    def _job(self, first: int, sizes: list[int], units: tuple[np.ndarray, ...] | None) -> Job:
        known = [self._checkpoint.flags(first + i, n) if self._checkpoint else None for i, n in enumerate(sizes)]
        return Job(first, tuple(known), units, self._totals.keeps_more)

    def _flags(self, jobs: Iterator[Job], first: int) -> Iterator[np.ndarray]:
        """Yield which samples were accepted, (n,) of bool, chunk after chunk."""
        chunk = first
        for result in self._evaluate(jobs):
            self._totals.add(result)
            for size, flags in zip(result.sizes, result.flags, strict=True):
                if self._checkpoint:
                    self._checkpoint.append(chunk, size, flags)
                chunk += 1
                yield np.unpackbits(np.frombuffer(flags, np.uint8), count=size).astype(bool)
            if self._progress is not None:
                self._progress(self._totals.tried, self._total, self._totals.accepted)


def _together(chunks: int) -> int:
    """Return how many chunks make a job: few enough that all workers have jobs, enough that sending them is cheap."""
    return min(LARGEST_JOB, max(1, chunks // 64))


def _region(region: Region | Mapping[str, Any] | None) -> Region:
    if isinstance(region, Region):
        return region
    return Region.model_validate({} if region is None else region)


def _header(robot: Robot, requested: dict[str, Any]) -> dict[str, Any]:
    """Return everything that the flags depend on."""
    import scipy

    data = hashlib.sha256(robot.model_dump_json().encode()).hexdigest()
    versions = {"towline": __version__, "numpy": np.__version__, "scipy": scipy.__version__}
    return {**requested, "robot": f"{robot.name} {data[:16]}", "chunk": CHUNK, **versions}
