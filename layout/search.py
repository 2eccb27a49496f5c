"""The search of a design: annealed starts, sequential linear programs, and audits that add the worst poses.

Half of the time new starts are tried, most of them symmetric. In the other half some points of the best layout are
moved at random, and linear programs continue from there, because the optimum of a start is mostly only a local one.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..models import Robot
from .annealing import Moves, anneal
from .evaluation import FEW_INSTANTS, Evaluation, Rows, rows_of, with_tasks
from .goal import NOTHING, Goal, Outcome, goal_of
from .linear_programs import PROGRAMS, maximise, merit
from .requirements import Requirements
from .room import room_of
from .symmetry import Mirrors
from .variables import Variables

Progress = Callable[[str, float, float], None]  # what is being done, the share of time, the best margin so far [N]

AUDITED = 100_000  # random poses
ROOM_AUDITED = 10_000  # of them, for distances and frequencies
FEW = 32  # rows for annealing
_ADDED, _APART = 20, 0.03  # worst poses that an audit adds, and how far apart they are, in sizes of the robot
_ROUNDS = 6  # audits at the end
_ANNEALING, _IMPROVING = 0.3, 0.4  # of the time at most, for each start and each sequence of linear programs
_STARTING, _SEARCHING = 0.45, 0.9  # of the time: when new starts end, and when only audits are left
_DRAWN, _MOST_MOVES, _FEW_PROGRAMS = 4, 3, 15  # layouts near the best one, moves to each, programs from one of them
_FIRST_STEP, _LATER_STEP = 0.1, 0.02  # longest steps of the first linear program, of the ranges
_REPAIRS, _BY_POINTS = 4, 2  # of a layout that an audit refutes: at most, and how many of them may move points
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
    search = _Search(variables, requirements, progress, variables.of_robot() if first is None else first)
    try:
        search.run()
    except KeyboardInterrupt:
        search.stop()
    return search.found


class _Search:
    """The state of a search."""

    def __init__(self, variables: Variables, requirements: Requirements, progress: Progress, first: np.ndarray):
        robot, require, tasks = variables.robot, requirements.require, requirements.tasks
        self._started = time.perf_counter()
        self._until = self._started + requirements.time_limit
        self._variables, self._requirements, self._progress = variables, requirements, progress
        self._rng = np.random.default_rng(requirements.seed)
        self._room = room_of(robot, requirements)
        corners = [
            each.places(tuple(min(count, 3) for count in each.grid)) for each in require
        ]  # middles and centre too
        coarse = few(rows_of(robot, require, corners), self._rng, FEW)
        rows = with_tasks(coarse, robot, tasks, FEW_INSTANTS)
        self._coarse = Evaluation(variables, rows, self._room.with_spare(_FEW_SPARE))
        rows = with_tasks(rows_of(robot, require, [each.places() for each in require]), robot, tasks)
        self.found = Found(goal_of(variables, requirements), first, rows)
        self._y = first.copy()  # of the layout that is improved
        self._free = self._best_moves = Moves(variables)

    def run(self) -> None:
        """Try starts, then layouts near the best one, and audit it at last."""
        starts = self._starts()
        while self.found.starts == 0 or self._share() < _SEARCHING:
            if self.found.starts == 0 and self._requirements.start == "robot":
                own = self._y.copy()
                if self._limits_alone(own):
                    self._improve("the robot's own points", _FIRST_STEP, limits=True)
                    self._y = own.copy()
                self._improve("the robot's own layout", _FIRST_STEP)
                self._take(own)  # audits may find that the linear programs have made it worse
            elif self._share() < _STARTING or (not self._met() and self.found.starts % 2):
                next(starts)
            else:
                self._move_on()
            self.found.starts += 1
        self._improve_best()
        self._settle(_ROUNDS)

    def stop(self) -> None:
        """Keep the layout that was being improved, if it is better."""
        found = self.found
        found.stopped = True
        outcome = Evaluation(self._variables, found.rows, self._room).outcome(self._y, found.goal)
        if found.better(self._y, outcome):
            found.y = self._y

    def _share(self) -> float:
        """Return the elapsed share of the time."""
        return (time.perf_counter() - self._started) / self._requirements.time_limit

    def _met(self) -> bool:
        return self.found.outcome.missing <= 0.0 and self.found.outcome.margin >= self._requirements.margin

    def _limits_alone(self, y: np.ndarray) -> bool:
        """Return whether tension limits are free, besides points that already keep all bounds of the room."""
        limits = self._variables.limits
        every = Evaluation(self._variables, self.found.rows, self._room)
        return bool(limits.any() and not limits.all()) and every.missing(y) <= 0.0

    def _starts(self) -> Iterator[None]:
        """Improve annealed layouts: one of each symmetry, then half of the best symmetry, half of random ones."""
        mirrors, rng = Mirrors(self._variables), self._rng
        kinds = [None, *mirrors.signs]
        order, best = list(rng.permutation(len(kinds))), 0
        while True:
            kind = order.pop() if order else best if rng.random() < 0.5 else int(rng.integers(len(kinds)))
            signs = kinds[kind]
            moves = Moves(self._variables, None if signs is None else mirrors.symmetry(signs, rng))
            before = self.found.y
            ends = min(self._until, time.perf_counter() + _ANNEALING * self._requirements.time_limit)
            self._y = anneal(self._coarse, self.found.goal, moves, rng, ends)
            self._improve(f"start {self.found.starts + 1}", _FIRST_STEP)
            if self.found.y is not before:
                best, self._best_moves = kind, moves
            yield

    def _move_on(self) -> None:
        """Improve the best of some random layouts near the best one, every other time of the same symmetry."""
        rng, found = self._rng, self.found
        moves = self._free if rng.random() < 0.5 else self._best_moves
        evaluation, value = Evaluation(self._variables, found.rows, self._room.with_spare(_SPARE)), -np.inf
        for _ in range(_DRAWN):
            candidate = found.y
            for _ in range(rng.integers(1, _MOST_MOVES + 1)):
                candidate = moves.neighbour(candidate, rng, limits=False)
            candidate_value, _ = merit(evaluation, found.goal, candidate)
            if candidate_value > value:
                self._y, value = candidate, candidate_value
        self._improve(f"start {found.starts + 1}", _FIRST_STEP, _FEW_PROGRAMS)

    def _settle(self, rounds: int) -> None:
        """Improve the best layout until audits agree with its rows."""
        for _ in range(rounds):
            if self.found.audit_agrees or time.perf_counter() > self._until:
                break
            self._improve_best()

    def _improve_best(self) -> None:
        """Improve the best layout over the rows that audits have added, and to the end."""
        self._y = self.found.y.copy()
        self._improve(f"audit of start {self.found.starts}", _LATER_STEP)

    def _improve(self, what: str, delta: float, programs: int = PROGRAMS, limits: bool = False) -> None:
        """Improve a layout, or its tension limits alone, by linear programs, and keep it if it is the best.

        Where an audit finds it worse than the best one, the programs continue with the poses that this has added. Steps
        of points may lose the margin again at other poses, so at last the tension limits restore it, if they are free:
        for given points they are a linear problem.
        """
        found, variables = self.found, self._variables
        ends = min(self._until, time.perf_counter() + _IMPROVING * self._requirements.time_limit)
        for repair in range(_REPAIRS + 1):
            self._progress(what, min(self._share(), 1.0), found.outcome.margin)
            moved = variables.with_points_held(self._y) if limits else variables
            evaluation = Evaluation(moved, found.rows, self._room.with_spare(_SPARE))
            maximise(evaluation, found.goal, self._y, ends, delta, programs)
            refuted = self._take(self._y)
            if refuted is None:
                break
            delta, programs = _LATER_STEP, PROGRAMS
            limits = refuted.missing <= 0.0 and bool(variables.limits.any()) and (limits or repair >= _BY_POINTS)

    def _take(self, y: np.ndarray) -> Outcome | None:
        """Audit a layout, add the worst poses to the rows, and keep it if it is the best.

        Return its outcome if only poses of the audit make it worse than the best one or miss the requirements.
        """
        found = self.found
        promised = Evaluation(self._variables, found.rows, self._room).outcome(y, found.goal)
        if not found.better(y, promised):
            return None  # the audit can only find less
        audited, worst = self._audit(y, promised)
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
            agrees |= self._met()
        return None if agrees else outcome

    def _audit(self, y: np.ndarray, promised: Outcome) -> tuple[Outcome, Rows]:
        """Return the result at random poses, and the worst of those that are worse than promised."""
        variables, goal, rng = self._variables, self.found.goal, self._rng
        rows = audited_rows(variables.robot, self._requirements, rng)
        values = Evaluation(variables, rows).margins(y)
        worst, margin = rows.only(_apart(rows, values, promised.margin, self._room.size)), float(values.min())
        some = few(rows, rng, ROOM_AUDITED)
        evaluation = Evaluation(variables, some, self._room)
        spaces, short = evaluation.spaces(y), 0.0
        outcome = evaluation.outcome_besides(y, goal._replace(per_hertz=0.0), margin)
        if spaces.size:
            least = spaces.min(axis=1)[some.pose_of]
            short = max(0.0, -float(least.min()))
            worst = worst.joined(some.only(_apart(some, least, -promised.missing, self._room.size)))
        if goal.per_hertz:
            frequencies = evaluation.frequencies(y)[:, 0]
            outcome = outcome._replace(frequency=float(frequencies.min()))
            worst = worst.joined(some.only(_apart(some, frequencies, promised.frequency, self._room.size)))
        return outcome._replace(missing=short), worst


def audited_rows(robot: Robot, requirements: Requirements, rng: np.random.Generator) -> Rows:
    """Return rows at random poses of all requirements."""
    require = requirements.require
    count = max(1000, AUDITED // sum(len(each.demands) for each in require))
    return rows_of(robot, require, [each.sampled(count, rng) for each in require])


def _apart(rows: Rows, values: np.ndarray, below: float, size: float) -> np.ndarray:
    """Return rows with values (K,) below a bound, the worst first, some distance apart, for a robot of a size [m]."""
    order = np.flatnonzero(values < below)
    order = order[np.argsort(values[order])]
    places = rows.poses[rows.pose_of[order]] / np.repeat([size, 1.0], 3)
    picked: list[int] = []
    while order.size and len(picked) < _ADDED:
        picked.append(int(order[0]))
        far = np.abs(places - places[0]).max(axis=1) > _APART
        order, places = order[far], places[far]
    return np.array(picked, dtype=int)


def few(rows: Rows, rng: np.random.Generator, most: int) -> Rows:
    """Return the rows or, if there are more, a random choice of `most`."""
    count = len(rows.pose_of)
    return rows if count <= most else rows.only(np.sort(rng.choice(count, most, replace=False)))
