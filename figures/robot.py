"""Draw a robot: floor, posts, carriers, platform, and cables with their numbers and tensions.

Farther parts are drawn first, so that nearer ones cover them. A robot in a vertical plane has coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.text import quantity
from . import style
from .perspective import Perspective
from .scene import Scene, faces, outline
from .tension_colours import mark, place, scale, shades

PARTS = 8  # of a cable, so that it is before one body and behind another
HIGH, BARS, AIR = 2.7, 0.9, 0.04  # inches, of which title, scale and legend; share of the picture around the robot
NARROW = 0.2  # of the picture: an axis with one number
IN_ORDER = 3  # above the floor
POST, BODY = "#8a8a8a", "#b4b4b4"
LETTERS = 6.0  # [points]: numbers and tensions of cables
# A letter's width and the height of a line [letters].
LETTER, LINE = 0.58, 1.25
LEFT = 0.25  # of its length that is drawn of a cable that has been cut


def draw(scene: Scene, resting: np.ndarray | None = None) -> style.Figure:
    """Draw a robot at the first instant of a scene, and the outline of positions of its platform, `resting` (n, 3)."""
    anchors, attachments, rotors, tensions = scene.anchors[0], scene.attachments[0], scene.rotors[0], scene.tensions[0]
    corners = [np.array(box) for box in scene.boxes]
    seen = Perspective(np.vstack([anchors, attachments, *rotors, *corners]), bool(scene.standing.size))
    flat, floor = seen.flat, seen.floor
    canvas = style.figure(height=HIGH)
    ax = style.axes(canvas, "x [m]", "z [m]") if flat else canvas.add_subplot()
    pieces: list[tuple[float, Callable[[], Any]]] = []

    def line(ends: np.ndarray, **look: Any) -> None:
        pieces.append((seen.depth(ends), partial(ax.plot, *seen(ends).T, solid_capstyle="round", **look)))

    def body(corners: np.ndarray, colour: str) -> None:
        for face in faces(corners):
            paint = partial(ax.fill, *seen(corners[face]).T, facecolor=colour, edgecolor="#444444", lw=0.4)
            pieces.append((seen.depth(corners[face]), paint))
        if not faces(corners) and len(corners) > 1:
            line(corners, color=colour, linewidth=3.0)

    if resting is not None and len(resting):
        on_floor = resting if flat else np.column_stack([resting[:, :2], np.full(len(resting), floor)])
        edge = outline(on_floor[:, [0, 2]] if flat else on_floor[:, :2])
        if len(edge) > 2:
            around = np.insert(edge, 1, 0.0, axis=1) if flat else np.column_stack([edge, np.full(len(edge), floor)])
            label = "can rest here (outline)" if flat else "can rest above here (outline)"
            ax.fill(*seen(around).T, color=style.colour(2), alpha=0.18, linewidth=0, label=label)
    for anchor in anchors[scene.standing]:
        if anchor[2] > floor:
            line(np.array([anchor, [*anchor[:2], floor]]), color=POST, linewidth=0.8)
    colours = shades(place(tensions, scene.t_min, scene.t_max)) / 255.0
    for anchor, attachment, shade in zip(anchors, attachments, colours, strict=True):
        way = anchor + np.linspace(0.0, 1.0, PARTS + 1)[:, None] * (attachment - anchor)
        for part in pairwise(way):
            line(np.array(part), color=shade, linewidth=1.5)
    body(scene.platform[0], style.colour(4))
    for cables in scene.bodies:
        body(anchors[cables], BODY)
    for low_corner, high_corner in scene.boxes:
        for edge in box_edges(low_corner, high_corner):
            line(edge, color=style.colour(3), linewidth=0.6)
    for circle in rotors:
        line(circle, color="#000000", linewidth=0.7)
    for _, paint in sorted(pieces, key=lambda piece: -piece[0]):
        for artist in paint():
            artist.set_zorder(IN_ORDER)  # otherwise lines are before faces
    ax.plot(*seen(anchors).T, "o", color="#000000", markersize=1.8, zorder=IN_ORDER)
    seen.fit(ax, AIR)
    if flat:
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(style.few_ticks(5))
    _number(ax, seen(anchors), seen(attachments), tensions)
    for position, name in zip(scene.carriers[0], scene.names, strict=True):
        ax.annotate(name, tuple(seen(position)), (0, 5), textcoords="offset points", ha="center", fontsize=LETTERS)
    style.heading(ax, scene.title if flat else f"{scene.title}; cells of the floor: {quantity(seen.cell, 'm')}")
    style.legend_below(canvas, ax)
    if np.isfinite(tensions).all():
        place_of_bar = {"location": "bottom", "aspect": 40, "pad": 0.02}
        bar = style.colour_bar(canvas, scale(), ax, "tension [N] from t_min to t_max", **place_of_bar)
        mark(bar, scene.t_min, scene.t_max, LETTERS)
    canvas.draw_without_rendering()  # the first pass of the layout cuts off the title of a robot that fills the width
    return canvas


def _number(ax: style.Axes, starts: np.ndarray, ends: np.ndarray, tensions: np.ndarray) -> None:
    """Write number and tension beside each cable near its anchor, where it covers no other."""
    from matplotlib.patheffects import withStroke

    wide, high = (max(float(np.diff(limits)[0]), 1e-9) for limits in (ax.get_xlim(), ax.get_ylim()))
    points = 72.0 * min(0.95 * style.COLUMN / wide, (HIGH - BARS) / high)  # for a unit, about
    taken: list[tuple[np.ndarray, float]] = []
    for index, (start, end) in enumerate(zip(starts, ends, strict=True)):
        text = f"{index + 1}" + ("" if np.isnan(tensions[index]) else f": {quantity(float(tensions[index]), 'N', 3)}")
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


def drawn_ends(anchors: np.ndarray, attachments: np.ndarray, cut: np.ndarray | None) -> np.ndarray:
    """Return the ends of cables in {G} [m], (..., m, 3) as anchors and attachments are; `cut` is (..., m) or None.

    A cut cable is drawn hanging from its anchor. Its true length depends on where it broke.
    """
    if cut is None:
        return attachments
    down = np.array([0.0, 0.0, -LEFT]) * np.linalg.norm(attachments - anchors, axis=-1, keepdims=True)
    return np.where(cut[..., None], anchors + down, attachments)
