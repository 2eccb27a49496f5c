"""`LengthGains`: the largest gains of length corrections by a measured pose with which no oscillation grows."""

from typing import Any

import numpy as np
from scipy.linalg import expm

from ..models.dynamics import dynamics_of
from ..models.elasticity import whitening
from ..models.robot import Robot
from ..statics.distribution import tensions as tensions_at
from .noise import Noise

USUAL = 4.0, 10.0  # P, and I [1/s]: the largest
UNYIELDING, LATE = (0.3, 2.0), 0.02  # P and I for cables that do not stretch, up to this delay [s]
LEAST = 1e-3  # of the usual gains; smaller ones are replaced by 0
SLOW = 0.01  # [1/s]: accepted growth, which rounding or motions that no cable damps may cause
MARGIN = 1.25  # factor by which gains stay below those at which oscillations no longer decay
TRUE = 0.5, 0.8, 1.0, 1.25  # stiffness and damping of the cables, in terms of the assumed ones, also with slack ones
PARTS = 4  # of a delay in the model, each an all-pass of first order; their phase is exact to 0.1 rad up to 3 rad
FINER = 1.25  # ratio of the delays for which gains are computed
SHORTEST = 1e-4  # [s]
STEP = 1e-3  # [s]: in which a length changes, and a damper pulls
RIPPLE = 0.01  # standard deviation of tensions by noise of the pose, in terms of their range


class LengthGains:
    """Gains P and I of lengths that are corrected by J (P e + I * integral of e), with a pose of an age h.

    Elastic cables pull with E A times their strain, and C times its rate. Deviations x from home, their sum z over the
    periods T, and the correction u obey

        x'' = -G x - E (x + u) - D (x' + u'),   u(t + T) = P y + I z,   z(t + T) = z + T y,   y = x(t - h)

    per unit of mass, with a constant u' in each period, where G is the stiffness due to constant tensions, E that due
    to elasticity, and D the damping. P is at most 4 and I at most 10/s; each is halved until no oscillation grows, with
    a margin of 25 % and with cables that are 25 % stiffer, or half as stiff, as while some are slack. A late pose, a
    long period, little damping or a platform that turns slowly, since its attachments are close to each other, need
    small gains; cables without damping permit none.

    Args:
        robot: The robot.
        stiffness, damping: E A [N] and C [N s/m] of the cables, (m,); infinite stiffness: cables that do not stretch.
        lag: Time constant of the winches [s]; the velocity is used to correct lengths earlier by this time.
        sensors: Errors of the sensors: P is so small that their noise changes tensions by at most 1 % of their range.
    """

    def __init__(self, robot: Robot, stiffness: np.ndarray, damping: np.ndarray, lag: float, sensors: Noise | None):
        self._elastic = bool(np.isfinite(stiffness).all())
        self._known: dict[tuple[int, int], tuple[float, float]] = {}
        self._most = USUAL[0]
        if not self._elastic:
            return
        dynamics, home, rows = dynamics_of(robot), robot.home, np.flatnonzero(robot.dof_mask)
        pulls = np.asarray(tensions_at(robot, home, method="soft-wrench").tensions)
        W, springs = whitening(robot, home), stiffness / dynamics.cable_lengths(home)
        A = W @ dynamics.wrench_matrix(home)[rows]
        self._G = W @ dynamics.stiffness(home, pulls, elastic=False)[np.ix_(rows, rows)] @ W.T
        self._E, self._D = ((A * (pulls > 0) * each) @ A.T for each in (springs, damping))
        if sensors is not None:
            spread = np.repeat(np.hypot(sensors.of_pose, lag * np.array([sensors.velocity, sensors.attitude_rate])), 3)
            stretch = np.linalg.norm(dynamics.length_jacobian(home) * (spread * robot.dof_mask), axis=1)  # (m,) [m]
            noise = stretch * np.hypot(springs, damping * np.sqrt(2) / STEP)  # [N]
            self._most = min(self._most, float((RIPPLE * (robot.t_max - robot.t_min) / np.maximum(noise, 1e-9)).min()))

    def at(self, period: float, age: float) -> tuple[float, float]:
        """Return P and I [1/s] for steps of a period and a pose of an age [s]."""
        if not self._elastic:
            share = min(1.0, LATE / (period + age))
            return UNYIELDING[0] * share, UNYIELDING[1] * share
        steps = [max(0, int(np.ceil(np.log(max(one, SHORTEST) / SHORTEST) / np.log(FINER)))) for one in (period, age)]
        key = steps[0], steps[1] if age > 0 else -1
        if key not in self._known:
            period, age = (SHORTEST * FINER**step * (step >= 0) for step in key)
            P = _largest(self._most, USUAL[0], lambda gain: self._grows(period, age, gain, 0.0))
            self._known[key] = P, _largest(USUAL[1], USUAL[1], lambda gain: self._grows(period, age, P, gain))
        return self._known[key]

    def _grows(self, period: float, age: float, proportional: float, integral: float) -> bool:
        """Return whether an oscillation grows with larger gains, and with softer or stiffer cables."""
        gains = MARGIN * proportional, MARGIN * integral
        return any(self._growth(period, age, *gains, true) > SLOW for true in TRUE)

    def _growth(self, period: float, age: float, proportional: float, integral: float, true: float) -> float:
        """Return how fast the fastest oscillation grows [1/s], from the exact linear map of a period.

        Its states are x, x', u, the states q of the delay, and z. Each part of the delay turns its input y into
        2 q - y, with q' = a (y - q).
        """
        n, parts = len(self._G), PARTS * (age > 0)
        x, v, u, *q, last = np.eye((4 + parts) * n).reshape(4 + parts, n, -1)  # last: u' in a period, or z before it
        y, changes = x, []
        for state in q:
            changes.append(2 * PARTS / age * (y - state))
            y = 2 * state - y
        falls = -self._G @ x - true * (self._E @ (x + u) + self._D @ (v + last))
        moved = expm(period * np.vstack([v, falls, last, *changes, 0 * last]))
        total = last + period * y
        slope = (proportional * y + integral * total - u) / period
        step = np.vstack([(moved @ np.vstack([x, v, u, *q, slope]))[:-n], total])
        return float(np.log(np.abs(np.linalg.eigvals(step)).max()) / period)


def _largest(first: float, usual: float, grows: Any) -> float:
    """Return the largest of `first` and its halves with which nothing grows, or 0."""
    gain = first
    while gain > LEAST * usual and grows(gain):
        gain /= 2
    return gain if gain > LEAST * usual else 0.0
