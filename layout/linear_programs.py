"""Sequential linear programs: maximise a goal over all rows, inside bounds and with room between cables."""

import time
from typing import NamedTuple

import numpy as np
from scipy.optimize import linprog

from .evaluation import Evaluation, Slopes
from .goal import Goal

MOST_RESERVES, MOST_DISTANCES = 150, 100  # smallest ones, which a linear program has
_PER_SIZE = 200.0  # cost, in force scales, of missing a bound by the size of the robot
_LARGEST = 1e7  # of the objective [N]
_FOUND, LITTLE = 1e-5, 0.01  # the search ends when the gain is below _FOUND * max(LITTLE * force scale, margin)
PROGRAMS = 60  # from one start, at most


class Multipliers(NamedTuple):
    """Weights of the rows' reserves at the optimum, which sum to at most one, and the value of wider bounds."""

    rows: np.ndarray  # (k,), into the rows of the evaluation
    weights: np.ndarray  # (k,)
    pull: np.ndarray  # (k, m), of the cables along the normals
    direction: np.ndarray  # (k, n)
    by_high: np.ndarray  # (p,), gained per unit by which an upper bound rises
    by_low: np.ndarray  # (p,), gained per unit by which a lower bound falls
    left: float  # improvement of the goal that the linear program still sees within its steps [N]


class _Program:
    """The linear program about a point, and its solution."""

    def __init__(self, evaluation: Evaluation, goal: Goal, y: np.ndarray, delta: float, every: np.ndarray):
        variables = evaluation.variables
        span = variables.high - variables.low
        self.scale = np.where(span > 0.0, span, 1.0)
        count = min(MOST_RESERVES, every.size)
        chosen = np.argpartition(every.ravel(), count - 1)[:count]
        chosen = chosen[np.isfinite(every.ravel()[chosen])]
        rows, normals = np.unravel_index(chosen, every.shape)
        self.found, slopes = evaluation.reserves(y, rows, normals)
        good = evaluation.usable(slopes)
        self.rows, self.good = rows[good], good
        # Variables: steps as shares of the ranges, the margin, what the room misses, the lowest frequency, and the
        # longest length of each cable.
        lengths = variables.robot.m if goal.per_metre else 0
        one = np.eye(3 + lengths)
        parts = [(Slopes(every.ravel()[chosen][good], slopes[good]), one[0])]
        near = 4.0 * delta * float(self.scale.max(initial=0.0))
        parts.append((evaluation.space_slopes(y, MOST_DISTANCES, near), -one[1]))
        if goal.per_hertz:
            parts.append((evaluation.frequency_slopes(y), one[2]))
        if lengths:
            longest, cables = evaluation.longest_slopes(y)
            parts.append((Slopes(-longest.value, -longest.by_variables), -one[3 + cables]))
        A = np.vstack(
            [
                np.hstack([-part.by_variables * self.scale, np.broadcast_to(column, (len(part.value), len(one)))])
                for part, column in parts
            ]
        )
        b = np.concatenate([part.value for part, _ in parts])
        missing = _price_of_missing(evaluation)
        cost = np.r_[goal.price * self.scale, -1.0, missing, -goal.per_hertz, np.full(lengths, goal.per_metre)]
        below, above = (variables.low - y) / self.scale, (variables.high - y) / self.scale
        self.low, self.high = np.maximum(below, -delta), np.minimum(above, delta)
        self.at_low, self.at_high = below >= -delta, above <= delta
        most = _LARGEST if goal.per_hertz else 0.0
        bounds = np.vstack(
            [
                np.c_[self.low, self.high],
                [[-_LARGEST, min(goal.enough, _LARGEST)], [0.0, _LARGEST], [-most, most]],
                np.tile([0.0, _LARGEST], (lengths, 1)),
            ]
        )
        options = {"presolve": False}  # of which such small dense programs have nothing
        self.solution = linprog(cost, A_ub=A, b_ub=b, bounds=bounds, method="highs", options=options)
        self.value = -self.solution.fun - float(goal.price @ y) if self.solution.success else -np.inf


def maximise(
    evaluation: Evaluation, goal: Goal, y: np.ndarray, until: float, delta: float = 0.1, programs: int = PROGRAMS
) -> None:
    """Move the variables to a local maximum of a goal, in place: an interrupt keeps what is reached.

    - `evaluation`: of all rows that count.
    - `goal`: the objective.
    - `y`: where to start, (p,); it is moved.
    - `until`: time of `time.perf_counter` at which it ends early [s].
    - `delta`: longest step of the first program, of the range of each variable.
    - `programs`: most linear programs.
    """
    least, (value, every) = LITTLE * evaluation.variables.robot.force_scale, merit(evaluation, goal, y)
    for _ in range(programs):
        if delta < 1e-6 or time.perf_counter() > until or not np.isfinite(value):
            break
        program = _Program(evaluation, goal, y, delta, every)
        predicted = program.value - value
        if not predicted > _FOUND * max(least, abs(value)):
            break
        step, variables = program.solution.x[: y.size], evaluation.variables
        candidate = np.clip(y + step * program.scale, variables.low, variables.high)
        candidate_value, candidate_every = merit(evaluation, goal, candidate)
        actual = candidate_value - value
        if actual > 1e-4 * predicted:
            largest = float(np.abs(step).max())
            y[:], value, every = candidate, candidate_value, candidate_every
            if actual > 0.7 * predicted and largest > 0.9 * delta:
                delta = min(2.0 * delta, 0.5)
            elif actual < 0.25 * predicted:
                delta *= 0.5
        else:
            delta *= 0.35


def merit(evaluation: Evaluation, goal: Goal, y: np.ndarray) -> tuple[float, np.ndarray]:
    """Return what `maximise` improves, the goal less the price of what the room misses [N], and all reserves."""
    every = evaluation.all_reserves(y)
    outcome = evaluation.outcome_besides(y, goal, float(every.min()))
    return goal.value(y, outcome) - _price_of_missing(evaluation) * evaluation.missing(y), every


def _price_of_missing(evaluation: Evaluation) -> float:
    """Return what it costs to miss a bound of the room [N/m]."""
    return _PER_SIZE * evaluation.variables.robot.force_scale / evaluation.room.size


def multipliers(evaluation: Evaluation, goal: Goal, y: np.ndarray, delta: float = 1e-3) -> Multipliers:
    """Return the multipliers of the linear program at a point, within small steps."""
    every = evaluation.all_reserves(y)
    program = _Program(evaluation, goal, y, delta, every)
    solution, p = program.solution, y.size
    if not solution.success:
        none, nowhere = np.zeros((0, 0)), np.zeros(p)
        return Multipliers(np.zeros(0, dtype=int), np.zeros(0), none, none, nowhere, nowhere, np.inf)
    weights = np.abs(solution.ineqlin.marginals[: program.rows.size])
    upper, lower = (np.abs(side.marginals[:p]) / program.scale for side in (solution.upper, solution.lower))
    keep = weights > 1e-9
    return Multipliers(
        program.rows[keep],
        weights[keep],
        program.found.pull[program.good][keep],
        program.found.direction[program.good][keep],
        np.where(program.at_high, upper, 0.0),
        np.where(program.at_low, lower, 0.0),
        program.value - goal.value(y, evaluation.outcome_besides(y, goal, float(every.min()))),
    )
