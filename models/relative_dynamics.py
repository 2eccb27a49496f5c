"""`RelativeDynamics`: paper F's form of the dynamics as CasADi Functions, called with arrays or with symbols."""

import os
from functools import cached_property

import casadi as ca
import numpy as np

from ..base.display import Displayed
from ..base.errors import InputError
from . import kinematics, relative, rigid_body
from .arrays import Array, one_array, several_arrays
from .batch import call
from .files import as_robot
from .motion import Motion
from .robot import Robot


class RelativeDynamics(Displayed):
    """Compute the dynamics as paper F does: in {A}, with the carrier's motion in a separate term, D_B (Eq. 38).

    `pose`, `velocity` and `acceleration` are those of the platform frame relative to {A}, in the axes of {A};
    `carrier_pose`, `carrier_velocity` and `carrier_acceleration` are those of {A} in {G}, default: at home and at rest.
    Each is (..., 6) [m, rad], since the only carrier needs no dimension of its own.

    `robot` is a `Robot` with one carrier, the name of one in the library, or the path of a robot file; `functions` are
    the CasADi Functions by name, with named inputs and outputs. Raises `InputError` if the robot is none of these.
    Every method raises it, in one line, for an argument of a wrong shape or value.
    """

    def __init__(self, robot: Robot | str | os.PathLike[str]):
        self.robot = as_robot(robot)
        if (count := len(self.robot.carriers)) != 1:
            raise InputError(f"relative must have a robot with one carrier, got {self.robot.name!r} with {count}")
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
        pose_G, velocity_G, _ = relative.motion_in_world(motion)
        W_e = rigid_body.aerodynamic_wrench(self.robot, pose_G, velocity_G, air)
        R_A = kinematics.rotation(motion.carrier_pose[3:6])
        w = self.functions["required_wrench"](*motion) - ca.vertcat(R_A.T @ W_e[0:3], R_A.T @ W_e[3:6])
        names = [*Motion._fields, "wind"]
        return ca.Function("relative_required_wrench_in_wind", [*motion, air], [w], names, ["w"])


def _relative_functions(robot: Robot) -> dict[str, ca.Function]:
    motion, names = Motion.symbols(6), list(Motion._fields)
    anchors, axes = ca.SX(robot.anchors.T), ca.SX(robot.pulley_axes.T)
    run = kinematics.cables(robot, motion.pose, anchors, axes)
    A = kinematics.wrench_matrix(robot, motion.pose, run.directions)
    D_B = relative.base_disturbance(robot, motion)
    still = ca.DM.zeros(3)  # without gravity, which D_B has, M_B ddX_b + F_B is that of the relative motion
    w = rigid_body.body_wrench(*rigid_body.body_of(robot), still, *motion[:3]) + D_B
    in_world = list(relative.motion_in_world(motion))
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
