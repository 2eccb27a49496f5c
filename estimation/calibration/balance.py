"""`Balance`: forces and moments on the platform, which cables, weight and inertia balance at each sample.

With the tensions t of the measured ones, of covariance V (large where none were measured), the wrench matrix A with
moments about the platform frame and the wrench w of weight and inertia, the residual is

    r = A t + w        e = L^-1 r        L L' = A V A' + W

with the covariance W of errors of the model. It is least squares over tensions as further unknowns, eliminated sample
by sample: these are t - V A' (L L')^-1 r, and the derivatives of r at them give the exact gradient (variable
projection). r is divided by the mean gain, as forces of zero would fit best otherwise.
"""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...core import columns_by_geometry, lines, wrench_by_axes
from ...models import points
from ...models.robot import Robot
from ..logs.load_cells import unreadable
from ..logs.measurements import Measurements, carriers_of, measured_poses
from .geometry import record_with
from .motion import Motion, motion_of
from .parameters import Parameters

OWN = 2e-3  # of the weight: standard deviation of forces that the model lacks
LASTING = 1.0  # [s] for which these forces, such as drag, hardly change
NOISY = 2.0  # times the stated standard deviations, of the noise that tensions of a motion show
HARDLY = 0.1  # of the mean tension: cables with less hardly pull
LEAST_TENSION = 0.1  # of a cable's mean: relative errors of smaller tensions are not smaller
UNMEASURED = 3.0  # times the weight or the largest mean tension: standard deviation of one that was not measured
MOST_CAPSTAN = 30.0  # of which exp is no overflow


class Balanced(NamedTuple):
    """Residuals (N, 6), and their derivatives by parameters (N, 6, P) and by shift and rotation (N, 6, 6), if wanted.

    Coordinates that are locked have zeros. `tensions` are the most likely ones (N, m) [N], with derivatives if wanted.
    """

    residuals: np.ndarray
    by_parameters: np.ndarray | None = None
    by_pose: np.ndarray | None = None
    tensions: np.ndarray | None = None
    tensions_by_parameters: np.ndarray | None = None  # (N, m, P)
    tensions_by_pose: np.ndarray | None = None  # (N, m, 6)


class FeltTensions(NamedTuple):
    """Tensions that stretch cables, (N, m) [N], with errors along directions of unit variance, (N, m, d) [N]."""

    tensions: np.ndarray
    errors: np.ndarray

    def only(self, rows: np.ndarray | slice) -> FeltTensions:
        """Return the tensions of some samples (k,)."""
        return FeltTensions(*(part[rows] for part in self))


class _Forces(NamedTuple):
    """Forces on the platform at samples: with the names of `Balance.at`."""

    record: np.ndarray
    poses: np.ndarray
    tensions: np.ndarray
    by_tensions: np.ndarray
    A: np.ndarray
    r: np.ndarray
    inner: np.ndarray
    variances: np.ndarray
    inverse_root: np.ndarray | None
    reduced: np.ndarray | None  # residuals in standard deviations
    pull: np.ndarray
    by_arm: np.ndarray
    accelerated: np.ndarray

    @property
    def most_likely(self) -> np.ndarray:
        """Return the tensions that the balance makes most likely [N], (N, m), or as they are if it is not finite."""
        if self.inverse_root is None or self.reduced is None:
            return self.tensions
        behind = (np.swapaxes(self.inverse_root, 1, 2) @ self.reduced[..., None])[..., 0]
        return np.asarray(self.tensions - self.variances * np.einsum("nim,ni->nm", self.inner, behind))


class _Log:
    """Motion and tensions of a whole log, which the balance at any of its samples shares; computed at first use."""

    def __init__(self, robot: Robot, measurements: Measurements):
        self._robot, self._measurements = robot, measurements

    @cached_property
    def motion(self) -> Motion:
        """Return the motion of the log."""
        return motion_of(self._robot, self._measurements)

    @cached_property
    def terms(self) -> tuple[np.ndarray, np.ndarray]:
        """Return what capstan, friction and gain multiply, as measured and smoothed, (3, N, m).

        These are y s, s and y, with tensions y and signs s of the cable speeds.
        """
        y, motion = self._measurements.tensions, self.motion
        if y is None:
            return (np.zeros((3, len(self._measurements), self._robot.m)),) * 2
        terms = np.stack([y * motion.signs, motion.signs, y])
        return terms, terms if motion.smooth is None else motion.smooth.values(terms)

    @cached_property
    def lasting(self) -> float:
        """Return how many samples of a motion share the forces that the model lacks, 1 if tensions were measured.

        The mean of many samples tells no more than if each had an independent error so many times as large (squared).
        """
        times = self._measurements.times
        if self._measurements.tensions is not None or times is None or not self.motion.sigma.any():
            return 1.0
        return max(1.0, 2 * LASTING / float(np.median(np.diff(times))))

    @cached_property
    def lost(self) -> np.ndarray:
        """Return which tensions were not measured, (N, m) of bool."""
        given = self._measurements
        if given.tensions is None:
            return np.ones((len(given), self._robot.m), dtype=bool)
        return unreadable(given.tensions, given.lengths)

    @cached_property
    def variances(self) -> np.ndarray:
        """Return the variances of the felt tensions over the mean gain, (N, m) [N^2], which no parameter changes."""
        given, weight = self._measurements.tensions, self._robot.weight
        if given is None:
            return np.full((len(self._measurements), self._robot.m), (UNMEASURED * weight) ** 2)
        usual = np.abs(given).mean(axis=0)
        size = self._measurements.sigma.tensions * np.maximum(np.abs(self.terms[1][2]), LEAST_TENSION * usual)
        smooth = self.motion.smooth
        if smooth is not None:
            # Noise far above the stated share, as of tensions by thrusts, does not grow with the tension: weights that
            # follow it would prefer samples whose tensions are too small.
            off = 1.4826 * np.median(np.abs(self.terms[0][2] - self.terms[1][2]), axis=0)  # (m,)
            off = off / np.sqrt(1 - min(float(np.median(smooth.share)), 0.5))
            stated = np.median(size, axis=0)
            size = np.where(off > NOISY * stated, stated, size)
        size = np.where(self.lost, UNMEASURED * max(weight, usual.max()), size)
        return size**2 + (1e-9 * max(weight, 1.0)) ** 2


class Balance:
    """The balance of forces on a robot's platform at the samples of a log; measured tensions are at the winches."""

    def __init__(self, robot: Robot, measurements: Measurements):
        self._robot, self._measurements = robot, measurements
        self._log, self._chosen = _Log(robot, measurements), np.arange(len(measurements))
        self._slack = np.zeros((len(measurements), robot.m), dtype=bool)
        self._rows = np.flatnonzero(robot.dof_mask)
        self._scale = robot.wrench_scale[self._rows]

    def only(self, rows: np.ndarray | slice) -> Balance:
        """Return the balance at some samples (k,), with the motion of the whole log."""
        other = copy(self)
        other._chosen = self._chosen[rows]
        return other

    def with_slack(self, slack: np.ndarray) -> Balance:
        """Return the balance of a log without measured tensions, some of whose cables, (N, m) of bool, hardly pull."""
        other = copy(self)
        other._slack = slack
        return other

    @property
    def _carriers(self) -> np.ndarray:
        """Return the poses of the carriers, (N, c, 6) or (c, 6) [m, rad]."""
        poses = carriers_of(self._robot, self._measurements)
        return poses if poses.ndim == 2 else np.ascontiguousarray(poses[self._chosen])

    @property
    def motion_is_known(self) -> bool:
        """Return whether poses show how the platform accelerates, or it is at rest."""
        return self._log.motion.is_known

    @property
    def at_rest(self) -> bool:
        """Return whether the platform is taken to be at rest in all samples."""
        return not self._log.motion.sigma.any()

    @property
    def equations(self) -> np.ndarray:
        """Return the number of equations of each sample beside those that tensions without measurement take, (N,)."""
        return np.maximum(len(self._rows) - (self._log.lost & ~self._slack)[self._chosen].sum(axis=1), 0)

    def tensions(self, table: np.ndarray, smooth: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return the tensions that the platform feels [N], (N, m), with derivatives.

        The derivatives are by capstan, friction, gain and zero, (N, m, 4). `table` is as in `Parameters`, (m, 15).
        """
        moving, signs, y = self._log.terms[int(smooth)][:, self._chosen]
        gain, zero = table[:, 13], table[:, 14]
        moving, y = moving - zero * signs, y - zero
        capstan = np.clip(table[:, 11], -MOST_CAPSTAN, MOST_CAPSTAN)  # a step of the fit may be far too long
        even, odd = np.cosh(capstan), np.sinh(capstan)  # of exp(capstan s), whose s is -1 or 1
        by_gain = even * y + odd * moving
        by_zero = -gain * (even + odd * signs)
        by = np.stack([gain * (odd * y + even * moving), signs, by_gain, by_zero], axis=2)
        return gain * by_gain + table[:, 12] * signs, by

    def _forces(
        self, of: Parameters, x: np.ndarray, placed: tuple[np.ndarray, np.ndarray], clock: float, noise: float
    ) -> _Forces:
        (position, rotation), robot, rows = placed, self._robot, self._rows
        table, m, count = of.table(x), robot.m, len(position)
        mass, com = x[of.clock + 1], x[of.clock + 2 : of.clock + 5]
        record = record_with(robot, table)
        record["com"] = 0.0  # moments about the platform frame
        poses = np.concatenate([position, points.angles(rotation)], axis=1)
        A, lengths = np.empty((count, 6, m)), np.empty((count, m))
        lines(record, poses, self._carriers, lengths, A, None, None, None)
        (tensions, by_tensions), variances = self.tensions(table), noise**2 * self._log.variances[self._chosen]
        motion = self._log.motion.ahead(self._measurements.times, clock, self._chosen)
        if self._measurements.tensions is None:
            slack, usual = self._slack[self._chosen], robot.weight / m
            tensions = np.where(slack, 0.0, tensions + usual)
            variances = np.where(slack, (noise * HARDLY * usual) ** 2, variances)
        arm = rotation @ com
        pull = motion.gravity + (motion.by_arm @ arm[..., None])[..., 0]
        force = mass * pull
        wrench = np.concatenate([force, np.cross(arm, force) - motion.turning], axis=1)
        r = (A @ tensions[..., None])[..., 0] + wrench
        inner = A[:, rows] * self._scale[:, None]
        M = (inner * variances[:, None]) @ np.swapaxes(inner, 1, 2)
        # Forces that the model lacks accelerate the platform, so they are errors of its acceleration, too.
        sigma = np.hypot(motion.sigma, np.sqrt(self._log.lasting) * noise * OWN * np.linalg.norm(robot.gravity))
        # Its errors over the mean gain [N], (N, k), as `variances` are: without it, all forces would grow together.
        heavy = np.where(rows < 3, mass / table[:, 13].mean(), robot.platform.mass)
        accelerated = heavy * sigma[:, None]
        M[:, np.arange(len(rows)), np.arange(len(rows))] += accelerated**2
        finite = np.isfinite(M).all() and np.isfinite(r).all()
        root = np.linalg.inv(np.linalg.cholesky(M)) if finite else None
        reduced = None if root is None else (root @ (r[:, rows] * self._scale)[..., None])[..., 0]
        felt = record, poses, tensions, by_tensions
        return _Forces(*felt, A, r, inner, variances, root, reduced, pull, motion.by_arm, accelerated)

    def masses(
        self, of: Parameters, x: np.ndarray, placed: tuple[np.ndarray, np.ndarray], clock: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the mass that the tensions carry at each sample [kg], (N,), and what friction would add to it, (N, m).

        Friction adds the vertical part of each cable's pull, with the sign of the cable's speed [kg/N]. Arguments as
        for `at`.
        """
        forces = self._forces(of, x, placed, clock, 1.0)
        down = forces.pull / (forces.pull**2).sum(axis=1, keepdims=True)
        masses = x[of.clock + 1] - np.einsum("ni,ni->n", forces.r[:, :3], down)
        return masses, np.einsum("nim,ni->nm", forces.A[:, :3], down) * self._log.terms[0][0, self._chosen]

    def carrying(
        self, of: Parameters, x: np.ndarray, placed: tuple[np.ndarray, np.ndarray], clock: float
    ) -> FeltTensions:
        """Return the tensions by weight and inertia of a platform that `hangs`. Arguments as for `at`.

        Errors of accelerations, which those of poses cause, would make cables seem stiffer unless they are unknowns.
        """
        forces, rows = self._forces(of, x, placed, clock, 1.0), self._rows
        motion, tensions = self._log.motion, forces.most_likely
        if forces.inverse_root is None or self.at_rest:
            return FeltTensions(tensions, np.zeros((*tensions.shape, 0 if self.at_rest else 6)))
        wrench = np.zeros((len(tensions), 6, 6))
        force = (x[of.clock + 1] * motion.sigma[self._chosen])[:, None, None]
        wrench[:, :3, :3] = force * np.eye(3)
        wrench[:, 3:, :3] = force * points.skew(placed[1] @ x[of.clock + 2 : of.clock + 5])
        wrench[:, 3:, 3:] = motion.turning_sigma[self._chosen, None, None] * np.eye(3)
        inner = forces.inverse_root @ forces.inner
        moved = np.swapaxes(inner, 1, 2) @ forces.inverse_root @ (self._scale[:, None] * wrench[:, rows])
        return FeltTensions(tensions, forces.variances[..., None] * moved)

    def smoothed(self, tensions: np.ndarray) -> np.ndarray:
        """Return tensions of the whole log (N, m) [N], smoothed if the platform moves."""
        smooth = self._log.motion.smooth
        return tensions if smooth is None else smooth.values(tensions[None])[0]

    def felt(self, table: np.ndarray, noise: float) -> FeltTensions:
        """Return the measured tensions, smoothed, with errors that make cables seem stiffer unless they are unknowns.

        Corrections by the balance of forces would have the errors of accelerations, which errors of poses cause.
        """
        tensions, _ = self.tensions(table, smooth=True)
        variances, smooth = self._log.variances[self._chosen], self._log.motion.smooth
        variances = variances if smooth is None else variances * smooth.share[self._chosen, None]
        return FeltTensions(tensions, noise * np.sqrt(variances)[..., None] * np.eye(self._robot.m))

    def at(
        self,
        of: Parameters,
        x: np.ndarray,
        placed: tuple[np.ndarray, np.ndarray],
        clock: float = 0.0,
        noise: float = 1.0,
        derive: bool = True,
        carries: bool = False,
    ) -> Balanced:
        """Return the balance at positions (N, 3) and rotations (N, 3, 3) with values x (P,) of parameters.

        The platform's acceleration is that `clock` [s] later. `noise` is a factor of all standard deviations of
        tensions and forces. `carries` tells whether derivatives of the most likely tensions are wanted, of a platform
        that `hangs`.
        """
        robot, rows, scale, rotation = self._robot, self._rows, self._scale, placed[1]
        table, m, count = of.table(x), robot.m, len(rotation)
        of_log = self._forces(of, x, placed, clock, noise)
        inverse_root, A, r = of_log.inverse_root, of_log.A, of_log.r
        if inverse_root is None or of_log.reduced is None:
            return Balanced(np.full((count, 6), np.inf), tensions=np.full((count, m), np.nan))
        gain = float(table[:, 13].mean())
        residuals = np.zeros((count, 6))
        residuals[:, rows] = of_log.reduced / gain
        tensions = of_log.most_likely
        if not derive:
            return Balanced(residuals, tensions=tensions)
        mass, arm = x[of.clock + 1], rotation @ x[of.clock + 2 : of.clock + 5]
        pull, by_arm = of_log.pull, of_log.by_arm
        raw = np.zeros((count, 6, of.count))
        S = np.empty((count, m, 6, 7))
        columns_by_geometry(of_log.record, of_log.poses, self._carriers, S)
        behind = np.zeros((count, 6))  # what multiplies changes of the wrench matrix, (N, 6)
        behind[:, rows] = (np.swapaxes(inverse_root, 1, 2) @ of_log.reduced[..., None])[..., 0] * scale
        bent = np.einsum("nmik,ni->nmk", S, behind)
        S *= tensions[..., None, None]
        felt = np.einsum("nim,nmk->nimk", A, of_log.by_tensions)
        for i in range(m):
            own = i * (of.clock // m)
            raw[..., own : own + 6], raw[..., own + 8] = S[:, i, :, :6], S[:, i, :, 6]
            raw[..., own + 11 : own + 15] = felt[:, :, i]
        raw[..., of.clock + 1] = np.concatenate([pull, np.cross(arm, pull)], axis=1)
        by_com = mass * np.concatenate([by_arm, points.skew(arm) @ by_arm - points.skew(pull)], axis=1)
        raw[..., of.clock + 2 : of.clock + 5] = by_com @ rotation
        by_pose = np.empty((count, 6, 6))
        wrench_by_axes(of_log.record, of_log.poses, self._carriers, np.ascontiguousarray(tensions), by_pose)
        by_pose[..., 3:] -= by_com @ points.skew(arm)
        raw[..., 13 : of.clock : of.clock // m] -= r[..., None] / (gain * m)
        weighted = inverse_root * (scale / gain)

        def reduce(derivatives: np.ndarray) -> np.ndarray:
            result = np.zeros_like(derivatives)
            result[:, rows] = weighted @ derivatives[:, rows]
            return result

        reduced = reduce(raw), reduce(by_pose)
        # Errors of accelerations grow with the mass over the gain. Without their part, a smaller mass would make them
        # smaller.
        of_forces = inverse_root[..., rows < 3]
        growing = (
            np.square(of_log.accelerated[:, rows < 3, None])
            / mass
            * (np.swapaxes(of_forces, 1, 2) @ residuals[:, rows, None])
        )
        growing = of_forces @ growing  # (N, k, 1)
        reduced[0][:, rows, of.clock + 1] -= growing[..., 0]
        reduced[0][:, rows, 13 : of.clock : of.clock // m] += mass / (gain * m) * growing
        if not carries:
            return Balanced(residuals, *reduced, tensions)
        # With the most likely tensions t = s - V A'z, where z = (L L')^-1 r: dt = -V A'(L L')^-1 dr - C dA'z, in which
        # dr is that at t, and C the covariance of t. The errors' growth by the mass counts twice.
        inner, V = inverse_root @ of_log.inner, of_log.variances[..., None]
        tensions_by, by = (-V * (np.swapaxes(inner, 1, 2) @ one[:, rows]) for one in reduced)
        tensions_by[..., of.clock + 1] += (V * (np.swapaxes(inner, 1, 2) @ growing))[..., 0]
        C = V * np.eye(m) - (V * np.swapaxes(inner, 1, 2)) @ (inner * of_log.variances[:, None])
        for i in range(m):
            own = i * (of.clock // m)
            tensions_by[..., own : own + 6] -= C[:, :, i, None] * bent[:, None, i, :6]
            tensions_by[..., own + 8] -= C[:, :, i] * bent[:, None, i, 6]
            turned, unit = np.empty((count, 6, 6)), np.tile(np.eye(m)[i], (count, 1))
            wrench_by_axes(of_log.record, of_log.poses, self._carriers, unit, turned)
            by -= C[:, :, i, None] * (behind[:, None] @ turned)
        return Balanced(residuals, *reduced, tensions, tensions_by, by)


def hangs(robot: Robot, measurements: Measurements) -> bool:
    """Return whether a platform `is_carried` on winches of which some turn: if all are locked, it swings."""
    locked = np.array_equal(measurements.lengths[1:], measurements.lengths[:-1])
    return is_carried(robot, measurements) and not locked


def is_carried(robot: Robot, measurements: Measurements) -> bool:
    """Return whether weight and inertia of a platform determine the tensions of its cables, none of them measured."""
    few = measurements.tensions is None and robot.m <= robot.dof_mask.sum() and robot.weight > 0
    return bool(few and not any(carrier.actuators for carrier in robot.carriers))


def needs_balance(robot: Robot, measurements: Measurements) -> bool:
    """Return whether gravity tells more of unknown poses than lengths do: with tensions, or with few cables."""
    if measurements.directions is not None:  # which tell more, also in motion
        return False
    moves, known = robot.dof_mask > 0, measured_poses(robot, measurements)[2]
    placed = known[:, :3][:, moves[:3]].all(axis=1).mean() > 0.5  # so lengths tell how the platform is turned
    few = robot.m < moves.sum() or (measurements.tensions is not None and not placed)
    return bool(few and robot.weight > 0 and not known[:, moves].all())
