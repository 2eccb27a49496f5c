"""Check random cases for as long as you like: each is determined by its number.

    python -m tests.soak NAME [--start 0] [--count N] [--only PART,...]

NAME is what is checked; the module of each states how. PARTs are families of problems and tasks, methods, or robots.
The exit code is 1 if anything is wrong, and each wrong case is printed with its number.

    exactness    statuses, tensions and certificates of tension distribution, in exact arithmetic
    continuity   methods that claim to be continuous, along motions
    step         exported control steps, compared with Python
    control      steps of computed torque in closed loops, from every state
    predictive   runs of predictive control
    mujoco       both controllers in MuJoCo, on robots that differ from their files
    silence      runs without faults, in which predictive control must stay in control
    files        crafted files of every kind that a command reads
    signals      SIGINT and SIGTERM at random moments of every long command
    tasks        plans of random tasks, and their results
    replanning   plans of the remainder of a motion, during the motion
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import NamedTuple

from towline.benchmarks.harness import machine
from towline.models import available

from . import (
    continuity,
    control_mujoco,
    control_silence,
    control_steps,
    crafted_files,
    exactness,
    predictive_steps,
    random_families,
    random_tasks,
    replanning,
    signals,
    step,
)

__all__ = ["SOAKS", "Soak"]


class Soak(NamedTuple):
    """A check: `check(start, count, parts)` prints and returns whether all is well; its usual count, and its parts."""

    check: Callable[[int, int, Sequence[str]], bool]
    cases: int
    parts: Sequence[str]
    usual: Sequence[str] = ()  # parts; default: all


SOAKS = {
    "exactness": Soak(exactness.soak, 1_000_000, exactness.PARTS, ("exact",)),
    "continuity": Soak(continuity.soak, 100, continuity.METHODS),
    "step": Soak(step.soak, 1_000_000, (*available(), "twelve"), step.ROBOTS),
    "control": Soak(control_steps.soak, 1_000_000, available()),
    "predictive": Soak(predictive_steps.soak, 100_000, available()),
    "mujoco": Soak(control_mujoco.soak, 1000, tuple(control_mujoco.TASKS)),
    "silence": Soak(control_silence.soak, 100, control_silence.ROBOTS),
    "files": Soak(crafted_files.soak, 1000, tuple(crafted_files.KINDS)),
    "signals": Soak(signals.soak, 100, tuple(signals.CASES)),
    "tasks": Soak(random_tasks.soak, 200, tuple(random_families.FAMILIES)),
    "replanning": Soak(replanning.soak, 100, ()),
}


def main() -> None:
    """Run a check."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description="Check random cases.")
    parser.add_argument("name", choices=SOAKS, metavar="NAME", help=", ".join(SOAKS))
    parser.add_argument("--start", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--count", type=int, help="number of cases (default: that of the check)")
    parser.add_argument("--only", default="", help="parts of the check, separated by commas")
    given = parser.parse_args()
    soak = SOAKS[given.name]
    count = soak.cases if given.count is None else given.count
    if count < 1 or given.start < 0:
        parser.error(f"--count must be 1 or more and --start 0 or more, got {count} and {given.start}")
    parts = given.only.split(",") if given.only else soak.usual or soak.parts
    if unknown := set(parts) - set(soak.parts):
        parser.error(f"--only must be among {', '.join(soak.parts)}, got {', '.join(sorted(unknown))}")
    print(f"Measured on {machine()}.\n")
    sys.exit(not soak.check(given.start, count, parts))


if __name__ == "__main__":
    main()
