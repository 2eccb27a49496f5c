"""The start of a fit without measured poses, and poses that it left in a wrong local minimum.

Without its offsets, a small platform seems rotated by a right angle, and a fit from there ends in a wrong local
minimum. So a first fit treats the orientation as roughly measured at its value at home, lengths as less certain, and
parameters as close to the file. The second fit drops these assumptions.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from ...base.errors import InputError
from ...models import points
from ...models.dynamics import dynamics_of
from ...models.robot import Robot
from ..pose.estimate import largest_cost
from ..pose.from_lengths import pose_from_lengths
from ..pose.search import level_platform, problem_of
from .fit import Fit, fit
from .hanging import slack
from .model import Model, State
from .outliers import robust
from .pose_noise import steadied

SHORTEST = 1e-3  # [m]; readings without their offsets may be negative
UPRIGHT = 0.2  # [rad], standard deviation of the orientation about home
ROUGH = 5e-3  # [m], standard deviation of the lengths
NEAR_THE_FILE = {"anchors": 0.01, "attachments": 0.01, "radii": 0.01, "offsets": 0.03}  # sigmas, of the cables' length
SCALES = 0.01  # sigma [1]
ENOUGH = 1e-3  # of the sum of squares, of a step that the first fit need not take
FAR = 0.05  # of the cables' length: offsets that are farther from the file are no errors of it
RARE = 0.05  # share of sound poses that fit no better than those that are looked for elsewhere
TURN = 1.0  # [rad] to each side about each axis, where such a search begins
CLEARLY = 2.0  # of the squares, in variances of the noise, by which another pose must fit better
MOST_SEARCHES = 5


def fit_from(
    model: Model, state: State, length: float, outliers: bool = False, enough: float = 0.0
) -> tuple[Fit, Model]:
    """Minimise the sum of squares, from level poses if none were measured; `length` is the length of the cables [m].

    It returns the fit, and the model with its weights of readings and the directions that it keeps. With `outliers`,
    readings that do not fit most others are excluded, because parameters and poses that adapt to them would hide
    them. `enough` is as in `fit`. The state has initial parameters, and the poses of `model.begin()`.
    """

    def cleaned(of: Model, state: State, softest: float = np.inf) -> tuple[State, np.ndarray]:
        return robust(of, state, length, softest) if outliers else (state, of.weights)

    if not model.has_unknown_poses:
        result = fit(model, state, length, enough=enough)
        state, weights = cleaned(model, result.state)
        return result._replace(state=state), replace(model, weights=weights)
    state = _by_forces(model, state, length)
    rough, begin = _rough(model, state, length)
    state, weights = cleaned(rough, fit(rough, begin, length, enough=ENOUGH).state)
    taut = model.weights * ~slack(rough, state) if outliers else model.weights
    model, clean = replace(model, weights=taut), replace(model, weights=weights * taut)
    clean, state = steadied(clean, _elsewhere(clean, state) or state, length)
    softest = (rough.measurements.sigma.lengths / model.measurements.sigma.lengths) ** 2
    state, weights = cleaned(replace(clean, weights=model.weights), state, softest)
    clean = replace(clean, weights=weights)
    result = fit(clean, state, length, enough=enough)
    for _ in range(MOST_SEARCHES):
        other = _elsewhere(clean, result.state)
        if other is None:
            break
        result = fit(clean, other, length, enough=enough)
    return result, clean


def level_poses(robot: Robot, lengths: np.ndarray, offsets: bool, carriers: np.ndarray | None = None) -> np.ndarray:
    """Return poses (N, 6) [m, rad] with the orientation at home and lengths closest to `lengths` (N, m) [m].

    With unknown `offsets`, lengths are relative to home at the first sample if that fits better. `carriers` are the
    poses of the carriers (N, c, 6); default: at home.
    """
    problem, weights = problem_of(robot, carriers), np.ones(robot.m)

    def level(of: np.ndarray) -> tuple[np.ndarray, float]:
        poses = level_platform(problem, np.maximum(of, SHORTEST), weights)
        return poses, float(np.median(np.abs(dynamics_of(robot).cable_lengths(poses, carriers) - of)))

    poses, misfit = level(lengths)
    if offsets and misfit > FAR * float(lengths.mean()):
        other, smaller = level(lengths - lengths[0] + dynamics_of(robot).cable_lengths(robot.home))
        if smaller < misfit:
            return other
    return poses


def _by_forces(model: Model, state: State, length: float) -> State:
    """Return poses and offsets that measured tensions suggest, which need no lengths; else the state as it is."""
    if model.balanced is None or model.measurements.tensions is None or "offsets" not in model.parameters.groups:
        return state
    sigma = model.measurements.sigma._asdict() | {"lengths": FAR * length}
    fixed = replace(model.parameters, groups=())
    loose = replace(model, parameters=fixed, measurements=model.measurements.changed(sigma=sigma), upright=UPRIGHT)
    at_home = np.where(np.isinf(model.pose_sigmas[:, :1]), model.robot.home[:3] - model.poses(state)[0], state.shift)
    level, home = (fit(loose, start, length).state for start in (state, state._replace(shift=at_home)))
    nearer = loose.residuals(level).of_samples <= loose.residuals(home).of_samples
    state = State(state.x, *(np.where(nearer, a.T, b.T).T for a, b in zip(level[1:], home[1:], strict=True)))
    misfit = np.median(model.residuals(state).readings, axis=1) * model.measurements.sigma.lengths
    x = state.x.copy()
    model.parameters.table(x)[:, 6] += misfit
    return state._replace(x=x)


def _rough(model: Model, state: State, length: float) -> tuple[Model, State]:
    """Return the model with level poses, rough lengths and parameters near the file, and its initial state."""
    given = model.measurements.sigma
    sigma = {**given._asdict(), "lengths": max(given.lengths, ROUGH)}
    near = {name: share * length for name, share in NEAR_THE_FILE.items()} | {"scales": SCALES}
    parameters = model.parameters
    if "offsets" in parameters.groups and "offsets" not in model.prior:
        misfit = np.median(model.residuals(state).readings, axis=1) * given.lengths
        if np.abs(misfit).max() > FAR * length:
            del near["offsets"]
            state = state._replace(x=state.x.copy())
            parameters.table(state.x)[:, 6] += misfit
    prior = {name: value for name, value in near.items() if name in parameters.groups} | model.prior
    measurements = model.measurements.changed(sigma=sigma)
    return replace(model, measurements=measurements, prior=prior, upright=UPRIGHT), state


def _elsewhere(model: Model, state: State) -> State | None:
    """Return the state with clearly better poses for samples that fit badly, or None without such poses."""
    unknown = np.isinf(model.pose_sigmas[:, np.flatnonzero(model.robot.dof_mask)]).all(axis=1)
    spare = model.weights.sum(axis=0) - int((model.robot.dof_mask > 0).sum())
    squares = (model.residuals(state).readings ** 2).sum(axis=0)
    tested = unknown & (spare > 0)
    if not tested.any():
        return None
    usual = squares / np.array([largest_cost(int(r), 0.5) if r > 0 else np.inf for r in spare])
    noise = float(np.median(usual[tested]))
    rare = np.array([largest_cost(int(r), RARE) if r > 0 else np.inf for r in spare])
    bad = np.flatnonzero(tested & (squares > noise * rare))
    if not bad.size:
        return None
    try:
        robot = model.parameters.calibrated(state.x)
    except InputError:  # values on the way that no robot has
        return None
    lengths = np.maximum(model.lengths(state)[bad], SHORTEST)
    sigma = model.measurements.sigma.lengths
    position, rotation = model.poses(state)
    # One of the other poses with these lengths may be about any oblique axis away.
    turns = np.array(list(product((0.0, TURN, -TURN), repeat=3))) * (robot.dof_mask[3:] > 0)
    turns = np.unique(turns, axis=0)  # (k, 3)
    starts = np.empty((len(bad), len(turns), 6))
    starts[..., :3], starts[..., 3:] = position[bad, None], robot.home[3:] + turns
    of_carriers = model.measurements.carrier_poses
    carriers = None if of_carriers is None else of_carriers[bad, None]
    found = pose_from_lengths(robot, np.repeat(lengths[:, None], len(turns), axis=1), starts, carriers, sigma)
    costs = ((found.residuals / sigma) ** 2).sum(axis=2)
    best = np.argmin(np.where(np.isfinite(costs), costs, np.inf), axis=1)
    better = costs[np.arange(len(bad)), best] < squares[bad] - CLEARLY * noise
    if not better.any():
        return None
    rows, poses = bad[better], found.pose[better, best[better]]
    shift, turn = state.shift.copy(), state.turn.copy()
    shift[rows] += poses[:, :3] - position[rows]
    turn[rows] = points.rotations(poses[:, 3:]) @ np.swapaxes(rotation[rows], 1, 2) @ turn[rows]
    return state._replace(shift=shift, turn=turn)
