"""Drift: how far the planned tensions alone, without feedback, take the platform off its plan.

A robot with fewer independent cables than degrees of freedom cannot follow an interpolated motion exactly: between the
nodes a little of the required wrench is missing. Forward dynamics shows the effect. Under tensions without feedback a
load has no stiffness along its cables and may have negative stiffness against turning, so over a whole plan the
smallest error grows without bound: that is a property of the system as much as of the plan. Over short windows, each
started on the plan, the drift is the plan's own error: the missing wrench, integrated twice. Both are reported.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np

from ...models.points import shortest_way
from ..tasks.paths import Motion
from ..tasks.scenario import Scenario

WINDOW = 0.1  # [s]
MOST_STEPS = 2000  # over the whole plan


class Drift(NamedTuple):
    """The distance of open-loop forward dynamics from the plan; infinite if it diverges."""

    window: float  # duration of each window [s]; each starts on the plan, one after the other
    # largest distance [m] and largest difference of an Euler angle [rad] at the end of a window
    window_position: float
    window_attitude: float
    # the same at any time of one run over the whole plan, from its start
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
    forward, plan = _forward(scenario), (motion, carriers, tensions)
    of_pairs = forward.mapaccum(pairs)
    ends = np.array([_run(of_pairs, plan, start, pairs, 1, step)[-1] for start in starts.tolist()])
    windows = _differences(ends, motion.pose[starts + 2 * pairs])
    stride = max(int(np.ceil(intervals / 2 / MOST_STEPS)), 1)
    count = intervals // (2 * stride)
    whole = _run(forward.mapaccum(count), plan, 0, count, stride, step)
    over_all = _differences(whole, motion.pose[2 * stride * np.arange(1, count + 1)])
    return Drift(2 * pairs * float(step), *windows, *over_all)


def _forward(scenario: Scenario) -> ca.Function:
    """Return the step of a state: pose and velocity (12,) to those after `h` [s].

    Carriers' poses and tensions are those at the beginning, the middle and the end of the step, one after the other.
    """
    c, m = len(scenario.robot.carriers), scenario.robot.m
    state, h = ca.MX.sym("state", 12), ca.MX.sym("h")
    carriers, tensions = ca.MX.sym("carriers", c, 18), ca.MX.sym("tensions", m, 3)

    def slope(state: ca.MX, instant: int) -> ca.MX:
        given = state[:6], state[6:], tensions[:, instant], carriers[:, 6 * instant : 6 * (instant + 1)]
        return ca.vertcat(state[6:], scenario.dynamics.acceleration(*given, scenario.wind))

    first = slope(state, 0)
    middle = slope(state + h / 2 * first, 1)
    again = slope(state + h / 2 * middle, 1)
    last = slope(state + h * again, 2)
    after = state + h / 6 * (first + 2 * middle + 2 * again + last)
    return ca.Function("forward", [state, h, carriers, tensions], [after])


def _run(
    steps: ca.Function, plan: tuple[Motion, Motion, np.ndarray], row: int, count: int, stride: int, step: float
) -> np.ndarray:
    """Return poses (count, 6) after each of `count` steps of 2 `stride` samples, from the plan at `row`.

    `steps` makes all steps of `_forward` in one call. Poses are nan once the motion has diverged.
    """
    motion, carriers, tensions = plan
    at = row + stride * (2 * np.arange(count)[:, None] + np.arange(3)).ravel()  # beginning, middle, end of each step
    states = steps(
        np.concatenate([motion.pose[row], motion.velocity[row]]),
        np.full((1, count), 2 * stride * step),
        np.concatenate(list(carriers.pose[at]), axis=1),
        tensions[at].T,
    )
    poses = np.asarray(states).T[:, :6]
    return np.where(np.isfinite(poses), poses, np.nan)


def _differences(poses: np.ndarray, planned: np.ndarray) -> tuple[float, float]:
    """Return largest distance [m] and difference of an Euler angle [rad] of poses (n, 6); infinite if they diverge."""
    off = shortest_way(poses - planned)
    if not np.isfinite(off).all():
        return np.inf, np.inf
    return float(np.linalg.norm(off[:, :3], axis=1).max()), float(np.abs(off[:, 3:]).max())
