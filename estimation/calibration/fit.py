"""`fit`: damped least squares (Levenberg and Marquardt) over parameters and poses.

Without a prior some directions of the parameters may be unobservable. A very weak prior about the file's values fixes
only these: the change from the file is the smallest possible (inner constraints).
"""

from typing import NamedTuple

import numpy as np

from .model import Model, State
from .normal_equations import Diagonals, NormalEquations, metric, pose_steps

MOST_STEPS = 150
NEGLIGIBLE = 1e-8  # decrease of the sum of squares relative to 1 + the sum: parameters move by 1e-4 of their sigmas
STILL = 1e-6  # [m] of a step, where it makes no difference to the sum of squares
MOST_IDLE = 8  # steps that make none
LEAST_BACK = 0.01  # share of the way back to the file along open directions, in one step
SMALL = 1e-3  # of 1 + the sum of squares
WEAK = 1e-3  # [1/m^2] times the square of the cables' length: a prior of 30 of their lengths
WEAKEST = 1e-12  # of the largest eigenvalue, so that rounding is smaller
LEAST, LARGEST = 1e-9, 1e12  # of the damping's factor, where it is not zero
GOOD = 0.75  # ratio of a step's decrease to the expected one
FARTHEST = 0.5  # of the cables' length: beyond that derivatives mean nothing, unless nothing is to be gained
RELATIVE = 1e-13  # of an eigenvalue to the largest, below which it is rounding
MOST_POSE_STEPS = 10
SHORTER = 0.25  # of the last step of a pose that fitted worse


class Fit(NamedTuple):
    """The state with the smallest sum of squares."""

    state: State
    cost: float  # sum of squares
    converged: bool  # True if no step reduces it notably
    steps: int  # number of steps tried


def unobservable_below(eigenvalues: np.ndarray, length: float) -> float:
    """Return the eigenvalue of the normal equations [1/m^2] below which a direction is unobservable.

    An eigenvalue is 1 / sigma^2 of its direction. If sigma exceeds the cable length, the direction is unobservable
    within the validity of the linearisation. Rounding turns zero eigenvalues into 1e-16 of the largest.

    - `eigenvalues`: [1/m^2], (p,).
    - `length`: length of the cables [m].
    """
    return max(1 / length**2, RELATIVE * float(eigenvalues.max(initial=0.0)))


def held(S: np.ndarray, length: float) -> np.ndarray:
    """Return normal equations with a weak prior about the file's values that affects only unobservable directions."""
    weak = max(WEAK / length**2, WEAKEST * float(np.diag(S).max(initial=0.0)))
    return S + weak * np.eye(len(S))


def fit(model: Model, state: State, length: float, steps: int = MOST_STEPS, enough: float = 0.0) -> Fit:
    """Minimise the sum of squares, starting from `state`; `length` is the length of the cables [m].

    It ends when the expected decrease is below the fraction `enough` of the sum; 0: when no step helps.
    """
    scale = metric(model)
    varies = model.parameters.varies
    first = model.parameters.first
    damping, back, at_best, equations = _Damping(), 1.0, False, None
    cost, ended, idle = np.inf, np.inf, 0
    for done in range(1, steps + 1):
        del equations  # before the next ones need as much memory
        equations = NormalEquations.at(model, state, scale, damping.added)
        cost = equations.cost
        damping.see(equations.diagonals)
        away = (state.x - first)[varies] * scale[varies]
        dp, expected = _step(equations, away * back, length, damping.factor > 0, at_best)
        if expected < enough * cost:
            return Fit(state, cost, True, done)
        size = float(np.abs(dp).max(initial=0.0))
        dx = np.zeros_like(state.x)
        dx[varies] = dp / scale[varies]
        tried = model.moved(state, dx, equations.poses_after(dp))
        new = model.cost(tried)
        little = NEGLIGIBLE * (1 + cost)
        negligible = expected <= little
        settles = equations.inverse_root is not None and little - GOOD * expected < new - cost < np.inf
        if settles:
            # The parameters may be right, and some poses have farther to go than their derivatives show.
            tried = settled(model, tried, little / len(state.shift))
            new = model.cost(tried)
        if negligible and damping.factor == 0:
            idle += 1
            costly = new - cost > SMALL * (1 + cost)
            if size <= STILL or idle >= MOST_IDLE or (costly and back < LEAST_BACK):
                # The last step costs nothing, and improves nearly quadratically.
                return Fit(tried, new, True, done) if new <= cost else Fit(state, cost, True, done)
            back = back / 4 if costly else min(2 * back, 1.0)
            if costly:
                continue
        # A step along open directions may cost a little: they are straight lines only nearby.
        if new - cost <= SMALL * (1 + cost) if negligible else new <= cost and size <= FARTHEST * length:
            # If no more reduction is expected, a step without damping shows whether that is so. At a kink of the sum,
            # as where a clock offset leaves samples without a pose, it promises a reduction that no step brings.
            if negligible and damping.factor > 0:
                if ended - cost <= little:
                    return Fit(state, cost, True, done)
                ended = cost
            damping.accept(0.0 if negligible else (cost - new) / expected)
            damping.factor *= not negligible
            state, cost, at_best = tried, new, settles
            continue
        damping.reject()
        if damping.factor > LARGEST:
            # No step is short enough.
            return Fit(state, cost, False, done)
    return Fit(state, cost, False, steps)


class _Damping:
    """Levenberg-Marquardt damping: a factor times the largest value so far of each diagonal element.

    With the current element instead, parameters with nearly zero derivatives would not be damped, and all steps would
    be rejected (More, in MINPACK). The factor follows the ratio of the actual to the expected decrease (Nielsen).
    """

    def __init__(self) -> None:
        self.factor, self._growth = 0.0, 2.0
        self._largest: Diagonals | None = None

    @property
    def added(self) -> Diagonals | None:
        """Return the damping of the diagonals, or None without damping."""
        if self._largest is None or self.factor == 0:
            return None
        return Diagonals(*(self.factor * part for part in self._largest))

    def see(self, diagonals: Diagonals) -> None:
        """Update the largest diagonals so far."""
        known = self._largest or diagonals
        self._largest = Diagonals(*(np.maximum(*pair) for pair in zip(known, diagonals, strict=True)))

    def accept(self, ratio: float) -> None:
        """Update the factor after an accepted step, by the ratio of the actual to the expected decrease."""
        self.factor *= 0.1 if ratio > GOOD else min(max(1 / 3, 1 - (2 * ratio - 1) ** 3), 2.0)
        self.factor *= self.factor > LEAST
        self._growth = 2.0

    def reject(self) -> None:
        """Increase the factor after a rejected step, ever faster."""
        self.factor = max(LEAST, self._growth * self.factor)
        self._growth *= 2


def _step(
    equations: NormalEquations, away: np.ndarray, length: float, damped: bool, at_best: bool
) -> tuple[np.ndarray, float]:
    """Return the step (p,) and the expected decrease of the sum of squares.

    Poses that are already optimal for the parameters (`at_best`) contribute no decrease.
    """
    of_poses = 0.0 if equations.y is None or at_best else float(np.vdot(equations.y, equations.y))
    S, b = held(equations.S, length), equations.b
    if damped:
        dp = -np.linalg.solve(S, b)
        return dp, float(-b @ dp) + of_poses
    # The prior brings open directions back to the file; it does not enter b, and what they seem to gain does not count.
    dp = -np.linalg.solve(S, b + (S - equations.S) @ away)
    values, vectors = np.linalg.eigh(equations.S)
    fixed = values > unobservable_below(values, length)
    return dp, float(((vectors.T @ b)[fixed] ** 2 / values[fixed]).sum()) + of_poses


def settled(model: Model, state: State, negligible: float) -> State:
    """Return the state with better poses and the same parameters; each pose has a step length of its own.

    It ends where the decrease of each sample's sum of squares is negligible.
    """
    rows = np.arange(len(state.shift))  # of poses that move
    share, part, found = np.ones(len(rows)), model, State(state.x, *(one.copy() for one in state[1:]))
    for _ in range(MOST_POSE_STEPS):
        dq, expected, before = pose_steps(part, found.only(rows))
        moves = np.flatnonzero(expected > negligible)
        if not moves.size:
            break
        if len(moves) < len(rows):
            rows, share, part, dq, before = rows[moves], share[moves], part.part(moves), dq[moves], before[moves]
        tried = part.moved(found.only(rows), np.zeros_like(state.x), share[:, None] * dq)
        better = part.residuals(tried).of_samples <= before
        share = np.where(better, 1.0, SHORTER * share)
        for whole, own in zip(found[1:], tried[1:], strict=True):
            whole[rows[better]] = own[better]
    return found
