"""Check exported control steps: their answers against Python's, and how long they take.

    python -m tests.soak step [--start 0] [--count 1000000] [--only wang-flying,...]

The states are those of `step_states`, easy and impossible ones. Python's answers are those of `Dynamics` and
`solve_batch`. In float, where a rank cannot be distinguished from a nearly lower one, infeasible and singular count as
one status.

It is wrong if a step that is sure has another status than Python, if a certificate does not hold, or if a command is
outside the limits. Times are those of the first states, with -O2. It needs a C compiler; "twelve" is a robot of twelve
cables.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from towline.benchmarks import harness
from towline.models import Dynamics, Robot, load
from towline.solvers import Status, solve_batch
from towline.solvers.solution import STATUSES

from .step_code import Array, StepCode, Steps
from .step_states import random_states, twelve_cables

ROBOTS = ("wang-flying", "cogiro", "ipanema-2", "wang-ctmrts-6", "twelve")
PRECISIONS = ("double", "float")
TIMED = 2000  # states
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
    certificates: int = 0
    unproven: int = 0  # certificates that do not hold
    outside: int = 0  # commands outside the limits or not finite
    iterations: int = 0  # most outer ones

    def plus(self, other: Accuracy) -> Accuracy:
        """Return both together."""
        largest = ("error", "iterations")
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
        above=int((error > 1e-12).sum()),
        certificates=int(proven.sum()),
        unproven=int((~(demand > reach)).sum()),
        outside=int((~inside).sum()),
        iterations=int(steps.counts[:, 0].max(initial=0)),
    )


def times(code: StepCode) -> list[str]:
    """Return best, mean and worst time [us] of the steps with exact tensions, and mean and worst of the soft ones."""
    rows = random_states(code.robot, TIMED, seed=1, single=code.precision == "float").rows(code.robot)
    status, spent = code.run(rows).status, 1e6 * code.times(rows)
    easy, soft = spent[status == OPTIMAL], spent[np.isin(status, (INFEASIBLE, SINGULAR, UNSURE))]
    beside = f"{soft.mean():.2f}, {soft.max():.2f}" if soft.size else "-"
    return [f"{easy.min():.2f}, {easy.mean():.2f}, {easy.max():.2f}", beside]


def soak(start: int, count: int, names: Sequence[str]) -> bool:
    """Compare `count` steps of each robot and precision, print a table, and return whether nothing is wrong."""
    words = "other status | unsure | wrongly optimal | error | above 1e-12 | certificates"
    columns = f"robot | numbers | steps | {words} | unproven | outside | iterations"
    print(harness.head(f"{columns} | optimal: best, mean, worst [us] | soft: mean, worst [us]", 2))
    well = True
    for name in names:
        for precision in PRECISIONS:
            with tempfile.TemporaryDirectory() as folder:
                code = StepCode(robot_named(name), precision, Path(folder))
                a, spent = accuracy(code, count, start), times(code)
            well &= a.passed
            cells = a.steps, a.others, a.unsure, a.wrongly_optimal, f"{a.error:.1e}", a.above, a.certificates
            print(harness.row(name, precision, *cells, a.unproven, a.outside, a.iterations, *spent), flush=True)
    return well
