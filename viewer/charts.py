"""Chart tensions and margin over time in the panel, with spans without tensions and the time that the scene shows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..base.display import Displayed
from ..figures import style
from .replay import Replay

TALL, LOW = 170, 110  # [pixels]
MARK = "#D55E0055"  # spans without tensions
NOW, LIMIT = "#222222", "#888888"
BELOW = -1e6  # times the range: a curve that leaves the chart, as charts join the points on both sides of a nan
DASHES = ([], [8, 3], [2, 3], [8, 3, 2, 3])  # of the first eight colours, and of those after them
LIMIT_DASH = [2, 2]
OTHER = [4, 4]  # of the plan that the shown one is compared with

Line = tuple[np.ndarray, str, dict[str, Any]]  # values, name and look of a curve
ROUNDING = 1e-9  # of the largest tension: a margin that is zero
POINTS = 240  # of a curve, about one for each pixel of the panel


class Charts:
    """Charts of tensions and margin in the panel of a viser server.

    - `gui`: of the server.
    - `shown`: the curves of what the scene shows.
    - `limits`: tension limits, which are drawn as far as the tensions come near them [N].
    - `other`: curves to compare them with, if there are any.
    """

    def __init__(self, gui: Any, shown: Curves, limits: np.ndarray, other: Curves | None = None):
        self._curves = shown
        drawn = [(shown, "", {})]
        drawn += [] if other is None else [(other.on(shown.times), ", other", {"dash": OTHER, "width": 1.0})]
        cables = range(shown.tensions.shape[1])
        several = [(its.tensions[:, i], i, word, look) for its, word, look in drawn for i in cables]
        tensions = [(values, f"cable {i + 1}{word}", _stroke(i) | look) for values, i, word, look in several]
        margins = [(its.margins, f"margin{word}", _stroke(0) | look) for its, word, look in drawn]
        self._charts = [
            self._chart(gui, "tensions [N]", tensions, TALL, np.unique(limits)),
            self._chart(gui, "tension margin [N]", margins, LOW),
        ]

    def move(self, time: float) -> None:
        """Move the cursor to `time` [s]."""
        for handle, columns in self._charts:
            handle.data = (self._curves.times, *columns, self._cursor(time))

    def _cursor(self, time: float) -> np.ndarray:
        """Return the column that draws the cursor: a spike, as charts have no vertical lines."""
        column = np.zeros(len(self._curves.times))
        column[self._curves.nearest(time)] = 1.0
        return column

    def _chart(self, gui: Any, title: str, lines: list[Line], height: int, limits: Iterable[float] = ()) -> Any:
        """Return the handle of a chart, and its columns without time and cursor."""
        known = np.concatenate([values[np.isfinite(values)] for values, _, _ in lines])
        low, high = min(float(known.min(initial=0.0)), 0.0), float(known.max(initial=0.0))
        low, high = 1.05 * low, 1.05 * high if high > low else low + 1.0
        constant = {"stroke": LIMIT, "width": 1.0, "dash": LIMIT_DASH}
        shown = [limit for limit in limits if low < limit < high]
        lines = [*((np.full(len(self._curves.times), limit), "limit", constant) for limit in shown), *lines]
        outside = low + BELOW * (high - low)
        hidden = {"points": {"show": False}}
        marks = [self._curves.infeasible.astype(float)] if self._curves.infeasible.any() else []
        marked = {"label": "infeasible", "scale": "mark", "fill": MARK, "width": 0, **hidden}
        columns = [*marks, *(_drawn(values, outside) for values, _, _ in lines)]
        series = (
            {"label": "time [s]"},
            *([marked] * len(marks)),
            *({"label": label, "scale": "y", **look, **hidden} for _, label, look in lines),
            {"label": "now", "scale": "mark", "stroke": NOW, "width": 1.5, **hidden},
        )
        handle = gui.add_uplot(
            data=(self._curves.times, *columns, self._cursor(float(self._curves.times[0]))),
            series=series,
            title=title,
            scales={"x": {"time": False}, "y": {"range": (low, high)}, "mark": {"range": (0.0, 1.0)}},
            axes=({"size": 30}, {"size": 45, "scale": "y"}),
            legend={"show": True},
            height=height,
            padding=(4, 12, 0, 0),
        )
        return handle, columns


def _drawn(values: np.ndarray, outside: float) -> np.ndarray:
    """Return a curve that leaves the chart where it has gaps, and ends where its values end, where charts take nan."""
    known = np.flatnonzero(np.isfinite(values))
    drawn = np.where(np.isfinite(values), values, outside)
    if len(known):
        drawn[: known[0]] = drawn[known[-1] + 1 :] = np.nan
    return drawn


def _stroke(index: int) -> dict[str, Any]:
    return {"stroke": style.colour(index), "width": 1.5, "dash": DASHES[index // len(style.COLOURS) % len(DASHES)]}


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
