"""Draw how much of each limit a plan uses over time, in percent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.text import quantity
from . import style

SHOWN = 0.2  # of a limit: what uses less is only named
MOST = 10.0  # of a limit: larger values are drawn as this


class Limited(NamedTuple):
    """A quantity over time and its limits."""

    name: str  # name and unit of the limit
    unit: str  # likewise
    labels: list[str]  # names of the curves
    values: np.ndarray  # (n, k)
    low: float  # the limits, which may be infinite
    high: float  # likewise

    def used(self) -> np.ndarray | None:
        """Return how much of the limit is used at each time, (n,), 1 at a limit; None if a share has no meaning.

        In the middle of a range that is not symmetric, half of it is used.
        """
        low, high, values = self.low, self.high, self.values
        if np.isfinite(low) and np.isfinite(high):
            if low >= high:
                return None
            share = np.abs(values) / high if low == -high else np.maximum(values - low, high - values) / (high - low)
        elif np.isfinite(high) and high > 0:
            share = values / high
        elif np.isfinite(low) and low > 0:
            share = low / np.maximum(values, low / MOST)  # a clearance may be negative
        else:
            return None
        known = ~np.isnan(share)
        return np.where(known.any(axis=1), np.max(share, axis=1, where=known, initial=0.0).clip(max=MOST), np.nan)

    def text(self) -> str:
        """Return the name with its limits."""
        unit = self.unit.replace("-", "")
        low, high = (f"{quantity(bound, unit)}" for bound in (self.low, self.high))
        finite = np.isfinite([self.low, self.high])
        if self.low == self.high:
            bounds = f"exactly {low}"
        elif finite.all():
            bounds = f"{low} to {high}" if self.low != -self.high else f"± {high}"
        else:
            bounds = f"at least {low}" if finite[0] else f"at most {high}"
        return style.typeset(f"{self.name.replace('_', ' ')} ({bounds})")


def limits(times: np.ndarray, quantities: list[Limited]) -> style.Figure:
    """Draw what quantities over `times` (n,) [s] use of their limits; those that use little are named below."""
    canvas = style.figure(height=1.9 + 0.16 * len(quantities))
    ax = style.axes(canvas, "time [s]", "share of the limit [%]")
    drawn: list[tuple[str, np.ndarray]] = []
    small: list[str] = []
    for limited in quantities:
        used = limited.used()
        if used is not None and np.isfinite(used).any() and np.nanmax(used) >= SHOWN:
            drawn.append((f"{limited.text()}: {100 * np.nanmax(used):.3g} %", 100 * used))
        else:
            shown = "" if used is None or not np.isfinite(used).any() else f": {100 * np.nanmax(used):.2g} %"
            small.append(limited.text() + shown)
    for index, (label, used) in enumerate(drawn):
        ax.plot(times, used, **style.look(index), label=label)
    ax.axhline(100.0, **style.LIMIT)
    ax.set_xlim(times[0], times[-1])
    highest = max([100.0, *(float(np.nanmax(used[np.isfinite(used)], initial=0.0)) for _, used in drawn)])
    ax.set_ylim(0.0, 1.08 * min(highest, 200.0))
    for label in small:
        ax.plot([], [], " ", label=label)
    return style.legend_below(canvas, ax)
