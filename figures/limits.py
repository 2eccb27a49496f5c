"""Draw the limited quantities of a plan over time, with a panel for each limit."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_CURVES = 8  # of a panel; of more the least and the largest at each time
LEAST = 0.1  # of a limit: a panel is at least so high; a limit that is farther away than that height is only named


class Limited(NamedTuple):
    """A quantity over time and its limits."""

    name: str  # name and unit of the limit
    unit: str  # likewise
    labels: list[str]  # names of the curves
    values: np.ndarray  # (n, k)
    low: float  # the limits; an infinite one is not drawn
    high: float  # likewise


def limits(times: np.ndarray, quantities: list[Limited]) -> Figure:
    """Draw quantities over `times` (n,) [s], with a panel for each."""
    canvas = style.figure(height=0.7 + 1.2 * len(quantities))
    looks: dict[str, int] = {}
    panels = style.panels_below(canvas, "time [s]", [f"[{style.typeset(quantity.unit)}]" for quantity in quantities])
    for ax, quantity in zip(panels, quantities, strict=True):
        _panel(ax, times, quantity, looks)
    style.legend_below(canvas, *canvas.axes)
    return canvas


def _panel(ax: Axes, times: np.ndarray, quantity: Limited, looks: dict[str, int]) -> None:
    values, notes = quantity.values, []
    if len(quantity.labels) > MOST_CURVES:
        least, most = values.min(axis=1), values.max(axis=1)
        ax.fill_between(times, least, most, color="#cccccc", linewidth=0)
        for edge in (least, most):
            ax.plot(times, edge, color="#000000", linewidth=1.0)
        notes.append(f"least and largest of {len(quantity.labels)}")
    else:
        for label, curve in zip(quantity.labels, values.T, strict=True):
            index = looks.setdefault(label, len(looks))
            ax.plot(times, curve, **style.look(index), label=label)
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 0.0)
    bounds = [bound for bound in (quantity.low, quantity.high) if np.isfinite(bound)]
    # A curve that hardly changes relative to its limit must look flat.
    size = max(high - low, LEAST * max((abs(bound) for bound in bounds), default=0.0), 1e-9)
    near = [bound for bound in bounds if low - size <= bound <= high + size]
    for bound in near:
        ax.axhline(bound, **style.LIMIT)
    notes.append(_as_text(quantity) + ("" if near or not bounds else " (outside the plot)"))
    middle, shown = (low + high) / 2, [low, high, *near]
    ax.set_ylim(min(*shown, middle - size / 2) - 0.1 * size, max(*shown, middle + size / 2) + 0.1 * size)
    ax.margins(x=0.01)
    style.heading(ax, style.typeset(f"{quantity.name}: {', '.join(notes)}"))


def _as_text(quantity: Limited) -> str:
    low, high, unit = quantity.low, quantity.high, quantity.unit.replace("-", "")
    if low == high:
        text = f"exactly {low:g}"
    elif np.isfinite(low) and np.isfinite(high):
        text = f"limits {low:g} and {high:g}"
    else:
        text = f"lower limit {low:g}" if np.isfinite(low) else f"limit {high:g}"
    return f"{text} {unit}".rstrip()
