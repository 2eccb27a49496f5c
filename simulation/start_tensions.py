"""`StartTensions`: the tensions and rates of elongation of cables with which the windows of a replay start."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..estimation.logs.recorded import Recorded
from ..estimation.logs.smoothing import Polynomials, widest_parabola
from ..models.robot import Robot
from .replayed_robot import Parameters, cells_of, changed

SLOW = 0.01  # [m/s] of a cable, below which friction is less than its value at higher speeds
SOON = 0.01  # [s], over which commanded forces change evenly
AGES = 12  # of earlier tensions


class StartTensions:
    """Tensions, and rates of elongation, at the starts of W windows.

    - `robot`: the robot of the plant.
    - `recorded`: the recording.
    - `starts`: times of the starts, (W,) [s].
    - `lengths`: distances along the cables, (W, m) [m].
    - `balance`: wrench matrices (W, 6, m) and required wrenches (W, 6).
    - `forces`: commanded forces of the winches' motors (W, m) [N] at some times (W,) [s], or None if these do not drive
      the plant.
    - `usual`: usual tension [N].
    - `stretching`: rates of elongation, (W, m) [m/s], as far as recorded tensions or forces show them.
    """

    def __init__(
        self,
        robot: Robot,
        recorded: Recorded,
        starts: np.ndarray,
        lengths: np.ndarray,
        balance: tuple[np.ndarray, np.ndarray],
        forces: Callable[[np.ndarray], np.ndarray] | None,
        usual: float,
    ):
        self._robot, self._starts, self._balance, self._forces, self._usual = robot, starts, balance, forces, usual
        self._pull = self._speeds = None
        rate: Any = np.zeros(lengths.shape)

        EA, C = (
            np.array(each) for each in zip(*((one.stiffness, one.damping or 0.0) for one in robot.cables), strict=True)
        )
        decay = C / EA * lengths  # (W, m) [s]

        def smoothed(values: np.ndarray) -> tuple[np.ndarray, ...]:
            even = Polynomials(recorded.times, widest_parabola(recorded.times, values)).fitted(values)[:3]
            return tuple(np.stack([np.interp(starts, recorded.times, one) for one in part.T], axis=1) for part in even)

        if recorded.tensions is not None:
            pull, rate, _ = smoothed(recorded.tensions)
            self._pull = pull.clip(0.0)
            # e + decay e' = tension: e is the mean of earlier tensions with weights that fall exponentially.
            ages, weights = np.polynomial.laguerre.laggauss(AGES)
            before = starts[:, None, None] - decay[..., None] * ages  # (W, m, k)
            each = [np.interp(before[:, i], recorded.times, one) for i, one in enumerate(recorded.tensions.T)]
            self._damping = self._pull - (np.stack(each, axis=1) @ weights).clip(0.0)
        elif recorded.lengths is not None and forces is not None:
            _, self._speeds, self._accelerations = smoothed(recorded.lengths)
            rate = (forces(starts + SOON) - forces(starts - SOON)) / (2 * SOON)
            self._damping = decay * rate
        self.stretching = rate * lengths / EA

    def elastic(self, with_: Parameters) -> np.ndarray:
        """Return the tensions of the cables' elongations, without damping, (W, m) [N].

        Without recorded tensions, they are what winches whose forces and motion are known must feel, or else those
        nearest to a tenth of their range that balance the motion.
        """
        robot, (A, wrench) = self._robot, self._balance
        if self._pull is not None:
            gains, zeros = cells_of(with_, self._usual)
            return ((self._pull - zeros - self._damping / with_.stiffness) / gains).clip(0.0)
        if self._forces is not None and self._speeds is not None:
            inertia = np.array([cable.winch.inertia for cable in robot.cables if cable.winch])
            friction = (with_.friction + np.array(with_.cable_friction)) * np.tanh(self._speeds / SLOW)
            felt = self._forces(self._starts - with_.delay) + friction + inertia * self._accelerations
            return (felt - self._damping / with_.stiffness).clip(0.0)
        usual = np.minimum(robot.t_min + 0.1 * (robot.t_max - robot.t_min), 2 * robot.force_scale)
        scale = robot.wrench_scale * (robot.dof_mask > 0)
        missing = scale * (wrench * with_.mass - A @ usual)
        turned = np.array(changed(robot, with_).gravity) - robot.gravity
        missing[..., :3] -= scale[:3] * with_.mass * robot.platform.mass * turned
        return (usual + (np.linalg.pinv(scale[:, None] * A, rcond=1e-6) @ missing[..., None])[..., 0]).clip(0.0)
