"""Tensions of a platform that hangs from few cables, as its weight and inertia determine them, and its slack cables."""

from dataclasses import replace

import numpy as np

from .balance import FeltTensions, is_carried
from .fit import Fit, fit
from .left_out import hardly_pull
from .model import Model, State

ROUNDS = 10  # of fits without the readings of cables that the one before shows to be slack


def carrying(model: Model, state: State, errors: bool = False) -> FeltTensions | None:
    """Return the tensions of a platform that `is_carried` at a state of the whole log, None for other logs.

    They are smoothed, as noise of the poses, which lengths have as well, would look like stretch. With `errors`, those
    of accelerations are unknowns.
    """
    if model.forces is None or not is_carried(model.robot, model.measurements):
        return None
    found: list[FeltTensions] = []
    for _, part, own in model.parts(state):
        assert part.forces is not None
        found.append(part.forces.carrying(part.parameters, own.x, part.poses(own), part.ahead))
    tensions, moved = (np.concatenate(of) for of in zip(*found, strict=True))
    return FeltTensions(model.forces.smoothed(tensions), moved if errors else moved[..., :0])


def slack(model: Model, state: State) -> np.ndarray:
    """Return which cables hardly pull at estimated poses of a platform at rest, (m, N) of bool.

    Their readings would be those of longer cables, which looks like stretch of the others.
    """
    none = np.zeros(model.weights.shape, dtype=bool)
    # Whether it is at rest follows from accelerations, which take memory for a long log.
    if model.forces is None or not model.has_unknown_poses or not model.forces.at_rest:
        return none
    tensions = carrying(model, state)
    return none if tensions is None else hardly_pull(tensions.tensions).T


def without_slack(model: Model, result: Fit, length: float) -> tuple[Model, Fit]:
    """Return the model in which `slack` cables have no readings, and hardly pull, and its fit.

    `length` is the length of the cables [m].
    """
    loose = np.zeros(model.weights.shape, dtype=bool)
    for _ in range(ROUNDS):
        found = loose | slack(model, result.state)
        if model.forces is None or np.array_equal(found, loose):
            break
        loose = found
        model = replace(model, weights=model.weights * ~loose, forces=model.forces.with_slack(loose.T))
        result = fit(model, result.state, length)
    return model, result
