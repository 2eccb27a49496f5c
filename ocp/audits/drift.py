"""Drift: how far the planned tensions alone, without feedback, take the platform off its plan.

A robot with fewer independent cables than degrees of freedom cannot follow an interpolated motion exactly: between the
nodes a little of the required wrench is missing. Forward dynamics shows the effect. Under tensions without feedback a
load has no stiffness along its cables and may have negative stiffness against turning, so over a whole plan the
smallest error grows without bound: that is a property of the system as much as of the plan. Over short windows, each
started on the plan, the drift is the plan's own error: the missing wrench, integrated twice. Both are reported.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

WINDOW = 0.1  # [s]
MOST_STEPS = 2000  # over the whole plan


class Drift(NamedTuple):
    """The distance of open-loop forward dynamics from the plan; infinite if it diverges.

    Attributes
    ----------
    window
        Duration of each window [s]; each starts on the plan, one after the other.
    window_position, window_attitude
        Largest distance [m] and largest difference of an Euler angle [rad] at the end of a window.
    position, attitude
        The same at any time of one run over the whole plan, from its start.
    """

    window: float
    window_position: float
    window_attitude: float
    position: float
    attitude: float


def drift(scenario: Scenario, times: np.ndarray, motion: Motion, carriers: Motion, tensions: np.ndarray) -> Drift:
    """Integrate the forward dynamics under `tensions` (n, m) along a plan whose `times` (n,) are equally spaced.

    Runge-Kutta steps of fourth order over pairs of samples: their midpoints are samples too, nothing is interpolated.
    """
    intervals = len(times) - 1
    step = times[1] - times[0]
    pairs = max(min(round(WINDOW / step), intervals) // 2, 1)
    starts = np.arange(0, intervals - 2 * pairs + 1, 2 * pairs)
    inputs = (carriers.pose, tensions)
    ends = _run(scenario, motion, inputs, starts, pairs, 1, step)[-1]
    windows = _differences(ends, motion.pose[starts + 2 * pairs])
    stride = max(int(np.ceil(intervals / 2 / MOST_STEPS)), 1)
    count = intervals // (2 * stride)
    whole = _run(scenario, motion, inputs, np.zeros(1, dtype=int), count, stride, step)[:, 0]
    over_all = _differences(whole, motion.pose[2 * stride * np.arange(1, count + 1)])
    return Drift(2 * pairs * float(step), *windows, *over_all)


def _run(
    scenario: Scenario,
    motion: Motion,
    inputs: tuple[np.ndarray, np.ndarray],
    rows: np.ndarray,
    count: int,
    stride: int,
    step: float,
) -> np.ndarray:
    """Return poses (count, k, 6) after each of `count` steps of 2 `stride` samples, from the plan at `rows` (k,).

    Where a run diverges beyond all numbers it ends: from there on the poses are nan.
    """
    h = 2 * stride * step

    def slope(state: np.ndarray, at: np.ndarray) -> np.ndarray:
        if not np.isfinite(state).all():
            return np.full_like(state, np.nan)
        pose, velocity = state[:, :6], state[:, 6:]
        carrier_pose, tensions = (values[at] for values in inputs)
        return np.hstack(
            [velocity, scenario.dynamics.acceleration(pose, velocity, tensions, carrier_pose, scenario.wind)]
        )

    state = np.hstack([motion.pose[rows], motion.velocity[rows]])
    poses = np.full((count, len(rows), 6), np.nan)
    for k in range(count):
        if not np.isfinite(state).all():
            break
        first = slope(state, rows)
        middle = slope(state + h / 2 * first, rows + stride)
        again = slope(state + h / 2 * middle, rows + stride)
        rows = rows + 2 * stride
        last = slope(state + h * again, rows)
        state = state + h / 6 * (first + 2 * middle + 2 * again + last)
        poses[k] = state[:, :6]
    return poses


def _differences(poses: np.ndarray, planned: np.ndarray) -> tuple[float, float]:
    """Return largest distance [m] and difference of an Euler angle [rad] of poses (n, 6); infinite if they diverge."""
    off = poses - planned
    off[:, 3:] = np.arctan2(np.sin(off[:, 3:]), np.cos(off[:, 3:]))
    if not np.isfinite(off).all():
        return np.inf, np.inf
    return float(np.linalg.norm(off[:, :3], axis=1).max()), float(np.abs(off[:, 3:]).max())
