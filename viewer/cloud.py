"""Convert a workspace to coloured points."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..base.display import Displayed
from ..base.errors import InputError
from ..base.netcdf import numbers_of
from ..base.text import quantity
from ..figures import style
from ..figures.tension_colours import rgb
from .geometry import FARTHEST

MOST_POINTS = 10_000  # more hide the robot among them
ACCEPTED, REFUSED = style.colour(2), style.colour(5)  # bluish green and orange: colours that do not need colour vision


@dataclass(frozen=True)
class Cloud(Displayed):
    """Coloured points in {G}."""

    positions: np.ndarray  # (n, 3) [m]
    colours: np.ndarray  # bytes (n, 3)
    legend: list[tuple[str, str]]  # (name, colour) pairs
    summary: str  # the number of points, as a sentence
    dataset: xr.Dataset  # source dataset


def cloud(dataset: xr.Dataset, where: str) -> Cloud:
    """Return the points of a dataset of `workspace.sample`; with `keep="none"`, the centres of the reached cells.

    Raises `InputError` if the dataset has no such points.
    """
    if "position" not in dataset:
        return _cells(dataset, where)
    positions = _places(dataset, "position", (-1, 3), where)
    accepted = (
        dataset["accepted"].to_numpy().astype(bool) if "accepted" in dataset else np.ones(len(positions), dtype=bool)
    )
    if accepted.shape != positions.shape[:1]:
        raise InputError(f"{where}: accepted must be one flag for each position, got the shape {accepted.shape}")
    shown = slice(None, None, max(-(-len(positions) // MOST_POINTS), 1))
    positions, accepted = positions[shown], accepted[shown]
    colours = np.where(accepted[:, None], rgb(ACCEPTED), rgb(REFUSED)).astype(np.uint8)
    legend = [("accepted", ACCEPTED)] + ([] if accepted.all() else [("not accepted", REFUSED)])
    kept, tried = (_count(dataset, name) for name in ("accepted", "samples"))
    summary = f"{kept} of {tried} samples accepted, {len(positions)} points shown"
    return Cloud(positions, colours, legend, summary, dataset)


def _count(dataset: xr.Dataset, name: str) -> str:
    """Return a count among the attributes of a file as text, "?" for anything that is not a number."""
    value = dataset.attrs.get(name)
    return quantity(int(value)) if isinstance(value, int | np.integer) else "?"


def _places(dataset: xr.Dataset, name: str, shape: tuple[int, ...], where: str) -> np.ndarray:
    """Return a variable of positions; raise InputError unless all of them can be drawn."""
    positions = numbers_of(dataset, name, shape, where, gaps=True, largest=np.inf)
    wrong = ~(np.abs(positions) <= FARTHEST)
    if wrong.any():
        raise InputError(f"{where}: positions must be within {FARTHEST:g} m, got {positions[wrong][0]:g}")
    return positions


def _cells(dataset: xr.Dataset, where: str) -> Cloud:
    if "reached" not in dataset or dataset["reached"].dims != ("x", "y", "z"):
        raise InputError(f"{where} must be a file written by `towline workspace`, got one without positions and cells")
    cells = np.argwhere(numbers_of(dataset, "reached", (-1, -1, -1), where) > 0)
    axes = [_places(dataset, name, (-1,), where) for name in ("x", "y", "z")]
    positions = np.stack([axis[column] for axis, column in zip(axes, cells.T, strict=True)], axis=1)
    colours = np.tile(np.array(rgb(ACCEPTED), np.uint8), (len(positions), 1))
    summary = f"{len(positions)} cells with accepted samples, shown by their centres"
    return Cloud(positions, colours, [("accepted in this cell", ACCEPTED)], summary, dataset)
