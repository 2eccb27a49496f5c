r"""How the wrench matrix depends on the places of the cables: the matrix and its derivatives, in NumPy alone.

The column of a cable is (u, r x u): u is the unit vector in which it pulls, r its attachment relative to the CoM. With
t = -u, and with e, k, theta and s of `cables.pulley`, a change of the attachment B, of the anchor A or of the radius
changes t by

    dt = T dB      dt = -T dA      dt = (1 - cos(theta)) / s  n dr

    T = n n^T / s + sin(theta) / rho  f f^T      n = cos(theta) e - sin(theta) k      f = k x e

where rho is the distance of B from the swivel axis: the straight part of length s turns about the sheave, and the
sheave about its axis. At a point anchor T = (1 - t t^T) / s. B moves r as well.

Source: derived here; a test compares it with algorithmic differentiation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from . import points
from .cables.sheaves import sheaves
from .parameters import locate
from .robot import Robot

__all__ = ["Columns", "columns", "derivatives", "wrench_matrices"]


class Columns(NamedTuple):
    """The cables at n poses in {G}, as far as the wrench matrix and its derivatives need them.

    Attributes
    ----------
    directions, arms
        The unit vectors u and the attachments relative to the CoM r [m], (n, m, 3).
    turning
        T, the derivative of -u by the attachment [1/m], (n, m, 3, 3).
    by_radius
        The derivative of -u by the radius of the pulley [1/m], (n, m, 3); zero for a point anchor.
    """

    directions: np.ndarray
    arms: np.ndarray
    turning: np.ndarray
    by_radius: np.ndarray


def wrench_matrices(robot: Robot, pose: np.ndarray, carrier_pose: np.ndarray) -> np.ndarray:
    """Return the wrench matrices at poses (n, 6) with carriers (n, c, 6), as `Dynamics` does, (n, 6, m).

    It costs less than `Dynamics` for a robot that is used once: nothing is compiled.
    """
    at = columns(robot, pose, carrier_pose)
    return np.concatenate([at.directions, np.cross(at.arms, at.directions)], axis=2).swapaxes(1, 2)  # (n, 6, m)


def columns(robot: Robot, pose: np.ndarray, carrier_pose: np.ndarray) -> Columns:
    """Return directions, arms and derivatives of all cables at poses (n, 6) with carriers (n, c, 6)."""
    ends = points.attachments(robot, pose)  # (n, m, 3)
    offset = ends - points.anchors(robot, carrier_pose)
    arms = ends - points.placed(pose, np.array([robot.platform.com]))
    length = np.linalg.norm(offset, axis=2, keepdims=True)
    along = offset / length  # t
    turning = (np.eye(3) - along[..., :, None] * along[..., None, :]) / length[..., None]
    by_radius = np.zeros_like(along)
    over = np.flatnonzero(robot.pulley_radii)
    if over.size:
        turned = points.rotations(carrier_pose[:, robot.carrier_of_cable[over], 3:])
        axes = np.einsum("nkij,kj->nki", turned, robot.pulley_axes[over])
        sheave = _over_sheave(offset[:, over], axes, robot.pulley_radii[over])
        along[:, over], turning[:, over], by_radius[:, over] = sheave
    return Columns(-along, arms, turning, by_radius)


def _over_sheave(offset: np.ndarray, axes: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return t (n, k, 3) and its derivatives by the attachment and by the radius, of cables over pulleys."""
    run = sheaves(offset, axes, radii)
    e, sin, cos = run.e, np.sin(run.wrap)[..., None], np.cos(run.wrap)[..., None]
    n, f = cos * e - sin * axes, np.cross(axes, e)
    turning = n[..., :, None] * n[..., None, :] / run.straight[..., None, None]
    turning += (sin / run.distance[..., None])[..., None] * f[..., :, None] * f[..., None, :]
    return run.along, turning, (1 - cos) / run.straight[..., None] * n


def derivatives(
    robot: Robot, pose: np.ndarray, carrier_pose: np.ndarray, names: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return how wrenches depend on numbers of the cables, by the names of `Robot.parameter_values`.

    Parameters
    ----------
    robot
        At whose numbers the derivatives are taken.
    pose, carrier_pose
        Of the platform, (n, 6), and of the carriers, (n, c, 6), in {G} [m, rad].
    names
        Of the p numbers.

    Returns
    -------
    The derivative by each number of the column of its cable, (n, 6, p) [1/m, -], and the index of that cable, (p,).

    Raises
    ------
    ValueError
        If the robot has no such number.
    """
    at = columns(robot, pose, carrier_pose)
    places = [locate(name, robot.cables) for name in names]
    cables = np.array([place.cable for place in places], dtype=int)
    platform, carriers = points.rotations(pose[:, 3:]), points.rotations(carrier_pose[..., 3:])
    owners = robot.carrier_of_cable
    moved = np.zeros((len(pose), len(places), 3))  # of the direction u
    lever = np.zeros_like(moved)  # of the arm r
    for column, (cable, part, axis) in enumerate(places):
        if part == "radius":
            moved[:, column] = -at.by_radius[:, cable]
        elif part == "anchor":
            moved[:, column] = np.einsum("nij,nj->ni", at.turning[:, cable], carriers[:, owners[cable], :, axis])
        else:
            lever[:, column] = platform[:, :, axis]
            moved[:, column] = -np.einsum("nij,nj->ni", at.turning[:, cable], lever[:, column])
    turned = np.cross(at.arms[:, cables], moved) + np.cross(lever, at.directions[:, cables])
    return np.concatenate([moved, turned], axis=2).swapaxes(1, 2), cables  # (n, 6, p), (p,)
