"""`RelativeDynamics`: paper F's form of the dynamics as CasADi Functions, called with arrays or with symbols.

The platform's motion is relative to its carrier {A}, and the carrier's motion is a disturbance D_B:

    M_B ddX_b + F_B + D_B = A (t + dT) + W_e,   D_B = (D_F, D_M),   all in {A}

    D_F = m (R_A^T ddx_A + alpha_A x x_c + omega_A x (omega_A x x_c) + 2 omega_A x dx_c) - m R_A^T g
    D_M = I_A alpha_A + I_A (omega_A x R Omega) + (omega_A + R Omega) x I_A omega_A + omega_A x (R I_b Omega)

with x_c the CoM in {A}, R = ^A R_B, Omega = P_b dTheta_b, I_A = R I_b R^T and, in {A}, omega_A = P_a dTheta_a,
alpha_A = dP_a dTheta_a + P_a ddTheta_a. Without the carrier's motion D_B is the weight alone.

Source: paper F, Eqs. 26 to 38 as corrected.
"""

from functools import cached_property

import casadi as ca
import numpy as np

from ..base.display import Displayed
from ..base.errors import InputError
from . import kinematics, rigid_body
from .arrays import Array, Motion, one_array, several_arrays
from .batch import call
from .files import AnyRobot, as_robot
from .robot import Robot
from .rotation import Matrix, angles_of, body_rate, inverse_rate_matrix, rate_matrix_derivative, rotation, turning


class RelativeDynamics(Displayed):
    """Compute the dynamics as paper F does: in {A}, with the carrier's motion in a separate term, D_B (Eq. 38).

    docs/theory.md names the paper.

    `pose`, `velocity` and `acceleration` describe the platform frame relative to {A}, in the axes of {A};
    `carrier_pose`, `carrier_velocity` and `carrier_acceleration` describe {A} in {G}, default: at home and at rest.
    Each is (..., 6) [m, rad], since the only carrier needs no dimension of its own.

    `robot` is a `Robot` with one carrier, the name of one in the library, or the path of a robot file; `functions` are
    the CasADi Functions by name, with named inputs and outputs. Raises `InputError` if the robot is none of these.
    Every method raises it, in one line, for an argument of a wrong shape or value.
    """

    def __init__(self, robot: AnyRobot):
        self.robot = as_robot(robot)
        if (count := len(self.robot.carriers)) != 1:
            raise InputError(f"relative requires a robot with one carrier, got {self.robot.name!r} with {count}")
        self.functions: dict[str, ca.Function] = _relative_functions(self.robot)

    @one_array
    def wrench_matrix(self, pose: Array) -> Array:
        """Return the wrench matrix A in {A}, (..., 6, m) [N and N m per N]; it depends on the relative pose alone."""
        return call(self.functions["wrench_matrix"], {"pose": pose}, matrices=("A",))["A"]

    @one_array
    def base_disturbance(
        self,
        pose: Array,
        velocity: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
    ) -> Array:
        """Return D_B, the quadrotor-disturbance term, (..., 6): force [N] and moment about the CoM [N m] in {A}.

        The weight is part of it (D_F has - m R_A^T g), as in paper F.
        """
        motion = Motion(pose, velocity, None, carrier_pose, carrier_velocity, carrier_acceleration)
        return call(self.functions["base_disturbance"], motion.arguments(self._home))["D_B"]

    @one_array
    def required_wrench(
        self,
        pose: Array,
        velocity: Array,
        acceleration: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
        wind: Array | None = None,
    ) -> Array:
        """Return M_B ddX_b + F_B + D_B - W_e: force [N] and moment about the CoM [N m] in {A}, (..., 6).

        `wind` is the velocity of the air in {G} [m/s], (..., 3); default: no air at all.
        """
        motion = Motion(pose, velocity, acceleration, carrier_pose, carrier_velocity, carrier_acceleration)
        arguments = motion.arguments(self._home)
        if wind is None:
            return call(self.functions["required_wrench"], arguments)["w"]
        return call(self._in_wind, arguments | {"wind": wind})["w"]

    @several_arrays
    def motion_in_world(
        self,
        pose: Array,
        velocity: Array,
        acceleration: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
    ) -> tuple[Array, Array, Array]:
        """Return pose, velocity and acceleration of the platform frame in {G}, (..., 6) each [m, rad] and per s, s^2.

        The Euler angles lie in (-pi, pi], so that a series of them may jump by 2 pi; `numpy.unwrap` undoes it.
        """
        motion = Motion(pose, velocity, acceleration, carrier_pose, carrier_velocity, carrier_acceleration)
        return tuple(call(self.functions["motion_in_world"], motion.arguments(self._home)).values())

    @property
    def _home(self) -> np.ndarray:
        return self.robot.carrier_home[0]

    @cached_property
    def _in_wind(self) -> ca.Function:
        motion, air = Motion.symbols(6), ca.SX.sym("wind", 3)
        pose_G, velocity_G, _ = motion_in_world(motion)
        W_e = rigid_body.aerodynamic_wrench(self.robot, pose_G, velocity_G, air)
        R_A = rotation(motion.carrier_pose[3:6])
        w = self.functions["required_wrench"](*motion) - ca.vertcat(R_A.T @ W_e[0:3], R_A.T @ W_e[3:6])
        names = [*Motion._fields, "wind"]
        return ca.Function("relative_required_wrench_in_wind", [*motion, air], [w], names, ["w"])


def _relative_functions(robot: Robot) -> dict[str, ca.Function]:
    motion, names = Motion.symbols(6), list(Motion._fields)
    anchors, axes = ca.SX(robot.anchors.T), ca.SX(robot.pulley_axes.T)
    run = kinematics.cables(robot, motion.pose, anchors, axes)
    A = kinematics.wrench_matrix(robot, motion.pose, run.directions)
    D_B = base_disturbance(robot, motion)
    still = ca.DM.zeros(3)  # without gravity, which is in D_B, M_B ddX_b + F_B is the wrench of the relative motion
    w = rigid_body.body_wrench(*rigid_body.body_of(robot), still, *motion[:3]) + D_B
    in_world = list(motion_in_world(motion))
    disturbing = motion._asdict()
    del disturbing["acceleration"]  # of the platform, which is no part of the disturbance
    return {
        "wrench_matrix": ca.Function("relative_wrench_matrix", [motion.pose], [A], ["pose"], ["A"]),
        "base_disturbance": ca.Function("base_disturbance", [*disturbing.values()], [D_B], [*disturbing], ["D_B"]),
        "required_wrench": ca.Function("relative_required_wrench", list(motion), [w], names, ["w"]),
        "motion_in_world": ca.Function(
            "motion_in_world", list(motion), in_world, names, ["pose_G", "velocity_G", "acceleration_G"]
        ),
    }


def base_disturbance(robot: Robot, motion: Motion) -> Matrix:
    """Return D_B = (D_F, D_M), (6, 1), in {A} [N, N m]: the coupled quadrotor-disturbance term, weight included."""
    R_A, omega_A, alpha_A = turning(motion.carrier_pose, motion.carrier_velocity, motion.carrier_acceleration)
    R, Omega = rotation(motion.pose[3:6]), body_rate(motion.pose[3:6], motion.velocity[3:6])
    com = ca.DM(robot.platform.com)
    x_c = motion.pose[0:3] + R @ com
    dx_c = motion.velocity[0:3] + R @ ca.cross(Omega, com)
    felt = R_A.T @ (motion.carrier_acceleration[0:3] - ca.DM(robot.gravity))
    D_F = robot.platform.mass * (
        felt + ca.cross(alpha_A, x_c) + ca.cross(omega_A, ca.cross(omega_A, x_c)) + 2 * ca.cross(omega_A, dx_c)
    )

    I_b = ca.DM(robot.inertia)
    I_A = R @ I_b @ R.T
    D_M = (
        I_A @ alpha_A
        + I_A @ ca.cross(omega_A, R @ Omega)
        + ca.cross(omega_A + R @ Omega, I_A @ omega_A)
        + ca.cross(omega_A, R @ I_b @ Omega)
    )
    return ca.vertcat(D_F, D_M)


def motion_in_world(motion: Motion) -> tuple[Matrix, Matrix, Matrix]:
    """Return pose, velocity and acceleration in {G}, (6, 1) each, of a frame that moves relative to {A} as given.

    The Euler angles come out in the ranges of `rotation.angles_of`; their rates do not exist at pitch = +-90 degrees.
    """
    R_A, omega_A, alpha_A = turning(motion.carrier_pose, motion.carrier_velocity, motion.carrier_acceleration)
    x, dx, ddx = motion.pose[0:3], motion.velocity[0:3], motion.acceleration[0:3]
    position = motion.carrier_pose[0:3] + R_A @ x
    speed = motion.carrier_velocity[0:3] + R_A @ (ca.cross(omega_A, x) + dx)
    acceleration_G = motion.carrier_acceleration[0:3] + R_A @ (
        ddx + ca.cross(alpha_A, x) + ca.cross(omega_A, ca.cross(omega_A, x)) + 2 * ca.cross(omega_A, dx)
    )

    R, Omega, alpha = turning(motion.pose, motion.velocity, motion.acceleration)
    angles = angles_of(R_A @ R)
    total_rate = R.T @ omega_A + Omega  # in platform axes
    total_alpha = R.T @ (alpha_A + ca.cross(omega_A, R @ Omega)) + alpha
    rates = inverse_rate_matrix(angles) @ total_rate
    rate_rates = inverse_rate_matrix(angles) @ (total_alpha - rate_matrix_derivative(angles, rates) @ rates)
    return ca.vertcat(position, angles), ca.vertcat(speed, rates), ca.vertcat(acceleration_G, rate_rates)
