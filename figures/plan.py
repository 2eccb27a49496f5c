"""Draw a plan: its path, its tensions with their limits, its carriers, its time law, and the solver's convergence."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.text import quantity
from . import style
from .style import name_at_the_end, together

if TYPE_CHECKING:
    import xarray as xr

MISSING: dict[str, Any] = {"step": "mid", "color": "#e4e4e4", "linewidth": 0}
SLANTED: dict[str, Any] = {"textcoords": "offset points", "rotation": 45, "fontsize": style.NOTE}
FLAT = 0.3  # of the largest range of tensions: panels with a smaller range have their own scale
Iterate = tuple[int, float, float]  # iteration, objective, infeasibility
FLOOR = 1e-16  # a logarithmic axis has no place for an infeasibility of exactly zero


def path(trajectory: xr.Dataset) -> style.Figure:
    """Draw the paths of platform and carriers in {G}, with the lines between them at a few instants."""
    canvas = style.figure(height=3.3)
    ax = style.axes_in_space(canvas)
    position = trajectory["pose"].values[:, :3]
    carriers = trajectory["carrier_pose"].values[:, :, :3]
    ax.plot(*position.T, **style.look(0), label="platform")
    for index, name in enumerate(trajectory["carrier"].values):
        if not trajectory["carrier_moves"].values[index]:
            continue  # cables hang from all over it: `views` has them
        label = str(name)
        if np.ptp(carriers[:, index], axis=0).max() < 1e-9:
            ax.plot(*carriers[0, index], "s", color=style.colour(index + 1), markersize=4, label=f"{label} (at rest)")
        else:
            ax.plot(*carriers[:, index].T, **style.look(index + 1), label=label)
        for row in np.linspace(0, len(position) - 1, 9).astype(int):
            ax.plot(*np.stack([position[row], carriers[row, index]]).T, color="#bbbbbb", linewidth=0.6)
    ax.plot(*position[0], "o", color=style.colour(0), markersize=4, label="start")
    moving = trajectory["carrier_moves"].values
    style.equal_scales(ax, np.concatenate([position, carriers[:, moving].reshape(-1, 3)]))
    return style.legend_below(canvas, ax)


def tensions(trajectory: xr.Dataset) -> style.Figure:
    """Draw the tension of every cable over time with its limits, as `tensions_side_by_side` does."""
    return tensions_side_by_side({"": trajectory})


def tensions_side_by_side(trajectories: dict[str, xr.Dataset]) -> style.Figure:
    """Draw the tensions of several plans of one robot with their limits, panels below each other.

    Where no tensions exist, thin lines show the tensions that the motion would need without limits, pushing included.

    `trajectories`: datasets of plans, by the titles of their panels.
    """
    phases = any("phase" in trajectory.coords for trajectory in trajectories.values())
    missing = any(not np.isfinite(trajectory["tensions"].values).all() for trajectory in trajectories.values())
    canvas = style.figure(height=1.1 + 1.6 * len(trajectories) + 0.4 * phases + 0.4 * missing)
    panels = style.panels_below(canvas, "time [s]", ["tension [N]"] * len(trajectories))
    for ax, (title, trajectory) in zip(panels, trajectories.items(), strict=True):
        _draw_tensions(ax, trajectory)
        if title:
            style.heading(ax, title)
    _same_scale(panels)
    for ax, trajectory in zip(panels, trajectories.values(), strict=True):
        _name_cables(ax, trajectory)
    return style.legend_below(canvas, *panels)


def base_offset(trajectory: xr.Dataset) -> style.Figure:
    """Draw the horizontal distance of each carrier from the platform, and below it its height above it."""
    canvas = style.figure(height=3.6)
    panels = style.panels_below(
        canvas, "time [s]", ["horizontal distance\nfrom platform [m]", "height above\nplatform [m]"]
    )
    time = trajectory["time"].values
    trajectory = trajectory.isel(carrier=trajectory["carrier_moves"].values)
    apart = trajectory["carrier_pose"].values[:, :, :3] - trajectory["pose"].values[:, None, :3]
    for ax, values in zip(panels, (np.linalg.norm(apart[:, :, :2], axis=2), apart[:, :, 2]), strict=True):
        for index, name in enumerate(trajectory["carrier"].values):
            ax.plot(time, values[:, index], **style.look(index), label=str(name))
        low, high = float(min(values.min(), 0.0)), float(max(values.max(), 1e-3))
        ax.set_ylim(1.08 * low, 1.08 * high)
    return style.legend_below(canvas, *panels)


def _same_scale(panels: list[style.Axes]) -> None:
    """Give panels one vertical range, unless the curves of one panel would look flat in it."""
    ends = np.array([ax.get_ylim() for ax in panels])
    spans = np.ptp(ends, axis=1)
    if spans.min() < FLAT * spans.max():
        return
    for ax in panels[1:]:
        ax.sharey(panels[0])
    panels[0].set_ylim(ends[:, 0].min(), ends[:, 1].max())


def _draw_tensions(ax: style.Axes, trajectory: xr.Dataset) -> None:
    time = trajectory["time"].values
    values, unlimited = trajectory["tensions"].values, trajectory["tensions_unlimited"].values
    missing = ~np.isfinite(values).all(axis=1)
    for index in range(values.shape[1]):
        ax.plot(time, values[:, index], **style.look(index))
        needed = np.where(missing, unlimited[:, index], np.nan)
        ax.plot(time, needed, **style.look(index) | {"linewidth": 0.6 * style.look(index)["linewidth"]})
    _draw_phases(ax, trajectory)
    if missing.any():
        shortfall = quantity(float(np.nanmax(trajectory["violation"].values)), "N", digits=3)
        label = f"no tensions inside the limits:\nshortfall up to {shortfall}; thin\nlines: tensions without limits"
        ax.fill_between(time, 0, 1, missing, transform=ax.get_xaxis_transform(), label=label, **MISSING)
    draw_limits(ax, trajectory, np.where(np.isfinite(values), values, unlimited))


def _name_cables(ax: style.Axes, trajectory: xr.Dataset) -> None:
    """Write the numbers of the cables beside their curves, of which those that coincide share a label."""
    ax.margins(x=0.0)
    values, unlimited = trajectory["tensions"].values, trajectory["tensions_unlimited"].values
    shown, names = together(
        np.where(np.isfinite(values), values, unlimited),
        [str(cable) for cable in trajectory["cable"].values],
        float(np.diff(ax.get_ylim())[0]),
    )
    name_at_the_end(ax, shown[-1], names)


def _draw_phases(ax: style.Axes, trajectory: xr.Dataset) -> None:
    """Draw where phases begin, with their names, and the force of the ground; nothing for a task without phases."""
    if "phase" not in trajectory.coords:
        return
    starts, ends = trajectory["phase_start"].values, trajectory["phase_end"].values
    for name, start, end in zip(trajectory["phase"].values, starts, ends, strict=True):
        if start > 0:
            ax.axvline(start, color="#999999", linewidth=0.8, linestyle=":")
        ax.annotate(str(name), ((start + end) / 2, 1.0), (0, 2), ax.get_xaxis_transform(), **SLANTED)
    reaction = trajectory["ground_reaction"].values
    if reaction.any():
        pushing = np.where(reaction > 0, reaction, np.nan)
        ax.plot(trajectory["time"].values, pushing, color="#aaaaaa", linewidth=1.8, label="ground")


def _free_end(values: np.ndarray, limit: float) -> float:
    """Return at which end of the axes, 0 or 1, curves (n, m) stay farther from a limit: there its name fits."""
    part = -(-2 * len(values) // 5)  # as long as the name
    first, last = (np.abs(some - limit).min() for some in (values[:part], values[-part:]))
    return 0.0 if first > last else 1.0


def draw_limits(ax: style.Axes, trajectory: xr.Dataset, shown: np.ndarray) -> None:
    """Draw the limits; upper ones too far away to draw without flattening the curves are in the legend."""
    for low in np.unique(trajectory["t_min"].values):
        style.limit_line(ax, low, f"t_min = {low:g} N", _free_end(shown, low))
    far: list[str] = []
    for high in np.unique(trajectory["t_max"].values):
        if high < 2 * np.abs(shown).max():
            style.limit_line(ax, high, f"t_max = {high:g} N", _free_end(shown, high), above=False)
        else:
            far.append(f"{high:g}")
    if far:
        style.far_limit(ax, f"t_max = {', '.join(far)} N,\nabove the plot")


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


def phase_plane(s: np.ndarray, sd: np.ndarray, active: Sequence[tuple[float, float, str]]) -> style.Figure:
    """Draw ds/dt over s, (n,) each.

    - `s`, `sd`: fraction of the path, increasing from 0 to 1, and its rate [1/s], whose square is linear between grid
      points.
    - `active`: stretches of the path with their active limit: start, end and name.
    """
    canvas = style.figure(height=2.2 + 0.17 * len({name for *_, name in active}))
    ax = style.axes(canvas, "fraction s of the path [-]", "ds/dt [1/s]")
    fine = np.unique(np.concatenate([s, np.linspace(0.0, 1.0, 500)]))
    speed = np.sqrt(np.maximum(np.interp(fine, s, sd**2), 0.0))
    ax.plot(fine, speed, color="#bbbbbb", linewidth=0.8)
    looks: dict[str, int] = {}
    for start, end, name in active:
        there = np.unique([start, *fine[(start < fine) & (fine < end)], end])
        label = None if name in looks else name
        look = style.look(looks.setdefault(name, len(looks)))
        ax.plot(there, np.sqrt(np.maximum(np.interp(there, fine, speed**2), 0.0)), **look, label=label)
    ax.set_ylim(bottom=0.0)
    ax.margins(x=0.01)
    return style.legend_below(canvas, ax)
