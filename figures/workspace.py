"""Draw workspaces: projections along the axes of {G}, cross sections, accepted shares of samples, maps of metrics."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ..base.text import quantity
from . import style
from .views import ABOVE, FRONT, SIDE, views_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.contour import QuadContourSet

VIEWS = (ABOVE, FRONT, SIDE)
SHARES = (0.1, 0.5, 0.9)  # of the samples along the line of sight: contours
SMOOTH = 0.8  # [cells]
MOST_POINTS = 20_000  # of a series in a panel: more are not visible, and files grow
CELLS = 32  # along each axis, at most
IN_A_CELL = 8  # samples that a cell should have: of half as many, some cells have none
LAYERS = 3  # of a volume, along z
LEVELS = 8
FLAT = 0.4  # height over width of a layer: with less, layers are drawn below one another
SHARE = 2.0  # [%] of the values below the lowest level, and above the highest one


def projections(points: dict[str, np.ndarray], marks: np.ndarray | None = None) -> style.Figure:
    """Draw points of {G} from above and from two sides, at equal scales.

    - `points`: (n, 3) [m] by label, drawn in their order.
    - `marks`: points to mark, such as anchors, (k, 3) [m].
    """
    canvas, panels = views_of(np.vstack([*points.values(), *([] if marks is None else [marks])]), VIEWS)
    for ax, view in zip(panels, VIEWS, strict=True):
        axes = [view.across, view.up]
        _panel(ax, {label: some[:, axes] for label, some in points.items()}, None if marks is None else marks[:, axes])
    return style.legend_below(canvas, panels[0], scale=2.0)


def cross_sections(points: np.ndarray, heights: list[float], thickness: float) -> style.Figure:
    """Draw the points of {G} that lie within `thickness` / 2 of each of some heights, from above, at one scale.

    - `points`: (n, 3) [m].
    - `heights`, `thickness`: [m].
    """
    columns = min(len(heights), 2)
    rows = -(-len(heights) // columns)
    canvas = style.figure(height=0.5 + 1.5 * rows)
    shown = [points[np.abs(points[:, 2] - height) <= thickness / 2][:, :2] for height in heights]
    every = np.vstack(shown)
    first = None
    for place, height in enumerate(heights):
        lowest, leftmost = place + columns >= len(heights), place % columns == 0
        labels = "x [m]" if lowest else "", "y [m]" if leftmost else ""
        ax = style.axes(canvas, *labels, (rows, columns, place + 1), first)
        first = first or ax
        ax.tick_params(labelbottom=lowest, labelleft=leftmost)
        _panel(ax, {"": shown[place]}, None)
        ax.set_aspect("equal", adjustable="box")  # the limits must stay equal
        style.heading(ax, f"z = {height:g} m ± {500 * thickness:g} mm,\n{len(shown[place])} points", 1 / columns)
        if len(every):
            low, high = every.min(axis=0), every.max(axis=0)
            middle, half = (low + high) / 2, 0.55 * max(float((high - low).max()), 1e-6)
            ax.set_xlim(middle[0] - half, middle[0] + half)
            ax.set_ylim(middle[1] - half, middle[1] + half)
    return canvas


def reached(result: xr.Dataset, anchors: np.ndarray | None = None) -> style.Figure:
    """Draw where samples were accepted: from above, from the front and from the side.

    Darker areas are those where a larger share of the samples along the line of sight was accepted. Axes along which
    the region has no extent are left out.

    - `result`: from `workspace.sample`, with the counts `tried` and `reached` (x, y, z) of its cells.
    - `anchors`: anchors to mark, (m, 3) in {G} [m] (default: none).
    """
    thick = [name for name in ("x", "y", "z") if result.sizes[name] > 1]
    views = [view for view in VIEWS if "xyz"[view.across] in thick and "xyz"[view.up] in thick]
    accepted, samples = result.attrs["accepted"], result.attrs["samples"]
    title = f"{result.attrs['robot']}: {quantity(accepted)} of {quantity(samples)} samples accepted"
    if not views:
        canvas = style.figure()
        canvas.suptitle(title, fontsize=style.TEXT)
        along = thick[0] if thick else "x"
        tried, held = (result[name].sum([axis for axis in "xyz" if axis != along]) for name in ("tried", "reached"))
        share = (held / tried.where(tried > 0)).where(held > 0, np.nan)  # white without an accepted sample
        style.axes(canvas, f"{along} [m]", "share accepted [-]").plot(result[along], share, color=style.colour(0))
        return canvas
    ends = np.array(np.meshgrid(*(outer_edges(result[name].values) for name in "xyz"))).reshape(3, -1).T
    canvas, panels = views_of(ends if anchors is None else np.vstack([ends, anchors]), views, 0.8)
    canvas.suptitle(title, fontsize=style.TEXT)
    for ax, view in zip(panels, views, strict=True):
        across, up = "xyz"[view.across], "xyz"[view.up]
        behind = next(name for name in ("x", "y", "z") if name not in (across, up))
        _contours(ax, result, behind, across, up)
        if anchors is not None:
            ax.plot(*anchors[:, [view.across, view.up]].T, "^", color="#000000", markersize=3, label="anchors")
    return style.legend_below(canvas, panels[0])


def _contours(ax: style.Axes, result: xr.Dataset, behind: str, across: str, up: str) -> None:
    """Fill the areas of `SHARES`; counts are averaged over neighbouring cells, because samples may be few."""
    from scipy.ndimage import gaussian_filter

    counts = result[["tried", "reached"]].sum(behind).transpose(up, across)
    for axis, other in ((across, up), (up, across)):  # cells that no sample can be in are joined with their neighbours
        while (counts["tried"].sum(other) == 0).any() and counts.sizes[axis] % 2 == 0:
            counts = counts.coarsen({axis: 2}).sum()
    tried, reached = (gaussian_filter(np.pad(each.astype(float), 1), SMOOTH) for each in (counts.tried, counts.reached))
    share = np.divide(reached, tried, out=np.zeros_like(tried), where=tried > 1e-9)
    cells = [np.pad(counts[name].to_numpy(), 1, mode="reflect", reflect_type="odd") for name in (across, up)]
    share[[0, -1]] = share[:, [0, -1]] = 0.0  # outside the region, so that contours close
    colours = [style.colour(2) + alpha for alpha in ("33", "77", "cc")]
    ax.contourf(*cells, share, levels=[*SHARES, 1.01], colors=colours)
    ax.contour(*cells, share, levels=[SHARES[1]], colors=style.colour(2), linewidths=0.8)
    for low, high, colour in zip(SHARES, [*SHARES[1:], None], colours, strict=True):
        label = f"over {low:.0%}" if high is None else f"{low:.0%} to {high:.0%}"
        ax.fill([], [], color=colour, label=f"{label} accepted".replace("%", " %"))


def _panel(ax: style.Axes, points: dict[str, np.ndarray], marks: np.ndarray | None) -> None:
    for index, (label, some) in enumerate(points.items()):
        shown = some[:: -(-len(some) // MOST_POINTS)] if len(some) else some
        # Raster images inside: tens of thousands of shapes make files that are slow to view.
        ax.plot(*shown.T, ".", color=style.colour(index), markersize=1.2, label=label or None, rasterized=True)
    if marks is not None:
        ax.plot(*marks.T, "^", color="#000000", markersize=4, label="anchors")


def outer_edges(centres: np.ndarray) -> tuple[float, float]:
    """Return the outer edges of equal cells, from their centres."""
    half = 0.5 * float(centres[1] - centres[0]) if len(centres) > 1 else 0.0
    return float(centres[0]) - half, float(centres[-1]) + half


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
            shades = _filled_contours(ax, position[some][:, axes], values[some], cells, levels) or shades
            ax.plot(*marks[:, axes].T, "^", color="#000000", markersize=3, clip_on=False)
        if shades is not None:
            style.colour_bar(canvas, shades, panels, label, location="bottom", aspect=40)
    return canvas


def _filled_contours(
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
