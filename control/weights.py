"""Costs of a predictive controller: `Weights`, from bandwidths, and `terminal`, the cost after the last stage."""

from typing import NamedTuple

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.robot import Robot


class Usual(NamedTuple):
    """The defaults for one type of robot: bandwidths [rad/s], and the duration of a stage [s]."""

    bandwidth: float
    carrier_bandwidth: float
    observer: float
    stage: float


# Carriers that correct errors, with cables of fixed length or with winches; those that may leave their reference, and
# are slower than tensions; and those that stay.
TEAM, TOWING = Usual(8.0, 6.0, 20.0, 0.025), Usual(6.0, 6.0, 20.0, 0.025)
PATIENT, STILL = Usual(40.0, 2.0, 60.0, 0.03), Usual(40.0, 2.0, 60.0, 0.015)

SHARE = 0.05  # of the robot's scale of forces: the tension that costs as much as a carrier at the end of its reach
SINGULAR = 1e-3  # of the largest singular value: directions with less are not controlled by tensions
ROUNDS = 2000  # of the Riccati recursion
SETTLED = 1e-9  # relative change at which it ends
DISCOUNT = 0.95  # of the cost of each stage, if it does not settle without


class Weights(NamedTuple):
    """Weights of the squared errors of each stage."""

    states: np.ndarray  # weights of the errors of pose and rate, and of the carriers' positions and rates, (n,)
    controls: np.ndarray  # weights of the deviations from planned tensions, and of the carriers' accelerations, (u,)


def weights(
    robot: Robot, bandwidth: np.ndarray, reach: np.ndarray, carrier_bandwidth: float, duration: float, moved: np.ndarray
) -> Weights:
    """Return the weights with which errors decay with the bandwidth while tensions are away from their limits.

    A double integrator ddx = a with the cost w^4 x^2 + 2 w^2 dx^2 + a^2 decays with the double pole -w. The smallest
    tensions for an acceleration a cost a' M (A A')^-1 M a, whose diagonal at home replaces a^2.

    Parameters
    ----------
    robot
        The robot.
    bandwidth
        Bandwidth w of each coordinate of the pose, (6,) [rad/s].
    reach
        Intended deviation of each freed coordinate of a carrier, (f,) [m, rad].
    carrier_bandwidth
        Bandwidth with which these return [rad/s].
    duration
        Duration of a stage [s].
    moved
        Accelerations of the pose at home per unit of the freed coordinates, (6, f). They contribute to the least effort
        if tensions do not control all degrees of freedom.
    """
    A, M = _at_home(robot)
    far = (SHARE * robot.force_scale / reach) ** 2
    if robot.m < len(robot.platform.dof):
        A = np.concatenate([A, M @ moved / np.sqrt(far)], axis=1)
    U, sizes, _ = np.linalg.svd(A)
    sizes = np.concatenate([sizes, np.zeros(6)])[:6]
    held = sizes > SINGULAR * sizes[0]
    effort = (U[:, held] / sizes[held]).T @ (M * robot.dof_mask)  # least tensions for unit accelerations
    of_acceleration = np.einsum("ij,ij->j", effort, effort)
    pose, rate = bandwidth**4 * of_acceleration, 2 * bandwidth**2 * of_acceleration
    states = np.concatenate([pose, rate, far, 2 * far / carrier_bandwidth**2])
    return Weights(duration * states, duration * np.concatenate([np.ones(robot.m), far / carrier_bandwidth**4]))


def tensions_of(robot: Robot) -> np.ndarray:
    """Return the smallest tensions for unit accelerations of the pose at rest at home, (m, 6) [N]."""
    A, M = _at_home(robot)
    return np.linalg.pinv(A, SINGULAR) @ (M * robot.dof_mask)


def _at_home(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return wrench matrix (6, m) and wrenches of unit accelerations (6, 6), with moments divided by the length."""
    dynamics, rest = dynamics_of(robot), np.zeros(6)
    scale = (np.repeat([1.0, 1 / robot.length], 3) * robot.dof_mask)[:, None]
    still = dynamics.required_wrench(robot.home, rest, rest)
    M = np.stack([dynamics.required_wrench(robot.home, rest, unit) - still for unit in np.eye(6)], axis=1)
    return scale * dynamics.wrench_matrix(robot.home, robot.carrier_home), scale * M


def terminal(A: np.ndarray, B: np.ndarray, by: Weights) -> np.ndarray:
    """Return the infinite-horizon LQR cost of the dynamics x' = A x + B u, (n, n), by the Riccati recursion.

    The recursion does not converge for uncontrollable motions, such as the swing of a load with few cables. Costs are
    then discounted over time.
    """
    Q, R = np.diag(by.states), np.diag(by.controls)
    for discount in (1.0, DISCOUNT):
        a, b, P = np.sqrt(discount) * A, np.sqrt(discount) * B, Q
        for _ in range(ROUNDS):
            Pb = P @ b
            gain = np.linalg.solve(R + b.T @ Pb, Pb.T @ a)
            last, P = P, Q + a.T @ (P @ a - Pb @ gain)
            P = (P + P.T) / 2
            if np.abs(P - last).max() <= SETTLED * np.abs(P).max():
                return P
    return P
