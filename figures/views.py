"""Draw a plan from above and from the side: paths, cables at start and end, reach boxes, regions to keep out of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import style
from .hull import outline

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .animation import Scene

VIEWS = (("from above", 0, 1), ("from the side, along y", 0, 2))  # and the axes of {G} in the picture
FORBIDDEN = {"facecolor": "#e8e8e8", "edgecolor": "#666666", "hatch": "////", "linewidth": 0.8}
REACH = {"facecolor": "none", "edgecolor": "#666666", "linestyle": "--", "linewidth": 0.8}


def views(scene: Scene) -> Figure:
    """Draw a scene of a few instants, from start to end, in two views of equal scale."""
    canvas = style.figure(5.0, 6.4)
    panels = [
        style.axes(canvas, f"{'xyz'[across]} [m]", f"{'xyz'[up]} [m]", (2, 1, row + 1))
        for row, (_, across, up) in enumerate(VIEWS)
    ]
    for ax, (title, across, up) in zip(panels, VIEWS, strict=True):
        _view(ax, scene, [across, up])
        ax.set_title(title, fontsize=9)
    style.legend_below(canvas, panels[0])
    return canvas


def _view(ax: Axes, scene: Scene, axes: list[int]) -> None:
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
        body = outline(scene.attachments[k][:, axes])
        if len(body) > 1:
            ax.add_patch(Polygon(body, facecolor=shade, edgecolor=style.colour(0), alpha=0.6))
    for index, name in enumerate(scene.names):
        curve, drawn = scene.carriers[:, index][:, axes], style.colour(index + 1)
        if np.ptp(scene.carriers[:, index], axis=0).max() < 1e-9:
            ax.plot(*curve[0], "s", color=drawn, markersize=5, label=f"{name} (at rest)")
        else:
            ax.plot(*curve.T, color=drawn, label=name)
    ax.plot(*scene.path[:, axes].T, color=style.colour(0), linewidth=2.0, label="platform")
    ax.plot(*scene.path[0, axes], "o", color=style.colour(0), markersize=5, label="start")
    ax.set_aspect("equal", adjustable="datalim")
    ax.autoscale_view()
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(style.few_ticks())
