"""Poses from lengths for robots with fewer cables than coordinates: equilibrium poses."""

from dataclasses import replace

import numpy as np

from ...base.errors import InputError
from ...base.text import counted
from ...models import points
from ...models.robot import Robot
from ...statics.equilibria import Equilibrium, equilibria, rest_near, sensitivity
from .estimate import PoseEstimate, moved, unbounded
from .parameter_errors import length_errors
from .problem import Problem

STEP = 1e-5  # of a numerical derivative, in radians, and times the platform's size


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
    by_parameters = np.zeros_like(covariance) if robot.uncertainty else None
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
            by_length, by_file, neutral = _motions(robot, rest, lengths[row], carriers[row])
            covariance[row] = unbounded((by_length * own.sigma**2) @ by_length.T, neutral)
            if by_parameters is not None and robot.uncertainty is not None:
                by_parameters[row] = by_file @ robot.uncertainty.matrix @ by_file.T
    return replace(own, by_gravity=by_gravity, known_covariance=covariance, by_parameters=by_parameters)


def _motions(robot: Robot, rest: Equilibrium, lengths: np.ndarray, carriers: np.ndarray) -> list[np.ndarray]:
    """Return motions of the platform frame, as its shift and a small rotation in {G}, at an equilibrium.

    They are the derivatives by measured lengths, (6, m), and by the file's uncertain parameters, (6, p), and neutral
    motions, (6, k). With the energy E = -m g c + sum t_i (l_i - L_i), a parameter acts like a change of lengths and the
    wrench -d^2 E / (dpose dparameter).
    """
    by_length, compliance, neutral = sensitivity(robot, rest, carriers)
    step = STEP * np.diag([robot.length] * 3 + [1.0] * 3)
    around = moved(rest.pose, np.vstack([np.zeros(6), step, -step]))  # (13, 6)
    L, _ = length_errors(robot, around, np.tile(lengths, (13, 1)), np.tile(carriers, (13, 1, 1)))
    pulled = np.einsum("i,nip->np", rest.tensions, L)
    wrench = (pulled[7:] - pulled[1:7]) / (2 * np.diag(step)[:, None])
    arm = points.rotations(rest.pose[3:]) @ np.array(robot.platform.com)
    wrench[3:] -= np.cross(arm, wrench[:3], axis=0)  # about the CoM
    motions = [by_length, compliance @ wrench - by_length @ L[0], neutral]
    for of in motions:
        of[:3] += np.cross(arm, of[3:], axis=0)  # of the CoM before
    return motions
