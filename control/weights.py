"""Costs of a predictive controller: `Weights`, from bandwidths, `terminal`, after the last stage at home; `ripple`."""

from typing import NamedTuple

import numpy as np

from ..base.tolerances import INDEPENDENT
from ..core import control_stages
from ..models.dynamics import dynamics_of
from ..models.record import record_of
from ..models.robot import Robot
from ..statics.distribution import tensions
from .carrier_references import Moved
from .controllability import needs_carriers
from .settings import Limits

SHARE = 0.05  # of the robot's scale of forces: the tension that costs as much as a carrier at the end of its reach
ROOM = 1e-3  # of its upper limit: what a tension is taken to be from limits
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

    - `robot`: the robot.
    - `bandwidth`: bandwidth w of each coordinate of the pose, (6,) [rad/s].
    - `reach`: intended deviation of each freed coordinate of a carrier, (f,) [m, rad].
    - `carrier_bandwidth`: bandwidth with which these return [rad/s].
    - `duration`: duration of a stage [s].
    - `moved`: accelerations of the pose at home per unit of the freed coordinates, (6, f). They contribute to the least
      effort if tensions do not control all degrees of freedom.
    """
    A, M = _at_home(robot)
    far = (SHARE * robot.force_scale / reach) ** 2
    if needs_carriers(robot):
        A = np.concatenate([A, M @ moved / np.sqrt(far)], axis=1)
    U, sizes, _ = np.linalg.svd(A)
    sizes = np.concatenate([sizes, np.zeros(6)])[:6]
    held = sizes > INDEPENDENT * sizes[0]
    effort = (U[:, held] / sizes[held]).T @ (M * robot.dof_mask)  # least tensions for unit accelerations
    of_acceleration = np.einsum("ij,ij->j", effort, effort)
    pose, rate = bandwidth**4 * of_acceleration, 2 * bandwidth**2 * of_acceleration
    states = np.concatenate([pose, rate, far, 2 * far / carrier_bandwidth**2])
    return Weights(duration * states, duration * np.concatenate([np.ones(robot.m), far / carrier_bandwidth**4]))


def stage_at_home(robot: Robot, moved: Moved, stage: float, tensions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A, (n, n), and B, (n, u), of a stage [s] at rest at home, with tensions (m,) [N]."""
    n, u, c = 12 + 2 * moved.count, robot.m + moved.count, len(robot.carriers)
    states, controls, carriers = np.zeros((1, n)), np.zeros((1, u)), np.zeros((1, c, 12))
    states[0, :6], controls[0, : robot.m], carriers[0, :, :6] = robot.home, tensions, robot.carrier_home
    still = np.zeros((1, 1 + c, 3, 6))
    still[0, :, 0] = np.vstack([robot.home, robot.carrier_home])
    states[0, 12 : 12 + moved.count] = moved.along(still[:, 0], still[:, 1:])[0, 0]
    A, B, rest = np.zeros((1, n, n)), np.zeros((1, n, u)), np.zeros((1, n))
    about = np.array([stage]), np.zeros(6), carriers, states, controls
    control_stages(record_of(robot), moved.freed, moved.tethers, *about, A, B, rest)
    return A[0], B[0]


def ripple(robot: Robot, limits: Limits, bandwidth: np.ndarray) -> np.ndarray | None:
    """Return the tensions that unit rates require, relative to their distance from limits at home, (m, 6) [s/m].

    They accelerate the pose by `bandwidth`, (6,) [rad/s], times the rates. None if the robot cannot rest at home.
    """
    best = tensions(robot, robot.home, method="largest-margin").tensions
    if best is None:
        return None
    A, M = _at_home(robot)
    asked = np.linalg.pinv(A, INDEPENDENT) @ (M * robot.dof_mask) * bandwidth
    room = np.minimum(best - limits.low, limits.high - best)
    return asked / np.maximum(room, ROOM * limits.high)[:, None]


def accelerations(robot: Robot) -> np.ndarray:
    """Return how unit tensions accelerate the pose at home, (6, m) [m/(s^2 N), rad/(s^2 N)]."""
    A, M = _at_home(robot)
    return np.linalg.pinv(M * robot.dof_mask, INDEPENDENT) @ A


def _at_home(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return wrench matrix (6, m) and wrenches of unit accelerations (6, 6), with moments divided by the length."""
    dynamics, rest = dynamics_of(robot), np.zeros(6)
    scale = (robot.wrench_scale * robot.dof_mask)[:, None]
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
