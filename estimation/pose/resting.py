"""Poses from lengths for robots with fewer cables than coordinates: equilibrium poses."""

from __future__ import annotations

import numpy as np

from ...base.errors import InputError
from ...models import points
from ...models.dynamics import dynamics_of
from ...models.robot import Robot
from ...statics.equilibria import Equilibrium, equilibria, per_length, rest_near
from .estimate import PoseEstimate
from .problem import Problem
from .search import estimates


def open_estimates(
    robot: Robot,
    problem: Problem,
    lengths: np.ndarray,
    starts: np.ndarray | None,
    carriers: np.ndarray | None,
    sigma: np.ndarray,
) -> PoseEstimate:
    """Return the estimates of a robot whose lengths do not determine the pose at home, or anywhere.

    If the lengths determine the pose well, the estimate is that pose, otherwise the equilibrium.

    Parameters
    ----------
    problem, lengths, starts
        As for a descent: (N, m) and (N, 6), or None for default starts.
    carriers
        (c, 6) or (N, c, 6), in {G}, or None for carriers at home.
    sigma
        (m,) [m].

    Raises
    ------
    InputError
        If the robot has no gravity and too few cables, so that the pose is undetermined.
    """
    places = np.broadcast_to(
        robot.carrier_home if carriers is None else carriers, (len(lengths), *robot.carrier_home.shape)
    )
    if robot.m < problem.freedoms:
        if robot.weight == 0.0:
            raise InputError(
                f"gravity must not be zero if the lengths do not determine the pose, as the {robot.m} cables of robot "
                f"{robot.name!r} do for {problem.freedoms} coordinates"
            )
        rests = _rests(robot, problem, lengths, starts, places, sigma)
        return PoseEstimate(robot, *rests[:3], sigma, carriers, None, np.ones(len(lengths), bool), rests[3])
    own = estimates(robot, problem, lengths, starts, carriers, sigma)
    hang = np.flatnonzero(~(own.consistent & own.conditioned))
    if robot.weight == 0.0 or not hang.size:
        return own
    covariance, by_gravity = own.covariance.copy(), np.zeros(len(lengths), bool)
    near = own.pose if starts is None else starts
    rests = _rests(robot, problem.of(hang), lengths[hang], near[hang], places[hang], sigma)
    rows = hang[rests[2]]
    for whole, part in zip((own.pose, own.residuals, own.converged, covariance), rests, strict=True):
        whole[rows] = part[rests[2]]
    by_gravity[rows] = True
    return PoseEstimate(
        robot, own.pose, own.residuals, own.converged, sigma, carriers, own.ambiguous, by_gravity, covariance
    )


def _rests(
    robot: Robot,
    problem: Problem,
    lengths: np.ndarray,
    starts: np.ndarray | None,
    carriers: np.ndarray,
    sigma: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return poses (N, 6), errors (N, m) [m], whether an equilibrium exists (N,), and covariances (N, 6, 6)."""
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
    """Return the covariance of the platform frame and a small rotation, (6, 6), infinite if a motion is neutral."""
    moves = per_length(robot, rest, carriers)
    if moves is None:
        return np.full((6, 6), np.inf)
    arm = points.rotations(rest.pose[3:]) @ np.array(robot.platform.com)
    moves[:3] += np.cross(arm, moves[3:], axis=0)  # of the CoM before
    return (moves * sigma**2) @ moves.T
