"""Poses from lengths of robots with fewer cables than coordinates: where the platform rests under its weight."""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from .. import points
from ..dynamics import dynamics_of
from ..robot import Robot
from ..statics import Equilibrium, equilibria, per_length, rest_near
from .problem import Problem

__all__ = ["resting"]


def resting(
    robot: Robot,
    problem: Problem,
    lengths: np.ndarray,
    starts: np.ndarray | None,
    carriers: np.ndarray,
    sigma: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return poses (N, 6), errors of the lengths (N, m) [m], where there is a rest (N,), and covariances (N, 6, 6).

    Parameters
    ----------
    problem, lengths, starts
        As for a descent: (N, m) and (N, 6), or None for starts of its own.
    carriers
        (N, c, 6), in {G}.
    sigma
        (m,) [m].

    Raises
    ------
    InputError
        If the robot has no gravity: the lengths alone do not decide.
    """
    if robot.weight == 0.0:
        freedoms = problem.freedoms
        raise InputError(
            f"gravity must not be zero where the lengths leave a motion open, as the {robot.m} cables of robot "
            f"{robot.name!r} do for {freedoms} coordinates"
        )
    near = starts
    if near is None:
        near = problem.descend_from_afar(lengths, 1.0 / sigma, np.tile(problem.home, (len(lengths), 1)))[0]
    poses, errors = near.copy(), np.full(lengths.shape, np.inf)
    converged, covariance = np.zeros(len(lengths), bool), np.full((len(lengths), 6, 6), np.inf)
    for row, own in enumerate(lengths):
        rest = rest_near(robot, own, near[row], carriers[row])
        if rest is None and starts is None:
            rest = next(iter(equilibria(robot, own, carriers[row])), None)
        if rest is None:
            errors[row] = dynamics_of(robot).cable_lengths(near[row], carriers[row]) - own
            continue
        poses[row], converged[row] = rest.pose, True
        errors[row] = rest.lengths - own
        errors[row, rest.slack] = 0.0
        covariance[row] = _covariance(robot, rest, carriers[row], sigma)
    return poses, errors, converged, covariance


def _covariance(robot: Robot, rest: Equilibrium, carriers: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return the covariance of the platform frame and a small rotation, (6, 6), infinite where a motion is neutral."""
    moves = per_length(robot, rest, carriers)
    if moves is None:
        return np.full((6, 6), np.inf)
    arm = points.rotations(rest.pose[3:]) @ np.array(robot.platform.com)
    moves[:3] += np.cross(arm, moves[3:], axis=0)  # of the CoM before
    return (moves * sigma**2) @ moves.T
