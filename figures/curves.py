"""Curves over one axis, in panels one below the other, with the bounds that they are to keep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Panel(NamedTuple):
    """One panel.

    Attributes
    ----------
    label
        Of its vertical axis, with the unit.
    curves
        (n,) each, by their names in the legend; not finite: a gap.
    bounds
        Values to draw a dashed line at, by what is written on it.
    logarithmic
        Whether the vertical axis is.
    """

    label: str
    curves: Mapping[str, np.ndarray]
    bounds: Mapping[str, float] = {}
    logarithmic: bool = False


def curves(
    x: np.ndarray,
    xlabel: str,
    panels: Sequence[Panel],
    *,
    logarithmic: bool = False,
    marks: Mapping[str, float] | None = None,
) -> Figure:
    """Draw panels over `x` (n,); curves of one name look the same in all of them.

    Parameters
    ----------
    logarithmic
        Whether the horizontal axis is.
    marks
        Places on the horizontal axis to draw a dotted line at, by what is written on it.
    """
    canvas = style.figure(5.0, 1.2 + 2.0 * len(panels))
    looks: dict[str, int] = {}
    for row, panel in enumerate(panels):
        last = row + 1 == len(panels)
        ax = style.axes(canvas, xlabel if last else "", panel.label, (len(panels), 1, row + 1))
        ax.tick_params(labelbottom=last)
        ax.set_xscale("log" if logarithmic else "linear")
        ax.set_yscale("log" if panel.logarithmic else "linear")
        for name, values in panel.curves.items():
            index = looks.setdefault(name, len(looks))
            ax.plot(x, values, color=style.colour(index), linestyle=style.line_style(index), label=name)
        for text, bound in panel.bounds.items():
            ax.axhline(bound, **style.LIMIT)
            ax.annotate(text, (1, bound), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8)
        for text, place in (marks or {}).items():
            ax.axvline(place, color="#666666", linestyle=":", linewidth=1.0)
            where = ("data", "axes fraction")
            paper = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
            look = {"ha": "right", "va": "top", "rotation": 90, "fontsize": 8}
            ax.annotate(
                text, (place, 0.98), xycoords=where, xytext=(-2, 0), textcoords="offset points", bbox=paper, **look
            )
        ax.margins(x=0.01)
    style.legend_below(canvas, *canvas.axes)
    return canvas
