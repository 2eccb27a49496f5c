"""A first value of the clock offset: the sum of squares has valleys where motions repeat, so many values are tried."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .fit import held
from .model import Model, State
from .normal_equations import NormalEquations, metric

__all__ = ["CLOCK_RANGE", "begin_with_clock"]

CLOCK_RANGE = 1.0  # [s] to each side
SHARE = 0.25  # of the record, to which the range is limited
MOST_SAMPLES = 400
TRIED = 81


def begin_with_clock(model: Model, length: float) -> State:
    """Return the state to begin with: at each clock offset tried, the other parameters are fitted in one step.

    The length is that of the cables [m].
    """
    times = model.measurements.times
    assert times is not None
    few = _thinned(model)
    most = min(CLOCK_RANGE, SHARE * float(times[-1] - times[0]))
    without = replace(
        few, parameters=replace(few.parameters, groups=tuple(g for g in few.parameters.groups if g != "clock"))
    )
    clocks = np.linspace(-most, most, TRIED)
    costs = [_cost_at(without, clock, length) for clock in clocks]
    at = int(np.argmin(costs))
    finer = np.linspace(clocks[max(at - 1, 0)], clocks[min(at + 1, TRIED - 1)], 17)
    best = finer[int(np.argmin([_cost_at(without, clock, length) for clock in finer]))]
    state = model.begin()
    state.x[model.parameters.clock] = best
    return state


def _cost_at(model: Model, clock: float, length: float) -> float:
    """Return the mean square of the readings' residuals after one step of the parameters."""
    state = model.begin()
    state.x[model.parameters.clock] = clock
    residuals, derivatives = model.linearised(state)
    inside = int(model.inside(state).sum())
    equations = NormalEquations.at(model, residuals, derivatives, metric(model))
    of_poses = 0.0 if equations.y is None else float(np.vdot(equations.y, equations.y))
    gained = 0.0
    if equations.b.size:
        gained = float(equations.b @ np.linalg.solve(held(equations.S, length), equations.b))
    return (residuals.cost - of_poses - gained) / max(inside, 1)


def _thinned(model: Model) -> Model:
    """Return the model of few enough samples, whose poses are still those of the whole track."""
    count = len(model.measurements)
    rows = np.unique(np.linspace(0, count - 1, MOST_SAMPLES).astype(int)) if count > MOST_SAMPLES else np.arange(count)
    assert model.track is not None
    return replace(
        model,
        measurements=model.measurements.only(rows),
        weights=model.weights[:, rows],
        track=model.track.at_samples(rows),
    )
