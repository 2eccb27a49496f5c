"""`PoseEstimate`: the pose that fits measured cable lengths best, with its uncertainty."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.display import Displayed, Fact, brief
from ...base.text import quantity, quantity_range, quantity_row
from ...core import pose_covariance
from ...models import points
from ...models.dynamics import dynamics_of
from ...models.record import record_of
from ...models.robot import Robot
from .residual_tests import BLOCK, SINGULAR, length_errors, residual_tests, squares_of

FALSE_ALARM = 0.01  # share of sound measurements that count as inconsistent
FALSE_ALARM_IN_LOG = 1e-4  # probability that any sample of a sound log is called wrong
EXACT = 1e-6  # standard deviations: errors where there are as many lengths as coordinates
CHANGED = 1e-6  # share of a motion of unit length
MOST_TURN = np.radians(5.0)  # standard deviation of an angle up to which the geometry is nearly linear
PULL = 0.03  # of the weight: a pose is off by the noise of its lengths, and so are the tensions that hold it
MOST_CURVED = 0.5  # part of a change of lengths that is not linear, two standard deviations away


@dataclass(eq=False)
class PoseEstimate(Displayed):
    """The pose of the platform that fits measured cable lengths best; arrays have the leading dimensions of these.

    Attributes:
        robot: The robot.
        pose: (x, y, z, roll, pitch, yaw) of the platform frame in {G}, (..., 6) [m, rad].
        residuals: Length of each cable at that pose minus its measured length, (..., m) [m].
        converged: True if the search ended at a minimum of the residuals, (...).
        sigma: Standard deviations of the measured lengths, (m,) [m].
        carrier_pose: Poses of the carriers, (c, 6) or (..., c, 6), or None if they are at home.
        ambiguous: True if the search found another pose that may be the true one, (...): it passes the test of
            `consistent` at the 0.01 % level, even if the cables cannot hold it with the file's CoM and load. Always
            False with a start.
        by_gravity: True if the lengths alone do not determine the pose, and gravity fixes it, (...).
        known_covariance: `covariance_of_noise` once it is computed, (..., 6, 6): by the search for a single pose with a
            start and for equilibria, otherwise when it is first asked for; None before.
        by_parameters: Covariance of equilibria due to the `uncertainty` of the robot file, (..., 6, 6), zero for other
            poses; None without any.
    """

    robot: Robot
    pose: np.ndarray
    residuals: np.ndarray
    converged: Any
    sigma: np.ndarray
    carrier_pose: np.ndarray | None
    ambiguous: Any = None
    by_gravity: Any = False
    known_covariance: np.ndarray | None = None
    by_parameters: np.ndarray | None = None

    def _headline(self) -> str:
        shape = self.pose.shape[:-1]
        return f"{self.robot.name}: {f'{quantity(int(np.prod(shape)))} poses' if shape else 'pose'} from cable lengths"

    def _facts(self) -> Iterable[Fact]:
        names = ("converged", "consistent", "determined", "ambiguous", "by_gravity")
        verdicts = {name: np.asarray(getattr(self, name)) for name in names if getattr(self, name) is not None}
        return [
            ("pose", f"({quantity_row(self.pose)}) [m, rad]" if self.pose.ndim == 1 else brief(self.pose)),
            ("residual", quantity_range(1e3 * np.ravel(self.residual), "mm")),
            *((name, quantity(int(of.sum())) if of.ndim else brief(bool(of))) for name, of in verdicts.items()),
        ]

    def reshape(self, batch: tuple[int, ...], carrier_pose: np.ndarray | None) -> None:
        """Replace the leading dimension N by `batch`, and set `carrier_pose`."""
        for name in ("pose", "residuals", "converged", "ambiguous", "by_gravity", "known_covariance", "by_parameters"):
            value = getattr(self, name)
            if not isinstance(value, np.ndarray):
                continue
            if batch:
                shaped = value.reshape((*batch, *value.shape[1:]))
            else:
                shaped = value[0] if value.ndim > 1 else bool(value[0])
            setattr(self, name, shaped)
        self.carrier_pose = carrier_pose
        for name in ("covariance", "conditioned"):  # of the former dimensions
            self.__dict__.pop(name, None)

    @property
    def residual(self) -> Any:
        """Return the root mean square of the residuals, (...) [m]."""
        return np.sqrt(np.mean(np.square(self.residuals), axis=-1))

    @property
    def cost(self) -> Any:
        """Return the sum of squared residuals in standard deviations, (...).

        It is the least one over all poses, with the covariance of the lengths' noise and of the file's `uncertainty`.
        """
        residuals = self.residuals.reshape(-1, self.robot.m)
        squares = squares_of(self.robot, self.pose.reshape(-1, 6), residuals, self.sigma, self._carriers())
        return squares.reshape(self.pose.shape[:-1])[()]

    @property
    def consistent(self) -> Any:
        """Return whether noise of `sigma` and the file's `uncertainty` explain residuals (chi-square test at 1 %).

        With no more cables than coordinates nearly all lengths fit some pose, and the test is meaningless. It is not
        applied where gravity fixes the pose (`by_gravity`).
        """
        fits = self.cost <= largest_cost(self.robot.m - int(self.robot.dof_mask.sum()))
        return self.converged & (fits | self.by_gravity)

    @cached_property
    def covariance(self) -> np.ndarray:
        """Return the covariance of x, y, z and a small rotation in {G}, (..., 6, 6) [m^2, m rad, rad^2].

        It is zero for coordinates that cannot move, and infinite for those that an undetermined motion changes. It
        includes the `uncertainty` of the robot file.
        """
        own = self.covariance_of_noise
        if self.by_parameters is not None:
            own = own + self.by_parameters
        if self.robot.uncertainty is None:
            return own
        lengths_alone = ~np.asarray(self.by_gravity, dtype=bool) & np.isfinite(own).all(axis=(-2, -1))
        if not lengths_alone.any():
            return own
        pose, measured = self.pose.reshape(-1, 6), self._lengths_at(self.pose) - self.residuals
        measured = measured.reshape(-1, self.robot.m)
        noise = np.where(lengths_alone[..., None, None], own, 0.0).reshape(-1, 6, 6)
        carriers, added = self._carriers(), np.empty_like(noise)
        for first in range(0, len(pose), BLOCK):
            rows = slice(first, first + BLOCK)
            at = carriers if carriers.ndim == 2 else carriers[rows]
            L, J = length_errors(self.robot, pose[rows], measured[rows], at)
            by_file = noise[rows] @ np.swapaxes(J / self.sigma[:, None] ** 2, 1, 2) @ L  # (n, 6, p), least squares
            added[rows] = by_file @ self.robot.uncertainty.matrix @ np.swapaxes(by_file, 1, 2)
        return own + added.reshape(own.shape)

    @property
    def covariance_of_noise(self) -> np.ndarray:
        """Return the part of the covariance that is due to the noise of the lengths, (..., 6, 6)."""
        if self.known_covariance is None:
            self.known_covariance = self._covariance_of_noise()
        return self.known_covariance

    def _covariance_of_noise(self) -> np.ndarray:
        covariances = np.empty((*self.pose.shape[:-1], 6, 6))
        poses = np.ascontiguousarray(self.pose)
        pose_covariance(record_of(self.robot), self._carriers(), 1.0 / self.sigma, poses, covariances)
        partly = np.isinf(covariances).any(axis=(-2, -1))
        if partly.any():
            units = np.repeat([1.0, self.robot.length], 3)
            J = self._weighted_gradient()[partly] / units
            inverse = np.linalg.pinv(J, rcond=SINGULAR)  # (..., 6, m)
            open_ = np.diag(self.robot.dof_mask) - inverse @ J
            known = inverse @ np.swapaxes(inverse, -1, -2) / np.outer(units, units)
            covariances[partly] = unbounded(known, open_)
        return covariances

    @property
    def sigmas(self) -> np.ndarray:
        """Return the standard deviations of x, y, z and a small rotation in {G}, (..., 6) [m, rad]."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))

    @property
    def determined(self) -> Any:
        """Return whether the lengths determine the pose, or lengths and gravity if `by_gravity`, (...)."""
        return np.isfinite(self.covariance).all(axis=(-2, -1))

    @cached_property
    def conditioned(self) -> Any:
        """Return whether the covariance can be trusted, (...): the lengths are nearly linear about the pose.

        It is False if the standard deviation of an angle due to noise exceeds 5 degrees, or if, two standard deviations
        away along any principal axis of the covariance, half of the change of the lengths is nonlinear.
        """
        covariance = self.covariance_of_noise
        finite = np.asarray(np.isfinite(covariance).all(axis=(-2, -1)))
        believed = np.where(finite[..., None, None], covariance, 0.0)
        values, axes = np.linalg.eigh(believed)
        steps = 2.0 * np.swapaxes(axes * np.sqrt(np.maximum(values, 0.0))[..., None, :], -1, -2)  # (..., 6, 6), rows
        linear = np.einsum("...cj,...kj->...kc", self._weighted_gradient(), steps)
        lengths = self._lengths_at(self.pose)[..., None, :]
        change = (self._lengths_at(points.moved(self.pose[..., None, :], steps)) - lengths) / self.sigma
        curved = np.linalg.norm(change - linear, axis=-1) > MOST_CURVED * np.linalg.norm(linear, axis=-1)
        some = np.linalg.norm(linear, axis=-1) > 1e-6  # none for coordinates that cannot move
        small = np.sqrt(np.linalg.eigvalsh(believed[..., 3:, 3:]).max(axis=-1)) <= MOST_TURN
        return finite & small & ~(curved & some).any(axis=-1)

    @property
    def taut(self) -> Any:
        """Return whether tensions of at least zero can hold the weight at rest at the pose, (...)."""
        held = taut(self.robot, self.pose.reshape(-1, 6), self._carriers())
        return held.reshape(self.pose.shape[:-1]) if self.pose.ndim > 1 else bool(held[0])

    def suspects(self) -> np.ndarray:
        """Return residuals over their standard deviations, (..., m); the largest marks the most likely wrong reading.

        It is 0 for a cable without redundancy. The lengths are linearised, so a large error may mark another cable.
        """
        pose, residuals = self.pose.reshape(-1, 6), self.residuals.reshape(-1, self.robot.m)
        statistics = residual_tests(self.robot, pose, residuals, self.sigma, self._carriers())[1]
        return statistics.reshape(self.residuals.shape)

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate as plain numbers, for JSON."""
        names = ("pose", "residual", "residuals", "converged", "consistent", "conditioned", "determined", "by_gravity")
        plain = {name: np.asarray(getattr(self, name)).tolist() for name in names}
        finite = np.where(np.isfinite(self.covariance), self.covariance, np.nan).astype(object)
        finite[finite != finite] = None  # JSON has no infinity
        return plain | {"covariance": finite.tolist(), "ambiguous": np.asarray(self.ambiguous).tolist()}

    def _carriers(self) -> np.ndarray:
        """Return the poses of the carriers, (c, 6), or (N, c, 6) for N poses."""
        carriers = self.robot.carrier_home if self.carrier_pose is None else self.carrier_pose
        if carriers.ndim > 2:
            carriers = np.broadcast_to(carriers, (*self.pose.shape[:-1], *carriers.shape[-2:]))
            carriers = carriers.reshape(-1, *carriers.shape[-2:])
        return np.ascontiguousarray(carriers)

    def _weighted_gradient(self) -> np.ndarray:
        return gradient(self.robot, self.pose, self.carrier_pose) / self.sigma[:, None]

    def _lengths_at(self, pose: np.ndarray) -> np.ndarray:
        carriers = self.carrier_pose
        if carriers is not None and carriers.ndim > 2:
            carriers = carriers.reshape(*carriers.shape[:-2], *[1] * (pose.ndim - self.pose.ndim), *carriers.shape[-2:])
        return dynamics_of(self.robot).cable_lengths(pose, carriers)


def unbounded(covariance: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Return covariances (..., 6, 6) that are infinite for coordinates that undetermined motions (..., 6, k) change."""
    changed = np.asarray((np.abs(motions) > CHANGED).any(axis=-1))
    return np.where(changed[..., :, None] | changed[..., None, :], np.inf, covariance)


def largest_cost(redundancy: int, false_alarm: float = FALSE_ALARM) -> float:
    """Return the quantile of the sum of squared errors, in standard deviations, for a fraction of measurements."""
    if redundancy <= 0:
        return EXACT**2
    from scipy.special import chdtri

    return float(chdtri(redundancy, false_alarm))


def gradient(robot: Robot, pose: np.ndarray, carrier_pose: np.ndarray | None) -> np.ndarray:
    """Return d lengths / d (x, y, z, small rotation in {G} about the platform frame), (..., m, 6).

    The pull of a cable on the platform is -dl/dx for each newton, so this is -A^T with the moments taken about the
    platform frame; columns of coordinates that cannot move are zero.
    """
    A = dynamics_of(robot).wrench_matrix(pose, carrier_pose)  # (..., 6, m), moments about the CoM
    arm = np.einsum("...ij,j->...i", points.rotations(pose[..., 3:]), np.array(robot.platform.com))
    moments = A[..., 3:, :] + np.cross(arm[..., :, None], A[..., :3, :], axis=-2)
    return -np.swapaxes(np.concatenate([A[..., :3, :], moments], axis=-2) * robot.dof_mask[:, None], -1, -2)


def taut(robot: Robot, poses: np.ndarray, carrier_pose: np.ndarray | None) -> np.ndarray:
    """Return whether non-negative tensions hold the weight at rest, (N,), at poses (N, 6): measured cables are taut."""
    if robot.weight == 0.0:
        return np.ones(len(poses), bool)
    dynamics, still = dynamics_of(robot), np.zeros(6)
    rows = np.flatnonzero(robot.dof_mask)
    A = (dynamics.wrench_matrix(poses, carrier_pose) * robot.wrench_scale[:, None])[:, rows]
    w = (dynamics.required_wrench(poses, still, still) * robot.wrench_scale)[:, rows]
    if robot.m == len(rows):
        regular = np.abs(np.linalg.det(A)) > 1e-12
        tensions = np.linalg.solve(np.where(regular[:, None, None], A, np.eye(robot.m)), w[..., None])[..., 0]
        return regular & (tensions >= -PULL * robot.weight).all(axis=1)
    from scipy.optimize import nnls

    missing = [nnls(*balance)[1] for balance in zip(A, w, strict=True)]
    return np.array(missing) <= PULL * robot.weight
