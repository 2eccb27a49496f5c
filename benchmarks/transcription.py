"""Compare solvers and schemes on the same plans: their time, and the wrench error that the audit measures.

    python -m towline.benchmarks.transcription [--runs 5]

The first table compares IPOPT with fatrop: build and first solve, and the same object solved again from its own
solution; medians of several runs. The second carries the load of paper C's robot, whose three cables cannot follow
every motion exactly, by each scheme on ever finer meshes without refinement. It prints the largest wrench error between
the points over the weight, and the time of one run.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from statistics import median
from typing import Any, Literal, NamedTuple

from ..models import Robot, load
from ..ocp import Planner, Task
from ..ocp.audits.audit import audit
from ..ocp.nlp.program import build
from ..ocp.nlp.rows import Mesh
from ..ocp.nlp.solver import Solver
from ..ocp.tasks.lay_out import lay_out
from ..ocp.tasks.scheme import SCHEMES
from ..studies.flying.circle import tasks
from ..studies.towing import plans as towing_plans
from .machine import machine

STEPS = (10, 20, 40, 80)
LINE = {
    "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.3]},
    "duration": 1.5,
    "tube": {"position": "free", "ends": "exact"},
    "objective": {"deviation": 1.0},
}
Case = tuple[Robot, Task]


class Timing(NamedTuple):
    """Times of build and first solve and of the second solve [s], iterations of both, and the objective."""

    first: float
    again: float
    iterations: int
    iterations_again: int
    objective: float


def main() -> None:
    """Measure and print both tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--runs", type=int, default=5, help="of each case (default: 5)")
    options = parser.parse_args()
    if options.runs < 1:
        parser.error(f"--runs must be 1 or more, got {options.runs}")
    print(machine(("casadi", "numpy")))
    for name, case in CASES.items():
        for solver in ("ipopt", "fatrop"):
            print(_line(name, solver, case, options.runs), flush=True)
    for scheme in SCHEMES:
        for steps in STEPS:
            print(_wrench_error(scheme, steps), flush=True)


def circle(ends: Literal["free", "rest"]) -> Case:
    """Return paper F's circle with the base free, N = 100; not periodic, which fatrop does not support."""
    task = tasks()[1]
    return load("wang-flying"), task.model_copy(update={"base": task.base.model_copy(update={"ends": ends})})


def crane() -> Case:
    """Return a line for eight cables, with the tube free, N = 100."""
    return load("ipanema-1"), Task.model_validate(LINE)


def towing(drive: towing_plans.Drive) -> Case:
    """Return paper C's robot with least effort, N = 50."""
    robot = towing_plans.robot("wang-ctmrts", drive)
    return robot, towing_plans.task(robot, "effort")


CASES: dict[str, Callable[[], Case]] = {
    "paper F's circle, ends free": lambda: circle("free"),
    "paper F's circle, ends at rest": lambda: circle("rest"),
    "ipanema-1, a line": crane,
    "paper C, fixed length": lambda: towing("fixed-length"),
    "paper C, variable length": lambda: towing("variable-length"),
    "paper C, both": lambda: towing("both"),
}


def _line(name: str, solver: str, case: Callable[[], Case], runs: int) -> str:
    done = [_timed(case, solver) for _ in range(runs)]
    first, again = (median(one[i] for one in done) for i in range(2))
    one = done[0]
    return (
        f"{name:32} {solver:7} first {first:6.3f} s ({one.iterations:3} iterations)  again {again:6.3f} s "
        f"({one.iterations_again:2})  objective {one.objective:.7g}"
    )


def _timed(case: Callable[[], Case], solver: str) -> Timing:
    robot, task = case()
    planner = Planner(robot, task.model_copy(update={"solver": solver}))
    first = planner.plan()
    planner.plan()  # the solver for a warm start is made here
    again = planner.plan()
    if not (first.feasible and again.feasible):
        raise SystemExit(f"{task.name} by {solver}: {first.status.value}")
    return Timing(
        first.build_s + first.solve_s,
        again.build_s + again.solve_s,
        first.iterations,
        again.iterations,
        first.iterates[-1][1],
    )


def _wrench_error(scheme: str, steps: int) -> str:
    robot, task = towing("variable-length")
    changed: dict[str, Any] = {"scheme": scheme}
    scenario = lay_out(robot, task.model_copy(update=changed))
    start = time.perf_counter()
    outcome = Solver(build(scenario, Mesh(steps))).solve(None)
    took = time.perf_counter() - start
    share = audit(scenario, outcome.deviation).violation.max() / robot.force_scale
    return f"{scheme:9} N = {steps:3}  wrench error {share:8.2e} of the weight  {took:6.3f} s  {outcome.message}"


if __name__ == "__main__":
    main()
