"""Reduce the tensions of a replay to curves that a chart can redraw with every frame."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.display import Displayed
from .replay import Replay

ROUNDING = 1e-9  # of the largest tension: a margin that is zero
POINTS = 240  # of a curve, about one for each pixel of the panel


@dataclass(frozen=True)
class Curves(Displayed):
    """Tensions and margins of a motion at k of its instants, which include its worst."""

    times: np.ndarray  # (k,) [s], increasing
    tensions: np.ndarray  # (k, m) [N], nan where there are no tensions
    margins: np.ndarray  # (k,) [N], nan there too

    @property
    def infeasible(self) -> np.ndarray:
        """Return which instants have no tensions, or tensions beyond their limits, (k,)."""
        return ~(self.margins >= -1e-6 * float(np.nanmax(np.abs(self.tensions), initial=0.0)))

    @property
    def infeasible_spans(self) -> list[tuple[float, float]]:
        """Return the first and the last infeasible instant of each span, as shares of the duration."""
        edges = np.diff(np.r_[False, self.infeasible, False].astype(int))
        shares = (self.times - self.times[0]) / max(float(np.ptp(self.times)), np.finfo(float).tiny)
        first, last = shares[edges[:-1] > 0], shares[edges[1:] < 0]
        return list(zip(first.tolist(), last.tolist(), strict=True))

    def nearest(self, time: float) -> int:
        """Return the index of the instant nearest to `time` [s]."""
        return int(np.abs(self.times - time).argmin())

    def on(self, times: np.ndarray) -> Curves:
        """Return the curves at other times (j,) [s], interpolated, and nan before the first and after the last."""
        columns = [np.interp(times, self.times, column, np.nan, np.nan) for column in self.tensions.T]
        return Curves(times, np.stack(columns, 1), np.interp(times, self.times, self.margins, np.nan, np.nan))


def curves(replay: Replay, points: int = POINTS) -> Curves:
    """Return the curves of a replay: the instant with the least margin of each of `points` parts, and both ends."""
    margins = replay.margins
    severity = np.where(np.isnan(margins), -np.inf, margins)
    edges = np.unique(np.linspace(0, len(margins), points + 1).round().astype(int))
    worst = [low + severity[low:high].argmin() for low, high in pairwise(edges)]
    shown = np.unique([0, *worst, len(margins) - 1])
    rounding = ROUNDING * float(np.nanmax(np.abs(replay.tensions), initial=0.0))
    drawn = np.where(np.abs(margins[shown]) < rounding, 0.0, margins[shown])
    return Curves(replay.times[shown], replay.tensions[shown], drawn)
