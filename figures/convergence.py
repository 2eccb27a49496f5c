"""Draw the convergence of a solver: infeasibility and objective over the iterations of all its runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from . import style

Iterate = tuple[int, float, float]  # iteration, objective, infeasibility
FLOOR = 1e-16  # a logarithmic axis has no place for an infeasibility of exactly zero


def runs(iterates: Sequence[Iterate]) -> list[np.ndarray]:
    """Split rows of (iteration, objective, infeasibility) where the iteration falls: one array (k, 3) for each run."""
    rows = np.array(iterates, dtype=float).reshape(-1, 3)
    starts = np.flatnonzero(np.diff(rows[:, 0]) <= 0) + 1
    return [run for run in np.split(rows, starts) if len(run)]


def convergence(iterates: Sequence[Iterate]) -> style.Figure:
    """Draw infeasibility and objective over the iterations, numbered through all runs, with a colour for each run.

    `iterates`: rows of (iteration, objective, infeasibility) in order. Another run begins where the iteration number
    falls to 0: a finer mesh, tighter limits, or a program with slacks.
    """
    canvas = style.figure(height=3.3)
    labels = ("infeasibility [-]", "objective [-]")
    above, below = style.panels_below(canvas, "iteration (all solver runs)", labels)
    parts = runs(iterates)
    starts = np.cumsum([0, *(len(part) for part in parts)])
    for index, (part, start) in enumerate(zip(parts, starts, strict=False)):
        at = start + np.arange(len(part))
        look: dict[str, Any] = {**style.look(index), "marker": ".", "markersize": 3, "label": f"run {index + 1}"}
        above.plot(at, np.maximum(part[:, 2], FLOOR), **look)
        below.plot(at, part[:, 1], **look)
    for ax in (above, below):
        for _, start in pairwise(starts[:-1]):
            ax.axvline(start - 0.5, color="#999999", linewidth=0.8, linestyle=":")
        ax.set_xlim(-0.5, max(float(starts[-1]), 1.0) - 0.5)
    above.set_yscale("log")
    _scale_objective(below, np.concatenate([part[:, 1] for part in parts]) if parts else np.ones(1))
    return style.legend_below(canvas, above) if len(parts) > 1 else canvas


def _scale_objective(ax: style.Axes, values: np.ndarray) -> None:
    """Use a logarithmic axis; if an objective is not positive, one that is linear near zero.

    An axis of less than a decade has plain numbers as labels, because it may contain no power of ten.
    """
    from matplotlib.ticker import MaxNLocator, NullLocator, StrMethodFormatter

    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    if not sizes.size:
        return
    if (values[np.isfinite(values)] > 0).all():
        ax.set_yscale("log")
        if sizes.max() < 10 * sizes.min():
            ax.yaxis.set_major_locator(MaxNLocator(6))
            ax.yaxis.set_minor_locator(NullLocator())
            ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    else:
        ax.set_yscale("symlog", linthresh=float(sizes.min()))
