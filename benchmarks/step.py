"""Measure exported control steps: their answers against Python's, their time beside OSQP's generated code, their size.

    python -m towline.benchmarks.step [--count 1000000] [--robots wang-flying,...] [--parts accuracy,time,size]

The states are those of `step_states`, easy and impossible ones. Python's answers are those of `Dynamics` and
`solve_batch`. In float, where a rank cannot be distinguished from a nearly lower one, infeasible and singular count as
one status. Where tensions in double differ by more than 1e-12 of the largest limit, exact arithmetic decides which side
is off.

The exit code is 1 if a step that is sure has another status than Python, if a certificate does not hold, or if a
command is outside the limits. It needs a C compiler; "twelve" is a robot of twelve cables.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..models import Dynamics, Robot, available, load
from ..solvers import Status, TensionProblem, solve_batch
from ..solvers.box_least_squares import project
from ..solvers.exact_arithmetic import exact_optimum
from ..solvers.status import STATUSES
from .machine import machine
from .step_code import Array, StepCode, Steps
from .step_peer import osqp_times
from .step_size import measure_size, target
from .step_states import random_states, twelve_cables

ROBOTS = ("wang-flying", "cogiro", "ipanema-2", "wang-ctmrts-6", "twelve")
PRECISIONS = ("double", "float")
PARTS = ("accuracy", "time", "size")
BLOCK = 20_000  # more than the C core solves itself in `solve_batch`: another form of the method answers
CODES = {status: code for code, status in enumerate(STATUSES)}
OPTIMAL, INFEASIBLE, SINGULAR = (CODES[status] for status in (Status.OPTIMAL, Status.INFEASIBLE, Status.SINGULAR))
ROUNDED = 1e-12  # a cable without a limit may pull along a direction by this part of its column norm
UNSURE = CODES[Status.INACCURATE]


class Accuracy(NamedTuple):
    """Counts of steps, and the largest differences of tensions, relative to the largest limit."""

    steps: int = 0
    unsure: int = 0  # "inaccurate" where Python has a status
    others: int = 0  # another status than Python's
    wrongly_optimal: int = 0  # of `others`, those that are called optimal
    error: float = 0.0  # of tensions that both call optimal
    above: int = 0  # how many errors are above 1e-12
    step_off: float = 0.0  # of these, the largest distance of the step from exact arithmetic, in double
    python_off: float = 0.0  # and that of Python
    certificates: int = 0
    unproven: int = 0  # certificates that do not hold
    outside: int = 0  # commands outside the limits or not finite
    iterations: int = 0  # most outer ones

    def plus(self, other: Accuracy) -> Accuracy:
        """Return both together."""
        largest = ("error", "step_off", "python_off", "iterations")
        both = {name: (getattr(self, name), getattr(other, name)) for name in self._fields}
        return Accuracy(**{name: max(pair) if name in largest else sum(pair) for name, pair in both.items()})

    @property
    def passed(self) -> bool:
        """Return whether nothing is wrong: being unsure is not."""
        return self.others == self.wrongly_optimal == self.unproven == self.outside == 0


def robot_named(name: str) -> Robot:
    """Return a robot of the library, or that of twelve cables."""
    return twelve_cables() if name == "twelve" else load(name)


def accuracy(code: StepCode, count: int, seed: int = 0) -> Accuracy:
    """Compare steps with Python's answers, in blocks of seeds from `seed` on."""
    robot, dynamics, total = code.robot, Dynamics(code.robot), Accuracy()
    for block, first in enumerate(range(0, count, BLOCK)):
        states = random_states(robot, min(BLOCK, count - first), seed + block, code.precision == "float")
        steps = code.run(states.rows(robot))
        A, w = states.problems(dynamics)
        total = total.plus(compare(robot, A, w, steps, code.precision == "float"))
    return total


def compare(robot: Robot, A: Array, w: Array, steps: Steps, single: bool = False) -> Accuracy:
    """Compare steps, in single precision or not, with the answers to the problems of Python."""
    batch = solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length)
    sure = steps.status != UNSURE
    status, code = (np.where(single & (codes == SINGULAR), INFEASIBLE, codes) for codes in (steps.status, batch.code))
    both = (steps.status == OPTIMAL) & (batch.code == OPTIMAL)
    error = np.abs(steps.tensions - batch.tensions)[both].max(axis=1, initial=0.0) / robot.t_max.max()
    above = np.flatnonzero(both)[error > 1e-12]
    off = [(0.0, 0.0)]
    for row in [] if single else above:
        problem = TensionProblem(A[row], w[row], robot.t_min, robot.t_max, length=robot.length)
        exact = exact_optimum(problem, project(problem).closest).tensions
        off.append((float(np.abs(steps.tensions[row] - exact).max()), float(np.abs(batch.tensions[row] - exact).max())))
    step_off, python_off = np.max(off, axis=0) / robot.t_max.max()
    proven = np.isin(steps.status, (INFEASIBLE, SINGULAR))
    pull = np.einsum("ni,nij->nj", steps.direction[proven], A[proven])
    columns = np.linalg.norm(A[proven] * robot.wrench_scale[:, None], axis=1)
    limit = np.where(pull > 0.0, robot.t_max, robot.t_min)
    reach = np.where(np.isfinite(limit) | (np.abs(pull) > ROUNDED * columns), pull * limit, 0.0).sum(axis=1)
    demand = np.einsum("ni,ni->n", steps.direction[proven], w[proven])
    inside = ((steps.tensions >= robot.t_min) & (steps.tensions <= robot.t_max)).all(axis=1)
    return Accuracy(
        steps=len(A),
        unsure=int((~sure & (batch.code != UNSURE)).sum()),
        others=int((sure & (status != code)).sum()),
        wrongly_optimal=int(((steps.status == OPTIMAL) & (batch.code != OPTIMAL)).sum()),
        error=float(error.max(initial=0.0)),
        above=above.size,
        step_off=float(step_off),
        python_off=float(python_off),
        certificates=int(proven.sum()),
        unproven=int((~(demand > reach)).sum()),
        outside=int((~inside).sum()),
        iterations=int(steps.counts[:, 0].max(initial=0)),
    )


def accuracy_lines(names: list[str], count: int) -> tuple[list[str], bool]:
    """Return a table of the accuracies, and whether all is well."""
    heads = [
        "robot",
        "numbers",
        "steps",
        "other status",
        "unsure",
        "wrongly optimal",
        "error",
        "above 1e-12",
        "step off",
    ]
    heads += ["Python off", "certificates", "unproven", "outside", "iterations"]
    lines = [f"| {' | '.join(heads)} |", "|---|---|" + "---:|" * 12]
    well = True
    for name in names:
        for precision in PRECISIONS:
            with tempfile.TemporaryDirectory() as folder:
                row = accuracy(StepCode(robot_named(name), precision, Path(folder)), count)
            well &= row.passed
            cells = (row.steps, row.others, row.unsure, row.wrongly_optimal, f"{row.error:.1e}", row.above)
            cells += (
                f"{row.step_off:.0e}",
                f"{row.python_off:.0e}",
                row.certificates,
                row.unproven,
                row.outside,
                row.iterations,
            )
            lines.append(f"| {name} | {precision} | {' | '.join(map(str, cells))} |")
            print(lines[-1], file=sys.stderr)
    return lines, well


def time_lines(names: list[str], count: int = 2000) -> list[str]:
    """Return a table of times.

    OSQP's are those of the feasible states: new data and solve, from the last solution, without the mechanics. Its
    errors are the 99th percentile, in units of the largest limit.
    """
    heads = ["robot", "optimal: best, mean, worst [us]", "soft: mean, worst [us]"]
    heads += ["OSQP at 1e-3 [us]", "error", "ratio", "OSQP at 1e-6 [us]", "error", "ratio"]
    lines = [f"| {' | '.join(heads)} |", "|---|---|---|" + "---:|" * 6]
    for name in names:
        robot = robot_named(name)
        states = random_states(robot, count, seed=1)
        A, w = states.problems(Dynamics(robot))
        with tempfile.TemporaryDirectory() as folder:
            code = StepCode(robot, "double", Path(folder) / "step")
            rows = states.rows(robot)
            steps, times = code.run(rows), 1e6 * code.times(rows)
            easy, soft = steps.status == OPTIMAL, np.isin(steps.status, (INFEASIBLE, SINGULAR, UNSURE))
            cells = [f"{times[easy].min():.2f}, {times[easy].mean():.2f}, {times[easy].max():.2f}"]
            cells += [f"{times[soft].mean():.2f}, {times[soft].max():.2f}" if soft.any() else "-"]
            for tolerance in (1e-3, 1e-6):
                peer = osqp_times(robot, A[easy], w[easy], tolerance, Path(folder) / f"osqp-{tolerance:g}")
                errors = np.abs(peer.tensions - steps.tensions[easy]).max(axis=1) / robot.t_max.max()
                error = np.percentile(np.nan_to_num(errors, nan=np.inf), 99)
                mean = 1e6 * peer.seconds.mean()
                cells += [f"{mean:.1f}", f"{error:.0e}", f"1/{mean / times[easy].mean():.0f}"]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def size_lines(names: list[str]) -> list[str]:
    """Return a table of code and stack."""
    compiler = target()
    lines = [f"{' '.join(compiler)} -Os; the stack without that of the C library.", ""]
    lines += ["| robot | .text, double [B] | stack, double [B] | .text, float [B] | stack, float [B] |"]
    lines += ["|---|---:|---:|---:|---:|"]
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            sizes = [measure_size(robot_named(name), real, Path(folder) / real, compiler) for real in PRECISIONS]
        lines.append(f"| {name} | {' | '.join(f'{size.text} | {size.stack}' for size in sizes)} |")
    return lines


def main() -> None:
    """Run and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=1_000_000, help="states of each robot and precision")
    parser.add_argument("--robots", default=",".join(ROBOTS), help="names, separated by commas")
    parser.add_argument("--parts", default=",".join(PARTS), help="of accuracy, time and size, separated by commas")
    options = parser.parse_args()
    names, parts = options.robots.split(","), options.parts.split(",")
    if options.count < 1:
        parser.error(f"--count must be at least 1, got {options.count}")
    for option, given, known in (("--robots", names, {*available(), "twelve"}), ("--parts", parts, {*PARTS})):
        if unknown := set(given) - known:
            parser.error(f"{option} must be among {', '.join(sorted(known))}, got {', '.join(sorted(unknown))}")
    print(f"# Exported control steps\n\nMeasured on {machine()}.")
    well = True
    if "accuracy" in parts:
        lines, well = accuracy_lines(names, options.count)
        print("\n## Answers\n", *lines, sep="\n")
    if "time" in parts:
        print("\n## Time\n", *time_lines(names), sep="\n")
    if "size" in parts:
        print("\n## Size\n", *size_lines([*available(), "twelve"]), sep="\n")
    sys.exit(not well)


if __name__ == "__main__":
    main()
