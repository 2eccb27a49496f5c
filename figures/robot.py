"""Draw a robot: floor, posts, carriers, platform, and cables with their numbers and tensions.

Farther parts are drawn first, so that nearer ones cover them. A robot in a vertical plane has coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.text import quantity
from . import style
from .hull import faces, outline
from .perspective import Perspective
from .tension_colours import mark, place, scale, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PARTS = 8  # of a cable, so that it is before one body and behind another
HIGH, BARS, AIR = 2.7, 0.9, 0.04  # inches, of which title, scale and legend; share of the picture around the robot
NARROW = 0.2  # of the picture: an axis with one number
IN_ORDER = 3  # above the floor
POST, BODY = "#8a8a8a", "#b4b4b4"
LETTERS = 6.0  # [points]: numbers and tensions of cables
# A letter's width and the height of a line [letters].
LETTER, LINE = 0.58, 1.25


@dataclass(frozen=True)
class RobotSketch:
    """The parts of a robot to draw; everything in {G} [m]."""

    title: str
    anchors: np.ndarray  # (m, 3)
    attachments: np.ndarray  # likewise
    carriers: np.ndarray  # (c, 3) origins of the frames of carriers that move, and their names
    names: list[str]
    boxes: list[tuple[np.ndarray, np.ndarray]]  # corners (low, high) of reach boxes
    tensions: np.ndarray | None  # (m,) [N], or None for grey cables
    t_min: np.ndarray  # (m,) [N]
    t_max: np.ndarray  # likewise
    # Points of the platform's body, (k, 3); default: the attachments.
    surface: np.ndarray | None = None
    # Anchors of each carrier that moves, whose hull is drawn; default: none.
    bodies: list[np.ndarray] = field(default_factory=list)
    # Cables whose anchor never moves, (m,): a post is below it; default: none.
    fixed: np.ndarray | None = None
    # Positions at which the platform can rest, (k, 3); default: none.
    resting: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    # Circles in which rotors turn, (r, p, 3); default: none.
    rotors: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))


def draw(sketch: RobotSketch) -> Figure:
    """Draw a robot."""
    corners = [np.array(box) for box in sketch.boxes]
    points = np.vstack([sketch.anchors, sketch.attachments, *sketch.rotors, *corners])
    fixed = np.zeros(len(sketch.anchors), bool) if sketch.fixed is None else sketch.fixed
    seen = Perspective(points, bool(fixed.any()))
    flat, floor = seen.flat, seen.floor
    canvas = style.figure(height=HIGH)
    ax = style.axes(canvas, "x [m]", "z [m]") if flat else canvas.add_subplot()
    pieces: list[tuple[float, Callable[[], Any]]] = []

    def line(ends: np.ndarray, **look: Any) -> None:
        shown = seen(ends)
        pieces.append((seen.depth(ends), lambda: ax.plot(*shown.T, solid_capstyle="round", **look)))

    def body(corners: np.ndarray, colour: str) -> None:
        for face in faces(corners):
            shown = seen(corners[face])
            pieces.append(
                (
                    seen.depth(corners[face]),
                    lambda shown=shown: ax.fill(*shown.T, facecolor=colour, edgecolor="#444444", lw=0.4),
                )
            )
        if not faces(corners) and len(corners) > 1:
            line(corners, color=colour, linewidth=3.0)

    if len(sketch.resting):
        on_floor = (
            sketch.resting if flat else np.column_stack([sketch.resting[:, :2], np.full(len(sketch.resting), floor)])
        )
        edge = outline(on_floor[:, [0, 2]] if flat else on_floor[:, :2])
        if len(edge) > 2:
            around = np.insert(edge, 1, 0.0, axis=1) if flat else np.column_stack([edge, np.full(len(edge), floor)])
            label = "can rest here (outline)" if flat else "can rest above here (outline)"
            ax.fill(*seen(around).T, color=style.colour(2), alpha=0.18, linewidth=0, label=label)
    for anchor in sketch.anchors[fixed]:
        if anchor[2] > floor:
            line(np.array([anchor, [*anchor[:2], floor]]), color=POST, linewidth=0.8)
    tensions = sketch.tensions
    known = np.full(len(sketch.anchors), np.nan) if tensions is None else tensions
    colours = shades(place(known, sketch.t_min, sketch.t_max)) / 255.0
    for anchor, attachment, shade in zip(sketch.anchors, sketch.attachments, colours, strict=True):
        way = anchor + np.linspace(0.0, 1.0, PARTS + 1)[:, None] * (attachment - anchor)
        for part in pairwise(way):
            line(np.array(part), color=shade, linewidth=1.5)
    body(sketch.attachments if sketch.surface is None else sketch.surface, style.colour(4))
    for corners in sketch.bodies:
        body(corners, BODY)
    for low_corner, high_corner in sketch.boxes:
        for edge in box_edges(low_corner, high_corner):
            line(edge, color=style.colour(3), linewidth=0.6)
    for circle in sketch.rotors:
        line(circle, color="#000000", linewidth=0.7)
    for _, paint in sorted(pieces, key=lambda piece: -piece[0]):
        for artist in paint():
            artist.set_zorder(IN_ORDER)  # otherwise lines are before faces
    ax.plot(*seen(sketch.anchors).T, "o", color="#000000", markersize=1.8, zorder=IN_ORDER)
    seen.fit(ax, AIR)
    if flat:
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(style.few_ticks(5))
    _number(ax, seen(sketch.anchors), seen(sketch.attachments), tensions)
    for position, name in zip(sketch.carriers, sketch.names, strict=True):
        ax.annotate(name, tuple(seen(position)), (0, 5), textcoords="offset points", ha="center", fontsize=LETTERS)
    style.heading(ax, sketch.title if flat else f"{sketch.title}; cells of the floor: {quantity(seen.cell, 'm')}")
    if len(sketch.resting):
        style.legend_below(canvas, ax)
    if tensions is not None:
        bar = style.colour_bar(
            canvas, scale(), ax, "tension [N] from t_min to t_max", location="bottom", aspect=40, pad=0.02
        )
        mark(bar, sketch.t_min, sketch.t_max, LETTERS)
    return canvas


def _number(ax: Axes, starts: np.ndarray, ends: np.ndarray, tensions: np.ndarray | None) -> None:
    """Write number and tension beside each cable near its anchor, where it covers no other."""
    from matplotlib.patheffects import withStroke

    wide, high = (max(float(np.diff(limits)[0]), 1e-9) for limits in (ax.get_xlim(), ax.get_ylim()))
    points = 72.0 * min(0.95 * style.COLUMN / wide, (HIGH - BARS) / high)  # for a unit, about
    taken: list[tuple[np.ndarray, float]] = []
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        text = f"{index + 1}" if tensions is None else f"{index + 1}: {quantity(float(tensions[index]), 'N', 3)}"
        wide, high = LETTERS * LETTER * len(text) / points, LETTERS * LINE / points
        at = start + 0.3 * (end - start)
        while any(abs(at[0] - x) < (wide + other) / 2 and abs(at[1] - y) < high for (x, y), other in taken):
            at = at - [0.0, 0.5 * high]
        taken.append((at, wide))
        halo = [withStroke(linewidth=1.5, foreground="white")]
        ax.text(float(at[0]), float(at[1]), text, fontsize=LETTERS, ha="center", va="center", path_effects=halo)


def box_edges(low: np.ndarray, high: np.ndarray) -> list[np.ndarray]:
    """Return the twelve edges of a box, (2, 3) each."""
    corners = np.array([[(low, high)[(i >> k) & 1][k] for k in range(3)] for i in range(8)])
    return [corners[[i, i | 1 << k]] for i in range(8) for k in range(3) if not i >> k & 1]
