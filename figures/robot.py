"""Draw a robot in space: carriers, anchors, cables coloured by tension, platform, and where it can rest."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import style
from .hull import faces
from .tension_colours import mark, place, scale, shades

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class RobotSketch:
    """The parts of a robot to draw; everything in {G} [m]."""

    title: str
    anchors: np.ndarray  # (m, 3)
    attachments: np.ndarray  # likewise
    com: np.ndarray  # (3,)
    carriers: np.ndarray  # (c, 3) origins of the carriers' frames, and their names
    names: list[str]
    boxes: list[tuple[np.ndarray, np.ndarray]]  # corners (low, high) of reach boxes
    tensions: np.ndarray | None  # (m,) [N], or None for grey cables
    t_min: np.ndarray  # (m,) [N]
    t_max: np.ndarray  # likewise
    # Positions at which the platform can rest, (k, 3); default: none.
    resting: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    # Circles in which rotors turn, (r, p, 3); default: none.
    rotors: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))


def draw(sketch: RobotSketch) -> Figure:
    """Draw a robot."""
    canvas = style.figure(height=3.2)
    ax = style.axes_in_space(canvas)
    if len(sketch.resting):
        ax.scatter(*sketch.resting.T, s=5, color=style.colour(2), alpha=0.5, linewidths=0, label="can rest here")
    tensions = sketch.tensions
    known = np.full(len(sketch.anchors), np.nan) if tensions is None else tensions
    colours = shades(place(known, sketch.t_min, sketch.t_max)) / 255.0
    for anchor, attachment, shade in zip(sketch.anchors, sketch.attachments, colours, strict=True):
        ax.plot(*np.stack([anchor, attachment]).T, color=shade, linewidth=1.0)
    ax.scatter(*sketch.anchors.T, s=8, marker="^", color="#000000", label="anchors")
    ax.scatter(*sketch.com, s=14, color=style.colour(1), label="CoM")
    _draw_platform(ax, sketch.attachments)
    for low, high in sketch.boxes:
        for edge in box_edges(low, high):
            ax.plot(*edge.T, color=style.colour(3), linewidth=0.7)
    for circle in sketch.rotors:
        ax.plot(*circle.T, color="#000000", linewidth=0.7)
    for position, name in zip(sketch.carriers, sketch.names, strict=True):
        ax.text(*position, name, fontsize=style.NOTE)
    style.equal_scales(
        ax, np.vstack([sketch.anchors, sketch.attachments, sketch.com[None], sketch.carriers, *sketch.rotors])
    )
    ax.set_title(sketch.title, fontsize=style.TEXT)
    style.legend_below(canvas, ax)
    if tensions is not None:
        bar = style.colour_bar(canvas, scale(), ax, "tension [N] from t_min to t_max", shrink=0.6, pad=0.14)
        mark(bar, sketch.t_min, sketch.t_max, style.NOTE)
    return canvas


def _draw_platform(ax: Any, attachments: np.ndarray) -> None:
    """Draw the convex hull of the attachments: a body, a plate, or a line."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    corners = [attachments[face] for face in faces(attachments)]
    if corners:
        body = Poly3DCollection(corners, facecolor=style.colour(4), edgecolor=style.colour(0), alpha=0.5)
        ax.add_collection3d(body)
    else:
        ax.plot(*attachments.T, color=style.colour(4), linewidth=3.0)


def box_edges(low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Return the twelve edges of a box, (2, 3) each."""
    corners = np.array([[(low, high)[(i >> k) & 1][k] for k in range(3)] for i in range(8)])
    return [corners[[i, i | 1 << k]] for i in range(8) for k in range(3) if not i >> k & 1]
