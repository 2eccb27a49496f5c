"""`Dynamics`: a robot's kinematics and dynamics as CasADi Functions, called with arrays or with symbols."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from . import kinematics, relative, rigid_body, wind
from .batch import call
from .robot import Robot

Array = Any  # np.ndarray with leading batch dimensions in and out, or a CasADi expression in and out


class Dynamics:
    """What a motion needs and what the cables can give, for one robot.

    All of it is in {G}; `relative` has the form of paper F, in the frame {A} of a single carrier. Every argument may
    have leading batch dimensions, which broadcast; a CasADi SX or MX in gives one out.

    Parameters
    ----------
    robot
        From `load` or `Robot.model_validate`.

    Attributes
    ----------
    functions
        The CasADi Functions by name, with named inputs and outputs, to build on.
    """

    def __init__(self, robot: Robot):
        self.robot = robot
        self.functions: dict[str, ca.Function] = _world_functions(robot)

    def wrench_matrix(self, pose: Array, carrier_pose: Array | None = None) -> Array:
        """Wrench matrix A: force [N per N] and moment about the platform's CoM [N m per N] of each cable, in {G}.

        Parameters
        ----------
        pose
            (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6).
        carrier_pose
            The same of each carrier, (..., c, 6); None: at home.

        Returns
        -------
        (..., 6, m)

        Raises
        ------
        InputError
            If an argument has a wrong shape or a value that is not finite.
        """
        return call(self.functions["wrench_matrix"], {"pose": pose, "carrier_pose": self._carriers(carrier_pose)})["A"]

    def cable_lengths(self, pose: Array, carrier_pose: Array | None = None) -> Array:
        """Distance from anchor to attachment of each cable [m], (..., m). Arguments as in `wrench_matrix`."""
        arguments = {"pose": pose, "carrier_pose": self._carriers(carrier_pose)}
        return call(self.functions["cable_lengths"], arguments)["lengths"]

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
        """Wrench w that the cables have to give so that the platform moves as stated: A t = w.

        Inertia and velocity terms less gravity and wind: force [N] and moment about the CoM [N m], in {G}, (..., 6).
        In {G} the carriers act on the platform only through A, so their motion does not enter w; it is checked, so
        that one call serves this form and `relative`, where it is the disturbance D_B.

        Parameters
        ----------
        pose, velocity, acceleration
            (x, y, z, roll, pitch, yaw) of the platform frame in {G} and its time derivatives, (..., 6).
        carrier_pose, carrier_velocity, carrier_acceleration
            The same of each carrier, (..., c, 6); None: at home and at rest.
        wind
            Velocity of the air in {G} [m/s], (..., 3); None: no air at all, also no drag of the motion.

        Raises
        ------
        InputError
            If an argument has a wrong shape or value, or wind is given and the robot's file has no `platform.aero`.
        """
        arguments = {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        given = {
            "carrier_pose": carrier_pose,
            "carrier_velocity": carrier_velocity,
            "carrier_acceleration": carrier_acceleration,
        }
        arguments |= {name: np.zeros((self._count, 6)) if value is None else value for name, value in given.items()}
        if wind is None:
            return call(self.functions["required_wrench"], arguments)["w"]
        return call(self._in_wind, arguments | {"wind": wind})["w"]

    def aerodynamic_wrench(self, pose: Array, velocity: Array, wind: Array) -> Array:
        """W_e: force [N] and moment about the CoM [N m] of the air, (..., 6), in {G}; see `models.wind`."""
        arguments = {"pose": pose, "velocity": velocity, "wind": wind}
        return call(self._aerodynamic, arguments)["W_e"]

    @cached_property
    def relative(self) -> RelativeDynamics:
        """The form of paper F, in the frame {A} of the robot's only carrier.

        Raises
        ------
        InputError
            If the robot has more than one carrier: then no carrier's frame is {A}.
        """
        return RelativeDynamics(self.robot)

    @property
    def _count(self) -> int:
        return len(self.robot.carriers)

    def _carriers(self, carrier_pose: Array | None) -> Array:
        return self.robot.carrier_home if carrier_pose is None else carrier_pose

    @cached_property
    def _aerodynamic(self) -> ca.Function:
        pose, velocity, air = ca.SX.sym("pose", 6), ca.SX.sym("velocity", 6), ca.SX.sym("wind", 3)
        W_e = wind.aerodynamic_wrench(self.robot, pose, velocity, air)
        return ca.Function("aerodynamic_wrench", [pose, velocity, air], [W_e], ["pose", "velocity", "wind"], ["W_e"])

    @cached_property
    def _in_wind(self) -> ca.Function:
        still = self.functions["required_wrench"]
        inputs = [ca.SX.sym(name, *still.size_in(name)) for name in still.name_in()]
        air = ca.SX.sym("wind", 3)
        w = still(*inputs) - self._aerodynamic(inputs[0], inputs[1], air)
        return ca.Function("required_wrench_in_wind", [*inputs, air], [w], [*still.name_in(), "wind"], ["w"])


class RelativeDynamics:
    """Paper F's form of the dynamics: everything in {A}, the carrier's motion apart in D_B (paper F, Eq. 38).

    `pose`, `velocity` and `acceleration` are those of the platform frame relative to {A}, as seen in {A}; `carrier_*`
    are those of {A} in {G}. Each is (..., 6), a single carrier having no row of its own.

    Attributes
    ----------
    functions
        The CasADi Functions by name, with named inputs and outputs.
    """

    def __init__(self, robot: Robot):
        if len(robot.carriers) != 1:
            raise InputError(
                f"relative: robot {robot.name!r} has {len(robot.carriers)} carriers; accepted: robots with one carrier"
            )
        self.robot = robot
        self.functions: dict[str, ca.Function] = _relative_functions(robot)

    def wrench_matrix(self, pose: Array) -> Array:
        """Wrench matrix A in {A}, (..., 6, m); it depends on the relative pose alone."""
        return call(self.functions["wrench_matrix"], {"pose": pose})["A"]

    def base_disturbance(
        self,
        pose: Array,
        velocity: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
    ) -> Array:
        """D_B, the coupled quadrotor-disturbance term: force [N] and moment about the CoM [N m] in {A}, (..., 6).

        The weight is part of it (D_F has - m R_A^T g), as in paper F. None: carrier at home and at rest.
        """
        arguments = {"pose": pose, "velocity": velocity}
        arguments |= self._carrier(carrier_pose, carrier_velocity, carrier_acceleration)
        return call(self.functions["base_disturbance"], arguments)["D_B"]

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
        """M_B ddX_b + F_B + D_B - W_e: force [N] and moment about the CoM [N m] in {A}, (..., 6).

        `wind` is the velocity of the air in {G} [m/s], (..., 3); None: no air at all.
        """
        arguments = {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        arguments |= self._carrier(carrier_pose, carrier_velocity, carrier_acceleration)
        if wind is None:
            return call(self.functions["required_wrench"], arguments)["w"]
        return call(self._in_wind, arguments | {"wind": wind})["w"]

    def motion_in_world(
        self,
        pose: Array,
        velocity: Array,
        acceleration: Array,
        carrier_pose: Array | None = None,
        carrier_velocity: Array | None = None,
        carrier_acceleration: Array | None = None,
    ) -> tuple[Array, Array, Array]:
        """Pose, velocity and acceleration of the platform frame in {G}, (..., 6) each.

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


def _world_functions(robot: Robot) -> dict[str, ca.Function]:
    count = len(robot.carriers)
    pose, velocity, acceleration = (ca.SX.sym(name, 6) for name in ("pose", "velocity", "acceleration"))
    carriers = [ca.SX.sym(f"carrier_{name}", count, 6) for name in ("pose", "velocity", "acceleration")]
    anchors = kinematics.anchors(robot.anchors, robot.carrier_of_cable, carriers[0])
    A = kinematics.wrench_matrix(robot.attachments, np.array(robot.platform.com), pose, anchors)
    lengths = kinematics.norms(kinematics.cable_vectors(robot.attachments, pose, anchors))
    w = rigid_body.inertial_wrench(robot, pose, velocity, acceleration)
    place = ["pose", "carrier_pose"]
    motion = ["pose", "velocity", "acceleration", "carrier_pose", "carrier_velocity", "carrier_acceleration"]
    return {
        "wrench_matrix": ca.Function("wrench_matrix", [pose, carriers[0]], [A], place, ["A"]),
        "cable_lengths": ca.Function("cable_lengths", [pose, carriers[0]], [lengths], place, ["lengths"]),
        "required_wrench": ca.Function(
            "required_wrench", [pose, velocity, acceleration, *carriers], [w], motion, ["w"]
        ),
    }


def _relative_functions(robot: Robot) -> dict[str, ca.Function]:
    names = ["pose", "velocity", "acceleration", "carrier_pose", "carrier_velocity", "carrier_acceleration"]
    motion = [ca.SX.sym(name, 6) for name in names]
    pose, velocity, acceleration, *carrier = motion
    anchors = ca.SX(robot.anchors.T)
    A = kinematics.wrench_matrix(robot.attachments, np.array(robot.platform.com), pose, anchors)
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
