"""An initial value of the clock offset: repeating motions cause local minima, so many values are tried."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...models.robot import Robot
from ..logs.alignment import coarse
from ..logs.measurements import Measurements, measured_poses, tracked
from ..logs.pose_track import PoseTrack
from ..logs.smoothing import after_pauses
from .balance import needs_balance
from .fit import held
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .parameters import IN_BALANCE

CLOCK_RANGE = 1.0  # [s] to each side
SHARE = 0.25  # of the record, to which the range is limited
MOST_SAMPLES = 400
FEWER = 100  # samples that leave out most of the offsets
TRIED = 81
LIKELY = 9  # offsets that are tried again with all samples
HALVINGS = 3  # of the step between offsets
FEWEST = 0.4  # of the samples that must have a pose
WINDING = 10.0  # standard deviations of readings that change, and so show a clock offset
SMOOTH = 0.1  # error of a pose between others, as a share of how far poses are apart


def begin_with_clock(model: Model, length: float) -> State:
    """Return the initial state: for each clock offset, the other parameters are fitted in one step.

    Offsets within a second are tried, and around the one with the best correlation of cable speeds if it is larger.
    `length` is the length of the cables [m].
    """
    count = len(model.measurements)
    # Where poses are measured, forces tell less of the clock than lengths do.
    left_out = ("clock",) if needs_balance(model.robot, model.measurements) else ("clock", *IN_BALANCE)
    fixed = tuple(group for group in model.parameters.groups if group not in left_out)
    few = model.only(np.unique(np.linspace(0, count - 1, min(count, MOST_SAMPLES)).astype(int)))
    few = replace(few, parameters=replace(few.parameters, groups=fixed))
    times = model.measurements.times
    assert times is not None
    most = min(CLOCK_RANGE, SHARE * float(times[-1] - times[0]))
    tried = np.linspace(-most, most, TRIED)
    far = _by_cable_speeds(model)
    if abs(far) > most:
        tried = np.concatenate([tried, far + tried])
    step = tried[1] - tried[0]
    fewer = few.only(slice(None, None, max(len(few.measurements) // FEWER, 1)))
    tried = tried[np.argsort(_costs(fewer, tried, length), kind="stable")[:LIKELY]]
    cost, best = min(zip(_costs(few, tried, length), tried, strict=True))
    for _ in range(HALVINGS):
        step /= 2
        beside = best - step, best + step
        cost, best = min((cost, best), *zip(_costs(few, beside, length), beside, strict=True))
    state = model.begin()
    state.x[model.parameters.clock] = best
    return state


def is_still(measurements: Measurements) -> bool:
    """Return whether the readings hardly change, as with locked winches."""
    return float(measurements.lengths.std(axis=0).max()) < WINDING * measurements.sigma.lengths


def winds(measurements: Measurements) -> bool:
    """Return whether readings change within a part of the log that has no pauses, and so show a clock offset.

    Cables that are locked again after each pause do not: a wrong offset only moves poses from one part to the next.
    """
    assert measurements.times is not None
    ends = [0, *after_pauses(measurements.times), len(measurements)]
    return not all(is_still(measurements.only(slice(*part))) for part in pairwise(ends))


def moves_smoothly(robot: Robot, measurements: Measurements) -> bool:
    """Return whether every other pose follows from its neighbours, so that poses can be interpolated.

    It is false if the platform was moved from pose to pose, or did not move.
    """
    assert measurements.times is not None
    position, rotation, _ = measured_poses(robot, measurements)
    rows = np.flatnonzero(tracked(robot, measurements))
    used = np.zeros(len(measurements), dtype=bool)
    used[rows[::2]] = True
    if used.sum() < 4:
        return False
    track = PoseTrack(measurements.times, position, rotation, used)
    left = rows[1::2][track.inside(0.0)[rows[1::2]]]
    if not left.size:
        return False
    apart = track.at_samples(left).at(0.0)[0] - position[left]
    spread = position[left] - np.median(position[left], axis=0)
    sizes = np.linalg.norm([apart, spread], axis=2)  # (2, n), whose medians hardly depend on a few wrong positions
    return bool(np.median(sizes[0]) < SMOOTH * np.median(sizes[1]))


def _by_cable_speeds(model: Model) -> float:
    """Return the clock offset [s], up to half the record, with the best correlation of cable speeds."""
    given, track = model.measurements, model.track
    assert given.times is not None
    assert track is not None
    begin, known = model.begin(), track.inside(0.0)
    if known.sum() < 4:
        return 0.0
    # The residuals at the clock offset 0 are lengths less readings, up to their scales and offsets.
    readings = model.lengths(begin)
    lengths = readings + (model.residuals(begin).readings * given.sigma.lengths).T
    return coarse(given.times, readings, given.times[known], lengths[known])[0]


def _costs(model: Model, clocks: Iterable[float], length: float) -> list[float]:
    """Return the mean square of the readings' residuals after one step of the parameters, inf with too few poses."""
    scale, costs = metric(model), []
    for clock in clocks:
        state = model.begin()
        state.x[model.parameters.clock] = clock
        inside = int(model.inside(state).sum())
        if inside < FEWEST * len(model.measurements):
            costs.append(np.inf)
            continue
        equations = NormalEquations.at(model, state, scale)
        of_poses = 0.0 if equations.y is None else float(np.vdot(equations.y, equations.y))
        gained = float(equations.b @ np.linalg.solve(held(equations.S, length), equations.b))
        costs.append((equations.cost - of_poses - gained) / max(inside, 1))
    return costs
