"""Draw maps of metrics over a slice of a workspace, or over three layers of one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from . import style
from .workspace import SMOOTH, outer_edges

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.contour import QuadContourSet

CELLS = 32  # along each axis, at most
IN_A_CELL = 8  # samples that a cell should have: of half as many, some cells have none
LAYERS = 3  # of a volume, along z
LEVELS = 8
FLAT = 0.4  # height over width of a layer: with less, layers are drawn below one another
SHARE = 2.0  # [%] of the values below the lowest level, and above the highest one


def metric_map(result: xr.Dataset, metrics: Sequence[str], anchors: np.ndarray | None = None) -> style.Figure:
    """Draw contours of metrics: means of samples in each cell of positions and, with less weight, in its neighbours.

    A region without extent along one axis has one panel, a volume three: the lower, middle and upper third of the
    heights of its samples. Along a line, the samples themselves are drawn.

    - `result`: from `workspace.sample`, with the variables `metrics` and `position`.
    - `anchors`: anchors to mark, (m, 3) in {G} [m] (default: none).
    """
    thick = [k for k, name in enumerate("xyz") if result.sizes[name] > 1]
    position = result["position"].values
    layers, headings = [np.ones(len(position), dtype=bool)], [""]
    if len(thick) == 3:
        heights = position[:, 2] if len(position) else outer_edges(result["z"].values)
        low, high = np.min(heights), np.max(heights)
        ends = np.linspace(low, high, LAYERS + 1)
        digits = 2 - int(np.floor(np.log10(max(high - low, 1e-9))))
        between = list(pairwise(ends))
        layers = [(position[:, 2] >= low) & (position[:, 2] <= high) for low, high in between]
        headings = ["z = {:g} to\n{:g} m".format(*np.round(pair, digits)) for pair in between]
    marks = np.empty((0, 3)) if anchors is None else anchors
    axes = thick[:2]
    box = np.array([outer_edges(result["xyz"[k]].values) for k in axes])
    extent = np.ptp(np.vstack([box.T, marks[:, axes]]), axis=0)
    below = extent[-1] < FLAT * extent[0]  # layers below one another, not side by side
    columns = 1 if below else len(layers)
    rows, down = len(metrics), len(layers) // columns
    tall = (style.COLUMN - 0.8) / columns * extent[-1] / extent[0]  # of panels at equal scales [inches]
    tall = 2.5 if len(thick) == 1 else 0.8 + 0.15 * columns + down * float(np.clip(tall, 0.4, 3.5)) + 0.35 * (down - 1)
    canvas = style.figure(height=rows * tall)
    for row, name in enumerate(metrics):
        values, unit = result[name].values, style.typeset(result[name].attrs["units"])
        label = name.replace("_", " ") + ("" if unit == "1" else f" [{unit}]")
        if len(thick) == 1:
            ax = style.axes(canvas, f"{'xyz'[axes[0]]} [m]", label, (rows, 1, row + 1))
            ax.plot(position[:, axes[0]], values, ".", color=style.colour(0), markersize=2, rasterized=True)
            continue
        finite = np.isfinite(values)
        levels, panels, shades = _levels(values[finite]), [], None
        for index, (layer, heading) in enumerate(zip(layers, headings, strict=True)):
            lowest, leftmost = index >= len(layers) - columns, index % columns == 0
            labels = f"{'xyz'[axes[0]]} [m]" if lowest else "", f"{'xyz'[axes[1]]} [m]" if leftmost else ""
            place = rows * down, columns, row * len(layers) + index + 1
            ax = style.axes(canvas, *labels, place, panels[0] if panels else None)
            panels.append(ax)
            ax.grid(False)
            ax.set_aspect("equal", adjustable="box")
            ax.tick_params(labelbottom=lowest, labelleft=leftmost)
            for axis, count in ((ax.xaxis, 5 - columns), (ax.yaxis, 2 if below else 5 - columns)):
                axis.set_major_locator(style.few_ticks(count))
            style.heading(ax, heading.replace("\n", " ") if below else heading, 1 / columns)
            some = layer & finite
            count = int(np.clip(np.sqrt(some.sum() / IN_A_CELL), 2, CELLS))
            cells = [np.linspace(low, high, count + 1) for low, high in box]
            shades = _contours(ax, position[some][:, axes], values[some], cells, levels) or shades
            ax.plot(*marks[:, axes].T, "^", color="#000000", markersize=3, clip_on=False)
        if shades is not None:
            style.colour_bar(canvas, shades, panels, label, location="bottom", aspect=40)
    return canvas


def _contours(
    ax: style.Axes, position: np.ndarray, values: np.ndarray, cells: list[np.ndarray], levels: np.ndarray
) -> QuadContourSet | None:
    """Fill contours of the means of values in cells, given by their edges, if some neighbouring cells have samples."""
    from scipy.ndimage import gaussian_filter

    count, *_ = np.histogram2d(*position.T, bins=cells)
    total, *_ = np.histogram2d(*position.T, bins=cells, weights=values)
    if not ((count[1:, 1:] > 0) & (count[:-1, :-1] > 0) & (count[1:, :-1] > 0) & (count[:-1, 1:] > 0)).any():
        return None
    near = gaussian_filter(count, SMOOTH)
    mean = np.ma.masked_array(gaussian_filter(total, SMOOTH) / np.where(count > 0, near, 1.0), count == 0).T
    centres = [(edges[1:] + edges[:-1]) / 2 for edges in cells]
    shades = ax.contourf(*centres, mean, levels=levels, extend="both", cmap="viridis")
    ax.contour(*centres, mean, levels=levels, colors="#ffffff", linewidths=0.4)
    return shades


def _levels(values: np.ndarray) -> np.ndarray:
    """Return round levels that most values are between."""
    from matplotlib.ticker import MaxNLocator

    low, high = np.percentile(values, (SHARE, 100 - SHARE)) if len(values) else (0.0, 1.0)
    if style.one_value(low, high):
        return low + 0.4 * style.ONE_VALUE * max(abs(low), style.TINY) * np.array([-1.0, 1.0])
    return np.array(MaxNLocator(LEVELS).tick_values(low, high))
