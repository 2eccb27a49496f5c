"""Simulated annealing of a layout on few poses: a start from which linear programs find a good local optimum.

From random layouts the linear programs alone stop where the available wrench set is flat: the margin is 0 there, more
than around. Coordinates drawn at their bounds, where good layouts have many, and swaps of attachments pass it. Cables
cannot be moved through each other by small steps, so the room between them is part of the score.
"""

import time

import numpy as np

from .evaluation import Evaluation
from .goal import Goal
from .moves import Moves

MOVES = 2000
_NEGATIVE = 0.05  # weight of the mean of negative margins
_HOT = 0.1  # first temperature, of the force scale
_MISSING_COSTS = 5.0  # force scales per metre by which a bound of the room is missed


def anneal(evaluation: Evaluation, goal: Goal, moves: Moves, rng: np.random.Generator, until: float) -> np.ndarray:
    """Return the variables of a good layout for the rows of an evaluation, (p,).

    - `evaluation`: an evaluation of few poses, because it is repeated thousands of times.
    - `goal`: the objective.
    - `moves`: the random changes.
    - `until`: time of `time.perf_counter` at which it ends [s]: where an evaluation takes long, with fewer moves.
    """
    force = evaluation.variables.robot.force_scale

    def score(y: np.ndarray, least: float) -> float:
        found = evaluation.margins(y)
        value = goal.value(y, evaluation.outcome_besides(y, goal, float(found.min())))
        value += _NEGATIVE * float(np.minimum(found, 0.0).mean())
        if value > least:  # else it is refused without the distances
            value -= _MISSING_COSTS * force * evaluation.missing(y)
        return value

    y = moves.layout(rng)
    value = score(y, -np.inf)
    best, best_value = y, value
    started, count = time.perf_counter(), MOVES
    for number in range(MOVES):
        temperature = force * _HOT * max(0.0, 1.0 - number / count) ** 2 + 1e-9
        least = value + temperature * float(np.log(rng.random() + 1e-300))  # by Metropolis
        candidate = moves.neighbour(y, rng)
        candidate_value = score(candidate, least)
        if candidate_value > least:
            y, value = candidate, candidate_value
            if value > best_value:
                best, best_value = y, value
        if number % 100 == 99:
            now = time.perf_counter()
            count = min(MOVES, round(number * (until - started) / (now - started)))
            if now > until:
                break
    return best
