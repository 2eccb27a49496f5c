"""Draw the envelopes of many runs over time: quantiles of position errors and of extreme tensions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import style
from .end_labels import name_at_the_end
from .flight import draw_tolerance, scale_of

if TYPE_CHECKING:
    import xarray as xr

GREY = "#444444"


def envelopes(flights: xr.Dataset) -> style.Figure:
    """Draw median, range of 5 to 95 % and extreme of the runs: errors above, smallest and largest tensions below."""
    canvas = style.figure(height=3.4)
    errors, tensions = style.panels_below(canvas, "time [s]", ["", "tension [N]"], [1.7, 1.7])
    error = flights["error_quantiles"].values
    largest = float(np.nanmax(error))
    scale, unit = scale_of(largest)
    errors.set_ylabel(f"error [{unit}]")
    _draw_band(errors, flights, error / scale, 0, -1)
    errors.set_ylim(bottom=0.0)
    names = {"largest": ("tension_max_quantiles", -1), "smallest": ("tension_min_quantiles", 0)}
    for index, (variable, extreme) in enumerate(names.values()):
        _draw_band(tensions, flights, flights[variable].values, 1 + index, extreme)
    ends = [_last(flights[variable].sel(quantile=0.5).values) for variable, _ in names.values()]
    name_at_the_end(tensions, np.array(ends), list(names), cables=False)
    for ax in (errors, tensions):
        ax.set_xlim(0.0, float(flights.attrs["duration_s"]))
    errors.plot([], [], color=GREY, linewidth=1.5, label="median of the runs")
    errors.fill_between([], [], color=GREY, alpha=0.25, linewidth=0, label="5 to 95 %")
    errors.plot([], [], color=GREY, linewidth=0.6, label="extreme of all")
    draw_tolerance(errors, float(flights.attrs["tolerance_m"]), largest, scale)
    return style.legend_below(canvas, errors)


def _draw_band(ax: style.Axes, flights: xr.Dataset, values: np.ndarray, index: int, extreme: int) -> None:
    """Draw quantiles (q, n) of a value over time in one colour, and one of them as its extreme."""
    time, quantiles, colour = flights["time"].values, flights["quantile"].values, style.colour(index)
    low, median, high = (values[int(np.abs(quantiles - share).argmin())] for share in (0.05, 0.5, 0.95))
    ax.fill_between(time, low, high, color=colour, alpha=0.25, linewidth=0)
    ax.plot(time, median, color=colour)
    ax.plot(time, values[extreme], color=colour, linewidth=0.6)


def _last(values: np.ndarray) -> float:
    """Return the last value that is a number, or 0 if there is none."""
    known = values[np.isfinite(values)]
    return float(known[-1]) if known.size else 0.0
