"""Chart tensions and margin over time in the panel, with spans without tensions and the time that the scene shows."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..figures import style
from .curves import Curves

TALL, LOW = 170, 110  # [pixels]
MARK = "#D55E0055"  # spans without tensions
NOW, LIMIT = "#222222", "#888888"
BELOW = -1e6  # times the range: a curve that leaves the chart, as charts join the points on both sides of a nan
DASHES = ([], [8, 3], [2, 3], [8, 3, 2, 3])  # of the first eight colours, and of those after them
LIMIT_DASH = [2, 2]
OTHER = [4, 4]  # of the plan that the shown one is compared with

Line = tuple[np.ndarray, str, dict[str, Any]]  # values, name and look of a curve


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
