"""Draw a plan from above and from the side: paths, bodies and cables at start and end, reach boxes, keep-outs."""

from __future__ import annotations

import numpy as np

from . import style
from .hull import outline
from .projection import ABOVE, FRONT, views_of
from .scene import Scene

SWEPT = 15  # instants at which rotors are drawn
NEAR = 0.3  # of the robot's extent
FORBIDDEN = {"facecolor": "#e8e8e8", "edgecolor": "#666666", "hatch": "////", "linewidth": 0.8}
REACH = {"facecolor": "none", "edgecolor": "#666666", "linestyle": "--", "linewidth": 0.8}


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
