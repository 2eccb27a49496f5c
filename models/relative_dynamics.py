"""`RelativeDynamics`: paper F's form of the dynamics as CasADi Functions, called with arrays or with symbols."""

from __future__ import annotations

import os
from functools import cached_property
from typing import overload

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from . import kinematics, relative, wind
from .arrays import Array, Symbol
from .batch import call
from .files import as_robot
from .robot import Robot


class RelativeDynamics:
    """Compute the dynamics as paper F does: in {A}, with the carrier's motion in a term of its own, D_B (Eq. 38).

    `pose`, `velocity` and `acceleration` are those of the platform frame relative to {A}, in the axes of {A};
    `carrier_pose`, `carrier_velocity` and `carrier_acceleration` are those of {A} in {G}, default: at home and at rest.
    Each is (..., 6) [m, rad], a single carrier having no row of its own.

    Parameters
    ----------
    robot
        A `Robot` with one carrier, the name of one in the library, or the path of a robot file.

    Attributes
    ----------
    functions
        The CasADi Functions by name, with named inputs and outputs.

    Raises
    ------
    InputError
        If `robot` is none of these. Every method raises it, in one line, for an argument of a wrong shape or value.
    """

    def __init__(self, robot: Robot | str | os.PathLike[str]):
        robot = as_robot(robot)
        if len(robot.carriers) != 1:
            raise InputError(
                f"relative must have a robot with one carrier, got {robot.name!r} with {len(robot.carriers)}"
            )
        self.robot = robot
        self.functions: dict[str, ca.Function] = _relative_functions(robot)

    @overload
    def wrench_matrix(self, pose: Symbol) -> Symbol: ...
    @overload
    def wrench_matrix(self, pose: ArrayLike) -> np.ndarray: ...
    def wrench_matrix(self, pose: Array) -> Array:
        """Return the wrench matrix A in {A}, (..., 6, m) [N and N m per N]; it depends on the relative pose alone."""
        return call(self.functions["wrench_matrix"], {"pose": pose}, matrices=("A",))["A"]

    @overload
    def base_disturbance(
        self,
        pose: Symbol,
        velocity: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
    ) -> Symbol: ...
    @overload
    def base_disturbance(
        self,
        pose: ArrayLike,
        velocity: ArrayLike,
        carrier_pose: ArrayLike | None = None,
        carrier_velocity: ArrayLike | None = None,
        carrier_acceleration: ArrayLike | None = None,
    ) -> np.ndarray: ...
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
        arguments = {"pose": pose, "velocity": velocity}
        arguments |= self._carrier(carrier_pose, carrier_velocity, carrier_acceleration)
        return call(self.functions["base_disturbance"], arguments)["D_B"]

    @overload
    def required_wrench(
        self,
        pose: Symbol,
        velocity: Array,
        acceleration: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
        wind: Array | None = None,
    ) -> Symbol: ...
    @overload
    def required_wrench(
        self,
        pose: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        carrier_pose: ArrayLike | None = None,
        carrier_velocity: ArrayLike | None = None,
        carrier_acceleration: ArrayLike | None = None,
        wind: ArrayLike | None = None,
    ) -> np.ndarray: ...
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
        arguments = {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        arguments |= self._carrier(carrier_pose, carrier_velocity, carrier_acceleration)
        if wind is None:
            return call(self.functions["required_wrench"], arguments)["w"]
        return call(self._in_wind, arguments | {"wind": wind})["w"]

    @overload
    def motion_in_world(
        self,
        pose: Symbol,
        velocity: Array,
        acceleration: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
    ) -> tuple[Symbol, Symbol, Symbol]: ...
    @overload
    def motion_in_world(
        self,
        pose: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        carrier_pose: ArrayLike | None = None,
        carrier_velocity: ArrayLike | None = None,
        carrier_acceleration: ArrayLike | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...
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
        arguments = {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        arguments |= self._carrier(carrier_pose, carrier_velocity, carrier_acceleration)
        motion = call(self.functions["motion_in_world"], arguments)
        return motion["pose_G"], motion["velocity_G"], motion["acceleration_G"]

    def _carrier(self, pose: Array | None, velocity: Array | None, acceleration: Array | None) -> dict[str, Array]:
        return {
            "carrier_pose": self.robot.carrier_home[0] if pose is None else pose,
            "carrier_velocity": np.zeros(6) if velocity is None else velocity,
            "carrier_acceleration": np.zeros(6) if acceleration is None else acceleration,
        }

    @cached_property
    def _in_wind(self) -> ca.Function:
        still = self.functions["required_wrench"]
        inputs = [ca.SX.sym(name, *still.size_in(name)) for name in still.name_in()]
        air = ca.SX.sym("wind", 3)
        pose_G, velocity_G, _ = relative.motion_in_world(*inputs)
        W_e = wind.aerodynamic_wrench(self.robot, pose_G, velocity_G, air)
        R_A = kinematics.rotation(inputs[3][3:6])
        in_A = ca.vertcat(R_A.T @ W_e[0:3], R_A.T @ W_e[3:6])
        names = [*still.name_in(), "wind"]
        return ca.Function("relative_required_wrench_in_wind", [*inputs, air], [still(*inputs) - in_A], names, ["w"])


def _relative_functions(robot: Robot) -> dict[str, ca.Function]:
    names = ["pose", "velocity", "acceleration", "carrier_pose", "carrier_velocity", "carrier_acceleration"]
    motion = [ca.SX.sym(name, 6) for name in names]
    pose, velocity, acceleration, *carrier = motion
    anchors, axes = ca.SX(robot.anchors.T), ca.SX(robot.pulley_axes.T)
    run = kinematics.cables(robot.attachments, pose, anchors, axes, robot.pulley_radii)
    A = kinematics.wrench_matrix(robot.attachments, np.array(robot.platform.com), pose, run.directions)
    D_B = relative.base_disturbance(robot, pose, velocity, *carrier)
    w = relative.relative_inertial_wrench(robot, pose, velocity, acceleration) + D_B
    in_world = relative.motion_in_world(*motion)
    disturbing = [name for name in names if name != "acceleration"]
    return {
        "wrench_matrix": ca.Function("relative_wrench_matrix", [pose], [A], ["pose"], ["A"]),
        "base_disturbance": ca.Function("base_disturbance", [pose, velocity, *carrier], [D_B], disturbing, ["D_B"]),
        "required_wrench": ca.Function("relative_required_wrench", motion, [w], names, ["w"]),
        "motion_in_world": ca.Function(
            "motion_in_world", motion, list(in_world), names, ["pose_G", "velocity_G", "acceleration_G"]
        ),
    }
