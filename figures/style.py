"""Give every figure the same style: colour-blind safe, units on the axes, legible at 8 cm width."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..writing import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

# Okabe and Ito (2008), distinct for every kind of colour vision; black and yellow last.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#F0E442"]
LIMIT = {"color": "#666666", "linestyle": "--", "linewidth": 1.0}
DPI = 160


def colour(index: int) -> str:
    """Return the colour of the index-th series."""
    return COLOURS[index % len(COLOURS)]


def line_style(index: int) -> str:
    """Return solid for the first eight colours, then dashed, so that more than eight series stay distinct."""
    return ["-", "--", ":", "-."][(index // len(COLOURS)) % 4]


def figure(width: float = 5.0, height: float = 3.6) -> Figure:
    """Return an empty figure, size in inches, that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def axes(canvas: Figure, xlabel: str, ylabel: str, place: tuple[int, int, int] = (1, 1, 1)) -> Axes:
    """Return axes with labels, a light grid and no box, at `place` (rows, columns, index)."""
    return _dressed(canvas.add_subplot(*place), xlabel, ylabel)


def _dressed(ax: Axes, xlabel: str, ylabel: str) -> Axes:
    ax.set_xlabel(xlabel)
    ax.set_ylabel(ylabel)
    ax.grid(True, color="#dddddd", linewidth=0.6)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def panels_below(
    canvas: Figure, xlabel: str, ylabels: Sequence[str], heights: Sequence[float] | None = None
) -> list[Axes]:
    """Return axes below each other, of which only the last has numbers and a label on its horizontal axis.

    `heights` are relative; default: all are equal.
    """
    grid = canvas.add_gridspec(len(ylabels), 1, height_ratios=heights)
    every = []
    for row, ylabel in enumerate(ylabels):
        last = row == len(ylabels) - 1
        every.append(_dressed(canvas.add_subplot(grid[row]), xlabel if last else "", ylabel))
        every[-1].tick_params(labelbottom=last)
    return every


def axes_in_space(canvas: Figure) -> Any:
    """Return axes of a 3-D picture, with coordinates and units as labels, and few ticks."""
    from mpl_toolkits.mplot3d import Axes3D  # its import registers the projection

    ax: Any = canvas.add_subplot(projection=Axes3D.name)
    for axis in "xyz":
        # Numbers run across the label of z: it stands off. Below, the others' labels would leave the figure.
        getattr(ax, f"set_{axis}label")(f"{axis} [m]", labelpad=7 if axis == "z" else 4)
        getattr(ax, f"{axis}axis").set_major_locator(few_ticks())
    return ax


def equal_scales(ax: Any, points: np.ndarray) -> None:
    """Set the same scale on all three axes, so that a circle looks like a circle."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = max(0.54 * float((high - low).max()), 1e-3)  # some air, so that ticks do not meet at the corners
    for axis, centre in zip("xyz", (low + high) / 2, strict=True):
        getattr(ax, f"set_{axis}lim")(centre - half, centre + half)
    ax.set_box_aspect((1, 1, 1))


def few_ticks() -> MaxNLocator:
    """Set few enough tick marks that a small 3-D axis stays legible."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4, prune="both")


def limit_line(ax: Axes, value: float, text: str, place: float = 1.0, above: bool = True) -> None:
    """Draw a limit as a dashed line with its name above or below it: 0 is at the left end, 1 at the right."""
    ax.axhline(value, **LIMIT)
    side, edge = "left" if place < 0.5 else "right", "bottom" if above else "top"
    ax.annotate(text, (place, value), xycoords=("axes fraction", "data"), ha=side, va=edge, fontsize=8)


def legend_below(canvas: Figure, *panels: Axes) -> None:
    """Draw one legend for all panels at the bottom, in rows of equal length that fit the width of the figure."""
    shown = {}
    for ax in panels:
        handles, labels = ax.get_legend_handles_labels()
        shown = {**shown, **{label: it for label, it in zip(labels, handles, strict=True) if label not in shown}}
    labels, handles = list(shown), list(shown.values())
    if not labels:
        return
    longest = max(len(label) for label in labels)
    most = max(int(canvas.get_figwidth() / (0.45 + 0.07 * longest)), 1)
    rows = max(-(-len(labels) // most), 1)
    columns = max(-(-len(labels) // rows), 1)
    canvas.legend(handles, labels, fontsize="small", ncols=columns, loc="outside lower center", frameon=False)


def save(canvas: Figure, path: Path) -> Path:
    """Save as PNG; a failure leaves no partial file."""
    with whole_file(path) as temporary:
        canvas.savefig(temporary, dpi=DPI, format="png")
    return path


def svg(canvas: Figure) -> str:
    """Return the figure as SVG text with letters as shapes, so that no font is needed and equal figures are equal."""
    import io

    from matplotlib import rc_context

    stream = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with rc_context({"svg.fonttype": "path", "svg.hashsalt": "towline"}):
        canvas.savefig(stream, format="svg", metadata=nothing)
    return stream.getvalue()
