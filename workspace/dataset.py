"""The dataset of a run (counts, samples, volume and boundary with units), its files and figure, and its `Counts`.

The result does not depend on the process, to the last bit. Chunks with known flags, from a checkpoint, are counted
again without evaluating the condition.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import processors
from ..base.display import Displayed
from ..base.inputs import InputError, check_ending, file_path, required, shown
from ..base.netcdf import Contents, save_netcdf
from ..base.writing import whole_folder
from ..models.files import AnyRobot, as_robot
from .condition import Condition, Places
from .domain import THINNEST, Domain
from .metrics import METRICS, metric_values
from .refinement import Refinement
from .sampling import CHUNK, Sampler
from .volume import LEVEL, share_interval

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

RESOLUTION = 32  # cells along each axis
METRES = {"units": "m"}
OF_THIS_RUN = ("seconds", "poses_per_s", "workers")  # left out of files, which are equal whatever computed them


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


def dataset(
    counts: Counts, domain: Domain, keep: str, method: str, refinement: Refinement | None, metrics: tuple[str, ...]
) -> xr.Dataset:
    """Return the results of a run as a dataset, which `sample` documents."""
    import xarray as xr

    bounds = np.stack([counts.low, counts.high]) if counts.accepted else np.full((2, 3), np.nan)
    variables: dict[str, Any] = {
        "bounds": (("end", "axis"), bounds, METRES),
        "tried": (("x", "y", "z"), counts.cells[0], {"units": "1", "long_name": "samples tried in the cell"}),
        "reached": (("x", "y", "z"), counts.cells[1], {"units": "1", "long_name": "samples accepted in the cell"}),
        **_volume(counts, domain, method, refinement),
    }
    coordinates: dict[str, Any] = {"axis": ["x", "y", "z"], "end": ["min", "max"]}
    for name, low, high, count in zip("xyz", *domain.box, counts.cells.shape[1:], strict=True):
        coordinates[name] = ((name,), low + (np.arange(count) + 0.5) * (high - low) / count, METRES)
    if keep != "none":
        variables |= _kept(counts, domain, keep, metrics)
        coordinates |= {"angle": ["roll", "pitch", "yaw"]} if domain.attitude_varies else {}
        names = [carrier.name for carrier in domain.robot.carriers]
        coordinates |= {"carrier": names} if domain.carriers_vary else {}
    if refinement is not None:
        variables |= _boundary(domain, refinement)
    return xr.Dataset(variables, coordinates)


def save(result: xr.Dataset, file: str | os.PathLike[str]) -> Path:
    """Save a result of `sample` atomically: as NetCDF, or as a Zarr folder if the path ends in .zarr.

    `xarray.load_dataset` reads the former, `xarray.open_zarr` the latter (extra `cluster`). Attributes of the run, such
    as its duration, are left out, so that equal results are equal NetCDF files.

    Raises `InputError` if an argument has a wrong type, the file cannot be written, or is a Zarr folder that exists
    already.
    """
    import xarray as xr

    required("result", result, xr.Dataset)
    path = file_path("file", file)
    lasting = result.copy(deep=False)
    lasting.attrs = {name: value for name, value in result.attrs.items() if name not in OF_THIS_RUN}
    if path.suffix == ".zarr":
        return _save_zarr(lasting, path)
    compressed = [str(name) for name, variable in lasting.data_vars.items() if variable.size > CHUNK]
    return save_netcdf(Contents.of(lasting), check_ending("file", path, ".nc", ".zarr"), compressed)


def _save_zarr(result: xr.Dataset, path: Path) -> Path:
    if find_spec("zarr") is None:
        raise InputError(f"file must end in .nc unless zarr is installed (pip install 'towline[cluster]'), got {path}")
    with whole_folder(path) as temporary:
        result.to_zarr(temporary, mode="w", zarr_format=2, consolidated=True)
    return path


def _kept(counts: Counts, domain: Domain, keep: str, metrics: tuple[str, ...]) -> dict[str, Any]:
    rows = np.vstack([np.empty((0, domain.numbers_kept + len(metrics))), *counts.samples])
    values, rows = rows[:, domain.numbers_kept :], rows[:, : domain.numbers_kept]
    kept: dict[str, Any] = {"position": (("point", "axis"), rows[:, :3], METRES)}
    if domain.attitude_varies:
        kept["attitude"] = (("point", "angle"), rows[:, 3:6], {"units": "rad"})
    if domain.carriers_vary:
        where = rows[:, 6 if domain.attitude_varies else 3 :].reshape(len(rows), len(domain.robot.carriers), 3)
        kept["carrier_position"] = (("point", "carrier", "axis"), where, METRES)
    for name, column in zip(metrics, values.T, strict=True):
        kept[name] = (("point",), column, {"units": METRICS[name].unit, "long_name": METRICS[name].about})
    if keep == "all":
        flags = np.concatenate([np.empty(0, dtype=bool), *counts.flags])
        kept["accepted"] = (("point",), flags, {"long_name": "whether the condition holds"})
    return kept


def _boundary(domain: Domain, refinement: Refinement) -> dict[str, Any]:
    corners, _ = domain.places(refinement.cells)
    upper, _ = domain.places(refinement.cells + refinement.edges)
    edges = np.zeros(len(domain.low))
    edges[domain.varying] = domain.extent * refinement.edges
    about = {"units": "m", "long_name": "centres of the smallest cells, through which the boundary passes"}
    return {
        "boundary": (("cell", "axis"), (corners.pose[:, :3] + upper.pose[:, :3]) / 2, about),
        "cell_edges": (("axis",), edges[:3], {"units": "m", "long_name": "edges of the smallest cells"}),
    }


def _volume(counts: Counts, domain: Domain, method: str, refinement: Refinement | None) -> dict[str, Any]:
    ends = np.nan, np.nan
    if refinement is not None:
        ends = refinement.inside, refinement.inside + refinement.mixed
        value = refinement.estimate
        about = "lower and upper bound, if the first, coarse grid misses no part of the workspace"
    elif domain.position_from_lengths:
        value = np.count_nonzero(counts.cells[1]) / counts.cells[1].size
        about = "no interval: positions are not uniform; this is the volume of the cells reached"
    else:
        value = counts.accepted / counts.tried
        about = "no interval: a grid is not random; it can be off by half a layer of cells along the boundary"
        if method != "grid":
            ends = share_interval(counts.accepted, counts.tried)
            about = f"{100 * LEVEL:g} % confidence interval of Clopper and Pearson"
            about += "; with sobol the error is usually smaller" * (method == "sobol")
    unit = {"units": domain.measure_unit}
    return {
        "volume": ((), domain.measure * value, unit),
        "volume_interval": (("end",), [domain.measure * end for end in ends], {**unit, "long_name": about}),
    }


def draw(result: xr.Dataset, robot: AnyRobot | None = None) -> Figure:
    """Draw the metrics of a workspace as contours, or, if it has none, where samples were accepted.

    Args:
        result: A result of `sample`.
        robot: The robot whose anchors are drawn as triangles (default: none).

    Raises:
        InputError: If an argument has a wrong type, or the result is not one of `sample`.
    """
    import xarray as xr

    from ..figures.workspace import metric_map, reached

    required("result", result, xr.Dataset)
    if "reached" not in result:
        raise InputError(f"result must be a result of sample, got a dataset with {shown(list(result.data_vars))}")
    anchors = None if robot is None else as_robot(robot).home_anchors
    metrics = [str(name) for name in result.data_vars if name in METRICS]
    return metric_map(result, metrics, anchors) if metrics else reached(result, anchors)
