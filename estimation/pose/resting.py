"""Poses from lengths for robots with fewer cables than coordinates: equilibrium poses."""

from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...base.text import counted
from ...models import points
from ...models.robot import Robot
from ...statics.equilibria import Equilibrium, equilibria, per_length, rest_near
from .estimate import PoseEstimate, unbounded
from .problem import Problem


def resting(own: PoseEstimate, problem: Problem, lengths: np.ndarray, starts: np.ndarray | None) -> PoseEstimate:
    """Return estimates from lengths (N, m): the equilibrium if these do not determine the pose well.

    An equilibrium is near `starts` (N, 6) or, without any, near the pose from lengths alone. With fewer cables than
    coordinates it is anywhere. Raises `InputError` if the robot has no gravity and too few cables, so that the pose
    is undetermined.
    """
    robot, few = problem.robot, problem.robot.m < problem.freedoms
    if few and robot.weight == 0.0:
        raise InputError(
            "gravity must not be zero if the lengths do not determine the pose, got none for robot "
            f"{robot.name!r}, which has {counted(robot.m, 'cable')} for {problem.freedoms} coordinates"
        )
    if few:
        own.converged, own.ambiguous = np.zeros(len(lengths), bool), None
    hang = np.flatnonzero(~(own.consistent & own.conditioned))
    if robot.weight == 0.0 or not hang.size:
        return own
    covariance, by_gravity = own.covariance_of_noise.copy(), np.full(len(lengths), few)
    near = own.pose if starts is None else starts
    carriers = np.broadcast_to(problem.carriers, (len(lengths), *robot.carrier_home.shape))
    for row in hang:
        rest = rest_near(robot, lengths[row], near[row], carriers[row])
        if rest is None and few and starts is None:
            rest = next(iter(equilibria(robot, lengths[row], carriers[row])), None)
        if rest is not None:
            own.pose[row], own.converged[row], by_gravity[row] = rest.pose, True, True
            own.residuals[row] = rest.lengths - lengths[row]
            own.residuals[row, rest.slack] = 0.0
            covariance[row] = _covariance(robot, rest, carriers[row], own.sigma)
    return replace(own, by_gravity=by_gravity, known_covariance=covariance)


def _covariance(robot: Robot, rest: Equilibrium, carriers: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """Return the covariance of the platform frame and a small rotation, (6, 6), infinite where motions are neutral."""
    motions = np.hstack(per_length(robot, rest, carriers))
    arm = points.rotations(rest.pose[3:]) @ np.array(robot.platform.com)
    motions[:3] += np.cross(arm, motions[3:], axis=0)  # of the CoM before
    moves, neutral = np.split(motions, [robot.m], axis=1)
    return unbounded((moves * sigma**2) @ moves.T, neutral)
