"""Draw curves: over one axis, in panels below each other, with their bounds; or in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import NamedTuple, Self

import numpy as np

from . import style

FLATTEST = 1e-3  # height of a panel over its largest value: below, curves that are constant would show rounding


class Panel(NamedTuple):
    """A panel with curves."""

    label: str  # label of the vertical axis, with the unit
    # (n,) each, by their names in the legend; an empty name has no entry, and nan leaves a gap.
    curves: Mapping[str, np.ndarray]
    bounds: Mapping[str, float] = {}  # values of dashed lines, by their labels
    dots: Mapping[str, np.ndarray] = {}  # as `curves`, drawn as dots, for points that should lie on a curve
    logarithmic: bool = False  # use a logarithmic vertical axis

    @classmethod
    def of_cables(cls, label: str, values: np.ndarray, bounds: Mapping[str, float] | None = None) -> Self:
        """Return a panel with the values (n, m) of all cables."""
        return cls(label, {f"cable {i + 1}": column for i, column in enumerate(values.T)}, bounds or {})


def curves(
    x: np.ndarray,
    xlabel: str,
    panels: Sequence[Panel],
    *,
    logarithmic: bool = False,
    marks: Mapping[str, float] | None = None,
) -> style.Figure:
    """Draw panels over `x` (n,); curves of one name look the same in all of them.

    Curves differ by their dashes, so that those on top of each other stay visible.

    - `logarithmic`: use a logarithmic horizontal axis.
    - `marks`: positions of vertical lines, by their names in the legend.
    """
    canvas = style.figure(height=0.9 + 1.4 * len(panels))
    looks: dict[str, int] = {}
    labels = [style.typeset(panel.label) for panel in panels]
    for ax, panel in zip(style.panels_below(canvas, style.typeset(xlabel), labels), panels, strict=True):
        ax.set_xscale("log" if logarithmic else "linear")
        ax.set_yscale("log" if panel.logarithmic else "linear")
        for name, values in panel.curves.items():
            index = looks.setdefault(name, len(looks))
            ax.plot(x, values, **style.look(index), label=name)
        for name, values in panel.dots.items():
            index = looks.setdefault(name, len(looks))
            ax.plot(x, values, "o", markersize=3, color=style.colour(index), label=name)
        for text, bound in panel.bounds.items():
            style.limit_line(ax, bound, text, place=0.01)
        for (text, place), dashes in zip((marks or {}).items(), cycle((":", "-.")), strict=False):
            ax.axvline(place, color="#666666", linestyle=dashes, linewidth=1.2, label=text)
        ax.margins(x=0.01)
        if not panel.logarithmic:
            low, high = ax.get_ylim()
            missing = FLATTEST * max(abs(low), abs(high)) - (high - low)
            if missing > 0:
                ax.set_ylim(low - missing / 2, high + missing / 2)
    return style.legend_below(canvas, *canvas.axes)


def curve_in_space(ways: Mapping[str, np.ndarray]) -> style.Figure:
    """Draw curves (n, 3) [m] with their names and equal scales; a dot marks the start of each."""
    canvas = style.figure(height=3.3)
    ax = style.axes_in_space(canvas)
    for index, (name, points) in enumerate(ways.items()):
        ax.plot(*points.T, **style.look(index), label=name)
        ax.plot(*points[0], "o", color=style.colour(index), markersize=4)
    style.equal_scales(ax, np.concatenate(list(ways.values())))
    return style.legend_below(canvas, ax)
