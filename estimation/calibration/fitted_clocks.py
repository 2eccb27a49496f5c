"""Estimate, along with a fit, clocks that are known only roughly: `with_clocks`.

Derivatives of all residuals by the clocks are differences. From their normal equations poses and parameters are
eliminated, as in `NormalEquations`, and a step of the clocks is taken before each further fit. The covariance of the
parameters includes the uncertainty of the clocks.
"""

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from .fit import Fit, fit, held
from .model import Model, State
from .normal_equations import NormalEquations, metric
from .observability import Observability
from .parameters import Parameter

ROUNDS = 6
ENOUGH = 1e-4  # a fit in the search ends if a step would reduce the sum of squares by less than this fraction
STEP = 2e-3  # [s] of finite differences
SETTLED = 0.1  # standard deviations; the last step is smaller than this
LONGEST, SHORTER = 0.05, 0.25  # longest step [s], and the factor of a step after one that fitted worse
SEARCHED, MOST_SAMPLES = 200, 4000  # samples


class Recorded(Protocol):
    """Recording that can be read at shifted times.

    Attributes:
        names: Names of the clocks, (k,).
        sigmas: Their standard deviations before the fit, (k,) [s].
        unit: Unit of the clocks in reports.
        per_second: Size in this unit of a clock that is ahead by 1 s.
    """

    names: tuple[str, ...]
    sigmas: np.ndarray
    unit: str
    per_second: float

    def model(self, model: Model, ahead: np.ndarray) -> Model:
        """Return a model with what was recorded if the clocks are `ahead`, (k,) [s]."""
        ...


class Clocks(NamedTuple):
    """Clocks, as estimated along with a fit.

    Attributes:
        recorded: The recording on these clocks.
        ahead: Time by which each clock is ahead, (k,) [s].
        covariance: Their covariance, (k, k) [s^2].
        effect: Derivatives of the free parameters, in metres, by the clocks, (p, k) [m/s].
    """

    recorded: Recorded
    ahead: np.ndarray
    covariance: np.ndarray
    effect: np.ndarray

    def parameters(self, inflation: float) -> tuple[Parameter, ...]:
        """Return the clocks in their units; `inflation` is a factor of the covariance."""
        sigmas, of = np.sqrt(np.diag(self.covariance) * inflation), self.recorded
        values = zip(of.names, (of.per_second * self.ahead).tolist(), (of.per_second * sigmas).tolist(), strict=True)
        return tuple(Parameter(name, ahead, sigma, ahead, of.unit) for name, ahead, sigma in values)

    def widened(self, seen: Observability) -> Observability:
        """Return the observability of parameters with the uncertainty of the clocks."""
        K, information = self.effect, seen.information
        inner = np.linalg.inv(self.covariance) + K.T @ information @ K
        return replace(
            seen,
            covariance=seen.covariance + K @ self.covariance @ K.T,
            information=information - information @ K @ np.linalg.solve(inner, K.T @ information),
        )


def with_clocks(
    model: Model, result: Fit, of: Recorded, before: Clocks | None, length: float, search: bool = False
) -> tuple[Model, Fit, Clocks]:
    """Return the model whose clocks fit best, its fit, and the clocks.

    - `of`: what was recorded; the model has it with clocks as estimated `before`, or as recorded.
    - `length`: length of the cables [m].
    - `search`: True to use few samples, far from the right clocks.
    """
    count, prior = len(model.measurements), 1 / of.sigmas**2
    ahead = first = np.zeros(len(of.sigmas)) if before is None else before.ahead
    most, longest = SEARCHED if search else MOST_SAMPLES, LONGEST
    rows = np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))

    def fitted(clocks: np.ndarray, state: State) -> tuple[Fit, float]:
        found = fit(of.model(model, clocks).only(rows), state, length, enough=ENOUGH if search else 0.0)
        return found, found.cost + float(prior @ clocks**2)

    def derivatives() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        gradient, information, effect = _derivatives(model, now.state, of, ahead, rows, length)
        more, own = count / len(rows), np.diag(prior)
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
    if ahead is not first:
        model = of.model(model, ahead)
        result = fit(model, result.state._replace(x=now.state.x), length) if len(rows) < count else now
    return model, result, Clocks(of, ahead, covariance, effect)


def _derivatives(
    model: Model, state: State, of: Recorded, ahead: np.ndarray, rows: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return gradient (k,) and information (k, k) of the clocks by some samples, and `Clocks.effect`."""
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
