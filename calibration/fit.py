"""`fit`: damped least squares (Levenberg and Marquardt) over parameters and poses.

Without a prior some directions of the parameters may be open. A very weak prior about the file's values decides there
and nowhere else: the change from the file is the smallest there is (inner constraints).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .model import Model, State
from .normal_equations import NormalEquations, metric

__all__ = ["Fit", "fit", "held", "unobservable_below"]

MOST_STEPS = 150
NEGLIGIBLE = 1e-8  # decrease of the sum of squares relative to 1 + the sum: parameters move by 1e-4 of their sigmas
STILL = 1e-6  # [m] of a step, where it makes no difference to the sum of squares
MOST_IDLE = 4  # steps that make none
SMALL = 1e-3  # of 1 + the sum of squares
WEAK = 1e-3  # [1/m^2] times the square of the cables' length: a prior of 30 of their lengths
WEAKEST = 1e-12  # of the largest eigenvalue, so that rounding is smaller
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


def held(S: np.ndarray, length: float) -> np.ndarray:
    """Return normal equations with so weak a prior about the file's values that only open directions feel it."""
    weak = max(WEAK / length**2, WEAKEST * float(np.diag(S).max(initial=0.0)))
    return S + weak * np.eye(len(S))


def fit(model: Model, state: State, length: float, steps: int = MOST_STEPS) -> Fit:
    """Minimise the sum of squares from `state` on; `length` is that of the cables [m]."""
    scale = metric(model)
    varies = model.parameters.varies
    first = model.parameters.first
    cost, damping, done, idle = model.residuals(state).cost, 0.0, 0, 0
    while done < steps:
        residuals, derivatives = model.linearised(state)
        while done < steps:
            done += 1
            equations = NormalEquations.at(model, residuals, derivatives, scale, damping)
            away = (state.x - first)[varies] * scale[varies]
            dp, expected = _step(equations, away, length, damping)
            size = float(np.abs(dp).max(initial=0.0))
            dx = np.zeros_like(state.x)
            dx[varies] = dp / scale[varies]
            tried = model.moved(state, dx, equations.poses_after(dp))
            new = model.residuals(tried).cost
            if damping == 0 and expected <= NEGLIGIBLE * (1 + cost):
                idle += 1
                if size <= STILL or idle == MOST_IDLE:
                    # The last step costs nothing, and improves nearly quadratically.
                    return Fit(tried, new, True, done) if new <= cost else Fit(state, cost, True, done)
            # A step along open directions may cost a little: they are straight lines only nearby.
            if new <= cost or max(new - cost, expected) <= SMALL * (1 + cost):
                state, cost = tried, new
                damping = 0.0 if damping <= LEAST else damping / 30
                break
            damping = max(LEAST, 10 * damping)
            if damping > LARGEST:
                # No step is short enough: the sum of squares is at its rounding.
                return Fit(state, cost, expected <= SMALL * (1 + cost), done)
    return Fit(state, cost, False, done)


def _step(equations: NormalEquations, away: np.ndarray, length: float, damping: float) -> tuple[np.ndarray, float]:
    """Return the step (p,) and the decrease of the sum of squares to expect."""
    of_poses = 0.0 if equations.y is None else float(np.vdot(equations.y, equations.y))
    if not equations.b.size:
        return np.zeros(0), of_poses
    S = held(equations.S, length)
    back = (S - equations.S) @ away if not damping else 0.0
    if damping:
        S = S + np.diag(damping * np.diag(S))
    # The prior brings open directions back to the file, and they do not enter b.
    both = np.linalg.solve(S, np.column_stack([equations.b, equations.b + back]))
    return -both[:, 1], float(equations.b @ both[:, 0]) + of_poses
