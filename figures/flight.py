"""Draw a simulation over time: error, wind, carriers, tensions, status; errors of many runs; and replays."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping
from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.text import numbered
from . import style
from .plan import draw_limits
from .style import name_at_the_end, together

if TYPE_CHECKING:
    import xarray as xr

OFFSET = 1e-6  # [m]; carriers that stay so near to their reference have no panel
GREY, DARK = "#d4d4d4", "#444444"
DIFFERENCE = 0.01  # of all tensions' range: commands nearer to the real tensions are not drawn over them
DECADES = 30.0  # largest error over the smallest of flights from which on the axis is logarithmic
SCALES = ((1.0, 1.0, "m"), (1e-4, 1e-3, "mm"), (0.0, 1e-6, "µm"))  # from which lengths units are used, and their size
EVENT_DASHES = ["-", (0, (4, 2)), (0, (1, 1.5)), (0, (6, 1.5, 1, 1.5)), (0, (6, 1.5, 1, 1.5, 1, 1.5)), (0, (1, 4))]
EVENT_WIDTH = 50  # characters of a line in the legend
THRUST = "thrust"  # an actuator of carriers that fly
LABELS = {
    "position": ("position [mm]", 1e3),
    "rotation": ("rotation [mrad]", 1e3),
    "tensions": ("tension [N]", 1.0),
    "lengths": ("length [mm]", 1e3),
}
VECTORS = ("position", "rotation")


def flight(trajectory: xr.Dataset) -> style.Figure:
    """Draw error, wind, carriers' deviations and thrusts, if any, and the status of each control step."""
    time = trajectory["time"].values
    draws: list[tuple[str, float, Any]] = [("", 1.7, _draw_error)]
    if "wind" in trajectory:
        wind = trajectory["wind"].values
        draws.append(("wind [m/s]", 1.3, partial(_draw_named, names="xyz", values=wind)))
    if _offsets(trajectory).max(initial=0.0) > OFFSET:
        draws.append(("", 1.3, _draw_offsets))
    if "actuation" in trajectory and THRUST in trajectory["actuator"].values:
        thrusts = trajectory["actuation"].sel(actuator=THRUST).values
        of_carriers = partial(_draw_named, names=trajectory["carrier"].values, values=thrusts)
        draws.append(("thrust\ncommanded [N]", 1.3, of_carriers))
    if answers := _answers(trajectory):
        draws.append(("", 0.1 + 0.18 * len(answers), _draw_answers))
    heights = [height for _, height, _ in draws]
    canvas = style.figure(height=0.7 + 0.85 * sum(heights))
    panels = style.panels_below(canvas, "time [s]", [label for label, _, _ in draws], heights)
    for ax, (_, _, draw) in zip(panels, draws, strict=True):
        draw(ax, trajectory)
        ax.set_xlim(time[0], _end(time))
    canvas.align_ylabels(panels[:-1])
    _mark_events(panels, trajectory)
    return style.legend_below(canvas, panels[0])  # of a tolerance outside the plot, and of events


def tensions(trajectory: xr.Dataset) -> style.Figure:
    """Draw real tensions, those commanded where they differ, their limits, and grey spans in which a cable is slack."""
    canvas = style.figure(height=3.1)
    ax = style.axes(canvas, "time [s]", "tension [N]")
    time, real, commanded = (trajectory[name].values for name in ("time", "tensions", "tensions_commanded"))
    gone = trajectory["cut"].values > 0 if "cut" in trajectory else np.zeros(real.shape, dtype=bool)
    low, high = float(np.nanmin([real, commanded])), float(np.nanmax([real, commanded]))
    differs = (np.abs(real - commanded) > DIFFERENCE * max(high - low, 1e-9)) & ~gone
    for index in range(real.shape[1]):
        ax.plot(time, np.where(gone[:, index], np.nan, real[:, index]), **style.look(index))
        commands = np.where(differs[:, index], commanded[:, index], np.nan)
        ax.plot(time, commands, color=style.colour(index), linewidth=0.6)
    ax.plot([], [], color=DARK, linewidth=1.5, label="real" if differs.any() else "real, and as commanded")
    if differs.any():
        ax.plot([], [], color=DARK, linewidth=0.6, label="commanded, where it differs")
    slack = (real <= 0) & (trajectory["t_min"].values > 0) & ~gone
    if slack.any():
        for start, stop in _spans(time, np.asarray(slack.any(axis=1))):
            ax.axvspan(start, stop, color=GREY, linewidth=1.0, zorder=0)
        ax.fill_between([], [], color=GREY, label=f"slack: {numbered('cable', np.flatnonzero(slack.any(axis=0)))}")
    draw_limits(ax, trajectory, np.nan_to_num(real))
    ax.set_xlim(time[0], _end(time))
    left = ~gone[-1]
    names = [str(cable) for cable in trajectory["cable"].values[left]]
    shown, names = together(real[:, left], names, float(np.diff(ax.get_ylim())[0]))
    name_at_the_end(ax, shown[-1], names)
    _mark_events([ax], trajectory)
    return style.legend_below(canvas, ax)


def errors(flights: xr.Dataset) -> style.Figure:
    """Draw the largest error of each of many runs, in ascending order, with the tolerance."""
    canvas = style.figure(height=2.5)
    largest, tolerance = np.sort(flights["error_max"].values), float(flights.attrs["tolerance_m"])
    passed = flights["passed"].values[np.argsort(flights["error_max"].values, kind="stable")]
    scale, unit = scale_of(largest[-1])
    ax = style.axes(canvas, "share of the runs [%]", f"largest error [{unit}]")
    share = 100 * (np.arange(len(largest)) + 0.5) / len(largest)
    ax.plot(share, largest / scale, color="#999999", linewidth=0.8)
    for index, (some, mark, label) in enumerate(((passed, "o", "passed"), (~passed, "x", "failed"))):
        if some.any():
            ax.plot(share[some], largest[some] / scale, mark, markersize=4, color=style.colour(index), label=label)
    if largest[0] * DECADES < largest[-1] and largest[0] > 0:
        ax.set_yscale("log")
    else:
        ax.set_ylim(bottom=0.0)
    draw_tolerance(ax, tolerance, largest[-1], scale)
    ax.set_xlim(0, 100)
    return style.legend_below(canvas, ax)


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
    medians = [flights[variable].sel(quantile=0.5).dropna("time").values for variable, _ in names.values()]
    ends = [float(median[-1]) if median.size else 0.0 for median in medians]
    name_at_the_end(tensions, np.array(ends), list(names), cables=False)
    for ax in (errors, tensions):
        ax.set_xlim(0.0, float(flights.attrs["duration_s"]))
    errors.plot([], [], color=DARK, linewidth=1.5, label="median of the runs")
    errors.fill_between([], [], color=DARK, alpha=0.25, linewidth=0, label="5 to 95 %")
    errors.plot([], [], color=DARK, linewidth=0.6, label="extreme of all")
    draw_tolerance(errors, float(flights.attrs["tolerance_m"]), largest, scale)
    return style.legend_below(canvas, errors)


def _draw_band(ax: style.Axes, flights: xr.Dataset, values: np.ndarray, index: int, extreme: int) -> None:
    """Draw quantiles (q, n) of a value over time in one colour, and one of them as its extreme."""
    time, quantiles, colour = flights["time"].values, flights["quantile"].values, style.colour(index)
    low, median, high = (values[int(np.abs(quantiles - share).argmin())] for share in (0.05, 0.5, 0.95))
    ax.fill_between(time, low, high, color=colour, alpha=0.25, linewidth=0)
    ax.plot(time, median, color=colour)
    ax.plot(time, values[extreme], color=colour, linewidth=0.6)


def _mark_events(panels: list[style.Axes], trajectory: xr.Dataset) -> None:
    """Draw a line at each event through all panels, and name it in the legend."""
    happened = json.loads(trajectory.attrs.get("report", "{}")).get("events", [])
    for event, dashes in zip(happened, itertools.cycle(EVENT_DASHES), strict=False):
        for ax in panels:
            ax.axvline(event["at_s"], color="#000000", linewidth=0.8, linestyle=dashes, zorder=1)
        label = fill(f"{event['at_s']:.4g} s: {event['what']}", EVENT_WIDTH)
        panels[0].plot([], [], color="#000000", linewidth=0.8, linestyle=dashes, label=label)


def _draw_error(ax: style.Axes, trajectory: xr.Dataset) -> None:
    error = trajectory["tracking_error"].values
    largest = float(error.max(initial=0.0, where=np.isfinite(error)))
    scale, unit = scale_of(largest)
    ax.plot(trajectory["time"].values, error / scale, **style.look(0))
    ax.set_ylabel(f"error [{unit}]")
    ax.set_ylim(bottom=0.0)
    draw_tolerance(ax, float(trajectory.attrs["tolerance_m"]), largest, scale)


def draw_tolerance(ax: style.Axes, tolerance: float, largest: float, scale: float) -> None:
    """Draw the tolerance if it is near, else name it."""
    own, unit = scale_of(tolerance)
    text = f"tolerance {tolerance / own:g} {unit}"
    if tolerance < 2 * largest:
        style.limit_line(ax, tolerance / scale, text, place=0.01)
        ax.set_ylim(top=1.2 * max(tolerance, largest) / scale)
    else:
        style.far_limit(ax, f"{text}, above the plot")


def _draw_offsets(ax: style.Axes, trajectory: xr.Dataset) -> None:
    offsets = _offsets(trajectory)
    scale, unit = scale_of(float(offsets.max()))
    ax.set_ylabel(f"offset of\ncarriers [{unit}]")
    names = trajectory["carrier"].values[trajectory["carrier_moves"].values]
    _draw_named(ax, trajectory, names, offsets / scale)
    ax.set_ylim(bottom=0.0)


def _draw_answers(ax: style.Axes, trajectory: xr.Dataset) -> None:
    """Draw a row for each status, black where steps had it."""
    time, answered = trajectory["time"].values, trajectory["answered"].values
    answers = _answers(trajectory)
    for row, flag in enumerate(answers.values()):
        spans = [(start, stop - start) for start, stop in _spans(time, answered == flag)]
        ax.broken_barh(spans, (row - 0.35, 0.7), facecolor=DARK, edgecolor=DARK, linewidth=0.8)
    ax.set_yticks(range(len(answers)), list(answers))
    ax.set_ylim(len(answers) - 0.5, -0.5)
    ax.grid(False)
    ax.tick_params(axis="y", length=0)
    style.heading(ax, "status of each control step")


def _answers(trajectory: xr.Dataset) -> dict[str, int]:
    """Return the status words that occur, with their numbers."""
    variable = trajectory["answered"]
    words = str(variable.attrs["flag_meanings"]).split()
    known = zip(words, np.ravel(variable.attrs["flag_values"]).tolist(), strict=True)
    there = set(np.unique(variable.values).tolist())
    return {word.replace("_", " "): flag for word, flag in known if flag in there}


def _offsets(trajectory: xr.Dataset) -> np.ndarray:
    """Return the distances of the carriers that move from their reference, (n, c) [m]."""
    moves = trajectory["carrier_moves"].values
    off = trajectory["carrier_pose"].values[:, moves, :3] - trajectory["carrier_reference"].values[:, moves, :3]
    return np.linalg.norm(off, axis=2)


def _spans(time: np.ndarray, where: np.ndarray) -> list[tuple[float, float]]:
    """Return the spans of periods for which `where` holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    ends = np.append(time, _end(time))
    return [(float(ends[start]), float(ends[stop])) for start, stop in edges.reshape(-1, 2)]


def _end(time: np.ndarray) -> float:
    """Return the end of the last period."""
    return float(time[-1] + (time[-1] - time[-2] if len(time) > 1 else 1e-3))


def scale_of(largest: float) -> tuple[float, str]:
    """Return the unit in which the largest of some lengths reads best, with its size [m]."""
    return next(((size, unit) for least, size, unit in SCALES if largest >= least), SCALES[-1][1:])


def _draw_named(ax: style.Axes, trajectory: xr.Dataset, names: Iterable[Any], values: np.ndarray) -> None:
    """Draw the columns of values (n, k) that have any, with their names beside the panel."""
    for index, name in enumerate(names):
        if np.isfinite(values[:, index]).any():
            ax.plot(trajectory["time"].values, values[:, index], **style.look(index), label=str(name))
    ax.legend(fontsize=style.NOTE, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, handlelength=2.6)


def replay(
    times: np.ndarray,
    residuals: Mapping[str, np.ndarray],
    explained: Mapping[str, np.ndarray],
    noise: Mapping[str, float],
    title: str,
    by: str = "",
) -> style.Figure:
    """Draw the size of each kind of residual over time, and its noise.

    - `times`: times of the samples of each window, (W, S) [s].
    - `residuals`, `explained`: measured minus simulated by kind, (W, S, k), with the model and with the parameter that
      explains most, which is called `by`.
    - `noise`: standard deviation of each kind.
    - `title`: result in one line.
    """
    canvas = style.figure(height=0.9 + 1.1 * len(residuals))
    panels = style.panels_below(canvas, "time [s]", [LABELS[name][0] for name in residuals])
    for ax, (name, part) in zip(panels, residuals.items(), strict=False):
        scale = LABELS[name][1]
        curves = [(part, 0, "model"), *([(explained[name], 1, f"with {by} fitted")] if explained else [])]
        for values, index, label in curves:
            for k, (at, window) in enumerate(zip(times, values, strict=True)):
                look: dict[str, Any] = style.look(index) | {"linewidth": 0.9}
                ax.plot(at, scale * _size(name, window), **look, label=label if k == 0 else None)
        usual = np.sqrt(np.isfinite(part).any(axis=(0, 1)).sum()) if name in VECTORS else 1.0
        ax.axhline(scale * usual * noise[name], color="#444444", linewidth=0.8, linestyle=":", label="noise, rms")
        ax.set_ylim(bottom=0.0)
    style.heading(panels[0], title)
    return style.legend_below(canvas, panels[0])


def _size(name: str, values: np.ndarray) -> np.ndarray:
    """Return the length of vectors (S, 3), or the root mean square over the cables (S, m).

    Coordinates that do not move are nan and are left out; samples without any number stay nan.
    """
    squares, known = np.nan_to_num(np.square(values)).sum(axis=-1), np.isfinite(values).any(axis=-1)
    return np.sqrt(np.where(known, squares / (1 if name in VECTORS else values.shape[-1]), np.nan))
