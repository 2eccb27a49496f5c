"""The mechanics of one control step as a CasADi Function: wrench matrix and required wrench."""

import casadi as ca
import numpy as np

from ...models.dynamics import Dynamics
from ...models.robot import Robot


def moving_carriers(robot: Robot) -> list[int]:
    """Return the indices of the carriers that move, whose poses the step has to be given."""
    return [index for index, carrier in enumerate(robot.carriers) if carrier.moves]


def mechanics(robot: Robot) -> ca.Function:
    """Return the Function of a step, with zero rows for the coordinates that the platform does not have.

    Returns
    -------
    casadi.Function
        From `pose`, `velocity` and `acceleration` (6,), `carrier_pose` (c, 6) of the carriers that move and `wind` (3,)
        if the robot has such, and `disturbance` (6,) to `A` (6, m) and `w` (6,): `A` and `w` of `Dynamics`, less the
        disturbance.
    """
    dynamics, moving, mask = Dynamics(robot), moving_carriers(robot), ca.DM(robot.dof_mask)
    motion = {name: ca.SX.sym(name, 6) for name in ("pose", "velocity", "acceleration")}
    carrier_pose, disturbance = ca.SX.sym("carrier_pose", len(moving), 6), ca.SX.sym("disturbance", 6)
    wind = ca.SX.sym("wind", 3) if robot.platform.aero else None
    carriers = ca.SX(np.array(robot.carrier_home))
    for row, index in enumerate(moving):
        carriers[index, :] = carrier_pose[row, :]
    A = dynamics.wrench_matrix(motion["pose"], carriers) * ca.repmat(mask, 1, robot.m)
    w = (dynamics.required_wrench(*motion.values(), carrier_pose=carriers, wind=wind) - disturbance) * mask
    inputs = motion | ({"carrier_pose": carrier_pose} if moving else {})
    inputs |= ({} if wind is None else {"wind": wind}) | {"disturbance": disturbance}
    shared = ca.cse([ca.densify(A), ca.densify(w)])
    return ca.Function("mechanics", [*inputs.values()], shared, [*inputs], ["A", "w"])
