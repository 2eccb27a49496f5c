"""The dataset of a run (counts, samples, volume and boundary with names and units), and its files."""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError
from ..base.inputs import check_ending, file_path, required
from ..base.netcdf import Contents, save_netcdf
from ..base.writing import whole_folder
from .counts import Counts
from .domain import Domain
from .metrics import METRICS
from .refinement import Refinement
from .sampling import CHUNK
from .volume import LEVEL, share_interval

if TYPE_CHECKING:
    import xarray as xr

METRES = {"units": "m"}
OF_THIS_RUN = ("seconds", "poses_per_s", "workers")  # left out of files, which are equal whatever computed them


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
    """Return the volume and its interval."""
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
