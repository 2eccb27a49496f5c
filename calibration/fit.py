"""`fit`: damped least squares (Levenberg and Marquardt) over parameters and poses.

Without a prior some directions of the parameters may be unobservable: a step along them is chosen so that the change
from the file stays the smallest there is (inner constraints), and not by the data.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .model import Model, State
from .normal_equations import NormalEquations, metric

__all__ = ["Fit", "fit", "unobservable_below"]

MOST_STEPS = 60
NEGLIGIBLE = 1e-8  # decrease of the sum of squares relative to 1 + the sum: parameters move by 1e-4 of their sigmas
STILL = 1e-6  # [m] of a step along unobservable directions
LEAST, LARGEST = 1e-6, 1e12  # of the damping, where it is not zero
RELATIVE = 1e-13  # of an eigenvalue to the largest, below which it is rounding


class Fit(NamedTuple):
    """The state with the least sum of squares.

    Attributes
    ----------
    cost
        The sum.
    converged
        Whether no step makes it notably smaller.
    steps
        Steps tried.
    """

    state: State
    cost: float
    converged: bool
    steps: int


def unobservable_below(eigenvalues: np.ndarray, length: float) -> float:
    """Return the eigenvalue of the normal equations [1/m^2] below which a direction counts as unobservable.

    An eigenvalue is 1 / sigma^2 of its direction. If sigma is longer than the cables, the data leave the direction open
    as far as the derivatives mean anything. Rounding makes eigenvalues of 1e-16 of the largest from those that are 0.

    Parameters
    ----------
    eigenvalues
        [1/m^2], (p,).
    length
        Of the cables [m].
    """
    return max(1 / length**2, RELATIVE * float(eigenvalues.max(initial=0.0)))


def fit(model: Model, state: State, length: float, steps: int = MOST_STEPS) -> Fit:
    """Minimise the sum of squares from `state` on; `length` is that of the cables [m]."""
    scale = metric(model)
    varies = model.parameters.varies
    first = model.parameters.first
    cost, damping, done = model.residuals(state).cost, 0.0, 0
    while done < steps:
        residuals, derivatives = model.linearised(state)
        while done < steps:
            done += 1
            equations = NormalEquations.at(model, residuals, derivatives, scale, damping)
            away = (state.x - first)[varies] * scale[varies]
            dp, along, expected = _step(equations, away, length, damping)
            dx = np.zeros_like(state.x)
            dx[varies] = dp / scale[varies]
            tried = model.moved(state, dx, equations.poses_after(dp))
            new = model.residuals(tried).cost
            if damping == 0 and expected <= NEGLIGIBLE * (1 + cost) and along <= STILL:
                # The last step costs nothing, and improves nearly quadratically.
                return Fit(tried, new, True, done) if new <= cost else Fit(state, cost, True, done)
            if new <= cost or (along > STILL and new <= cost + 1e-3 * (1 + cost) and expected <= 1e-3 * (1 + cost)):
                state, cost = tried, new
                damping = 0.0 if damping <= LEAST else damping / 30
                break
            damping = max(LEAST, 10 * damping)
            if damping > LARGEST:
                # No step is short enough: the sum of squares is at its rounding.
                return Fit(state, cost, expected <= 1e-6 * (1 + cost), done)
    return Fit(state, cost, False, done)


def _step(
    equations: NormalEquations, away: np.ndarray, length: float, damping: float
) -> tuple[np.ndarray, float, float]:
    """Return the step (p,), its part along unobservable directions [m] and the decrease of squares to expect."""
    of_poses = 0.0 if equations.y is None else float(np.vdot(equations.y, equations.y))
    if not equations.b.size:
        return np.zeros(0), 0.0, of_poses
    values, vectors = np.linalg.eigh(equations.S)
    observable = values > unobservable_below(values, length)
    V, free = vectors[:, observable], vectors[:, ~observable]
    right = V.T @ equations.b
    if damping:
        diagonal = np.maximum(np.diag(equations.S), 1e-12 * values[-1])
        dp = -V @ np.linalg.solve(np.diag(values[observable]) + damping * (V.T * diagonal) @ V, right)
        return dp, 0.0, float(-(equations.b @ dp)) + of_poses
    dp = -V @ (right / values[observable])
    back = free @ (free.T @ (away + dp))
    return dp - back, float(np.linalg.norm(back)), float(right @ (right / values[observable])) + of_poses
