"""Tension distribution in a hot loop: towline against the solvers that are installed, in one run.

    towline bench tension [--count 100] [--repeats 5] [--m 6,7,8,12] [--out FOLDER] [--json]

qpbenchmark calls each solver once per problem, cold; a controller calls it every millisecond. Here each contender
solves the problems of a task one after the other, in blocks that take turns, so that a machine that heats up or slows
down does so for all. A ratio is a block's median over the median of `daqp.solve` in the same turn, as the median of
all turns.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.inputs import InputError, whole_number
from ..base.writing import check_writable, whole_file
from ..figures import style
from .harness import alternating, machine, ratio, table
from .tension_contenders import REFERENCE, Contender, contenders
from .tension_tasks import KINDS, Task, make_task

Array = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

# Tensions, or their wrench, this far off are a failure, in units of the largest tension: 1000 times what was required.
FAILED = 1e-6
MOST = 100_000  # problems of a task, and runs of a solver
SOLVERS = ("daqp", "osqp", "clarabel", "piqp", "proxsuite", "quadprog", "highspy", "scs", "moreau")


@dataclass(frozen=True)
class Row:
    """One contender at one task.

    Times are of a call; for a batch, of a call divided by its problems: its p99 is one of calls, not of problems. Wrong
    is, for a feasible problem, no result, or tensions or a wrench off by more than `FAILED`; for an infeasible one,
    tensions. Errors of tensions are None if the task is infeasible, if there is no result or if it minimises something
    else.
    """

    task: str
    contender: str
    tolerance: str  # the accuracy required
    median_us: float
    p99_us: float
    ratio: float  # to `daqp.solve`; above 1 is slower
    max_error: float | None  # largest of a tension, in units of the largest tension
    failures: int  # problems, of `problems`, that it got wrong
    problems: int  # how many it was given; fewer than requested if it ran out of time
    detail: str = ""  # what went wrong beyond that


@dataclass(frozen=True)
class Report:
    """Rows, and what they were measured on and with."""

    rows: list[Row]
    machine: str
    count: int
    repeats: int

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists and numbers, ready for JSON."""
        return asdict(self)


def run(
    count: int = 100,
    repeats: int = 5,
    m: Sequence[int] = (6, 7, 8, 12),
    limit: float = 5.0,
    progress: Progress | None = None,
) -> Report:
    """Measure every contender at every task, of each kind and number `m` of cables, from 1 to 16.

    A task has `count` problems, at which each contender has `repeats` turns after one that is not counted. One that has
    spent more than `limit` [s] on a task, which is checked between calls, is out, with the times that it has.
    `progress` is called with the task's name and how many of how many turns at all tasks are done.

    Raises `InputError` if a number is out of range.
    """
    whole_number("count", count, 1, MOST)
    whole_number("repeats", repeats, 1, MOST)
    if not m or not all(1 <= cables <= 16 for cables in m):
        raise InputError(f"m must be numbers of cables from 1 to 16, got {list(m)}")
    if not limit > 0:
        raise InputError(f"limit must be a number > 0 [s], got {limit:g}")
    names = [(kind, cables) for cables in m for kind in KINDS]
    rows: list[Row] = []
    turns = repeats + 1
    for done, (kind, cables) in enumerate(names):

        def show(turn: int, done: int = done, task: str = f"{kind}, m = {cables}") -> None:
            if progress is not None:
                progress(task, done * turns + turn, len(names) * turns)

        show(0)
        rows += measure(make_task(kind, cables, count), contenders(), repeats, limit, show)
    return Report(rows, machine((*SOLVERS, "qpsolvers", "numpy")), count, repeats)


class _Runner:
    """One contender at one task: its results, its times, and why it is out."""

    def __init__(self, contender: Contender, task: Task, limit: float) -> None:
        self.contender, self.task, self.limit = contender, task, limit
        self.blocks: dict[int, list[float]] = {}  # [us] by turn
        self.answers: list[Array | None] = []
        self.detail = ""
        self.spent = 0.0

    def turn(self, number: int) -> None:
        """Solve every problem once; turn 0 is the one whose results are kept and whose times are not."""
        try:
            call = self.contender.prepare(self.task)
            if number == 0:
                call(0)  # imports and compilation belong to no problem, and are no reason to be out
            times, answers = self._solve(call)
        except Exception as error:  # a contender that breaks is a result, whatever it raises
            self.detail = f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
            return
        if number == 0:
            self.answers = answers
        if times:
            self.blocks[number] = times

    def _solve(self, call: Callable[[int], Any]) -> tuple[list[float], list[Array | None]]:
        count, times, answers = len(self.task.problems), list[float](), list[Array | None]()
        for i in range(1 if self.contender.batch else count):
            start = time.perf_counter_ns()
            answer = call(i)
            microseconds = (time.perf_counter_ns() - start) / 1e3
            if self.contender.batch:
                times.append(microseconds / len(answer[0]))
                answers = [x if ok else None for x, ok in zip(*answer, strict=True)][:count]
            else:
                times.append(microseconds)
                answers.append(answer)
            self.spent += microseconds / 1e6
            if self.spent > self.limit:
                self.detail = f"out after {self.spent:.1f} s"
                break
        return times, answers

    def counted(self) -> dict[int, list[float]]:
        """Return the times [us] of the turns that count, by turn; of turn 0 if there is no other."""
        return {turn: times for turn, times in self.blocks.items() if turn > 0} or self.blocks


def measure(
    task: Task, who: Sequence[Contender], repeats: int, limit: float, show: Callable[[int], None] = lambda turns: None
) -> list[Row]:
    """Measure contenders at one task, in blocks that take turns; the reference must be among them.

    `show` is called with how many turns are done.
    """
    runners = [_Runner(contender, task, limit) for contender in who if task.kind in contender.kinds]
    for turn, runner in alternating(runners, repeats + 1):
        show(turn)
        if not runner.detail:  # it is still in
            runner.turn(turn)
    show(repeats + 1)
    reference = next(runner for runner in runners if runner.contender.name == REFERENCE)
    return [_row(runner, reference.counted()) for runner in runners]


def _row(runner: _Runner, reference: dict[int, list[float]]) -> Row:
    blocks = runner.counted()
    times = [microseconds for block in blocks.values() for microseconds in block]
    error, failures = _judge(runner.contender, runner.task, runner.answers)
    return Row(
        task=runner.task.name,
        contender=runner.contender.name,
        tolerance=runner.contender.tolerance,
        median_us=float(np.median(times)) if times else float("nan"),
        p99_us=float(np.percentile(times, 99)) if times else float("nan"),
        ratio=ratio(blocks, reference),
        max_error=error,
        failures=failures,
        problems=len(runner.answers),
        detail=runner.detail,
    )


def _judge(contender: Contender, task: Task, answers: list[Array | None]) -> tuple[float | None, int]:
    """Return the largest tension error, and how many results are wrong."""
    if task.optima is None:
        return None, sum(answer is not None for answer in answers)
    errors, failures = [], 0
    for i, answer in enumerate(answers):
        if answer is None or not np.isfinite(answer).all():
            failures += 1
        elif contender.same_aim:
            errors.append(float(np.abs(answer[: task.m] - task.optima[i][: task.m]).max()))
            failures += errors[-1] > FAILED
        else:
            p = task.problems[i]
            violation = float(max(np.abs(p.A @ answer - p.w).max(), *(p.t_min - answer), *(answer - p.t_max)))
            failures += violation > FAILED
    return max(errors, default=None), failures


def write(report: Report, folder: Path) -> list[Path]:
    """Write `tension.md` and `tension.png` into a folder."""
    text, picture = folder / "tension.md", folder / "tension.png"
    for path in (text, picture):
        check_writable(path)
    with whole_file(text) as temporary:
        temporary.write_text(markdown(report), encoding="utf-8")
    return [text, _picture(report, picture)]


def markdown(report: Report) -> str:
    """Return the report as a page: one table for each task, the fastest first."""
    text = Path(__file__).with_name("tension_report.md").read_text(encoding="utf-8").rstrip()
    given = {"machine": report.machine, "count": report.count, "repeats": report.repeats}
    lines = [text.format(**given, reference=REFERENCE, failed=FAILED)]
    for task in dict.fromkeys(row.task for row in report.rows):
        rows = []
        for row in sorted([r for r in report.rows if r.task == task], key=lambda row: (np.isnan(row.ratio), row.ratio)):
            error = "-" if row.max_error is None else f"{row.max_error:.0e}"
            name = f"{row.contender} ({row.detail})" if row.detail else row.contender
            times = f"{row.median_us:.1f}", f"{row.p99_us:.1f}", f"{row.ratio:.2f}"
            times = times if np.isfinite(row.ratio) else "---"
            rows.append((name, *times, error, f"{row.failures} of {row.problems}"))
        columns = "contender | median us | p99 us | ratio | error | failures"
        lines += ["", f"## {task}", "", *table(columns, rows)]
    return "\n".join(lines) + "\n"


def _picture(report: Report, path: Path) -> Path:
    """Draw the ratios of every contender, one mark for each kind of task, at the number of cables nearest to eight."""
    sizes = {int(row.task.split("= ")[1]) for row in report.rows}
    m = min(sizes, key=lambda size: abs(size - 8))
    names = list(dict.fromkeys(row.contender for row in report.rows))[::-1]
    canvas = style.figure(height=1.0 + 0.17 * len(names))
    ax = style.axes(canvas, f"time, as a ratio to {REFERENCE}", "")
    for index, kind in enumerate(KINDS):
        here = {row.contender: row for row in report.rows if row.task == f"{kind}, m = {m}"}
        shown = [name for name in names if name in here and np.isfinite(here[name].ratio)]
        ratios = [here[name].ratio for name in shown]
        failed = ["none" if here[name].failures else style.colour(index) for name in shown]
        y = [names.index(name) for name in shown]
        ax.scatter(ratios, y, marker="os^D"[index], s=14, c=failed, edgecolors=style.colour(index), label=kind)
    ax.axvline(1.0, **style.LIMIT)
    ax.set_xscale("log")
    ax.set_yticks(range(len(names)), names)
    style.heading(ax, f"m = {m}; hollow: some results wrong")
    style.legend_below(canvas, ax)
    return style.save(canvas, path)
