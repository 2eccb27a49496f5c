"""Draw a calibration: residuals before and after, ellipsoids of the anchors, and how well each parameter is known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.text import quantity
from . import style

WITHIN_95 = 2.795  # standard deviations: the root of the 95 % quantile of chi-square with three degrees of freedom
DOTS: dict[str, Any] = {"linestyle": "none", "markersize": 2.0, "markeredgewidth": 0.0, "rasterized": True}
MOST_SAMPLES = 2000  # of a cable in a panel: more are not visible, and files grow
SMALLEST_SPAN = 1e-3  # [mm], to either side of zero: smaller residuals are rounding


def residuals(
    before: np.ndarray, after: np.ndarray, times: np.ndarray | None = None, wrong: np.ndarray | None = None
) -> style.Figure:
    """Draw the residuals of each cable's length with the parameters of the file, and with the calibrated ones.

    - `before`, `after`: (N, m) [m].
    - `times`: times of the samples, (N,) [s]; default: their numbers.
    - `wrong`: readings that the fit leaves out, (N, m); default: none. They are crosses, at the edge if they are beyond
      it.
    """
    canvas = style.figure(height=3.4)
    along = "sample" if times is None else "time [s]"
    top, bottom = style.panels_below(canvas, along, ("residual, file [mm]", "calibrated [mm]"))
    out = np.zeros(before.shape, dtype=bool) if wrong is None else wrong
    for ax, values in ((top, before), (bottom, after)):
        _of_cables(ax, np.where(out, np.nan, values), times)
        low, high = ax.get_ylim()
        rows, cables = np.nonzero(out & np.isfinite(values))
        if rows.size:
            at = rows if times is None else times[rows]
            look = {"color": style.colour(1), "markersize": 4.0, "clip_on": False, "label": "left out"}
            ax.plot(at, np.clip(1e3 * values[rows, cables], low, high), "x", **look)
            ax.set_ylim(low, high)
    return style.legend_below(canvas, top, scale=2.0)


def consistency(
    residuals: np.ndarray, cost: np.ndarray, largest: float, times: np.ndarray | None = None
) -> style.Figure:
    """Draw how well poses fit their lengths: the residual of each cable, and their sums of squares with a limit.

    - `residuals`: residuals of the lengths, (N, m) [m].
    - `cost`: sum of squares in standard deviations, (N,).
    - `largest`: limit that sound samples rarely exceed, or nan.
    - `times`: times of the samples, (N,) [s]; default: their numbers.
    """
    canvas = style.figure(height=3.4)
    along = "sample" if times is None else "time [s]"
    top, bottom = style.panels_below(canvas, along, ("residual [mm]", "sum of squares [-]"))
    _of_cables(top, residuals, times)
    at = np.arange(len(cost)) if times is None else times
    fits = ~(cost > largest)
    few = slice(None, None, -(-len(cost) // MOST_SAMPLES))
    bottom.plot(at[fits][few], cost[fits][few], ".", markersize=2.0, color=style.colour(0), rasterized=True)
    bottom.plot(at[~fits], cost[~fits], ".", markersize=3.0, color=style.colour(1), rasterized=True)
    bottom.set_yscale("symlog", linthresh=1.0)
    if np.isfinite(largest):
        style.limit_line(bottom, largest, "1 % of sound logs exceed this")
    return style.legend_below(canvas, top, scale=2.0)


def _of_cables(ax: style.Axes, values: np.ndarray, times: np.ndarray | None) -> None:
    """Draw values (N, m) [m] of the cables in a panel."""
    at = np.arange(len(values)) if times is None else times
    step = -(-len(values) // MOST_SAMPLES)
    for cable in range(values.shape[1]):
        look = DOTS | {"marker": style.marker(cable), "color": style.colour(cable), "label": f"cables[{cable}]"}
        ax.plot(at[::step], 1e3 * values[::step, cable], **look)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -SMALLEST_SPAN), max(high, SMALLEST_SPAN))
    style.heading(ax, f"root mean square {quantity(1e3 * float(np.sqrt(np.nanmean(values**2))), 'mm', 3)}")


def anchors(file: np.ndarray, found: np.ndarray, covariances: np.ndarray) -> style.Figure:
    """Draw each calibrated anchor relative to the file, with the ellipsoid that contains it with 95 % probability.

    There is a panel for each cable, all at the same scale: y against x, and z against x.

    - `file`, `found`: anchors of the file and calibrated ones, (m, 3) each [m].
    - `covariances`: of the calibrated ones, (m, 3, 3) [m^2].
    """
    from matplotlib.patches import Ellipse

    columns = 2 if len(file) <= 4 else 3
    rows = -(-len(file) // columns)
    canvas = style.figure(height=0.9 + (3.0 / columns + 0.15) * rows)
    moved = 1e3 * (found - file)
    spans = 1e3 * WITHIN_95 * np.sqrt(np.maximum(np.diagonal(covariances, axis1=1, axis2=2), 0.0))
    reach = 1.15 * max(float((np.abs(moved) + spans).max()), 1e-3)
    for cable, (place, covariance) in enumerate(zip(moved, covariances, strict=True)):
        last, first = cable + columns >= len(file), cable % columns == 0
        labels = "x [mm]" if last else "", "y and z [mm]" if first else ""
        ax = style.axes(canvas, *labels, (rows, columns, cable + 1))
        for index, up in enumerate((1, 2)):
            flat = np.array([0, up])
            values, vectors = np.linalg.eigh(covariance[np.ix_(flat, flat)])
            sizes = 2e3 * WITHIN_95 * np.sqrt(np.maximum(values, 0.0))
            angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
            shade, centre = style.colour(index), (float(place[0]), float(place[up]))
            label = f"calibrated, {'xyz'[up]} against x, 95 % ellipse"
            ax.plot(*centre, style.marker(index), color=shade, markersize=2.5, label=label)
            ax.add_patch(Ellipse(centre, sizes[1], sizes[0], angle=angle, facecolor=shade, alpha=0.35))
        ax.plot(0, 0, "+", color="#000000", markersize=7, label="file")
        ax.set_xlim(-reach, reach)
        ax.set_ylim(-reach, reach)
        ax.set_aspect("equal", adjustable="box")
        ax.set_title(f"cables[{cable}]", fontsize=style.NOTE)
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_locator(style.few_ticks())
    return style.legend_below(canvas, canvas.axes[0])


def observability(sigmas: Mapping[str, np.ndarray]) -> style.Figure:
    """Draw the standard deviations of the parameters by cable, one series for each kind of parameter.

    `sigmas`: (m,) [m] by kind, such as "anchor x"; inf where the measurements leave a parameter open, nan where it is
    fixed.
    """
    from matplotlib.ticker import LogLocator, NullFormatter

    canvas = style.figure(height=3.0)
    ax = style.axes(canvas, "index of the cable in the file", "standard deviation [mm]")
    every = np.concatenate([np.asarray(values, dtype=float) for values in sigmas.values()])
    finite = 1e3 * every[np.isfinite(every) & (every > 0)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.1, 10.0)
    beyond, opened = 4.0 * high, bool(np.isinf(every).any())
    shifts = np.linspace(-0.32, 0.32, len(sigmas)) if len(sigmas) > 1 else np.zeros(1)
    for index, ((kind, values), shift) in enumerate(zip(sigmas.items(), shifts, strict=True)):
        at = np.arange(len(values)) + shift
        known = np.isfinite(values)
        style_of: dict[str, Any] = {"color": style.colour(index), "linestyle": "none", "marker": style.marker(index)}
        ax.plot(at[known], 1e3 * values[known], markersize=4, label=kind, **style_of)
        unknown = at[np.isinf(values)]
        ax.plot(unknown, np.full(unknown.shape, beyond), markersize=4, fillstyle="none", **style_of)
    ax.set_yscale("log")
    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter("{x:g}")
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.set_ylim(low / 2, (2 * beyond) if opened else 2 * high)
    if opened:
        style.limit_line(ax, beyond / 1.6, "above this line: not determined", above=True)
    cables = max(len(values) for values in sigmas.values())
    ax.set_xticks(range(cables))
    return style.legend_below(canvas, ax)
