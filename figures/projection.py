"""Lay out views of one object along the axes of {G}: panels of one scale that share their axes, as in a drawing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from . import style

AIR = 0.05  # of an extent, beyond its ends
FLAT = 0.22  # of the largest extent: thinner objects have panels so thick
BESIDE, BETWEEN, ROW = 0.55, 0.45, 0.6  # inches: labels left of panels, between two, and below and above one
APART = 0.25  # inches from tick to tick, at least
TALLEST = 4.6  # inches, of the panels together: higher objects are drawn smaller


class View(NamedTuple):
    """A view along an axis of {G}: its name, and the axes of {G} across and up in the picture."""

    name: str
    across: int
    up: int


ABOVE = View("top view", 0, 1)
FRONT = View("front view", 0, 2)
SIDE = View("side view", 1, 2)


def views_of(points: np.ndarray, views: Sequence[View], below: float = 0.4) -> tuple[style.Figure, list[style.Axes]]:
    """Return a figure with a panel for each view, large enough for `points` (n, 3) [m], all at one scale.

    The view from above is above the view along y, and the view along x is beside it, so that coordinates line up.

    `below`: height for a legend [inches].
    """
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.ones(3))
    extent = (1 + 2 * AIR) * (high - low)
    middle, extent = (low + high) / 2, np.maximum(extent, max(FLAT * float(extent.max()), 1e-6))
    # Views share a column if they share the axis across, a row if that up.
    columns, rows = (list(dict.fromkeys(view[k] for view in views)) for k in (1, 2))
    places = [(columns.index(view.across), rows.index(view.up)) for view in views]
    placed = list(zip(views, places, strict=True))
    widths, heights = ({place[k]: float(extent[view[k + 1]]) for view, place in placed} for k in (0, 1))
    free = style.COLUMN - BESIDE - BETWEEN * (len(widths) - 1) - 0.1
    scale = min(free / sum(widths.values()), TALLEST / sum(heights.values()))
    canvas = style.figure(height=scale * sum(heights.values()) + ROW * len(heights) + below)
    grid = canvas.add_gridspec(
        len(heights),
        len(widths),
        width_ratios=[widths[column] for column in sorted(widths)],
        height_ratios=[heights[row] for row in sorted(heights)],
    )
    panels: list[style.Axes] = []
    in_column: dict[int, style.Axes] = {}
    in_row: dict[int, style.Axes] = {}
    for view, (column, row) in placed:
        lowest = row == max(heights)
        ax = canvas.add_subplot(grid[row, column], sharex=in_column.get(column), sharey=in_row.get(row))
        in_column[column] = in_row[row] = ax
        style.dressed(ax, f"{'xyz'[view.across]} [m]" if lowest else "", f"{'xyz'[view.up]} [m]" if not column else "")
        style.heading(ax, view.name, extent[view.across] / extent[[v.across for v in views]].max() / len(widths))
        ax.set_aspect("equal", adjustable="box")
        ax.set_xlim(*(middle[view.across] + np.array([-0.5, 0.5]) * extent[view.across]))
        ax.set_ylim(*(middle[view.up] + np.array([-0.5, 0.5]) * extent[view.up]))
        ax.tick_params(labelbottom=lowest, labelleft=not column)
        for axis, k in ((ax.xaxis, view.across), (ax.yaxis, view.up)):
            axis.set_major_locator(style.few_ticks(int(np.clip(scale * extent[k] / APART, 2, 4))))
        panels.append(ax)
    return canvas, panels
