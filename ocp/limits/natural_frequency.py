"""`NaturalFrequency`: a limit of the lowest natural frequency of the platform on its elastic cables.

All frequencies are at least f if and only if K - (2 pi f)^2 M has no negative pivot, where K is the stiffness and M the
inertia of the coordinates that move. Pivots have derivatives where two frequencies are equal, too, so they are the rows
of the program. The audit computes the frequencies themselves.
"""

import casadi as ca
import numpy as np
from typing_extensions import override

from ...models import Robot, kinematics
from ...models.elasticity import cable_stiffness, frequency, tension_stiffness
from ...models.rotation import rotation
from .limit import Limit, Rows
from .state import State

LEAST_PIVOT = 1e-3  # relative: rows are divided by a pivot, or by this if it is less


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
