"""The search of a design: annealed starts, sequential linear programs, and audits that add the worst poses."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .annealing import anneal
from .evaluation import Evaluation, Rows, rows_of
from .goal import NOTHING, Goal, Outcome, goal_of
from .linear_programs import maximise
from .requirements import Requirements
from .room import Room, room_of
from .task_rows import FEW_INSTANTS, with_tasks
from .variables import Variables

Progress = Callable[[str, float, float], None]  # what is being done, the share of time, the best margin so far [N]

AUDITED = 100_000  # random poses
ROOM_AUDITED = 10_000  # of them, for distances and frequencies
FEW = 32  # rows for annealing
_ADDED, _APART = 20, 0.15  # worst poses that an audit adds, and how far apart they are [m]
_SOON, _ROUNDS = 2, 6  # audits after a start that does not meet the requirements, and at the end
_ANNEALING, _IMPROVING = 0.3, 0.4  # of the time at most, for each start and each sequence of linear programs
_STARTING = 0.85  # of the time, for new starts
_FIRST_STEP, _LATER_STEP = 0.1, 0.02  # longest steps of the first linear program, of the ranges
_SAME = 1e-3  # of the margin: what an audit may find less
_SPARE, _FEW_SPARE = 0.002, 0.3  # of the clearance: what is searched for more than is asked, and at few poses


@dataclass
class Found:
    """The best layout of a search so far, and how the search went."""

    goal: Goal
    y: np.ndarray  # variables, (p,)
    rows: Rows  # all rows: those of the requirements, and what audits have added
    outcome: Outcome = NOTHING  # over all rows and the audited poses
    starts: int = 0  # layouts from which linear programs were run
    audit_agrees: bool = False  # whether the random poses of the last audit are no worse than the rows
    stopped: bool = False  # whether the search was interrupted

    def better(self, y: np.ndarray, outcome: Outcome) -> bool:
        """Return whether another layout is better."""
        return self.goal.better(y, outcome, self.y, self.outcome)


def search(
    variables: Variables, requirements: Requirements, progress: Progress, first: np.ndarray | None = None
) -> Found:
    """Search until the time limit for the layout with the largest margin; an interrupt ends it with the best so far.

    The first layout is the robot's own unless another is given, (p,).
    """
    robot, started = variables.robot, time.perf_counter()
    until = started + requirements.time_limit
    enough = started + _STARTING * requirements.time_limit
    rng = np.random.default_rng(requirements.seed)
    require, tasks = requirements.require, requirements.tasks
    rows = with_tasks(rows_of(robot, require, [each.places() for each in require]), robot, tasks)
    coarse = few(rows_of(robot, require, _coarse(requirements)), rng, FEW)
    room = room_of(robot, requirements)
    annealed = Evaluation(variables, with_tasks(coarse, robot, tasks, FEW_INSTANTS), room.with_spare(_FEW_SPARE))
    goal = goal_of(variables, requirements)
    found = Found(goal, variables.of_robot() if first is None else first, rows)

    def improve(what: str, delta: float) -> None:
        share = (time.perf_counter() - started) / requirements.time_limit
        progress(what, min(share, 1.0), found.outcome.margin)
        ends = min(until, time.perf_counter() + _IMPROVING * requirements.time_limit)
        maximise(Evaluation(variables, found.rows, room.with_spare(_SPARE)), goal, y, ends, delta)
        _take(variables, requirements, found, y, rng)

    def settle(rounds: int) -> None:
        nonlocal y
        for _ in range(rounds):
            if found.audit_agrees or time.perf_counter() > until:
                break
            y = found.y.copy()
            improve(f"audit of start {found.starts}", _LATER_STEP)

    y = found.y.copy()
    try:
        while found.starts == 0 or time.perf_counter() < enough:
            if found.starts == 0 and requirements.start == "robot":
                improve("the robot's own layout", _FIRST_STEP)
            else:
                near = found.y if found.starts % 2 and found.starts > 1 else None
                ends = min(until, time.perf_counter() + _ANNEALING * requirements.time_limit)
                y = anneal(annealed, goal, rng, ends, near)
                improve(f"start {found.starts + 1}", _FIRST_STEP)
            found.starts += 1
            if found.outcome.missing > 0.0 or found.outcome.margin < requirements.margin:
                settle(_SOON)
        settle(_ROUNDS)
    except KeyboardInterrupt:
        found.stopped = True
        if found.better(y, Evaluation(variables, found.rows, room).outcome(y, goal)):
            found.y = y
    return found


def _take(
    variables: Variables, requirements: Requirements, found: Found, y: np.ndarray, rng: np.random.Generator
) -> None:
    """Audit a layout, add the worst poses to the rows, and keep it if it is the best."""
    room, goal = room_of(variables.robot, requirements), found.goal
    promised = Evaluation(variables, found.rows, room).outcome(y, goal)
    if not found.better(y, promised):
        return  # the audit can only find less
    audited, worst = _audit(variables, requirements, room, goal, y, rng)
    agrees = audited.missing <= promised.missing and all(
        found >= wanted - _SAME * abs(wanted)
        for found, wanted in ((audited.margin, promised.margin), (audited.frequency, promised.frequency))
    )
    if not agrees:
        found.rows = found.rows.joined(worst)
    outcome = Outcome(
        min(audited.margin, promised.margin),
        max(audited.missing, promised.missing),
        min(audited.frequency, promised.frequency),
        max(audited.cable, promised.cable),
    )
    if found.better(y, outcome):
        found.y, found.outcome, found.audit_agrees = y.copy(), outcome, agrees


def _audit(
    variables: Variables, requirements: Requirements, room: Room, goal: Goal, y: np.ndarray, rng: np.random.Generator
) -> tuple[Outcome, Rows]:
    """Return the result at random poses, and the worst rows."""
    require = requirements.require
    demands = sum(len(each.demands) for each in require)
    count = max(1000, AUDITED // demands)
    rows = rows_of(variables.robot, require, [each.sampled(count, rng) for each in require])
    values = Evaluation(variables, rows).margins(y)
    worst, margin = rows.only(_apart(rows, np.argsort(values)[:300])), float(values.min())
    some = few(rows, rng, ROOM_AUDITED)
    evaluation = Evaluation(variables, some, room)
    spaces, short = evaluation.spaces(y), 0.0
    outcome = evaluation.outcome_besides(y, goal._replace(per_hertz=0.0), margin)
    if spaces.size:
        least = spaces.min(axis=1)
        short = max(0.0, -float(least.min()))
        worst = worst.joined(some.only(_apart(some, np.argsort(least)[:100])))
    if goal.per_hertz:
        frequencies = evaluation.frequencies(y)[:, 0]
        outcome = outcome._replace(frequency=float(frequencies.min()))
        worst = worst.joined(some.only(_apart(some, np.argsort(frequencies)[:100])))
    return outcome._replace(missing=short), worst


def _apart(rows: Rows, order: np.ndarray) -> np.ndarray:
    """Return rows, the worst first, whose poses are some distance from each other."""
    picked: list[int] = []
    for row in order:
        place = rows.poses[rows.pose_of[row]]
        if all(np.abs(place - rows.poses[rows.pose_of[other]]).max() > _APART for other in picked):
            picked.append(int(row))
        if len(picked) == _ADDED:
            break
    return np.array(picked, dtype=int)


def _coarse(requirements: Requirements) -> list[np.ndarray]:
    """Return few poses of each requirement: corners, middles and centre of its box."""
    return [each.places(tuple(min(count, 3) for count in each.grid)) for each in requirements.require]


def few(rows: Rows, rng: np.random.Generator, most: int) -> Rows:
    """Return the rows or, if there are more, a random choice of `most`."""
    count = len(rows.pose_of)
    return rows if count <= most else rows.only(np.sort(rng.choice(count, most, replace=False)))
