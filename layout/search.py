"""The search of a design: annealed starts, sequential linear programs, and audits that add the worst poses."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .annealing import anneal
from .evaluation import Evaluation, Rows, rows_of
from .goal import Goal, goal_of
from .linear_programs import maximise
from .requirements import Requirements
from .room import room_of
from .task_rows import FEW_INSTANTS, with_tasks
from .variables import Variables

Progress = Callable[[str, float, float], None]  # what is being done, the share of time, the best margin so far [N]

AUDITED = 100_000  # random poses
CLEARANCE_AUDITED = 10_000
FEW = 32  # rows for annealing
_ADDED, _APART = 20, 0.15  # worst poses that an audit adds, and how far apart they are [m]
_ROUNDS = 6
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
    margin: float = -np.inf  # smallest margin over all rows and the audited poses [N]
    missing: float = np.inf  # by how much a bound of the room is missed there [m]
    starts: int = 0  # layouts from which linear programs were run
    audit_agrees: bool = False  # whether the random poses of the last audit are no worse than the rows
    stopped: bool = False  # whether the search was interrupted

    def better(self, y: np.ndarray, margin: float, short: float) -> bool:
        """Return whether another result is better: less of the room is missing, or none and its rank is higher."""
        if short > 0.0 or self.missing > 0.0:
            return (short, -margin) < (self.missing, -self.margin)
        return self.goal.rank(margin, y) > self.goal.rank(self.margin, self.y)


def search(variables: Variables, requirements: Requirements, progress: Progress) -> Found:
    """Search until the time limit for the layout with the largest margin; an interrupt ends it with the best so far."""
    robot, started = variables.robot, time.perf_counter()
    until = started + requirements.time_limit
    enough = started + _STARTING * requirements.time_limit
    rng = np.random.default_rng(requirements.seed)
    require, tasks = requirements.require, requirements.tasks
    rows = with_tasks(rows_of(robot, require, [each.places() for each in require]), robot, tasks)
    coarse = _few(rows_of(robot, require, _coarse(requirements)), rng)
    room = room_of(requirements)
    few = Evaluation(variables, with_tasks(coarse, robot, tasks, FEW_INSTANTS), room.with_spare(_FEW_SPARE))
    goal = goal_of(variables, requirements)
    found = Found(goal, variables.of_robot(), rows)

    def improve(what: str, delta: float) -> None:
        share = (time.perf_counter() - started) / requirements.time_limit
        progress(what, min(share, 1.0), found.margin)
        maximise(Evaluation(variables, found.rows, room.with_spare(_SPARE)), goal, y, until, delta)
        _take(variables, requirements, found, y, rng)

    y = found.y.copy()
    try:
        while found.starts == 0 or time.perf_counter() < enough:
            if found.starts == 0 and requirements.start == "robot":
                improve("the robot's own layout", _FIRST_STEP)
            else:
                near = found.y if found.starts % 2 and found.starts > 1 else None
                y = anneal(few, goal, rng, until, near)
                improve(f"start {found.starts + 1}", _FIRST_STEP)
            found.starts += 1
        for number in range(_ROUNDS):
            if found.audit_agrees or time.perf_counter() > until:
                break
            y = found.y.copy()
            improve(f"audit {number + 1}", _LATER_STEP)
    except KeyboardInterrupt:
        found.stopped = True
        evaluation = Evaluation(variables, found.rows, room)
        if found.better(y, float(evaluation.margins(y).min()), evaluation.missing(y)):
            found.y = y
    return found


def _take(
    variables: Variables, requirements: Requirements, found: Found, y: np.ndarray, rng: np.random.Generator
) -> None:
    """Audit a layout, add the worst poses to the rows, and keep it if it is the best."""
    evaluation = Evaluation(variables, found.rows, room_of(requirements))
    promised, short = float(evaluation.margins(y).min()), evaluation.missing(y)
    if not found.better(y, promised, short):
        return  # the audit can only find less
    margin, missed, worst = _audit(variables, requirements, y, rng)
    agrees = margin >= promised - _SAME * abs(promised) and missed <= short
    if not agrees:
        found.rows = found.rows.joined(worst)
    margin, short = min(margin, promised), max(short, missed)
    if found.better(y, margin, short):
        found.y, found.margin, found.missing, found.audit_agrees = y.copy(), margin, short, agrees


def _audit(
    variables: Variables, requirements: Requirements, y: np.ndarray, rng: np.random.Generator
) -> tuple[float, float, Rows]:
    """Return the smallest margin and what the room misses at random poses, and the worst rows."""
    require = requirements.require
    demands = sum(len(each.demands) for each in require)
    count = max(1000, AUDITED // demands)
    rows = rows_of(variables.robot, require, [each.sampled(count, rng) for each in require])
    values = Evaluation(variables, rows).margins(y)
    picked = _apart(rows, np.argsort(values)[:300])
    short = 0.0
    some = rows.only(np.unique(rows.pose_of, return_index=True)[1][:CLEARANCE_AUDITED])
    spaces = Evaluation(variables, some, room_of(requirements)).spaces(y)
    if spaces.size:
        least = spaces.min(axis=1)
        short = max(0.0, -float(least.min()))
        closest = _apart(some, np.argsort(least)[:100])
        return float(values.min()), short, rows.only(picked).joined(some.only(closest))
    return float(values.min()), short, rows.only(picked)


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


def _few(rows: Rows, rng: np.random.Generator) -> Rows:
    count = len(rows.pose_of)
    return rows if count <= FEW else rows.only(np.sort(rng.choice(count, FEW, replace=False)))
