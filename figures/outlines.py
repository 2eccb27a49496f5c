"""Outlines of regions to keep out of as variables of a dataset, so that a file has all that a film draws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base.netcdf import Contents, Variable, numbers_of

if TYPE_CHECKING:
    import xarray as xr


def outline_variables(regions: Sequence[Sequence[np.ndarray]]) -> dict[str, Variable]:
    """Return the lines (n, 3) in {G} [m] of each region as variables; none without regions."""
    lines = [(number, line) for number, region in enumerate(regions, 1) for line in region]
    if not lines:
        return {}
    points = np.concatenate([np.append(line, np.full((1, 3), np.nan), axis=0) for _, line in lines])
    numbers = np.repeat([number for number, _ in lines], [len(line) + 1 for _, line in lines])
    about = "lines along the regions to keep out of in G, nan after each line"
    return {
        "keep_out": Variable(("outline", "axis"), points, {"units": "m", "long_name": about}),
        "keep_out_region": Variable(("outline",), numbers, {"long_name": "region of each point, from 1"}),
    }


def outlines_from(dataset: xr.Dataset | Contents, where: str) -> list[list[np.ndarray]]:
    """Return the lines of each region that a dataset, named `where` in errors, has; none without regions.

    Raises `InputError` if its variables are no outlines.
    """
    contents = dataset if isinstance(dataset, Contents) else Contents.of(dataset)
    if contents.get("keep_out") is None:
        return []
    points = numbers_of(contents, "keep_out", (-1, 3), where, gaps=True)
    numbers = numbers_of(contents, "keep_out_region", (len(points),), where)
    gaps = np.isnan(points[:, 0])
    regions: dict[float, list[np.ndarray]] = {}
    for rows in np.split(np.arange(len(points)), np.flatnonzero(gaps) + 1):
        if len(line := points[rows[~gaps[rows]]]):
            regions.setdefault(float(numbers[rows[0]]), []).append(line)
    return list(regions.values())
