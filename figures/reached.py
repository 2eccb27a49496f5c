"""Which places were reached, seen along each axis: the share of the samples behind each point that was accepted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def projections(found: xr.Dataset) -> Figure:
    """Views from above, from the front and from the side; those along an axis that has an extent of its own.

    Parameters
    ----------
    found
        With `tried` and `reached` (x, y, z), counts in cells, as `workspace.sample` returns it.
    """
    thick = [name for name in ("x", "y", "z") if found.sizes[name] > 1]
    pairs = [(a, b) for a, b in (("x", "y"), ("x", "z"), ("y", "z")) if a in thick and b in thick]
    canvas = style.figure(width=1.0 + 3.6 * max(len(pairs), 1), height=3.4)
    if not pairs:
        _line(canvas, found, thick[0] if thick else "x")
        return canvas
    panels = []
    for index, (across, up) in enumerate(pairs):
        behind = next(name for name in ("x", "y", "z") if name not in (across, up))
        ax = style.axes(canvas, f"{across} [m]", f"{up} [m]", (1, len(pairs), index + 1))
        share = _share(found, (behind,)).transpose(up, across)
        ax.pcolormesh(found[across], found[up], share, vmin=0, vmax=1, cmap="viridis", rasterized=True)
        ax.set_aspect("equal")
        panels.append(ax)
    canvas.colorbar(panels[0].collections[0], ax=panels, label="share accepted along the line of sight [-]")
    return canvas


def _line(canvas: Figure, found: xr.Dataset, along: str) -> None:
    """Of a region of one dimension."""
    share = _share(found, tuple(name for name in ("x", "y", "z") if name != along))
    style.axes(canvas, f"{along} [m]", "share accepted [-]").plot(found[along], share, color=style.colour(0))


def _share(found: xr.Dataset, over: tuple[str, ...]) -> xr.DataArray:
    """Accepted of those tried, nan where none were."""
    tried, reached = found["tried"].sum(over), found["reached"].sum(over)
    # What nothing was accepted of stays white.
    return (reached / tried.where(tried > 0)).where(reached > 0, np.nan)
