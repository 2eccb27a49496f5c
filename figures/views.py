"""Draw views along the axes of {G}: panels of one scale that share their axes, as in a drawing; and a plan in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from . import style
from .scene import Scene, outline

SWEPT = 15  # instants at which rotors are drawn
NEAR = 0.3  # of the robot's extent
FORBIDDEN = {"facecolor": "#e8e8e8", "edgecolor": "#666666", "hatch": "////", "linewidth": 0.8}
REACH = {"facecolor": "none", "edgecolor": "#666666", "linestyle": "--", "linewidth": 0.8}
AIR = 0.05  # of an extent, beyond its ends
FLAT = 0.22  # of the largest extent: thinner objects have panels so thick
BESIDE, BETWEEN, ROW = 0.55, 0.45, 0.6  # inches: labels left of panels, between two, and below and above one
APART = 0.25  # inches from tick to tick, at least
TALLEST = 4.6  # inches, of the panels together: higher objects are drawn smaller


def views(scene: Scene) -> style.Figure:
    """Draw a scene of a few instants, from start to end in two views of equal scale, or one if it is flat."""
    robot = scene.points
    near = NEAR * np.ptp(robot, axis=0).max()  # only this part of walls much larger than the robot is drawn
    lines = [line for outline_of in scene.obstacles for line in outline_of]
    outlines = [np.clip(line, robot.min(axis=0) - near, robot.max(axis=0) + near) for line in lines]
    points = np.vstack([robot, *outlines])
    thick = np.ptp(points, axis=0) > 1e-6 * np.ptp(points, axis=0).max()
    seen = [view for view in (ABOVE, FRONT) if thick[view.across] and thick[view.up]] or [ABOVE, FRONT]
    canvas, panels = views_of(points, seen, below=0.7)
    for ax, view in zip(panels, seen, strict=True):
        _view(ax, scene, [view.across, view.up])
    return style.legend_below(canvas, panels[0])


def _view(ax: style.Axes, scene: Scene, axes: list[int]) -> None:
    from matplotlib.patches import Polygon

    for index, lines in enumerate(scene.obstacles):
        label = "keep out" if index == 0 else None
        ax.add_patch(Polygon(outline(np.vstack(lines)[:, axes]), label=label, **FORBIDDEN))
    for index, (low, high) in enumerate(scene.boxes):
        corners = np.array([[x, y] for x in (low[axes[0]], high[axes[0]]) for y in (low[axes[1]], high[axes[1]])])
        ax.add_patch(Polygon(outline(corners), label="reach" if index == 0 else None, **REACH))
    for k, shade, label in ((0, "#bbbbbb", "cables at the start"), (-1, "#777777", "cables at the end")):
        for cable in range(scene.anchors.shape[1]):
            ends = np.stack([scene.anchors[k, cable], scene.attachments[k, cable]])[:, axes]
            ax.plot(*ends.T, color=shade, linewidth=0.8, label=label if cable == 0 else None)
        _body(ax, scene.platform[k][:, axes], shade, style.colour(0))
        for index, cables in enumerate(scene.bodies):
            _body(ax, scene.anchors[k, cables][:, axes], shade, style.colour(index + 1))
            ax.plot(*scene.carriers[k, index, axes], "s", color=style.colour(index + 1), markersize=3)
    _rotors(ax, scene.rotors[..., axes])
    if scene.standing.size:
        on_ground = scene.anchors[0, scene.standing][:, axes]
        ax.plot(*on_ground.T, "^", color="#000000", markersize=3, label="anchors on the ground")
    for index, name in enumerate(scene.names):
        curve, look = scene.carriers[:, index][:, axes], style.look(index + 1)
        if np.ptp(scene.carriers[:, index], axis=0).max() < 1e-9:
            ax.plot([], [], "s", color=look["color"], markersize=3, label=f"{name} (at rest)")
        else:
            ax.plot(*curve.T, **look, label=name)
    ax.plot(*scene.path[:, axes].T, **style.look(0), label="platform")
    if scene.path_missing.any():
        beyond = np.where(scene.path_missing[:, None], scene.path[:, axes], np.nan)
        ax.plot(*beyond.T, color=style.colour(5), linewidth=3.0, label="no tensions inside the limits")
    ax.plot(*scene.path[0, axes], "o", color=style.colour(0), markersize=4, label="start")


def _rotors(ax: style.Axes, circles: np.ndarray) -> None:
    """Draw the circles of rotors (k, r, p, 2) at some instants, so that what they sweep shows."""
    from matplotlib.collections import LineCollection

    shown = circles[np.unique(np.linspace(0, len(circles) - 1, SWEPT).round().astype(int))]
    if shown.shape[1]:
        lines = list(shown.reshape(-1, *shown.shape[2:]))
        ax.add_collection(LineCollection(lines, colors="#999999", linewidths=0.4, label="rotors"))


def _body(ax: style.Axes, corners: np.ndarray, inside: str, edge: str) -> None:
    """Draw a body as the convex hull of its points (k, 2); two points have a line between them, one point has none."""
    from matplotlib.patches import Polygon

    if len(body := outline(corners)) > 1:
        ax.add_patch(Polygon(body, facecolor=inside, edgecolor=edge, alpha=0.6, linewidth=0.8))


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
