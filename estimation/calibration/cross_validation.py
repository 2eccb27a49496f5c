"""Cross-validation: a small residual of the training samples does not prove that more parameters help.

The record is cut into blocks in time, every other block is fitted, and the lengths of the others are predicted (unknown
poses are estimated again). Then the two halves are swapped.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError
from ...models.robot import Robot
from ..logs.measurements import Measurements
from .model import Model, State
from .parameters import Parameters
from .solving import (
    Solved,
    check_enough,
    cleaned,
    covariance_of,
    inflation_of,
    is_enough,
    length_of,
    lengths_of,
    model_of,
    noise_of,
    solve,
    usual,
)
from .starts import fit_from

BLOCKS = 10  # of the record
SHORTEST = 4  # samples of a block; of fewer, every other sample is left out
WORSE = 1.02  # of the smallest error left out that a smaller set of parameters may have
CLEANED = {"anchors", "offsets", "clock"}  # found while wrong readings are looked for
CERTAIN = 3.0  # standard deviations that a clock offset must differ from 0
NESTED: tuple[tuple[str, ...], ...] = (
    (),
    ("offsets",),
    ("anchors",),
    ("anchors", "offsets"),
    ("anchors", "attachments", "offsets"),
    ("anchors", "offsets", "scales"),
    ("anchors", "attachments", "offsets", "scales"),
    ("anchors", "attachments", "offsets", "radii"),
    ("anchors", "attachments", "offsets", "scales", "radii"),
)


class Compared(NamedTuple):
    """A parameter set, and the root mean square of its training and validation residuals [m].

    With unknown poses both are corrected for the part of the errors that the poses absorb. Inf if half of the samples
    do not determine the parameters, or a fit did not converge.
    """

    free: tuple[str, ...]
    fitted: float
    left_out: float


@dataclass(frozen=True)
class HeldOut(Displayed):
    """Errors of cross-validation.

    Attributes
    ----------
    before
        Root mean square of the residuals with the file's parameters [m].
    after
        Root mean square with the parameters estimated from the other half [m].
    sets
        The parameter sets, from the empty set (the file) to the full set.
    best
        The smallest set with an error at most 2 % above the smallest error of all.
    """

    before: float
    after: float
    sets: tuple[Compared, ...]
    best: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as plain data."""
        sets = [{**one._asdict(), "free": list(one.free)} for one in self.sets]
        return {"before": self.before, "after": self.after, "sets": sets, "best": list(self.best)}


def halves(measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """Return the samples of the two halves: blocks in time, or every other sample of a short record."""
    count = len(measurements)
    blocks = BLOCKS if count >= BLOCKS * SHORTEST else count
    block = np.arange(count) * blocks // count
    if measurements.times is None and count < 1000:
        block = np.arange(count)
    return np.flatnonzero(block % 2 == 0), np.flatnonzero(block % 2 == 1)


def compare(
    robot: Robot,
    measurements: Measurements,
    weights: np.ndarray,
    free: tuple[str, ...],
    prior: dict[str, float],
    clock: float = 0.0,
) -> HeldOut:
    """Cross-validate the parameter sets within `free`; arguments are checked.

    Measurements are without slips, weights (m, N) are 0 for outliers, and a clock offset is near `clock` [s].
    """
    sets = [one for one in NESTED if set(one) < set(free) - {"clock"}]
    sets = [(*one, "clock") if one and "clock" in free else one for one in sets]
    if free == ("clock",):
        sets = [()]
    return _compare(robot, measurements, weights, [*sets, free], prior, clock)


def select(robot: Robot, measurements: Measurements, outliers: bool) -> tuple[str, ...]:
    """Return the smallest parameter set whose cross-validation error is close to the best.

    The sets are empty (the file), offsets alone, anchors, both, and these with attachments, scales and pulley
    radii; with a clock offset if times and poses of a motion were measured. With `outliers`, slips and outliers are
    removed first. Raises `InputError` if there are too few measurements even for the offsets.
    """
    sets = [one for one in NESTED if "radii" not in one or robot.pulley_radii.any()]
    check_enough(robot, measurements, ("offsets",), {})
    if "clock" in usual(robot, measurements):
        sets = [(*one, "clock") if one else one for one in sets]
    first = [one for one in sets if one and set(one) <= CLEANED and is_enough(robot, measurements, one)][-1]
    solved = solve(robot, measurements, first, {}, outliers)
    clock = float(solved.fit.state.x[solved.model.parameters.clock])
    if "clock" in first and not CERTAIN * _clock_sigma(solved) < abs(clock):
        # Errors of the poses' velocities let a clock offset seem certain where the lengths hardly change.
        sets, clock = [tuple(name for name in one if name != "clock") for one in sets], 0.0
    return _compare(robot, *cleaned(solved), sets, {}, clock).best


def _clock_sigma(solved: Solved) -> float:
    """Return the standard deviation of the clock offset [s]."""
    of = solved.model.parameters
    at = int(np.flatnonzero(np.flatnonzero(of.varies) == of.clock)[0])
    variance = inflation_of(noise_of(solved)) * covariance_of(solved)[at, at]
    return float(np.sqrt(variance)) if solved.observability.determined[at] else np.inf


def _compare(
    robot: Robot,
    measurements: Measurements,
    weights: np.ndarray,
    sets: list[tuple[str, ...]],
    prior: dict[str, float],
    clock: float,
) -> HeldOut:
    whole = replace(model_of(robot, measurements, (), {}), weights=weights)
    parts = halves(measurements)
    compared = []
    before = float(np.sqrt(_mean_square(*poses_fitted(whole))))
    for free in sets:
        if not free:
            compared.append(Compared((), before, before))
            continue
        own = {name: value for name, value in prior.items() if name in free}
        results = [_predict(whole, free, own, clock, parts[i], parts[1 - i]) for i in range(2)]
        known = [result for result in results if result is not None]
        fitted, left_out = (
            np.sqrt(np.mean([result[i] for result in known])) if len(known) == 2 else np.inf for i in range(2)
        )
        compared.append(Compared(free, float(fitted), float(left_out)))
    best = min(compared, key=lambda one: one.left_out)
    good = [one for one in compared if one.left_out <= WORSE * best.left_out]
    chosen = min(good, key=lambda one: Parameters(robot, one.free).varies.sum(), default=best)
    return HeldOut(before, compared[-1].left_out, tuple(compared), chosen.free)


def _predict(
    whole: Model, free: tuple[str, ...], prior: dict[str, float], clock: float, fitted: np.ndarray, left: np.ndarray
) -> tuple[float, float] | None:
    """Return the mean squares [m^2] of training and validation; None with too few samples, or if no fit converged."""
    if not (len(fitted) and len(left)):
        return None

    def part(rows: np.ndarray, groups: tuple[str, ...], own: dict[str, float]) -> Model:
        start = None if whole.start is None else whole.start[rows]
        of = model_of(whole.robot, whole.measurements.only(rows), groups, own, start)
        return replace(of, weights=whole.weights[:, rows])

    try:
        check_enough(whole.robot, whole.measurements.only(fitted), free, prior)
    except InputError:
        return None
    model = part(fitted, free, prior)
    length = length_of(whole.robot)
    begin = model.begin()
    begin.x[model.parameters.clock] = clock if "clock" in free else 0.0
    found = fit_from(model, begin, length)[0]
    if not found.converged:
        return None
    other = part(left, free, {})
    nothing = replace(other, parameters=replace(other.parameters, groups=()))
    state = nothing.begin()._replace(x=found.state.x)
    state = fit_from(nothing, state, length)[0].state
    return _mean_square(model, found.state), _mean_square(nothing, state)


def _mean_square(model: Model, state: State) -> float:
    """Return the mean square of the lengths' residuals [m^2], corrected for the part that unknown poses absorb."""
    used = model.weights * model.inside(state) > 0
    squares = float((lengths_of(model, state).T[used] ** 2).sum())
    unknown = int(np.isinf(model.pose_sigmas).sum())
    return squares / max(int(used.sum()) - unknown, 1)


def poses_fitted(model: Model) -> tuple[Model, State]:
    """Return the model without free parameters, and the poses that fit the lengths best with the robot's file."""
    nothing = replace(model, parameters=Parameters(model.robot, ()), prior={})
    return nothing, fit_from(nothing, nothing.begin(), length_of(model.robot))[0].state
