"""Equilibrium posture, the third of paper C's conditions: at a position, an attitude at which the platform rests.

Attitude (roll, pitch, yaw) and tensions are the unknowns of six equations

    S (A(x, theta) t - w) = 0,      S: moments divided by `Robot.length`

solved by Newton's method from the level platform. With three cables there are six unknowns. With more, each step has
least norm, with tensions in units of the weight, and the resulting attitude is checked for tensions inside the limits.
If the drive keeps the cable lengths, the position is unknown too, and l_i(x, theta) = L_i are three more equations.
"""

from typing import Literal

import numpy as np

from ...base.errors import InputError
from ...models import Robot
from ...models.dynamics import dynamics_of
from ..condition import Condition, Places, check_places
from ..feasibility import feasible, rest_wrench

STEPS = 20
STRIDE = 0.5  # [rad], maximum change of an angle in one step
SOLVED = 1e-9  # of the weight, largest residual
AT_ONCE = 4096


class EquilibriumPosture(Condition):
    """At the given position, tensions inside the limits hold the platform at rest in some attitude.

    The attitude of the configuration is ignored. Newton's method searches for one attitude, starting from level. If the
    search fails, the condition is false, which proves nothing. If the robot's drive is fixed-length, the position is
    unknown too, and its search starts from the given one: `postures` returns the resulting pose.
    """

    kind: Literal["equilibrium-posture"] = "equilibrium-posture"

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        pose, tensions = self.postures(robot, places)
        if robot.m <= 3:
            low, high = robot.t_min, robot.t_max
            return np.all((tensions >= low) & (tensions <= high), axis=1)
        held = np.all(np.isfinite(pose), axis=1)
        held[held] = feasible(robot, Places(pose[held], places.carriers[held]), rest_wrench(robot)[None])
        return held

    def postures(self, robot: Robot, places: Places) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (n, 6) at rest and their tensions (n, m) [N], of any sign; nan where Newton did not converge.

        Raises:
            InputError: If the platform cannot turn about all three axes, or has fewer than three cables or no weight.
        """
        check_places(robot, places)
        if robot.drive == "fixed-length" and robot.m > 3:
            raise InputError(
                f"robot must have three cables if their lengths are fixed, got {robot.name!r} with {robot.m}"
            )
        if robot.dof_mask.sum() < 6 or robot.m < 3 or robot.weight == 0:
            raise InputError(
                f"robot must have three cables or more, a weight and all six dof, got {robot.name!r} with {robot.m}, "
                f"{robot.weight:g} N and {', '.join(robot.platform.dof)}"
            )
        pose = places.pose.copy()
        pose[:, 3:] = 0.0
        tensions = np.full((len(places), robot.m), robot.weight / robot.m)
        for start in range(0, len(places), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            _solve(robot, pose[part], tensions[part], places.carriers[part])
        return pose, tensions


def _solve(robot: Robot, pose: np.ndarray, tensions: np.ndarray, carriers: np.ndarray) -> None:
    """Change pose (n, 6) and tensions (n, m) in place to a balance, or to nan."""
    wrench = rest_wrench(robot)
    unknown = slice(3 if robot.fixed_lengths is None else 0, 6)
    turned = 3 - unknown.start
    left = np.arange(len(pose))
    for _ in range(STEPS):
        error, jacobian = _balance(robot, wrench, pose[left], tensions[left], carriers[left])
        good = np.isfinite(error).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2))
        open_ = good & ~(np.abs(error).max(axis=1) <= SOLVED)
        lost = left[~good]
        pose[lost], tensions[lost] = np.nan, np.nan
        left, error, jacobian = left[open_], error[open_], jacobian[open_]
        if not left.size:
            return
        step = -_least_norm(jacobian, error)
        angles = step[:, turned : turned + 3]
        step *= np.minimum(1.0, STRIDE / np.maximum(np.abs(angles).max(axis=1), 1e-300))[:, None]
        pose[left, unknown] += step[:, : turned + 3]
        tensions[left] += robot.weight * step[:, turned + 3 :]
    pose[left], tensions[left] = np.nan, np.nan


def _least_norm(jacobian: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Return x (n, k) of least norm with J x = error, nan where J (n, rows, k) is rank-deficient."""
    if jacobian.shape[1] < jacobian.shape[2]:
        turned = jacobian.transpose(0, 2, 1)
        return (turned @ _least_norm(jacobian @ turned, error)[..., None])[..., 0]
    try:
        return np.linalg.solve(jacobian, error[..., None])[..., 0]
    except np.linalg.LinAlgError:  # one of them is exactly singular
        return np.array([_one(J, e) for J, e in zip(jacobian, error, strict=True)])


def _one(J: np.ndarray, error: np.ndarray) -> np.ndarray:
    try:
        return np.linalg.solve(J, error)
    except np.linalg.LinAlgError:
        return np.full(J.shape[1], np.nan)


def _balance(
    robot: Robot, wrench: np.ndarray, pose: np.ndarray, tensions: np.ndarray, carriers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return residuals (n, k), in units of weight and length, and their Jacobians (n, k, k or more).

    The Jacobian is by (position if lengths are fixed, attitude, tensions in units of the weight).
    """
    dynamics, scale = dynamics_of(robot), robot.wrench_scale / robot.weight
    A = dynamics.wrench_matrix(pose, carriers) * scale[:, None]
    error = np.einsum("nij,nj->ni", A, tensions) - scale * wrench
    by_pose = dynamics.wrench_jacobian(pose, tensions, carriers) * scale[:, None]
    if robot.fixed_lengths is None:
        return error, np.concatenate([by_pose[:, :, 3:], robot.weight * A], axis=2)
    stretch = (dynamics.cable_lengths(pose, carriers) - robot.fixed_lengths) / robot.length
    of_lengths = dynamics.length_jacobian(pose, carriers) / robot.length
    lower = np.concatenate([of_lengths, np.zeros((len(pose), robot.m, robot.m))], axis=2)
    upper = np.concatenate([by_pose, robot.weight * A], axis=2)
    return np.concatenate([error, stretch], axis=1), np.concatenate([upper, lower], axis=1)
