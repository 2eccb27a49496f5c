"""`Cloud`: the points of a workspace, coloured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..errors import InputError
from ..figures import style
from .colours import rgb

MOST_POINTS = 10_000  # more hide the robot among them
ACCEPTED, REFUSED = style.colour(2), style.colour(5)  # bluish green and orange: told apart with any colour vision


@dataclass(frozen=True)
class Cloud:
    """Points in {G}.

    Attributes
    ----------
    positions, colours
        (n, 3) [m] and bytes (n, 3).
    legend
        What is told by which colour.
    told
        How many there are, a sentence.
    """

    positions: np.ndarray
    colours: np.ndarray
    legend: list[tuple[str, str]]
    told: str


def cloud(found: xr.Dataset, where: str) -> Cloud:
    """The points of what `workspace.sample` found; of `keep="none"` the middles of the cells that were reached.

    Raises
    ------
    InputError
        If there are no points of that form in it.
    """
    if "position" not in found:
        return _cells(found, where)
    positions = found["position"].to_numpy()
    if positions.ndim != 2 or positions.shape[1:] != (3,) or positions.dtype.kind != "f":
        raise InputError(f"{where}: position: has the shape {positions.shape}; accepted: (points, 3) numbers")
    accepted = found["accepted"].to_numpy().astype(bool) if "accepted" in found else np.ones(len(positions), dtype=bool)
    shown = slice(None, None, max(-(-len(positions) // MOST_POINTS), 1))
    positions, accepted = positions[shown], accepted[shown]
    colours = np.where(accepted[:, None], rgb(ACCEPTED), rgb(REFUSED)).astype(np.uint8)
    legend = [("accepted", ACCEPTED)] + ([] if accepted.all() else [("not accepted", REFUSED)])
    kept, tried = int(found.attrs.get("accepted", accepted.sum())), found.attrs.get("samples", "?")
    return Cloud(positions, colours, legend, f"{kept} of {tried} samples accepted, {len(positions)} points shown")


def _cells(found: xr.Dataset, where: str) -> Cloud:
    if "reached" not in found or found["reached"].dims != ("x", "y", "z"):
        raise InputError(f"{where}: has neither positions nor cells; accepted: a file of `towline workspace`")
    cells = np.argwhere(found["reached"].to_numpy() > 0)
    axes = [found[name].to_numpy() for name in ("x", "y", "z")]
    positions = np.stack([axis[column] for axis, column in zip(axes, cells.T, strict=True)], axis=1)
    colours = np.tile(np.array(rgb(ACCEPTED), np.uint8), (len(positions), 1))
    told = f"{len(positions)} cells with accepted samples, shown by their middles"
    return Cloud(positions, colours, [("accepted in this cell", ACCEPTED)], told)
