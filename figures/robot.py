"""Draw a robot: floor, posts, carriers, platform, and cables with their numbers and tensions.

In space it is seen in perspective from the front, a little from the side and above; a robot in a vertical plane is
drawn flat, with coordinates. Farther parts are drawn first, so that nearer ones cover them.
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
from .tension_colours import mark, place, scale, shades

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ALONG = np.array([0.45, -1.0, 0.45]) / np.linalg.norm([0.45, -1.0, 0.45])  # from the robot to the camera
AWAY = 2.2  # of the robot's size: distance of the camera
BELOW = 0.03  # of the robot's size: how far the floor is below its lowest point, if it has no post
CELLS = 10  # of the floor along the robot's size, about
PARTS = 8  # of a cable, so that it is before one body and behind another
HIGH, BARS, AIR = 2.7, 0.9, 0.04  # inches, of which title, scale and legend; share of the picture around the robot
NARROW = 0.2  # of the picture: an axis with one number
FLAT = 1e-6  # of the robot's size
IN_ORDER = 3  # above the floor
FLOOR, POST, BODY = "#e2e2e2", "#8a8a8a", "#b4b4b4"
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
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(float(np.linalg.norm(high - low)), 1e-6)
    flat = high[1] - low[1] < FLAT * size
    floor = low[2] - (0.0 if sketch.fixed is not None and sketch.fixed.any() and low[2] > 0 else BELOW) * size
    floor = min(floor, 0.0) if sketch.fixed is not None and sketch.fixed.any() and low[2] < size else floor
    canvas = style.figure(height=HIGH)
    ax = style.axes(canvas, "x [m]", "z [m]") if flat else canvas.add_subplot()
    seen = _flat if flat else _perspective((low + high) / 2, size)
    pieces: list[tuple[float, Callable[[], Any]]] = []

    def line(ends: np.ndarray, **look: Any) -> None:
        shown, depth = seen(ends)
        pieces.append((depth, lambda: ax.plot(*shown.T, solid_capstyle="round", **look)))

    def body(corners: np.ndarray, colour: str) -> None:
        for face in faces(corners):
            shown, depth = seen(corners[face])
            pieces.append((depth, lambda shown=shown: ax.fill(*shown.T, facecolor=colour, edgecolor="#444444", lw=0.4)))
        if not faces(corners) and len(corners) > 1:
            line(corners, color=colour, linewidth=3.0)

    cell = _cell(size)
    if not flat:
        _draw_floor(ax, seen, low, high, floor, cell)
    if len(sketch.resting):
        on_floor = (
            sketch.resting if flat else np.column_stack([sketch.resting[:, :2], np.full(len(sketch.resting), floor)])
        )
        edge = outline(on_floor[:, [0, 2]] if flat else on_floor[:, :2])
        if len(edge) > 2:
            around = np.insert(edge, 1, 0.0, axis=1) if flat else np.column_stack([edge, np.full(len(edge), floor)])
            label = "can rest here (outline)" if flat else "can rest above here (outline)"
            ax.fill(*seen(around)[0].T, color=style.colour(2), alpha=0.18, linewidth=0, label=label)
    for anchor in sketch.anchors[sketch.fixed] if sketch.fixed is not None else ():
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
    ax.plot(*seen(sketch.anchors)[0].T, "o", color="#000000", markersize=1.8, zorder=IN_ORDER)
    ground = np.array([[x, y, floor] for x in (low[0], high[0]) for y in (low[1], high[1])])
    _fit(ax, seen(np.vstack([points] if flat else [points, ground]))[0], flat)
    _number(ax, seen(sketch.anchors)[0], seen(sketch.attachments)[0], tensions)
    for position, name in zip(sketch.carriers, sketch.names, strict=True):
        ax.annotate(name, seen(position[None])[0][0], (0, 5), textcoords="offset points", ha="center", fontsize=LETTERS)
    style.heading(ax, sketch.title if flat else f"{sketch.title}; cells of the floor: {quantity(cell, 'm')}")
    if len(sketch.resting):
        style.legend_below(canvas, ax)
    if tensions is not None:
        bar = style.colour_bar(
            canvas, scale(), ax, "tension [N] from t_min to t_max", location="bottom", aspect=40, pad=0.02
        )
        mark(bar, sketch.t_min, sketch.t_max, LETTERS)
    return canvas


def _flat(points: np.ndarray) -> tuple[np.ndarray, float]:
    return points[:, [0, 2]], 0.0


def _perspective(centre: np.ndarray, size: float) -> Callable[[np.ndarray], tuple[np.ndarray, float]]:
    """Return the function from points (k, 3) to their places in the picture (k, 2) and their mean depth [m]."""
    right = np.cross([0.0, 0.0, 1.0], ALONG)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(ALONG, right)])

    def seen(points: np.ndarray) -> tuple[np.ndarray, float]:
        arms = points - centre
        depth = np.maximum(AWAY * size - arms @ ALONG, 0.1 * size)
        return arms @ axes.T * (AWAY * size / depth)[:, None], float(depth.mean())

    return seen


def _cell(size: float) -> float:
    power = 10.0 ** np.floor(np.log10(size / CELLS))
    return float(power * max(step for step in (1, 2, 5) if step * power <= size / CELLS * (1 + 1e-9)))


def _draw_floor(ax: Axes, seen: Any, low: np.ndarray, high: np.ndarray, floor: float, cell: float) -> None:
    first, last = np.floor(low[:2] / cell) * cell, np.ceil(high[:2] / cell) * cell
    for axis in (0, 1):
        for at in np.arange(first[axis], last[axis] + 0.5 * cell, cell):
            ends = np.array([[*first, floor], [*last, floor]])
            ends[:, axis] = at
            ax.plot(*seen(ends)[0].T, color=FLOOR, linewidth=0.5)


def _fit(ax: Axes, shown: np.ndarray, flat: bool) -> None:
    """Leave air around the robot, and, in space, no axes."""
    from matplotlib.ticker import FixedLocator, MaxNLocator

    ax.set_aspect("equal", adjustable="box")
    low, high = shown.min(axis=0), shown.max(axis=0)
    size = float((high - low).max())
    air = AIR * size
    ax.set_xlim(low[0] - air, high[0] + air)
    ax.set_ylim(low[1] - air, high[1] + air)
    if flat:
        for axis, start, end in zip((ax.xaxis, ax.yaxis), low, high, strict=True):
            narrow = end - start < NARROW * size  # several numbers would overlap
            axis.set_major_locator(FixedLocator([start]) if narrow else MaxNLocator(5, steps=[1, 2, 5, 10]))
    else:
        ax.set_axis_off()
        ax.set_xticks([])
        ax.set_yticks([])


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
