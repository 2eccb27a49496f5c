"""Draw workspaces: projections along the axes of {G}, cross sections at heights, accepted shares of samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

VIEWS = ((0, 1), (0, 2), (1, 2))  # axes of {G} in the pictures: from above, along y, along x
MOST_POINTS = 20_000  # of a series in a panel: more are not visible, and files grow


def projections(points: dict[str, np.ndarray], marks: np.ndarray | None = None) -> Figure:
    """Draw points of {G} from above and from two sides, at equal scales.

    Parameters
    ----------
    points
        (n, 3) [m] by label, drawn in their order.
    marks
        Points to mark, such as anchors, (k, 3) [m].
    """
    canvas = style.figure(7.2, 3.0)
    panels = [
        style.axes(canvas, f"{'xyz'[across]} [m]", f"{'xyz'[up]} [m]", (1, 3, column + 1))
        for column, (across, up) in enumerate(VIEWS)
    ]
    for ax, axes in zip(panels, VIEWS, strict=True):
        _panel(ax, {label: some[:, axes] for label, some in points.items()}, None if marks is None else marks[:, axes])
    style.legend_below(canvas, panels[0])
    return canvas


def cross_sections(
    points: np.ndarray, heights: list[float], thickness: float, marks: np.ndarray | None = None
) -> Figure:
    """Draw the points of {G} that lie within `thickness` / 2 of each of some heights, from above, at one scale.

    Parameters
    ----------
    points
        (n, 3) [m].
    heights, thickness
        [m].
    marks
        Points to mark, (k, 3) [m].
    """
    canvas = style.figure(2.4 * len(heights), 2.8)
    shown = [points[np.abs(points[:, 2] - height) <= thickness / 2][:, :2] for height in heights]
    every = np.vstack([*shown, *([] if marks is None else [marks[:, :2]])])
    for column, height in enumerate(heights):
        ax = style.axes(canvas, "x [m]", "y [m]", (1, len(heights), column + 1))
        _panel(ax, {"": shown[column]}, None if marks is None else marks[:, :2])
        ax.set_title(f"z = {height:g} m ± {500 * thickness:g} mm, {len(shown[column])} points", fontsize=8)
        if len(every):
            low, high = every.min(axis=0), every.max(axis=0)
            middle, half = (low + high) / 2, 0.55 * max(float((high - low).max()), 1e-6)
            ax.set_adjustable("box")  # the limits are what is to be equal
            ax.set_xlim(middle[0] - half, middle[0] + half)
            ax.set_ylim(middle[1] - half, middle[1] + half)
    return canvas


def reached(result: xr.Dataset) -> Figure:
    """Draw the accepted share of the samples along each line of sight: from above, from the front and the side.

    Axes along which the region has no extent are left out.

    Parameters
    ----------
    result
        From `workspace.sample`, with the counts `tried` and `reached` (x, y, z) of its cells.
    """
    thick = [name for name in ("x", "y", "z") if result.sizes[name] > 1]
    pairs = [(a, b) for a, b in (("x", "y"), ("x", "z"), ("y", "z")) if a in thick and b in thick]
    canvas = style.figure(width=0.9 + 2.2 * max(len(pairs), 1), height=2.8)
    if not pairs:
        _reached_along(canvas, result, thick[0] if thick else "x")
        return canvas
    panels = []
    for index, (across, up) in enumerate(pairs):
        behind = next(name for name in ("x", "y", "z") if name not in (across, up))
        ax = style.axes(canvas, f"{across} [m]", f"{up} [m]", (1, len(pairs), index + 1))
        share = _share(result, (behind,)).transpose(up, across)
        ax.pcolormesh(result[across], result[up], share, vmin=0, vmax=1, cmap="viridis", rasterized=True)
        ax.set_aspect("equal")
        panels.append(ax)
    canvas.colorbar(panels[0].collections[0], ax=panels, label="share accepted along the line of sight [-]")
    return canvas


def _panel(ax: Axes, points: dict[str, np.ndarray], marks: np.ndarray | None) -> None:
    for index, (label, some) in enumerate(points.items()):
        shown = some[:: -(-len(some) // MOST_POINTS)] if len(some) else some
        # Raster images inside: tens of thousands of shapes make files that are slow to view.
        ax.plot(*shown.T, ".", color=style.colour(index), markersize=1.2, label=label or None, rasterized=True)
    if marks is not None:
        ax.plot(*marks.T, "^", color="#000000", markersize=4, label="anchors")
    ax.set_aspect("equal", adjustable="datalim")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(style.few_ticks())


def _reached_along(canvas: Figure, result: xr.Dataset, along: str) -> None:
    """Draw the accepted share over the axis of a region of one dimension."""
    share = _share(result, tuple(name for name in ("x", "y", "z") if name != along))
    style.axes(canvas, f"{along} [m]", "share accepted [-]").plot(result[along], share, color=style.colour(0))


def _share(result: xr.Dataset, over: tuple[str, ...]) -> xr.DataArray:
    """Return the accepted share, nan where nothing was tried."""
    tried, reached = result["tried"].sum(over), result["reached"].sum(over)
    # Lines without an accepted sample stay white.
    return (reached / tried.where(tried > 0)).where(reached > 0, np.nan)
