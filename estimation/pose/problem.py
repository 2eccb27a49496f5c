"""A robot's forward kinematics as arrays: what the kernel reads, and the calls of it."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ...models import points
from ...models.robot import Robot
from .estimate import gradient
from .machine import run

__all__ = ["Problem", "problem_of"]

FEW, STEPS = 6, 60  # most steps of a descent; from a start nearby it takes three
ROUNDING = 1e-11  # times the platform's size: a step that is rounding
NEGLIGIBLE = 1e-8  # times the platform's size and the least sigma [m]: a step that is nothing beside the noise
DAMPING = 1e-3  # of a first step from afar
MILD = 3.0  # largest ratio of weights in a descent from afar
OPEN = 1e-6  # of the gradient of the lengths, a singular value that is zero, relative to the largest


class Problem(NamedTuple):
    """The geometry of a robot with its carriers in one place, or in one place for each pose.

    Attributes
    ----------
    geometry
        Anchor in {G}, attachment in the platform frame and swivel axis in {G} of each cable, (N, m, 9) or (1, m, 9).
    radii
        Of the pulleys, (m,) [m].
    free
        1 for coordinates that move, else 0, (6,).
    home
        Pose of the platform to start from, (6,) [m, rad].
    scale
        Length that makes a rotation comparable with a displacement [m].
    freedoms
        How many coordinates move.
    open
        Whether the lengths leave a motion open at home, as parallel cables do, so that gravity decides.
    """

    geometry: np.ndarray
    radii: np.ndarray
    free: np.ndarray
    home: np.ndarray
    scale: float
    freedoms: int
    open: bool

    @property
    def m(self) -> int:
        """Return the number of cables."""
        return len(self.radii)

    def of(self, rows: np.ndarray) -> Problem:
        """Return the problem of some of the poses."""
        return self if len(self.geometry) == 1 else self._replace(geometry=self.geometry[rows])

    def descend(
        self,
        lengths: np.ndarray,
        weights: np.ndarray,
        poses: np.ndarray,
        damping: float,
        free: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the poses nearest to `poses` that fit measured lengths best, the errors there, and where that is so.

        Parameters
        ----------
        lengths
            (N, m) [m].
        weights
            Of each cable's error, (m,).
        poses
            (N, 6), from where to descend.
        damping
            Lambda of the first step: 0 from nearby.
        free
            1 for coordinates that move in this descent; default: all that the platform has.

        Returns
        -------
        Poses (N, 6), weighted errors (N, m) [m], and whether each descent ended at a minimum, (N,).
        """
        moved = np.array(poses, dtype=float, order="C")  # the kernel works in place
        errors, info = np.empty((len(lengths), self.m)), np.empty((len(lengths), 2))
        free = self.free if free is None else free
        smallest = max(ROUNDING, NEGLIGIBLE / weights.max(initial=0.0)) * self.scale
        how = (weights, free, smallest, damping)
        alone = len(lengths) == 1
        self._run(lengths, *how, STEPS if alone else FEW, moved, errors, info)
        if not alone and not info[:, 0].all():
            # The others together: in a vector of many problems all wait for the slowest.
            slow = np.flatnonzero(info[:, 0] == 0.0)
            rest = moved[slow], errors[slow], info[slow]
            self.of(slow)._run(lengths[slow], *how, STEPS, *rest)
            moved[slow], errors[slow], info[slow] = rest
        if self.freedoms < 6 or free is not self.free:
            _keep_locked(moved, poses, free[3:] > 0.0)
        return moved, errors, info[:, 0] > 0.0

    def descend_from_afar(
        self, lengths: np.ndarray, weights: np.ndarray, poses: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what `descend` does, from poses that are not nearby.

        Weights that are far apart make a narrow curved valley, in which a descent stops: it begins with `milder` ones.
        """
        mild = self.milder(weights)
        if (mild < weights).any():
            return self.descend(lengths, weights, self.descend(lengths, mild, poses, DAMPING)[0], 0.0)
        return self.descend(lengths, weights, poses, DAMPING)

    def milder(self, weights: np.ndarray) -> np.ndarray:
        """Return weights, (m,), with none far above those of the cables that are needed to decide the pose."""
        return np.minimum(weights, MILD * np.sort(weights)[max(self.m - self.freedoms, 0)])

    def _run(
        self,
        lengths: np.ndarray,
        weights: np.ndarray,
        free: np.ndarray,
        smallest: float,
        damping: float,
        steps: int,
        poses: np.ndarray,
        errors: np.ndarray,
        info: np.ndarray,
    ) -> None:
        """Call the kernel, which works in place of poses, errors and info."""
        each = 0 if len(self.geometry) == 1 else 9 * self.m
        given = (self.geometry.reshape(-1), each, lengths.reshape(-1), weights, self.radii, free)
        how = (self.scale, smallest, damping, steps, 0, len(lengths))
        run(*given, *how, poses.reshape(-1), errors.reshape(-1), info.reshape(-1))


def problem_of(robot: Robot, carrier_pose: np.ndarray | None = None) -> Problem:
    """Return the problem of a robot with its carriers at home, or at (c, 6) or (N, c, 6)."""
    global _last
    known, problem = _last
    if known is not robot or problem is None:  # the hash of a robot takes a sixth of a call of a stream
        key: Any = robot  # frozen, so it has a hash, unknown to a type checker
        problem = _at_home(key)
        _last = robot, problem
    if carrier_pose is None:
        return problem
    return problem._replace(geometry=_geometry(robot, carrier_pose.reshape(-1, *robot.carrier_home.shape)))


_last: tuple[Robot | None, Problem | None] = (None, None)


@lru_cache(maxsize=16)
def _at_home(robot: Any) -> Problem:
    geometry = _geometry(robot, robot.carrier_home[None])
    J = gradient(robot, robot.home, None)[:, robot.dof_mask > 0.0]
    values = np.linalg.svd(J * robot.wrench_scale[robot.dof_mask > 0.0], compute_uv=False)
    is_open = robot.m < J.shape[1] or bool(values[-1] < OPEN * values[0])
    return Problem(geometry, robot.pulley_radii, robot.dof_mask, robot.home, robot.length, J.shape[1], is_open)


def _keep_locked(poses: np.ndarray, starts: np.ndarray, turning: np.ndarray) -> None:
    """Write the angles that cannot move as they were, in place: the kernel returns any that give the same attitude."""
    if turning[1]:  # beyond a quarter turn roll and yaw would be half turns
        poses[:, 4] = np.arctan2(np.sin(poses[:, 4]), np.cos(poses[:, 4]) * np.cos(poses[:, 5]))
    poses[:, 3:][:, ~turning] = starts[:, 3:][:, ~turning]


def _geometry(robot: Robot, carriers: np.ndarray) -> np.ndarray:
    """Return (N, m, 9) for carriers at (N, c, 6)."""
    turned = points.rotations(carriers[:, robot.carrier_of_cable, 3:])
    parts = [points.anchors(robot, carriers), robot.attachments, np.einsum("nmij,mj->nmi", turned, robot.pulley_axes)]
    shape = (len(carriers), robot.m, 3)
    return np.ascontiguousarray(np.concatenate([np.broadcast_to(part, shape) for part in parts], axis=2))
