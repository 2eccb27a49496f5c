"""Estimate, along with a fit, clock offsets of carriers that another computer recorded: `with_carrier_clocks`.

`sigma.clocks` of the measurements is the standard deviation of these clocks, relative to the platform's. All
that a carrier recorded, which is its motion and the tensions and directions of its cables, is moved in time together.
Derivatives of all residuals by the clocks are differences. From their normal equations poses and parameters are
eliminated, as in `NormalEquations`, and a step of the clocks is taken before each further fit. The covariance of the
parameters includes the uncertainty of the clocks.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from ...models import points
from ...models.robot import Robot
from ..logs.measurements import Measurements
from ..logs.smoothing import continuous, smooth, within
from .balance import Balance
from .carrier_motion import CarrierMotion
from .fit import Fit, fit, held
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .observability import Observability

ROUNDS = 6
ENOUGH = 1e-4  # a fit in the search ends if a step would reduce the sum of squares by less than this fraction
STEP = 2e-3  # [s] of finite differences
SETTLED = 0.1  # standard deviations; the last step is smaller than this
LONGEST, SHORTER = 0.05, 0.25  # longest step [s], and the factor of a step after one that fitted worse
SEARCHED, MOST_SAMPLES = 200, 4000  # samples
FEWEST = 8  # samples


class CarrierClocks(NamedTuple):
    """Clock offsets of carriers, as estimated along with a fit.

    Attributes:
        carriers: Indices of the carriers, (k,).
        ahead: Time by which each clock is ahead of the clock of the platform's poses, (k,) [s].
        covariance: Their covariance, (k, k) [s^2].
        effect: Derivatives of the free parameters, in metres, by the clocks, (p, k) [m/s].
    """

    carriers: np.ndarray
    ahead: np.ndarray
    covariance: np.ndarray
    effect: np.ndarray

    def widened(self, seen: Observability) -> Observability:
        """Return the observability of parameters with the uncertainty of the clocks."""
        K, information = self.effect, seen.information
        inner = np.linalg.inv(self.covariance) + K.T @ information @ K
        return replace(
            seen,
            covariance=seen.covariance + K @ self.covariance @ K.T,
            information=information - information @ K @ np.linalg.solve(inner, K.T @ information),
        )


def has_carrier_clocks(robot: Robot, measurements: Measurements) -> bool:
    """Return whether the measurements contain motions of carriers whose clocks are not known exactly."""
    moves = measurements.carrier_poses is not None and any(carrier.moves for carrier in robot.carriers)
    return bool(moves and measurements.times is not None and measurements.sigma.clocks and len(measurements) >= FEWEST)


def with_carrier_clocks(
    model: Model, result: Fit, given: Measurements, before: CarrierClocks | None, length: float
) -> tuple[Model, Fit, CarrierClocks]:
    """Return the model whose carriers' clocks fit best, its fit, and the clocks.

    - `given`: measurements as recorded; the model has them with corrected clocks.
    - `before`: clocks of the model. Without them a search with few samples comes first.
    - `length`: length of the cables [m].
    """
    count, prior = len(given), 1 / given.sigma.clocks**2
    of = _Recorded(model.robot, given)
    ahead, longest = np.zeros(len(of.carriers)) if before is None else before.ahead, LONGEST
    most = SEARCHED if before is None else MOST_SAMPLES
    rows = np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))

    def fitted(clocks: np.ndarray, state: State) -> tuple[Fit, float]:
        found = fit(of.model(model, clocks).only(rows), state, length, enough=0.0 if before else ENOUGH)
        return found, found.cost + prior * float(clocks @ clocks)

    def derivatives() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        gradient, information, effect = _derivatives(model, now.state, of, ahead, rows, length)
        more, own = count / len(rows), prior * np.eye(len(ahead))
        return more * gradient + own @ ahead, np.linalg.inv(more * information + own), effect

    now, cost = fitted(ahead, State(result.state.x, *(part[rows] for part in result.state[1:])))
    gradient, covariance, effect = derivatives()
    for _ in range(ROUNDS):
        step = np.clip(-covariance @ gradient, -longest, longest)
        if (np.abs(step) <= SETTLED * np.sqrt(np.diag(covariance))).all():
            break
        tried, new = fitted(ahead + step, now.state)
        if new > cost:
            longest = SHORTER * float(np.abs(step).max())
            continue
        now, cost, ahead = tried, new, ahead + step
        gradient, covariance, effect = derivatives()
    model = of.model(model, ahead)
    result = fit(model, result.state._replace(x=now.state.x), length) if len(rows) < count else now
    return model, result, CarrierClocks(of.carriers, ahead, covariance, effect)


class _Recorded:
    """Measurements as recorded, from which poses of moving carriers can be read at shifted times."""

    def __init__(self, robot: Robot, given: Measurements):
        times, poses = given.times, given.carrier_poses
        assert times is not None
        assert poses is not None
        self.carriers = np.flatnonzero([carrier.moves for carrier in robot.carriers])
        self._robot, self._given, self._times, neighbours = robot, given, times, within(times)
        self._parts: list[tuple[np.ndarray, np.ndarray, np.ndarray, CubicSpline]] = []
        for index in self.carriers:
            own = np.asarray(robot.carrier_of_cable) == index
            turned = continuous(Rotation.from_matrix(points.rotations(poses[:, index, 3:])).as_quat())
            whole = np.hstack(
                [poses[:, index, :3], turned, *(part[:, own].reshape(len(times), -1) for part in self._of)]
            )
            curve = CubicSpline(times, smooth(times, _bridged(times, whole), neighbours))
            self._parts.append((own, whole, curve(times), curve))

    @property
    def _of(self) -> list[np.ndarray]:
        """Return the tensions and directions of the cables, which are shifted with the carriers; nan if unknown."""
        return [part for part in (self._given.tensions, self._given.directions) if part is not None]

    def at(self, ahead: np.ndarray) -> Measurements:
        """Return the measurements on one clock, if the clocks of the carriers are `ahead` of it, (k,) [s]."""
        given, new = self._given, [part.copy() for part in self._of]
        assert given.carrier_poses is not None
        poses = given.carrier_poses.copy()
        for index, by, (own, whole, smoothed, curve) in zip(self.carriers, ahead, self._parts, strict=True):
            # The noise is not shifted: interpolated noise is smaller, so that shifts of half a sample would fit better.
            later = whole + curve(self._times + by) - smoothed
            poses[:, index, :3] = later[:, :3]
            poses[:, index, 3:] = points.angles(Rotation.from_quat(later[:, 3:7]).as_matrix())
            first = 7
            for part in new:
                size = part[0, own].size
                part[:, own] = later[:, first : first + size].reshape(len(part), *part[0, own].shape)
                first += size
        named = {("tensions" if part.ndim == 2 else "directions"): part for part in new}
        return given.changed(carrier_poses=poses, **named, sigma={**given.sigma._asdict(), "clocks": 0.0})

    def model(self, model: Model, ahead: np.ndarray) -> Model:
        """Return a model with these measurements."""
        measurements = self.at(ahead)
        motion = None if model.carriers is None else CarrierMotion(self._robot, measurements)
        forces = Balance(self._robot, measurements)
        return replace(model, measurements=measurements, forces=forces, carriers=motion)


def _bridged(times: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return columns (n, k) with linear interpolations in place of nan, and zeros in columns without a number."""
    known = np.isfinite(columns)
    bridged = [
        np.interp(times, times[at], column[at]) if at.any() else np.zeros(len(times))
        for column, at in zip(columns.T, known.T, strict=True)
    ]
    return np.stack(bridged, axis=1)


def _derivatives(
    model: Model, state: State, of: _Recorded, ahead: np.ndarray, rows: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return gradient (k,) and information (k, k) of the clocks by some samples, and `CarrierClocks.effect`."""
    scale = metric(model)

    def at(clocks: np.ndarray) -> tuple[np.ndarray, np.ndarray, NormalEquations]:
        there = of.model(model, clocks).only(rows)
        e, equations = there.residuals(state), NormalEquations.at(there, state, scale)
        y = np.zeros(0) if equations.y is None else equations.y.ravel()
        return np.concatenate([e.readings.ravel(), e.balance.ravel(), e.directions.ravel()]), y, equations

    e, y, equations = at(ahead)
    later = [at(ahead + STEP * one) for one in np.eye(len(ahead))]
    E, Y = (np.stack([one[i] - now for one in later], axis=1) / STEP for i, now in enumerate((e, y)))
    B = np.stack([one[2].b - equations.b for one in later], axis=1) / STEP
    effect = -np.linalg.solve(held(equations.S, length), B) if B.size else B
    values, vectors = np.linalg.eigh(E.T @ E - Y.T @ Y + effect.T @ B)
    information = (vectors * np.maximum(values, 0.0)) @ vectors.T  # rounding and differences may make it indefinite
    return E.T @ e - Y.T @ y + effect.T @ equations.b, information, effect
