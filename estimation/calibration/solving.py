"""`solve`: fit the parameters of a robot to measurements, excluding outliers and modelling slips of winches."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...base.display import Displayed
from ...models.robot import Robot
from ..logs.cable_directions import placed
from ..logs.measurements import Measurements, measured_poses, tracked
from ..logs.pose_track import PoseTrack
from .autocorrelation import information_of
from .balance import Balance
from .carrier_clocks import CarrierClocks, has_carrier_clocks
from .carrier_motion import CarrierMotion
from .clock import begin_with_clock
from .clock_rate import ClockRate
from .considered import Considered, considered
from .fit import Fit, fit, held
from .fitted_clocks import Clocks, with_clocks
from .geometry import length_of
from .hanging import carrying, without_slack
from .left_out import left_out
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .observability import Observability
from .outliers import LEAST_THRESHOLD, SHORTEST, Outlier, Slip, find_outliers, find_slips, find_unbalanced, robust
from .parameters import OF_ROBOT, Parameter, Parameters
from .pose_noise import observed
from .projection import out_of_plane
from .repeating_errors import Repeating, repeating
from .restarts import restarts
from .sightings import sighted
from .starts import fit_from, level_poses

ROUNDS = 30  # of fits, each without the wrong readings of those before
FEW = 0.02  # of the samples
MOST_SLIPS = 8
ROUNDS_OF_WEIGHTS = 4
NEGLIGIBLE = 0.02  # of the lengths' noise, by which tensions that change move lengths
NOISE_OF_FORCES = 0.05, 1e4  # factors of the stated errors of forces


class Noise(NamedTuple):
    """The noise of a fit, and what it makes of the parameters.

    Attributes:
        excess: Ratio of residuals to their sigmas: root of the sum of squares over the redundancy; nan without any.
        autocorrelation: Factor of the variances because errors are autocorrelated, at least 1.
        lasting: Whether they are for longer than smoothing of the poses makes them.
        redundancy: Number of readings minus number of unknowns, of which priors determine a part.
        covariance, information: Those of the parameters, in metres, (p, p), zero along unobservable directions.
        repeating: Errors of lengths that repeat with the pose or the lengths, or None.
    """

    excess: float
    autocorrelation: float
    lasting: bool
    redundancy: float
    covariance: np.ndarray
    information: np.ndarray
    repeating: Repeating | None = None


@dataclass(frozen=True, eq=False)
class Solved(Displayed):
    """A fit, with outliers, slips, observability, and clocks that were known only roughly."""

    model: Model
    fit: Fit
    outliers: tuple[Outlier, ...]
    slips: tuple[Slip, ...]
    observability: Observability
    clocks: Clocks | None = None

    @property
    def parameters(self) -> np.ndarray:
        """Return the values of all parameters but slips."""
        return self.fit.state.x[: self.model.parameters.clock + OF_ROBOT]

    @property
    def clock_errors(self) -> tuple[Parameter, ...]:
        """Return the clocks as they were estimated."""
        return () if self.clocks is None else self.clocks.parameters(inflation_of(self.noise))

    @cached_property
    def noise(self) -> Noise:
        """Return the noise of the fit.

        Errors e of the readings with the covariance W and exact priors D give the parameters, of normal matrix
        H = J'J + D, the covariance H^-1 (J'W J + D) H^-1. Where unknown poses have noise, the observability widens it.
        """
        model, state, seen = self.model, self.fit.state, self.observability
        inside = model.inside(state)
        spare = (model.weights & inside).sum(axis=0) + sighted(model.measurements) * inside
        if model.balanced:
            weighed = inside if model.unbalanced is None else inside & ~model.unbalanced
            spare = spare + model.balanced.equations * weighed
        spare = spare - (np.isinf(model.pose_sigmas)).sum(axis=1)  # a pose with a finite sigma is an equation, too
        varies = model.parameters.varies
        sigmas, moved = model.prior_sigmas[varies], (state.x - model.parameters.first)[varies]
        values, vectors = np.linalg.eigh(seen.inverse)
        V, roots = vectors[:, len(values) - seen.rank :], np.sqrt(np.maximum(values[len(values) - seen.rank :], 0.0))
        D = (V * roots).T @ ((V * roots) / (sigmas * metric(model)[varies])[:, None] ** 2)
        redundancy = int(np.maximum(spare, 0).sum()) - seen.rank + float(np.trace(D))
        if redundancy <= 0:
            return Noise(np.nan, 1.0, False, redundancy, seen.covariance, seen.information)
        excess = float(np.sqrt(max(self.fit.cost - float(((moved / sigmas) ** 2).sum()), 0.0) / redundancy))
        if not seen.rank:
            return Noise(excess, 1.0, False, redundancy, seen.covariance, seen.information)
        white = np.eye(seen.rank) - D
        M, more, lags = information_of(model, state, V * roots, white)
        lasting = lags > (model.track.smoothed if model.track else 0)
        again = repeating(model, state, V * roots)
        M = M if again is None else again.larger(M, white)
        larger = max(1 / more, excess**2)  # smoothing of poses makes their noise smaller, but autocorrelated
        shares, turn = np.linalg.eigh((V / roots).T @ seen.covariance @ (V / roots))
        wide = (turn * np.sqrt(np.maximum(shares, 0.0))) @ turn.T
        M = larger * M + D + out_of_plane(model, state, V * roots)
        spread = roots[:, None] * (wide @ M @ wide) * roots
        more *= larger / max(1.0, excess**2)
        return Noise(excess, more, lasting, redundancy, V @ spread @ V.T, V @ np.linalg.inv(spread) @ V.T, again)


def solve(
    robot: Robot,
    measurements: Measurements,
    groups: tuple[str, ...],
    prior: dict[str, float],
    outliers: bool,
    near: Solved | None = None,
) -> Solved:
    """Fit, remove outliers and model slips, until there are no more; arguments are checked.

    `near` is a fit of the same log with fewer parameters, from which the fit begins if all poses are known.
    """
    begin = None if near is None or near.model.has_unknown_poses else near
    model = model_of(robot, measurements, groups, prior, near=begin)
    length, taut = length_of(robot), model.weights
    jumps = restarts(model, length)
    model = replace(model, parameters=replace(model.parameters, slips=tuple(jumps)))
    state = begin_with_clock(model, length) if "clock" in groups and begin is None else model.begin()
    parameters = begin.parameters if begin else state.x[: len(state.x) - len(jumps)]
    state = state._replace(x=np.append(parameters, list(jumps.values())))
    model = replace(model, ahead=float(state.x[model.parameters.clock]))
    result, used = fit_from(model, state, length, outliers)
    model, fitted = replace(model, kept=used.kept), used.weights
    model, result = _weighed(model, result, length, False)
    model, result = without_slack(model, result, length)
    clocks, recorded = (begin.clocks if begin else None), None
    if has_carrier_clocks(robot, measurements):
        recorded = CarrierClocks(robot, measurements)
        model, result, clocks = with_clocks(model, result, recorded, None, length, search=True)
    wrong: dict[tuple[int, int], Outlier] = {}
    slips: list[Slip] = []
    for _ in range(ROUNDS if outliers else 0):
        found, left = find_outliers(model, result.state)
        # If more than a few readings look wrong, something lasts: they are looked at only if it is no slip.
        many = len(found) > max(2, FEW * len(measurements))
        sought = (many or not found) and len(slips) < MOST_SLIPS and robot.fixed_lengths is None
        candidates = find_slips(model, result.state, length) if sought else []
        if sought and many:  # robust fits may see readings of several cables as wrong where one has slipped
            candidates += find_slips(model, fit(model, result.state, length).state, length)
        if candidates:
            tried = [(one, *_with_slip(replace(model, weights=taut), result, one, length)) for one in candidates]
            slip, longer, other, kept = min(tried, key=lambda one: _surprise(*one[2:]))
            large = abs(other.state.x[-1]) > LEAST_THRESHOLD * slip.sigma
            if large and _surprise(other, kept) < _surprise(result, fitted) - SHORTEST * LEAST_THRESHOLD**2:
                slips.append(slip)
                wrong, model, result, fitted = {}, longer, other, kept
                continue
        if not found and np.array_equal(fitted, model.weights):
            break
        wrong |= {(one.cable, one.sample): one for one in found}
        model = replace(model, weights=model.weights & ~left)
        result, fitted = fit(model, result.state, length), model.weights
    # A clock that still changes must bring in no readings that no test has seen.
    model = replace(model, weights=model.weights & model.inside(result.state)) if outliers else model
    model, result = _weighed(model, result, length, True)
    seen = observed(model, result.state, length)
    if recorded is None and result.converged and model.track and model.carriers is None:
        recorded = clocks.recorded if clocks else ClockRate(model)
    if recorded is not None:
        model, result, clocks = with_clocks(model, result, recorded, clocks, length)
        seen = clocks.widened(observed(model, result.state, length))
    return Solved(model, result, tuple(wrong.values()), tuple(slips), seen, clocks)


def _with_slip(model: Model, result: Fit, slip: Slip, length: float) -> tuple[Model, Fit, np.ndarray]:
    """Return the model with a further slip, its fit, and the weights of the fit."""
    parameters = replace(model.parameters, slips=(*model.parameters.slips, (slip.cable, slip.sample)))
    kept = None if model.kept is None else np.pad(model.kept, ((0, 0), (0, 1)))
    model = replace(model, parameters=parameters, kept=kept)
    state = result.state._replace(x=np.append(result.state.x, slip.size))
    state, weights = robust(model, fit(model, state, length).state, length)
    return model, fit(replace(model, weights=weights), state, length), weights


def _surprise(result: Fit, weights: np.ndarray) -> float:
    """Return the sum of squares of a fit, to which each sample with outliers adds the least square of an outlier."""
    return result.cost + LEAST_THRESHOLD**2 * float((~weights).any(axis=0).sum())


def _weighed(model: Model, result: Fit, length: float, stretches: bool) -> tuple[Model, Fit]:
    """Return the model with errors of forces as large as they turn out to be, and its fit.

    With `stretches`, cables are also stretched by tensions with errors. These would fit wrong readings.
    """
    for _ in range(ROUNDS_OF_WEIGHTS):
        before, state = model, result.state
        found = find_unbalanced(model, state)
        known = False if model.unbalanced is None else model.unbalanced
        if found is not None and (found[0] != 1.0 or (found[1] != known).any()):
            # Noise alone does not show how large forces are that the model lacks.
            least, most = NOISE_OF_FORCES if model.measurements.tensions is not None else (1.0, NOISE_OF_FORCES[1])
            noise = float(np.clip(model.noise * found[0], least, most))
            clock = float(state.x[model.parameters.clock])
            model = replace(model, noise=noise, unbalanced=found[1], ahead=clock)
        model = _stretched(model, state, length) if stretches else model
        if model is before:
            break
        begin = model.begin()
        same = state.errors.shape == begin.errors.shape
        result = fit(model, state if same else state._replace(errors=begin.errors), length)
    return model, result


def _stretched(model: Model, state: State, length: float) -> Model:
    """Return the model whose cables are stretched by the most likely tensions, or itself if this changes little.

    Noise of tensions would make a cable seem stiffer, so their errors are unknowns if the stiffness is free.
    """
    compliance, known = model.parameters.compliances(state.x), model.felt_tensions
    if known is None or model.forces is None or not compliance.any() or model.pulled_at_poses:
        return model
    felt = carrying(model, state) or model.forces.felt(model.parameters.table(state.x), model.noise)
    by_newtons = compliance * length / model.measurements.sigma.lengths
    matters = np.abs(felt.errors * by_newtons[:, None]).max(initial=0.0) > NEGLIGIBLE
    if {"stiffness", "elasticity"}.isdisjoint(model.parameters.groups) or not matters:
        felt = felt._replace(errors=felt.errors[..., :0])
    moved = np.sqrt((((felt.tensions - known.tensions) * by_newtons) ** 2).mean(axis=0)).max()
    same = felt.errors.shape == known.errors.shape and moved <= NEGLIGIBLE
    return model if same else replace(model, felt=felt)


def model_of(
    robot: Robot,
    measurements: Measurements,
    groups: tuple[str, ...],
    prior: dict[str, float],
    track: PoseTrack | None = None,
    weights: np.ndarray | None = None,
    near: Solved | None = None,
) -> Model:
    """Return the model of checked arguments, which starts with level poses where none are measured.

    `track` belongs to a model with the same poses, which needs as much memory as the log. `weights` are those of
    `Model`; default: of all readings but those of `left_out`. `near` is a fit of the same log: its parameters tell the
    tensions of a platform that `hangs` better than the file's, and so which cables are slack.
    """
    parameters = Parameters(robot, groups)
    track = near.model.track if near else track
    forces = (near.model.forces if near else None) or Balance(robot, measurements)
    every = np.ones(measurements.lengths.shape[::-1], dtype=bool)
    model = Model(parameters, measurements, prior, every if weights is None else weights, forces=forces)
    if "clock" in groups:
        if track is None:
            position, rotation, _ = measured_poses(robot, measurements)
            assert measurements.times is not None
            track = PoseTrack(measurements.times, position, rotation, tracked(robot, measurements), None)
        carriers = None if measurements.carrier_poses is None else CarrierMotion(robot, measurements)
        model = replace(model, track=track, carriers=carriers)
    elif np.isinf(model.pose_sigmas[:, :3]).any():
        table = parameters.table(parameters.first)
        lengths = table[:, 6] + table[:, 7] * measurements.lengths
        start = level_poses(robot, lengths, "offsets" in groups, measurements.carrier_poses)
        model = replace(model, start=placed(robot, measurements, start))
    elastic = "elasticity" in groups or parameters.compliances(parameters.first).any()
    begin = model.begin()
    felt = carrying(model, begin._replace(x=near.parameters) if near else begin, True) if elastic or near else None
    if weights is None:
        carried = felt.tensions if felt and near else None
        weights = ~np.any(list(left_out(robot, measurements, carried).values()), axis=0).T
    felt = felt if elastic else None
    return replace(model, weights=weights, felt=felt)


def cleaned(solved: Solved) -> tuple[Measurements, np.ndarray]:
    """Return the measurements without their slips, and which readings are no outliers, (m, N) of bool."""
    model, x = solved.model, solved.fit.state.x
    given = model.measurements
    lengths = given.lengths + (model.slips(x) / model.parameters.table(x)[:, 7:8]).T
    return given.changed(lengths=lengths), model.weights


def lengths_of(model: Model, state: State) -> np.ndarray:
    """Return the residuals of the lengths [m], (N, m), all readings included."""
    every = replace(model, weights=np.ones_like(model.weights))
    return (every.residuals(state).readings * model.measurements.sigma.lengths).T


def inflation_of(noise: Noise) -> float:
    """Return the factor of a covariance without priors, for residuals larger than stated, or autocorrelated."""
    return max(1.0, float(np.nan_to_num(noise.excess)) ** 2) * noise.autocorrelation


def covariance_of(solved: Solved) -> np.ndarray:
    """Return the covariance of the parameters, (p, p), in their order and units [m, 1, s].

    It includes errors of anchors that are fixed, and in parameters of forces errors of all fixed ends (`considered`).
    """
    scale = metric(solved.model)[solved.model.parameters.varies]
    covariance = solved.noise.covariance / scale[:, None] / scale
    covariance += considered_of(solved).covariance
    return (covariance + covariance.T) / 2


def one_step(
    solved: Solved, group: str, groups: tuple[str, ...], prior: dict[str, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return a further group of parameters after one step of the fit (k,), and its covariance for noise as stated.

    `groups` and `prior` contain the group.
    """
    of = solved.model
    model = replace(of, parameters=replace(of.parameters, groups=groups), prior=prior)
    scale, columns = metric(model), np.flatnonzero(Parameters(model.robot, (group,)).varies)
    equations = NormalEquations.at(model, solved.fit.state, scale)
    covariance = np.linalg.inv(held(equations.S, length_of(model.robot)))
    own, unit = np.isin(np.flatnonzero(model.parameters.varies), columns), scale[columns]
    return (-covariance @ equations.b)[own] / unit, covariance[np.ix_(own, own)] / unit / unit[:, None]


def considered_of(solved: Solved) -> Considered:
    """Return what errors of fixed cable ends do to a fit."""
    excess, redundancy = float(np.nan_to_num(solved.noise.excess)), solved.noise.redundancy
    return considered(solved.model, solved.fit.state, solved.observability.inverse, excess, redundancy)
