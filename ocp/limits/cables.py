"""Limits of cables and winches, and of the lowest natural frequency of the platform on elastic cables.

All frequencies are at least f if and only if K - (2 pi f)^2 M has no negative pivot, where K is the stiffness and M the
inertia of the coordinates that move. Pivots have derivatives where two frequencies are equal, too, so they are the rows
of the program. The audit computes the frequencies themselves.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Self

import casadi as ca
import numpy as np
from typing_extensions import override

from ...models import Robot, kinematics
from ...models.elasticity import cable_stiffness, frequency, tension_stiffness
from ...models.rotation import rotation
from .clearance import between_cables
from .distance import Distance, Pair
from .limit import Limit, Rate, Rows
from .state import State

SMALLEST = 1e-3  # [m], of the scale of a length
LEAST_PIVOT = 1e-3  # relative: rows are divided by a pivot, or by this if it is less


def names(robot: Robot) -> tuple[str, ...]:
    """Return what texts call the cables, (m,)."""
    return tuple(f"cable {i + 1}" for i in range(robot.m))


class EachCable(Limit):
    """Limit the size of a value, of either sign, of some cables, by their indices; default: of all."""

    def __init__(self, robot: Robot, most: float, cables: Sequence[int] | None = None):
        self.low, self.high, self.scale = -most, most, most
        self.cables = list(range(robot.m) if cables is None else cables)
        self.labels = tuple(names(robot)[cable] for cable in self.cables)

    @classmethod
    def each(cls, robot: Robot, bounds: Sequence[float | None]) -> Iterator[Self]:
        """Yield a limit for each different bound of the cables, (m,), which may be missing."""
        for most in dict.fromkeys(bounds):
            if most is not None:
                yield cls(robot, most, [cable for cable, its in enumerate(bounds) if its == most])


class CableSpeed(EachCable):
    """Limit the rate of the length of some cables, that is, the speed of their winches."""

    name, unit = "cable_speed", "m/s"

    @override
    def values(self, state: State) -> ca.SX:
        return state.cable_speeds[self.cables]


class CableAcceleration(EachCable):
    """Limit the second derivative of each cable's length, that is, the acceleration of its winch."""

    name, unit = "cable_acceleration", "m/s^2"

    @override
    def values(self, state: State) -> ca.SX:
        return state.cable_accelerations[self.cables]


class CableJerk(CableAcceleration, Rate):
    """Limit the third derivative of each cable's length, that is, the jerk of its winch."""

    name, unit = "cable_jerk", "m/s^3"


class WinchPower(EachCable):
    """Limit the mechanical power of each winch, the tension times the rate of the length, in both directions."""

    name, unit = "winch_power", "W"

    @override
    def values(self, state: State) -> ca.SX:
        return state.tensions * state.cable_speeds


class WinchForce(EachCable):
    """Limit the force of each winch's motor, without friction: the tension less inertia times cable acceleration.

    The bound is what friction leaves of the motor's force when the winch hauls in, also while it pays out: to correct
    an error it must be able to do either.
    """

    name, unit = "winch_force", "N"

    @override
    def values(self, state: State) -> ca.SX:
        inertia = ca.DM([winch.inertia if (winch := cable.winch) else 0.0 for cable in state.robot.cables])
        return (state.tensions - inertia * state.cable_accelerations)[self.cables]


class CableLength(Limit):
    """Limit the length of each cable."""

    name, unit = "cable_length", "m"

    def __init__(self, robot: Robot, low: float, high: float):
        self.low, self.high, self.scale = low, high, max(abs(low), abs(high), SMALLEST)
        self.labels = names(robot)

    @override
    def values(self, state: State) -> ca.SX:
        return state.run.lengths


class CableClearance(Distance):
    """Keep cables apart that share neither anchor nor attachment."""

    name, per_metre = "cable_clearance", 2.0

    def __init__(self, robot: Robot, least: float):
        self.low, self.scale = least, least
        self._pairs = [pair for pair in combinations(range(robot.m), 2) if not _share_an_end(robot, *pair)]
        self.labels = tuple(f"cables {i + 1} and {j + 1}" for i, j in self._pairs)

    @override
    def pairs(self, state: State) -> list[Pair]:
        cables = [ca.horzcat(state.attachments[:, i], state.anchors[:, i]) for i in range(state.robot.m)]
        return [Pair(cables[i], cables[j]) for i, j in self._pairs]

    @override
    def apart(self, pair: Pair) -> ca.SX:
        return between_cables(*ca.horzsplit(pair.points), *ca.horzsplit(pair.others))


def _share_an_end(robot: Robot, i: int, j: int) -> bool:
    of_carrier = robot.carrier_of_cable
    same_anchor = of_carrier[i] == of_carrier[j] and np.array_equal(robot.anchors[i], robot.anchors[j])
    return same_anchor or np.array_equal(robot.attachments[i], robot.attachments[j])


class Margin(Limit):
    """Keep each tension inside its limits by a margin. Only soft: a hard margin bounds the tensions themselves."""

    name, unit = "margin", "N"

    def __init__(self, robot: Robot, least: float):
        self.low, self.scale = least, robot.force_scale
        self.labels = names(robot) * 2

    @override
    def values(self, state: State) -> ca.SX:
        low, high = ca.DM(state.robot.t_min), ca.DM(state.robot.t_max)
        return ca.vertcat(state.tensions - low, high - state.tensions)


class TensionRate(EachCable, Rate):
    """Limit the rate of each tension."""

    name, unit = "tension_rate", "N/s"

    @override
    def values(self, state: State) -> ca.SX:
        return state.tensions


class NaturalFrequency(Limit):
    """Keep the natural frequencies of small motions, with fixed unstrained lengths, above a bound [Hz]."""

    name, unit = "natural_frequency", "Hz"

    def __init__(self, robot: Robot, least: float):
        self.low = self.scale = least
        self._moves = np.flatnonzero(robot.dof_mask).tolist()

    @override
    def values(self, state: State) -> ca.SX:
        """Return the entries of the stiffness and then of the inertia about the CoM, (2 k^2, 1)."""
        robot, pose, t = state.robot, state.platform.pose, state.tensions
        axes = kinematics.axes(robot, state.carrier_poses)
        A = kinematics.wrench_matrix(robot, pose, state.run.directions)
        K = tension_stiffness(robot, pose, state.anchors, axes, t) + cable_stiffness(robot, A, state.run.lengths, t)
        R = rotation(pose[3:6])
        M = ca.diagcat(robot.platform.mass * ca.SX.eye(3), R @ ca.DM(robot.inertia) @ R.T)
        parts = ((K + K.T) / 2, M)
        return ca.vertcat(*(ca.vec(ca.densify(part[self._moves, self._moves])) for part in parts))

    @override
    def rows(self, values: ca.SX, shrink: float = 0.0) -> Rows:
        k = len(self._moves)
        K, M = (ca.reshape(part, k, k) for part in ca.vertsplit(values, k * k))
        size = ca.diag(1.0 / ca.sqrt(ca.diag(M)))
        Y = size @ (K / (2 * np.pi * self.low) ** 2 - M) @ size
        pivots = []
        for k in range(Y.shape[0]):
            pivots.append(Y[k, k])
            below = Y[k + 1 :, k]
            Y[k + 1 :, k + 1 :] -= below @ below.T / ca.fmax(Y[k, k], LEAST_PIVOT)
        # The least pivot is no less than the least eigenvalue, (frequency / bound)^2 - 1.
        return Rows(ca.vertcat(*pivots), 2.0 * shrink, np.inf)

    @override
    def over(self, times: np.ndarray, values: np.ndarray) -> np.ndarray:
        k = len(self._moves)
        K, M = values.reshape(len(values), 2, k, k).swapaxes(0, 1)
        finite = np.isfinite(K).all(axis=(1, 2))
        known, found = finite & (M[:, 0, 0] > 0), np.where(finite, 0.0, np.nan)[:, None]
        C = np.linalg.inv(np.linalg.cholesky(M[known]))
        found[known] = frequency(np.linalg.eigvalsh(C @ K[known] @ C.swapaxes(1, 2))[:, :1])
        return found

    @property
    @override
    def slack_weight(self) -> float:
        # A pivot is about 1 - (bound / frequency)^2, whose slope at the bound is 2 / bound.
        return 0.0 if self.soft is None else self.low / 2 / self.soft
