"""Robust margins: the effect of geometric uncertainty on tensions, to first order.

A robot with cable parameters that differ by dp has another wrench matrix. The tensions t of the nominal robot,
A t = w, balance again with the smallest correction

    t + dt      dt = -A^+ dA t = G dp      G = -A^+ d(A t)/dp

So dt is normally distributed with the covariance G Sigma G^T. If each tension t_i keeps the distance k sigma_i from its
limits, t + dt is inside the limits as long as |dt_i| <= k sigma_i. There are two factors k with which this holds for
the fraction P of the robots at all poses simultaneously:

- any poses (`ellipsoid_factor`): the ellipsoid dp^T Sigma^-1 dp <= k^2 contains the fraction P of the robots if k^2 is
  the quantile P of the chi-square distribution with r degrees of freedom, r the rank of Sigma. Inside it
  |g . dp| <= k sqrt(g^T Sigma g) for every g (Scheffe);
- a motion (`motion_factor`): the row of G S of each cable, with S S^T = Sigma, has a direction that moves along a curve
  of length L_i on the unit sphere. Rice's formula bounds the probability that |dt_i| exceeds k sigma_i anywhere by
  2 (1 - Phi(k)) + L_i / pi exp(-k^2 / 2). The sum of these bounds over the cables is 1 - P. This factor is usually half
  of the first one, and never larger than it.

Source: H. Scheffe, Biometrika 40, 1953; S. O. Rice, Bell System Technical Journal 24, 1945; D. Q. Naiman, Annals of
Statistics 14, 1986.
"""

from __future__ import annotations

from copy import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.display import record
from ..base.inputs import InputError, finite_array, real_array, required, shown, whole_number
from ..models.part import LARGEST
from ..models.robot import Robot
from ..models.uncertainty import Uncertainty

__all__ = ["RobotShare", "Spread", "check_share", "ellipsoid_factor", "motion_factor", "share_of_robots", "spread"]

RANK = 1e-9  # of the largest singular value
ROUNDING = 1e-9  # of the force scale, in comparisons of tensions


def check_share(robot: Robot, share: object) -> float:
    """Check and return the fraction of robots for which limits must hold.

    Raises `InputError` if it is not a number above 0 and below 1, or the robot has no uncertainty.
    """
    value = _share("robust", share)
    uncertainty_of(robot)
    return value


def _share(name: str, value: object) -> float:
    if not isinstance(value, float | np.floating) or not 0.0 < value < 1.0:
        raise InputError(f"{name} must be a share of robots above 0 and below 1, such as 0.95, got {shown(value)}")
    return float(value)


def uncertainty_of(robot: Robot) -> Uncertainty:
    """Return the uncertainty of a robot's geometry, or raise InputError if it has none."""
    known = required("robot", robot, Robot).uncertainty
    uncertainty = known and known.geometry
    if uncertainty is None:
        raise InputError(f"robust must be left out if the robot's file has no uncertainty, got robot {robot.name!r}")
    return uncertainty


class Spread:
    """Compute the first-order spread of tensions at n configurations due to geometric uncertainty.

    - `robot`: robot with an uncertainty.
    - `pose`, `carrier_pose`: poses of the platform, (n, 6), and of the carriers, (n, c, 6), in {G} [m, rad].
    - `rows`: wrench rows that the cables balance; default: those of the coordinates that can move.

    Raises `InputError` if an argument has a wrong type or shape, or the robot has no uncertainty or fewer cables than
    rows.
    """

    def __init__(self, robot: Robot, pose: ArrayLike, carrier_pose: ArrayLike, rows: ArrayLike | None = None):
        from ..models.dynamics import dynamics_of
        from ..models.mechanics import derivatives

        uncertainty = uncertainty_of(robot)
        pose, carrier_pose = _places(robot, pose, carrier_pose)
        rows = np.flatnonzero(robot.dof_mask) if rows is None else _indices("rows", rows, 6)
        scale = robot.wrench_scale[rows]
        A = dynamics_of(robot).wrench_matrix(pose, carrier_pose)[:, rows] * scale[:, None]
        D, self._cables = derivatives(robot, pose, carrier_pose, uncertainty.parameters)
        self._D = D[:, rows] * scale[:, None]  # (n, rows, p)
        self._inverse = _inverse(A)  # (n, m, rows)
        self._factor = uncertainty.factor  # (p, r)

    def changes(self, tensions: ArrayLike) -> np.ndarray:
        """Return the change of tensions (n, m) along each direction of `Uncertainty.factor`, (n, m, r) [N]."""
        values = real_array("tensions", tensions)
        if values.shape != self._inverse.shape[:2]:
            raise InputError(f"tensions must be an array of shape {self._inverse.shape[:2]}, got {shown(values)}")
        change = (self._D * values[:, None, self._cables]) @ self._factor  # of A t, (n, rows, r)
        return -self._inverse @ change

    def sigmas(self, tensions: ArrayLike) -> np.ndarray:
        """Return the standard deviations of tensions (n, m), (n, m) [N]."""
        return np.linalg.norm(self.changes(tensions), axis=2)

    def only(self, rows: ArrayLike) -> Spread:
        """Return the same for some configurations, by their indices."""
        rows = _indices("rows", rows, len(self._inverse))
        part = copy(self)
        part._D, part._inverse = self._D[rows], self._inverse[rows]
        return part


def _inverse(A: np.ndarray) -> np.ndarray:
    """Return the minimum-norm inverse of matrices (n, rows, m), (n, m, rows).

    Directions that the cables do not span get huge tensions, not zero as in a pseudo-inverse, because other robots need
    wrenches along them.
    """
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    if A.shape[1] > A.shape[2]:
        raise InputError(f"robust must be left out for {A.shape[2]} cables and {A.shape[1]} wrench rows")
    held = np.maximum(sigma, RANK * np.maximum(sigma[:, :1], np.finfo(float).tiny))
    return (Vt.swapaxes(1, 2) / held[:, None]) @ U.swapaxes(1, 2)


def spread(robot: Robot, pose: ArrayLike, tensions: ArrayLike, carrier_pose: ArrayLike | None = None) -> np.ndarray:
    """Return the first-order standard deviations of tensions due to geometric uncertainty, (n, m) [N].

    Args:
        robot: Robot with an uncertainty.
        pose: Poses of the platform in {G} [m, rad], (n, 6).
        tensions: Tensions of the nominal robot at these poses [N], (n, m).
        carrier_pose: Poses of the carriers, (n, c, 6); default: at home.

    Raises `InputError` if an argument has a wrong type or shape, or the robot has no uncertainty.
    """
    poses, carriers = _places(robot, pose, carrier_pose)
    values = finite_array("tensions", tensions, (len(poses), robot.m))
    return Spread(robot, poses, carriers).sigmas(values)


def ellipsoid_factor(uncertainty: Uncertainty, share: float) -> float:
    """Return the factor k of standard deviations within which a fraction of robots stays at all poses simultaneously.

    Args:
        uncertainty: Uncertainty of a robot.
        share: Fraction of the robots, above 0 and below 1.

    Raises `InputError` if an argument is wrong.
    """
    return _chi(required("uncertainty", uncertainty, Uncertainty).factor.shape[1], _share("share", share))


def motion_factor(changes: ArrayLike, share: float) -> float:
    """Return the factor k within which a fraction of the robots stays along a motion, at all times and for all cables.

    Args:
        changes: Changes of the tensions along each direction of the uncertainty, at dense times in order, (n, m, r)
            [N].
        share: Fraction of the robots, above 0 and below 1.

    Raises `InputError` if an argument has a wrong type, shape or value.
    """
    from scipy.optimize import brentq
    from scipy.special import erfc

    share, changes = _share("share", share), real_array("changes", changes).astype(float)
    if changes.ndim != 3 or 0 in changes.shape[:2] or not (np.abs(changes) <= LARGEST).all():
        accepted = f"an array of shape (n, m, r) of numbers up to {LARGEST:g}"
        raise InputError(f"changes must be {accepted}, got {shown(changes)}")
    sigmas = np.linalg.norm(changes, axis=2, keepdims=True)  # (n, m, 1)
    varied = sigmas > ROUNDING * max(float(sigmas.max()), np.finfo(float).tiny)
    units = np.divide(changes, sigmas, out=np.zeros_like(changes), where=varied)
    flat = units.reshape(-1, units.shape[2])
    rank = int(np.linalg.matrix_rank(flat.T @ flat, tol=RANK * max(len(flat), 1), hermitian=True))
    if rank == 0:
        return 0.0
    curves, length = 0, 0.0
    for cable in range(units.shape[1]):
        curve = units[varied[:, cable, 0], cable]
        curves += bool(len(curve))
        # The chord's angle, exact also where it is small.
        length += float(2 * np.arcsin(np.clip(np.linalg.norm(np.diff(curve, axis=0), axis=1) / 2, 0, 1)).sum())
    most = _chi(rank, share)

    def excess(k: float) -> float:
        return float(curves * erfc(k / np.sqrt(2)) + length / np.pi * np.exp(-(k**2) / 2) - (1 - share))

    root: Any = brentq(excess, 0.0, most) if excess(most) < 0 else most
    return float(root)


def _chi(rank: int, share: float) -> float:
    from scipy.special import gammaincinv

    return float(np.sqrt(2 * gammaincinv(rank / 2, share))) if rank else 0.0


class RobotShare(NamedTuple):
    """Sampled robots, and which of them have tensions inside their limits at all poses.

    Attributes:
        holds: True for each robot that does, (count,).
    """

    holds: np.ndarray

    __repr__ = record

    @property
    def share(self) -> float:
        """Return the fraction of the robots that have tensions inside their limits at all poses."""
        return float(self.holds.mean())


def share_of_robots(
    robot: Robot,
    pose: ArrayLike,
    wrench: ArrayLike,
    carrier_pose: ArrayLike | None = None,
    count: int = 200,
    seed: int = 0,
) -> RobotShare:
    """Sample robots from the uncertainty, and check at poses whether tensions inside the limits give the wrenches.

    This is exact: each robot has its own wrench matrices, and the exact solver decides.

    Args:
        robot: Robot with an uncertainty.
        pose: Poses of the platform in {G} [m, rad], (n, 6).
        wrench: Required wrenches about the CoM in {G} [N, N m], (n, 6).
        carrier_pose: Poses of the carriers, (n, c, 6); default: at home.
        count: Number of robots.
        seed: Seed of the random numbers.

    Raises `InputError` if an argument has a wrong type or shape, or the robot has no uncertainty.
    """
    from ..models.dynamics import Dynamics
    from ..solvers import solve_batch

    poses, carriers = _places(robot, pose, carrier_pose)
    rows = np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows]
    w = finite_array("wrench", wrench, (len(poses), 6))[:, rows] * scale
    holds = np.zeros(whole_number("count", count, 1, 1_000_000), dtype=bool)
    for index, one in enumerate(robot.drawn(count, seed)):
        A = Dynamics(one).wrench_matrix(poses, carriers)[:, rows] * scale[:, None]
        holds[index] = solve_batch(A, w, robot.t_min, robot.t_max).feasible.all()
    return RobotShare(holds)


def _places(robot: Robot, pose: ArrayLike, carrier_pose: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (n, 6) and carriers (n, c, 6) as arrays of finite numbers, or raise InputError."""
    home, poses = required("robot", robot, Robot).carrier_home, finite_array("pose", pose, (-1, 6))
    if carrier_pose is None:
        return poses, np.broadcast_to(home, (len(poses), *home.shape))
    return poses, finite_array("carrier_pose", carrier_pose, (len(poses), *home.shape))


def _indices(name: str, value: ArrayLike, n: int) -> np.ndarray:
    array = real_array(name, value)
    if array.ndim != 1 or array.dtype.kind not in "iu" or not ((array >= 0) & (array < n)).all():
        raise InputError(f"{name} must be an array of indices below {n}, got {shown(array)}")
    return array
