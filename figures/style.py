"""Give every figure the same style: a journal's column wide, colour-blind safe, legible in grey, units on the axes."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.inputs import InputError, file_path, one_of, printable
from ..base.text import unbroken
from ..base.writing import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

# Okabe and Ito (2008), distinct for every kind of colour vision, with wine of Tol (2021) for their yellow, which is too
# light for lines on paper.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#882255"]
# On and off, in widths of the line: eight, one for each colour, so that curves differ where there is no colour.
DASHES = ((), (5, 1.6), (1.2, 1.2), (6, 1.4, 1.2, 1.4), (10, 2), (2.6, 1.2), (6, 1.2, 1.2, 1.2, 1.2, 1.2), (1.2, 2.6))
MARKERS = "os^vDP*X"
LIMIT = {"color": "#666666", "linestyle": "--", "linewidth": 0.8}
COLUMN = 88 / 25.4  # width of a journal's column [inches]
TEXT, NOTE = 8.0, 7.0  # sizes of letters [points]: labels of axes; numbers, legends, titles and notes
BELOW: dict[str, Any] = {"loc": "outside lower center", "fontsize": NOTE, "frameon": False}  # of legends
BELOW |= {"handlelength": 2.6, "columnspacing": 1.2, "borderpad": 0.2}
AT_LINE: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "fontsize": NOTE}
AT_LINE |= {"bbox": {"facecolor": "#ffffff", "alpha": 0.7, "linewidth": 0, "pad": 0.2}}
BESIDE, LETTER = 36.0, 3.8  # points: labels and numbers beside axes; a letter of a title on average
FORMATS = ("png", "pdf", "svg")
DPI = 300
ONE_VALUE, TINY = 1e-9, 1e-3  # values that differ by less, of the largest or of this, are the same
GAP = 0.065  # of a panel's height, between the names of curves at its edge
HIGHEST = 0.97  # of a panel's height, for the same: above is their heading
MOST_NAMES = 5  # of a curve: more would leave it no room
LINE = {"arrowstyle": "-", "color": "#999999", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 0}
AT_THE_END: dict[str, Any] = {"xycoords": "axes fraction", "va": "center", "arrowprops": LINE, "annotation_clip": False}
SAME = 1e-3  # of the panel's height: curves that are nowhere farther apart share a name


def colour(index: int) -> str:
    """Return the colour of the index-th series."""
    return COLOURS[index % len(COLOURS)]


def look(index: int) -> dict[str, Any]:
    """Return colour, dashes and width of the index-th series.

    Of sixteen, those with the same dashes differ in brightness. The solid line is wider: it stays visible on either
    side of a dashed one that lies on it.
    """
    dashes = DASHES[(index + len(DASHES) // 2 * (index // len(COLOURS))) % len(DASHES)]
    style, width = ((0.0, dashes), 1.2) if dashes else ("-", 1.8)
    return {"color": colour(index), "linestyle": style, "linewidth": width}


def marker(index: int) -> str:
    """Return the marker of the index-th series of points: eight, one for each colour."""
    return MARKERS[index % len(MARKERS)]


def typeset(unit: str) -> str:
    """Return a unit, or text with units, as it is printed: m/s^2 becomes m/s², [um] becomes [µm]; 5 N is not broken."""
    return unbroken(unit).replace("^2", "²").replace("^3", "³").replace("[um]", "[µm]")


def figure(width: float = COLUMN, height: float = 2.5) -> Figure:
    """Return an empty figure, size in inches, that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def axes(
    canvas: Figure, xlabel: str, ylabel: str, place: tuple[int, int, int] = (1, 1, 1), share: Axes | None = None
) -> Axes:
    """Return axes with labels, a light grid and no box, at `place` (rows, columns, index).

    With `share` they have the ranges of those axes, horizontally and vertically.
    """
    return dressed(canvas.add_subplot(*place, sharex=share, sharey=share), xlabel, ylabel)


def dressed(ax: Axes, xlabel: str, ylabel: str) -> Axes:
    """Set labels and a light grid, remove the box, and return the axes."""
    ax.set_xlabel(xlabel, fontsize=TEXT)
    ax.set_ylabel(ylabel, fontsize=TEXT)
    ax.tick_params(labelsize=NOTE)
    ax.grid(True, color="#dddddd", linewidth=0.5)
    ax.spines[["top", "right"]].set_visible(False)
    for axis in (ax.xaxis, ax.yaxis):
        axis.get_offset_text().set_fontsize(NOTE)
    return ax


def heading(ax: Axes, text: str, share: float = 1.0) -> None:
    """Write a title at the left above axes, wrapped to their `share` of a column's width."""
    from textwrap import fill

    letters = max(int((72.0 * COLUMN * share - BESIDE) / LETTER), 10)
    lines = [fill(line, letters, break_long_words=False) for line in text.splitlines()]
    ax.set_title("\n".join(lines), fontsize=NOTE, loc="left")


def panels_below(
    canvas: Figure, xlabel: str, ylabels: Sequence[str], heights: Sequence[float] | None = None
) -> list[Axes]:
    """Return axes below each other, of which only the last has numbers and a label on its horizontal axis.

    `heights` are relative; default: all are equal.
    """
    grid = canvas.add_gridspec(len(ylabels), 1, height_ratios=heights)
    every: list[Axes] = []
    for row, ylabel in enumerate(ylabels):
        last = row == len(ylabels) - 1
        panel = canvas.add_subplot(grid[row], sharex=every[0] if every else None)
        every.append(dressed(panel, xlabel if last else "", ylabel))
        every[-1].tick_params(labelbottom=last)
    return every


def axes_in_space(canvas: Figure) -> Any:
    """Return axes of a 3-D picture, with coordinates and units as labels, and few ticks."""
    from mpl_toolkits.mplot3d import Axes3D  # its import registers the projection

    ax: Any = canvas.add_subplot(projection=Axes3D.name)
    for axis in "xyz":
        getattr(ax, f"set_{axis}label")(f"{axis} [m]", fontsize=TEXT, labelpad=(0.9 if axis == "z" else 0.4) * TEXT)
        getattr(ax, f"{axis}axis").set_major_locator(few_ticks())
    ax.tick_params(labelsize=NOTE, pad=0.0)
    ax.tick_params(axis="z", pad=0.5 * TEXT)  # its numbers run across it
    return ax


def equal_scales(ax: Any, points: np.ndarray) -> None:
    """Set the same scale on all three axes, so that a circle looks like a circle."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = max(0.54 * float((high - low).max()), 1e-3)  # some air, so that ticks do not meet at the corners
    for axis, centre in zip("xyz", (low + high) / 2, strict=True):
        getattr(ax, f"set_{axis}lim")(centre - half, centre + half)
    ax.set_box_aspect((1, 1, 1), zoom=0.85)  # a margin for labels, which the layout does not count


def few_ticks(most: int = 4) -> MaxNLocator:
    """Set few enough tick marks that a small axis stays legible."""
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(most, steps=[1, 2, 5, 10], prune="both")


def limit_line(ax: Axes, value: float, text: str, place: float = 1.0, above: bool = True) -> None:
    """Draw a limit as a dashed line with its name above or below it: 0 is at the left end, 1 at the right."""
    ax.axhline(value, **LIMIT)
    side, edge = "left" if place < 0.5 else "right", "bottom" if above else "top"
    ax.annotate(text, (place, value), (0, 1 if above else -1), ha=side, va=edge, **AT_LINE)


def far_limit(ax: Axes, text: str) -> None:
    """Name in the legend a limit that is too far from the curves to be drawn."""
    ax.plot([], [], **LIMIT, label=text)


def legend_below(canvas: Figure, *panels: Axes, scale: float = 1.0) -> Figure:
    """Return the figure with one legend for all panels at the bottom, in rows of equal length that fit its width.

    Its markers are `scale` times those of the curves.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    shown = {}
    for ax in panels:
        handles, labels = ax.get_legend_handles_labels()
        shown = {**shown, **{label: it for label, it in zip(labels, handles, strict=True) if label not in shown}}
    renderer, count = FigureCanvasAgg(canvas).get_renderer(), len(shown)
    for rows in range(1, count + 1):
        legend = canvas.legend(list(shown.values()), list(shown), ncols=-(-count // rows), markerscale=scale, **BELOW)
        if rows == count or legend.get_window_extent(renderer).width <= 0.98 * canvas.bbox.width:
            break
        legend.remove()
    return canvas


def one_value(low: float, high: float) -> bool:
    """Return whether values between these are the same but for rounding."""
    return high - low <= ONE_VALUE * max(abs(low), abs(high), TINY)


def colour_bar(canvas: Figure, shades: ScalarMappable, panels: Axes | list[Axes], label: str, **place: Any) -> Colorbar:
    """Draw a colour bar beside panels, and return it; if all values are the same, it has one number."""
    limits: tuple[Any, Any] = shades.get_clim()  # a bar makes them different
    low, high = limits
    bar = canvas.colorbar(shades, ax=panels, **place)
    if low is not None and high is not None and one_value(low, high):
        middle = (low + high) / 2
        bar.set_ticks([middle], labels=[f"{middle:.4g}"])
    bar.set_label(label, fontsize=NOTE)
    bar.ax.tick_params(labelsize=NOTE)
    return bar


def check_picture(path: Path) -> Path:
    """Return the path of a figure, whose suffix is one of `FORMATS`.

    Raises `InputError` if the suffix is none of them.
    """
    if path.suffix[1:].lower() not in FORMATS:
        accepted = ", ".join(f".{name}" for name in FORMATS)
        raise InputError(f"a figure's file must end in one of {accepted}, got {printable(str(path))}")
    return path


def save(canvas: Figure, path: Path) -> Path:
    """Save as PNG, PDF or SVG, as the suffix of `path` states; a failure leaves no partial file.

    PDF contains its fonts as TrueType (type 42), whose text can be searched and edited; SVG has letters as shapes.
    Equal figures give equal files.

    Raises `InputError` if the suffix is none of them, or the file cannot be written.
    """
    form = check_picture(path).suffix[1:].lower()
    with whole_file(path) as temporary:
        if form == "svg":
            temporary.write_text(svg(canvas), encoding="utf-8")
        else:
            _print(canvas, form, temporary, DPI, {"CreationDate": None} if form == "pdf" else None)
    return path


def save_all(
    draw: Callable[[], Mapping[str, Figure]], folder: str | os.PathLike[str], format: str = "png"
) -> list[Path]:
    """Save the figures that `draw` returns by the names of their files, and return their paths.

    Raises `InputError` if the format is none of `FORMATS`, before anything is drawn, or a file cannot be written.
    """
    into, suffix = file_path("folder", folder), one_of("format", format, FORMATS)
    return [save(drawn, into / f"{name}.{suffix}") for name, drawn in draw().items()]


def svg(canvas: Figure) -> str:
    """Return the figure as SVG text with letters as shapes, so that no font is needed and equal figures are equal."""
    import io

    stream = io.StringIO()
    _print(canvas, "svg", stream, canvas.dpi, dict.fromkeys(("Creator", "Date", "Format", "Type")))
    return stream.getvalue()


def _print(canvas: Figure, form: str, file: Any, dpi: float, metadata: dict[str, None] | None) -> None:
    """Lay a figure out, if it is not yet, and draw it into a file.

    A second layout would differ. `savefig` draws a figure twice, the first time only for the layout.
    """
    from matplotlib import rc_context
    from matplotlib.backend_bases import get_registered_canvas_class

    usual, of_form = canvas.dpi, get_registered_canvas_class(form)(canvas)
    with rc_context({"pdf.fonttype": 42, "svg.fonttype": "path", "svg.hashsalt": "towline"}):
        try:
            canvas.dpi = of_form.fixed_dpi or dpi  # letters have other sizes at other numbers of points
            if (engine := canvas.get_layout_engine()) is not None:
                engine.execute(canvas)
            canvas.set_layout_engine("none")
            canvas.dpi = dpi
            getattr(of_form, f"print_{form}")(file, metadata=metadata)
        finally:
            canvas.dpi = usual


def together(values: np.ndarray, names: list[str], height: float) -> tuple[np.ndarray, list[str]]:
    """Return the curves (n, k) that differ somewhere, and the names of each: "1, 6", or "1, 2, 3 + 5"."""
    groups: list[list[int]] = []
    for index in range(values.shape[1]):
        for group in groups:
            apart = np.abs(values[:, index] - values[:, group[0]])
            if np.isfinite(apart).any() and np.nanmax(apart) < SAME * height:
                group.append(index)
                break
        else:
            groups.append([index])
    texts = []
    for group in groups:
        shown = group if len(group) <= MOST_NAMES else group[: MOST_NAMES - 2]
        more = f" + {len(group) - len(shown)}" if len(group) > len(shown) else ""
        texts.append(", ".join(names[index] for index in shown) + more)
    return values[:, [group[0] for group in groups]], texts


def name_at_the_end(ax: Axes, values: np.ndarray, names: list[str], cables: bool = True) -> None:
    """Write the names of curves beside their ends, whose last values are (k,).

    If they are numbers of `cables`, the highest has the word "cable" or "cables" before it.
    """
    low, high = ax.get_ylim()
    places = (np.clip(values, low, high) - low) / (high - low)
    order = np.argsort(places)
    gap = min(GAP, HIGHEST / max(len(order) - 1, 1))
    for cable, place in zip(order, _spread(places[order], gap), strict=True):
        about = ("cables " if "," in names[cable] else "cable ") if cables and cable == order[-1] else ""
        text, size = f"{about}{names[cable]}", NOTE * gap / GAP
        ax.annotate(text, (1.0, places[cable]), (1.05, place), fontsize=size, **AT_THE_END)


def _spread(places: np.ndarray, gap: float = GAP) -> np.ndarray:
    """Return increasing places with distances of at least `gap`, moved as much up as down."""
    gaps = gap * np.arange(len(places))
    up = np.maximum.accumulate(places - gaps) + gaps
    down = np.minimum.accumulate((places - gaps)[::-1])[::-1] + gaps
    apart = (up + down) / 2
    apart += max(0.0, -apart[0])  # all of them, so that none leaves the panel below
    return np.minimum(apart, HIGHEST - gaps[::-1])
