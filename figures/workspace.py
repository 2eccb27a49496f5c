"""Draw workspaces: projections along the axes of {G}, cross sections at heights, accepted shares of samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.text import quantity
from . import style
from .projection import ABOVE, FRONT, SIDE, views_of

if TYPE_CHECKING:
    import xarray as xr

VIEWS = (ABOVE, FRONT, SIDE)
SHARES = (0.1, 0.5, 0.9)  # of the samples along the line of sight: contours
SMOOTH = 0.8  # [cells]
MOST_POINTS = 20_000  # of a series in a panel: more are not visible, and files grow


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
