"""Plan motions past obstacles, each from the task alone, with default settings: no start, no side on which to pass.

    python -m towline.benchmarks.scenes [WORD ...] [--list]

WORDs select the scenes whose name contains one of them. Three scenes are of the kind that a cable robot on the ground
meets. The others are those of coltrans-planning (IMRCLab, examples/benchmark): one to six quadrotors carry a point
load through nothing, a window or a forest. Their obstacles, ends, cable lengths and bounds are theirs, and so is
what they keep: 0.1 m between quadrotors and obstacles, 0.2 m among quadrotors, 0.01 m about the load. Masses (34 g of a
quadrotor, 10 g of the load), thrust (0.6 N) and duration (8 s) are assumed.

Each row has what the planner reports: status, CPU time, the largest violation of the audit and the reason.
"""

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from ..models import Robot, load
from ..ocp import MotionStatus, Plan, plan
from . import harness

Scene = tuple[Robot, dict[str, Any]]

DATA: dict[str, Any] = YAML(typ="safe", pure=True).load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
LENGTH = DATA["cable"]["length"]  # [m], of the quadrotors' cables
QUADROTOR, APART, LOAD = 0.1, 0.2, 0.01  # [m]
FOUR_AT_GOAL = [(azimuth, 1.2) for azimuth in (0.0, 5.0, 3.14, 4.0)]
TEAMS = {  # azimuth and elevation of each cable [rad]
    1: [(0.0, np.pi / 2)],
    2: [(1.57, 1.0), (1.57 + np.pi, 1.0)],
    3: [(1.57, 1.0), (0.0, 1.0), (4.2, 1.0)],
    4: [(azimuth, 1.1) for azimuth in (0.0, 1.57, 3.14, 4.71)],
    5: [(azimuth, 1.2) for azimuth in (1.25, 0.0, 2.5, 3.75, 5.0)],
    6: [(azimuth, 1.1) for azimuth in (1.04, 0.0, 2.08, 3.16, 4.2, 5.24)],
}
GATE = [(0.5, 0.4, 0.4), (0.5, -0.4, 0.4)]  # x and y of the middle, and the width [m]
# x and y of the trees [m]
TREES_AT = ((0.75, -0.2, -0.75, 0.7, 0.3, -0.6, 0.5, -0.1, -0.5), (-0.25, -0.25, -0.25, 0.5, 0.25, 0.5, 1.25, 1.0, 1.0))
THIN_TREES_AT = (
    (1.98, 0.8853, 1.5711, 0.4922, 1.8408, 0.3165, 2.9604, 2.6036, 1.1281, 2.854, 0.0059),
    (0.7785, 1.0672, -1.1581, -0.9134, -0.3093, 0.0511, -1.0162, 0.1167, 0.1223, 1.0161, 1.0431),
)
TREES = [(x, y, 0.1) for x, y in zip(*TREES_AT, strict=True)]
THIN_TREES = [(x, y, 0.05) for x, y in zip(*THIN_TREES_AT, strict=True)]


def main() -> None:
    """Plan the scenes and print a row each."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("words", nargs="*", metavar="WORD", help="only scenes whose name contains one of these")
    parser.add_argument("--list", action="store_true", help="print the names of the scenes")
    options = parser.parse_args()
    names = [name for name in SCENES if not options.words or any(word in name for word in options.words)]
    if not names:
        parser.error(f"WORD must be part of a scene's name ({', '.join(SCENES)}), got {' '.join(options.words)}")
    if options.list:
        print("\n".join(names))
        return
    print(f"Measured on {harness.machine()}.\n")
    print(harness.head("scene | status | reason | robots | CPU s | violation", 3))
    undecided = 0
    for name in names:
        robot, task = SCENES[name]()
        start = time.process_time()
        planned = plan(robot, {"name": name} | task)
        print(row(name, planned, time.process_time() - start), flush=True)
        undecided += planned.status is MotionStatus.NOT_FOUND
    sys.exit(undecided > 0)


def row(name: str, planned: Plan, seconds: float) -> str:
    """Return the row of a scene."""
    audit = planned.audit
    violation = "-" if planned.status is MotionStatus.INFEASIBLE else f"{audit.violation.max():.1e} N"
    reason = planned.reason if not audit.excess else str(audit.excess[0])
    robots = len([carrier for carrier in planned.scenario.robot.carriers if carrier.moves])
    return harness.row(name, planned.status.value, reason, robots, f"{seconds:.1f}", violation)


def team(cables: list[tuple[float, float]]) -> Robot:
    """Return quadrotors with one cable each to a point load, at azimuths and elevations [rad] about it."""
    names = [f"quad{i}" for i in range(1, len(cables) + 1)]
    homes = [[*offset.tolist(), 0.0, 0.0, 0.0] for offset in _offsets(cables)]
    parts = {
        "name": f"point-load-{len(cables)}",
        "carriers": [DATA["quadrotor"] | {"name": name, "home": at} for name, at in zip(names, homes, strict=True)],
        "cables": [DATA["cable"] | {"carrier": name} for name in names],
    }
    return Robot.model_validate(DATA["team"] | parts)


def _offsets(cables: list[tuple[float, float]]) -> np.ndarray:
    """Return the positions of the quadrotors about the load, (n, 3) [m]."""
    azimuth, elevation = np.array(cables).T
    flat = np.cos(elevation)
    return LENGTH * np.stack([np.cos(azimuth) * flat, np.sin(azimuth) * flat, np.sin(elevation)], axis=1)


def carried(
    count: int,
    start: list[float],
    end: list[float],
    low: list[float],
    high: list[float],
    posts: list[tuple[float, float, float]],
    at_goal: list[tuple[float, float]] | None = None,
) -> Scene:
    """Return a scene in which a team carries its load from `start` to `end`, inside a box and past square posts."""
    cables = TEAMS[count]
    robot = team(cables)
    ends = [np.array(place) + _offsets(its) for place, its in ((start, cables), (end, at_goal or cables))]
    around = {
        carrier.name: {"kind": "line", "start": first.tolist(), "end": last.tolist()}
        for carrier, first, last in zip(robot.carriers, *ends, strict=True)
    }
    keep = {"platform": LOAD, "carriers": QUADROTOR, "cables": 0.001}
    places = []
    for i, (x, y, width) in enumerate(posts, start=1):
        low_corner, high_corner = [x - width / 2, y - width / 2, -1.5], [x + width / 2, y + width / 2, 1.5]
        places.append({"kind": "box", "name": f"post {i}", "min": low_corner, "max": high_corner, **keep})
    limits: dict[str, Any] = {"platform_box": {"min": low, "max": high}, "keep_out": places}
    if count > 1:
        limits["carrier_separation"] = APART
    task = {
        "path": {"kind": "line", "start": start, "end": end},
        "duration": 8,
        "steps": 60,
        "tube": {"position": "free"},
        "base": {"kind": "free", "ends": "rest" if at_goal is None else "exact", "around": around},
        "limits": limits,
    }
    return robot, task


def empty(count: int) -> Scene:
    """Return the scene without obstacles."""
    end = 1.5 if count == 6 else 1.2
    return carried(count, [-0.5, 0, 0], [end, 0, 0], [-0.6, -1.0, -0.1], [4.0, 1.0, 1.0], [])


def window(count: int) -> Scene:
    """Return the gap of 0.4 m between two blocks."""
    if count == 1:
        low, high = [-1.5, -0.4, -0.1], [1.5, 0.4, 0.2]
        return carried(1, [-1, 0, 0], [1, 0, 0], low, high, [(0.0, 0.4, 0.3), (0.0, -0.4, 0.3)])
    wide = 0.8 if count == 5 else 0.6
    at_goal = FOUR_AT_GOAL if count == 4 else None
    return carried(count, [-0.5, 0, 0], [3.5, 0, 0], [-0.6, -wide, -0.1], [4.0, wide, 1.0], GATE, at_goal)


def forest(count: int) -> Scene:
    """Return the trees."""
    if count == 1:
        return carried(1, [-0.5, 0, 0], [3.5, 0, 0], [-0.6, -1.0, -0.1], [4.0, 1.0, 1.0], THIN_TREES)
    at_goal = FOUR_AT_GOAL if count == 4 else None
    return carried(count, [0, -1, 0], [0, 2, 0], [-0.76, -1.1, 0.0], [0.76, 2.1, 0.5], TREES, at_goal)


def given(name: str) -> Scene:
    """Return a scene whose robot and task are both in scenes.yaml."""
    robot = DATA[name]["robot"]
    return load(robot) if isinstance(robot, str) else Robot.model_validate(robot), DATA[name]["task"]


SCENES: dict[str, Callable[[], Scene]] = {name: partial(given, name) for name in ("warehouse", "shelf", "hatch")}
for _kind in (empty, window, forest):
    for _count in range(1, 7):
        SCENES[f"{_kind.__name__}_{_count}"] = partial(_kind, _count)


if __name__ == "__main__":
    main()
