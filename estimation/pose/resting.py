"""Poses from lengths of robots with fewer cables than coordinates: where the platform rests under its weight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...models import points
from ...models.dynamics import dynamics_of
from ...models.robot import Robot
from ...statics.equilibria import Equilibrium, equilibria, per_length, rest_near
from .estimate import PoseEstimate
from .problem import Problem


def resting(problem: Problem, lengths: np.ndarray, starts: np.ndarray | None, sigma: np.ndarray) -> PoseEstimate:
    """Return where the platform rests with lengths (N, m), near `starts` (N, 6) or, without any, anywhere.

    Raises
    ------
    InputError
        If the robot has no gravity: the lengths alone do not decide.
    """
    robot = problem.robot
    if robot.weight == 0.0:
        raise InputError(
            f"gravity must not be zero where the lengths leave a motion open, as the {robot.m} cables of robot "
            f"{robot.name!r} do for {problem.freedoms} coordinates"
        )
    poses, errors, found, covariances = _rests(problem, lengths, starts, sigma)
    by_gravity = np.ones(len(lengths), bool)
    return PoseEstimate(robot, poses, errors, found, sigma, problem.carriers, None, by_gravity, covariances)


def with_rests(own: PoseEstimate, problem: Problem, lengths: np.ndarray, starts: np.ndarray | None) -> PoseEstimate:
    """Return estimates by lengths alone with the rest instead where these do not decide the pose well."""
    hang = np.flatnonzero(~(own.consistent & own.conditioned))
    if own.robot.weight == 0.0 or not hang.size:
        return own
    covariance, by_gravity = own.covariance.copy(), np.zeros(len(lengths), bool)
    near = own.pose if starts is None else starts
    rests = _rests(problem.of(hang), lengths[hang], near[hang], own.sigma)
    rows = hang[rests[2]]
    for whole, part in zip((own.pose, own.residuals, own.converged, covariance), rests, strict=True):
        whole[rows] = part[rests[2]]
    by_gravity[rows] = True
    return replace(own, by_gravity=by_gravity, known_covariance=covariance)


def _rests(
    problem: Problem, lengths: np.ndarray, starts: np.ndarray | None, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return poses (N, 6), errors (N, m) [m], where there is a rest (N,), and covariances (N, 6, 6)."""
    robot, near = problem.robot, starts
    carriers = np.broadcast_to(problem.carriers, (len(lengths), *robot.carrier_home.shape))
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
