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

    @property
    def is_drawn(self) -> bool:
        """Return whether it has a curve: a share that is large enough to be seen."""
        used = self.used()
        return used is not None and bool(np.nanmax(used, initial=0.0) >= SHOWN)

    def most(self) -> str:
        """Return the largest share or, where a share has no meaning, the value nearest to the only bound."""
        used, unit = self.used(), self.unit.replace("-", "")
        if used is not None:
            return f": {100 * np.nanmax(used):.3g} %" if np.isfinite(used).any() else ""
        bounds = np.isfinite([self.low, self.high])
        if bounds.all() or not np.isfinite(self.values).any():
            return ""
        nearest = np.nanmin(self.values) if bounds[0] else np.nanmax(self.values)
        return f": {quantity(float(nearest), unit, 3)}"

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
    highest = 100.0
    for index, limited in enumerate(each for each in quantities if each.is_drawn):
        used = 100 * np.asarray(limited.used())
        highest = max(highest, float(np.nanmax(used)))
        ax.plot(times, used, **style.look(index), label=limited.text() + limited.most())
    ax.axhline(100.0, **style.LIMIT)
    ax.set_xlim(times[0], times[-1])
    ax.set_ylim(0.0, 1.08 * min(highest, 200.0))
    for limited in quantities:
        if not limited.is_drawn:
            ax.plot([], [], " ", label=limited.text() + limited.most())
    return style.legend_below(canvas, ax)
