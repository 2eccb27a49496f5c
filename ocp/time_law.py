"""Compute the fastest time law along a task's path, as a stage of planning: `fastest`.

Where the path is followed exactly from rest to rest, `time_along` computes the least time of all time laws: a shorter
duration is impossible, and its law is a plan if it keeps the task's other limits too. Its minimum is that of a grid:
it differs from the true one by the grid's interval, some tenths of a per cent, so that `BOUND` of it is proven.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError, SolverError
from ..text import quantity
from .tasks.paths import AnyPath, LinePath, RestPath, WaypointPath
from .tasks.scenario import Scenario
from .tasks.task import Tube
from .tasks.task_limits import TaskLimits
from .timing.fastest_law import KNOWN_LIMITS, time_along
from .timing.timing import Timing

__all__ = ["BOUND", "fastest"]

BOUND = 0.99  # of the fastest law's time on its grid: no law is faster than this
PIECES = 400  # of a spline that is given to `time_along` as points: 1e-6 of its length off at most
LOOKS = 20_001
ON_PATH = 2e-6  # of a path's length: how far that spline may be off


def fastest(scenario: Scenario) -> tuple[Timing | None, str]:
    """Return the fastest law along the path of a scenario whose duration alone is free, or None, and the message.

    Limits of the task that `time_along` does not know are left out: its time is a lower bound even so.
    """
    task, still = scenario.task, [RestPath]
    if any(type(path) not in still for path in scenario.carrier_paths.values()):
        return None, "not computed: carriers have time laws of their own"
    if scenario.wind_box is not None:
        return None, "not computed: in moving air the drag is not proportional to the square of the speed"
    path = _curve(task.path)
    if path is None:
        return None, f"not computed: the path of kind {task.path.kind} has a time law of its own"
    hard = {name: getattr(task.limits, name) for name in KNOWN_LIMITS if name not in task.limits.soft}
    alone = {"path": path, "limits": TaskLimits(**hard), "margin": scenario.hard_margin, "tube": Tube()}
    try:
        timing = time_along(scenario.robot, task.model_copy(update=alone))
    except (InputError, SolverError) as error:
        return None, f"not computed: {str(error).removeprefix('time_along: ')}"
    if timing.feasible:
        return timing, f"the fastest law takes {quantity(timing.duration, 's', 6)}"
    return timing, f"{timing.status.value} at {quantity(100 * (timing.at or 0.0), '%', 3)} of the path"


def _curve(path: AnyPath) -> AnyPath | None:
    """Return the same curve without rest on it; None if the path does not go from rest to rest in any duration."""
    if not path.stretches or getattr(path, "timing", None) != "smooth":
        return None
    if isinstance(path, LinePath):
        return path.model_copy(update={"timing": "uniform"})
    return _through(path) if isinstance(path, WaypointPath) else None


def _through(path: WaypointPath) -> WaypointPath | None:
    """Return a natural spline through many points of a smooth path, densest at its ends; None if it deviates."""
    shares = np.linspace(0.0, 1.0, LOOKS)
    looks = path.by_fraction(shares).pose
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(looks, axis=0), axis=1))])
    targets = length[-1] * (1 - np.cos(np.pi * np.arange(PIECES + 1) / PIECES)) / 2
    at = np.interp(targets, length, shares)
    at[[0, -1]] = 0.0, 1.0
    points = tuple((x, y, z, roll, pitch, yaw) for x, y, z, roll, pitch, yaw in path.by_fraction(at).pose.tolist())
    spline = WaypointPath(kind="waypoints", frame=path.frame, points=points, timing="uniform")
    # Between the points only the deviation across the path matters: the time law decides where along it.
    between = (targets[1:] + targets[:-1]) / 2
    target, along, _ = path.by_fraction(np.interp(between, length, shares))
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    off = spline.by_fraction(between / length[-1]).pose - target
    across = off - np.sum(off * along, axis=1, keepdims=True) * along
    return spline if np.linalg.norm(across, axis=1).max() <= ON_PATH * length[-1] else None
