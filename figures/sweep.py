"""Draw results of plans over the varied fields: curves over one, maps over two, maps side by side over three.

Plans without a value are marked by their status.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from . import style

MARKS = {"infeasible": "x", "not-found": "o", "failed": "^"}  # by status; feasible plans have a value
MOST_TICKS = 6
MOST_COLUMNS = 3  # of maps side by side
MOST_NUMBERS, SMALL = (9, 14), 6.0  # cells across and up in which numbers fit, and their size [points]
NOTHING = "#eeeeee"  # behind marks in a map


class Axis(NamedTuple):
    """A varied field."""

    label: str  # its name, with the unit
    values: Sequence[float] | Sequence[str]  # numbers or words

    @property
    def texts(self) -> list[str]:
        """Return the values as text."""
        return [value if isinstance(value, str) else f"{value:g}" for value in self.values]


def sweep(
    axes: Sequence[Axis], status: np.ndarray, quantities: Mapping[str, np.ndarray], lower: Collection[str] = ()
) -> style.Figure:
    """Draw each quantity over one, two or three varied fields.

    - `status`: word for each plan, an axis for each varied field.
    - `quantities`: by their labels, shaped like `status`, nan where a plan has none.
    - `lower`: labels of quantities of which less is better; of all others more is better (default: none). Maps ring
      the best plan.
    """
    known = {label: values for label, values in quantities.items() if np.isfinite(values).any()}
    quantities = known or {"no plan is feasible": np.full(status.shape, np.nan)}
    canvas = _curves(axes[0], status, quantities) if len(axes) == 1 else _maps(axes, status, quantities, lower)
    return style.legend_below(canvas, *canvas.axes)


def _curves(axis: Axis, status: np.ndarray, quantities: Mapping[str, np.ndarray]) -> style.Figure:
    """Draw panels below each other, with the plans without a value along the bottom."""
    from matplotlib.transforms import blended_transform_factory

    canvas = style.figure(height=0.8 + 1.3 * len(quantities))
    words = isinstance(axis.values[0], str)
    x = np.arange(len(axis.values)) if words else np.array(axis.values)
    order = np.argsort(x)
    beyond = 0.4 if words else 0.04 * float(np.ptp(x)) or 0.5
    panels = style.panels_below(canvas, axis.label, list(quantities))
    for row, (ax, values) in enumerate(zip(panels, quantities.values(), strict=True)):
        line = "" if words else "-"  # between words there is nothing
        ax.plot(x[order], values[order], f"{line}o", color=style.colour(row), markersize=4, clip_on=False)
        bottom = blended_transform_factory(ax.transData, ax.transAxes)
        for word, mark in MARKS.items():
            which = x[status == word]
            _mark(ax, which, np.full(len(which), 0.06), word, mark, transform=bottom)
        ax.set_xlim(x.min() - beyond, x.max() + beyond)
        ax.margins(y=0.18)
        if words:
            ax.set_xticks(x, axis.texts)
        else:
            ax.xaxis.set_major_locator(style.few_ticks(MOST_TICKS))
        if not np.isfinite(values).any():
            ax.set_yticks([])
    return canvas


def _maps(
    axes: Sequence[Axis], status: np.ndarray, quantities: Mapping[str, np.ndarray], lower: Collection[str]
) -> style.Figure:
    """Draw the maps of all quantities side by side; over three fields a row of maps for each quantity."""
    if len(axes) == 2:
        canvas = style.figure(height=0.7 + 2.0 * len(quantities))
        panels = style.panels_below(canvas, axes[0].label, [axes[1].label] * len(quantities))
        for ax, (label, values) in zip(panels, quantities.items(), strict=True):
            image = _map(ax, axes, values, status, _range(values))
            _number(ax, image, values)
            _ring_best(ax, values if label in lower else -values)
            if np.isfinite(values).any():
                style.colour_bar(canvas, image, ax, f"{label}, {'lower' if label in lower else 'higher'} is better")
        return canvas
    third = axes[2]
    columns = min(len(third.values), MOST_COLUMNS)
    rows = -(-len(third.values) // columns)  # for each quantity
    canvas = style.figure(height=0.8 + 1.45 * rows * len(quantities))
    canvas.suptitle(f"titles: {third.label}", fontsize=style.TEXT)
    canvas.supylabel(axes[1].label, fontsize=style.TEXT)  # once, since the label is longer than a map is high
    for number, (label, values) in enumerate(quantities.items()):
        drawn: dict[style.Axes, style.ScalarMappable] = {}
        for place, text in enumerate(third.texts):
            row, column = divmod(place, columns)
            leftmost, lowest = column == 0, number + 1 == len(quantities) and place + columns >= len(third.texts)
            cell = (rows * len(quantities), columns, (number * rows + row) * columns + column + 1)
            shared = canvas.axes[0] if canvas.axes else None
            ax = style.axes(canvas, axes[0].label if lowest else "", "", cell, shared)
            drawn[ax] = _map(ax, axes, values[..., place], status[..., place], _range(values))
            ax.tick_params(labelleft=leftmost, labelbottom=lowest)
            style.heading(ax, text, 1 / columns)
        if np.isfinite(values).any():
            style.colour_bar(canvas, next(iter(drawn.values())), list(drawn), label)
    return canvas


def _range(values: np.ndarray) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    return (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)


def _map(
    ax: style.Axes, axes: Sequence[Axis], values: np.ndarray, status: np.ndarray, ends: tuple[float, float]
) -> style.ScalarMappable:
    """Draw a cell for each plan, all of one size, since values need not be evenly spaced."""
    ax.set_facecolor(NOTHING)
    ax.grid(False)
    image = ax.imshow(values.T, origin="lower", aspect="auto", cmap="viridis", vmin=ends[0], vmax=ends[1])
    for word, mark in MARKS.items():
        x, y = np.nonzero(status == word)
        _mark(ax, x, y, word, mark)
    for axis, set_ticks in zip(axes, (ax.set_xticks, ax.set_yticks), strict=False):
        texts = axis.texts
        shown = range(0, len(texts), -(-len(texts) // MOST_TICKS))
        set_ticks(list(shown), [texts[index] for index in shown])
    return image


def _number(ax: style.Axes, image: style.ScalarMappable, values: np.ndarray) -> None:
    """Write the values into the cells of a map that are large enough."""
    if values.shape[0] > MOST_NUMBERS[0] or values.shape[1] > MOST_NUMBERS[1]:
        return
    for (x, y), value in np.ndenumerate(values):
        if np.isfinite(value):
            dark = sum(image.to_rgba(value)[:3]) < 1.5
            ax.text(x, y, f"{value:.3g}", color="w" if dark else "k", fontsize=SMALL, ha="center", va="center")


def _ring_best(ax: style.Axes, values: np.ndarray) -> None:
    """Draw a frame around the cell of the smallest value, unless several have it."""
    known = np.isfinite(values)
    if known.any() and (values[known] == values[known].min()).sum() == 1:
        x, y = np.unravel_index(int(np.where(known, values, np.inf).argmin()), values.shape)
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]) / 2 + [x, y]
        ax.plot(*corners.T, color=style.colour(1), linewidth=1.5, label="best")


def _mark(ax: style.Axes, x: np.ndarray, y: np.ndarray, word: str, mark: str, **options: Any) -> None:
    """Mark plans of one status, with marks small enough for many of them."""
    if not len(x):
        return
    size = float(np.clip(40 / np.sqrt(len(x)), 2.5, 6))
    look = {"markersize": size, "color": "#555555", "markerfacecolor": "none", "linestyle": "none"}
    ax.plot(x, y, mark, label=word, **look, **options)
