"""`sample`: evaluate a condition at 10^3 to 10^9 configurations of a robot."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
from typing_extensions import Unpack

from ..base.checkpoint import Checkpoint, Kind
from ..base.execution import Execution, ExecutionOptions, Progress, Workers, started
from ..base.inputs import InputError, one_of, required, shown, whole_number, with_fields
from ..base.version import __version__
from ..models import Robot
from ..models.files import AnyRobot, as_robot
from .condition import Condition, condition_from, for_robots
from .dataset import Counter, Counts, dataset
from .domain import Domain
from .metrics import metric_names, metric_values
from .refinement import Refinement
from .region import Region
from .sampling import CHUNK, Sampler, check_sampling, chunks_of

if TYPE_CHECKING:
    import xarray as xr

KEEP = ("accepted", "all", "none")
MOST_POINTS = 10_000_000
LARGEST_JOB = 8  # chunks
KIND = Kind("workspace", "chunk")  # a result is which samples are accepted, one bit each


def sample(
    robot: AnyRobot,
    condition: Condition | Mapping[str, Any],
    region: Region | Mapping[str, Any] | None = None,
    samples: int = 60_000,
    method: str = "random",
    seed: int = 0,
    *,
    size: float | None = None,
    keep: str = "accepted",
    points_max: int = 1_000_000,
    metrics: str | Sequence[str] = (),
    robust: float | None = None,
    execution: Execution | None = None,
    **options: Unpack[ExecutionOptions],
) -> xr.Dataset:
    """Sample the configurations at which a condition holds.

    The result does not depend on the number of workers, to the last bit. Memory does not grow with the number of
    samples, because beyond `points_max` samples only counts are kept.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        condition: A `Condition`, or a mapping with its `kind` and keys.
        region: A `Region`, or a mapping of its keys; default: a box about home and anchors, down to the floor and
            inside the `workspace_box` of the robot file, and everything else at home.
        samples: Number of samples. A grid and adaptive refinement have at most this many.
        method: random; sobol (low discrepancy); grid; adaptive: cells whose corners differ are halved.
        seed: Seed of the random streams, and of the scrambling of sobol.
        size: Smallest cell edge of the adaptive method [m]; default: as small as the number of samples permits.
        keep: Samples in the dataset: accepted, all or none.
        points_max: Maximum number of samples in the dataset; the first ones are kept.
        metrics: Names of metrics to compute at the samples in the dataset, any of `METRICS` (default: none).
        robust: Fraction of all robots within the `uncertainty` of the robot file, such as 0.95, for which the
            conditions about tension limits hold at all accepted configurations, to first order. It sets the key
            `robust` of these conditions; others are not affected.
        execution: Workers and checkpoint, see `Execution`. Its `progress` is called with (samples done, samples in
            total, samples accepted); the total is an upper bound for adaptive.
        options: Fields of `Execution` by their names, which replace its own.

    Returns:
        Dataset: Its attributes are the arguments, `samples` and `accepted`, and the speed of this run, `seconds` and
            `poses_per_s`. Its variables are

            - `position` (point, axis) [m]: positions of the samples kept; `attitude` (point, angle) [rad] and
              `carrier_position` (point, carrier, axis) [m] if they vary; `accepted` (point) if all samples are kept.
            - `margin`, `natural_frequency`, `payload`, ... (point): the `metrics`, in their units; nan where they need
              tensions and there are none.
            - `tried`, `reached` (x, y, z): samples in each of 32 x 32 x 32 cells of the box of positions, and accepted
              samples.
            - `bounds` (end, axis) [m]: bounds of the accepted positions; nan if there are none.
            - `volume`, `volume_interval` (end) [m^3]: accepted fraction of the samples times the volume of the box,
              with the 95 % interval of Clopper and Pearson. It is the mean over all other varying quantities, and an
              area or a length if the box has no thickness along some axes. With `lengths` it is the volume of the cells
              reached, without an interval; a grid has no interval either. Adaptive: the interval from the cells inside
              to the cells inside or on the boundary.
            - `boundary` (cell, axis) [m], `cell_edges` (axis) [m]: adaptive method only, centres of the smallest cells
              with differing corners, and their edges.

    Raises:
        InputError: If an argument is wrong, the region is empty, the checkpoint cannot be written, is damaged or
            belongs to another run, or the scheduler does not exist. No file is changed then.
        SolverError: If workers end before their work is done, or the extra `cluster` is not installed.
    """
    start = time.perf_counter()
    robot = as_robot(robot)
    condition = condition_from(dict(condition) if isinstance(condition, Mapping) else condition)
    condition = for_robots(condition, robust)
    region = Region.model_validate({} if region is None else region)
    check_sampling(method, samples, seed)
    where = required("execution", Execution() if execution is None else execution, Execution)
    (where,) = with_fields("sample", dict(options), where)
    whole_number("points_max", points_max, 0, MOST_POINTS)
    one_of("keep", keep, KEEP)
    metrics = metric_names(metrics)
    if metrics and keep == "none":
        raise InputError("keep must be accepted or all with metrics, got 'none'")
    if size is not None and method != "adaptive":
        raise InputError(f"size must be left out unless method is adaptive, got {shown(size)}")
    domain = Domain.of(robot, region)
    refinement = Refinement(domain, samples, size) if method == "adaptive" else None
    sampler = None if refinement else Sampler(method, samples, seed, tuple(domain.extent.tolist()))
    # At one place, for wrong input that only the condition can detect, before there is a file or a worker.
    middle = domain.places(np.full((1, len(domain.extent)), 0.5))[0]
    condition.holds(robot, middle)
    for name in metrics:
        metric_values(name, robot, middle)
    requested = {
        "robot": robot.name,
        "condition": json.dumps(condition.model_dump(mode="json"), sort_keys=True),
        "region": json.dumps(region.model_dump(mode="json"), sort_keys=True),
        "method": method,
        "seed": int(seed),
    }
    total = int(samples) if sampler is None else sampler.samples
    counter = Counter(condition, domain, sampler, keep, total, metrics)
    counts = Counts(domain, points_max if keep != "none" else 0)
    depends_on = {**requested, "samples": total, "size": size}
    with started(where, KIND, lambda: _header(robot, depends_on)) as (workers, stored):
        _Run(counter, counts, workers, stored, where.progress).count(refinement)
    result = dataset(counts, domain, keep, method, refinement, metrics)
    seconds = time.perf_counter() - start
    result.attrs = {
        **requested,
        "samples": counts.tried,
        "accepted": counts.accepted,
        "keep": keep,
        "towline": __version__,
        "seconds": seconds,
        "poses_per_s": counts.tried / seconds,
        "workers": "cluster" if where.scheduler is not None else str(where.workers),
    }
    return result


class _Run:
    """Count chunk after chunk: chunks in the checkpoint are read from it, the others are appended to it."""

    def __init__(
        self,
        counter: Counter,
        counts: Counts,
        workers: Workers,
        checkpoint: Checkpoint | None,
        progress: Progress | None,
    ):
        self._counter = counter
        self._counts, self._workers, self._checkpoint, self._progress = counts, workers, checkpoint, progress
        self._chunk = 0

    def count(self, refinement: Refinement | None) -> None:
        """Count all samples: the sampler's, or those of a refinement, level by level."""
        if refinement is None:
            for _ in self.flags(self._counter.samples):
                pass
            return
        levels = refinement.levels()
        points = next(levels)
        with suppress(StopIteration):
            while True:
                points = levels.send(np.concatenate(list(self.flags(len(points), points))))

    def flags(self, samples: int, points: np.ndarray | None = None) -> Iterator[np.ndarray]:
        """Count the next samples; yield which of them are accepted, (n,) of bool, chunk after chunk.

        Their `points` are of the unit cube, (samples, d); default: the sampler's.
        """
        for counts, chunks in self._workers.map(self._counter.count, self._jobs(samples, points)):
            self._counts.add(counts)
            left = counts.tried
            for flags in chunks:
                size = min(CHUNK, left)
                left -= size
                if self._checkpoint:
                    self._checkpoint.put(self._chunk, flags)
                self._chunk += 1
                yield np.unpackbits(np.frombuffer(flags, np.uint8), count=size).astype(bool)
            if self._progress is not None:
                self._progress(self._counts.tried, self._counter.samples, self._counts.accepted)

    def _jobs(self, samples: int, points: np.ndarray | None) -> Iterator[tuple[Any, ...]]:
        """Yield the arguments of `Counter.count`, a few chunks each, so that all workers have jobs at low cost."""
        first, chunks = self._chunk, chunks_of(samples)
        together = min(LARGEST_JOB, max(1, chunks // 64))
        for start in range(0, chunks, together):
            some = range(start, min(start + together, chunks))
            known = [self._checkpoint and self._checkpoint.get(first + i) for i in some]
            units = None if points is None else [points[i * CHUNK : (i + 1) * CHUNK] for i in some]
            yield first + start, known, units, self._counts.left > 0


def _header(robot: Robot, requested: dict[str, Any]) -> dict[str, Any]:
    """Return everything on which the flags depend."""
    import scipy

    data = hashlib.sha256(robot.model_dump_json().encode()).hexdigest()
    versions = {"towline": __version__, "numpy": np.__version__, "scipy": scipy.__version__}
    return {**requested, "robot": f"{robot.name} {data[:16]}", "chunk": CHUNK, **versions}
