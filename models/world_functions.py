"""`WorldFunctions`: kinematics and dynamics of a robot in {G} as CasADi Functions, each built when it is first used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

import casadi as ca
import numpy as np

from . import elasticity, forward, kinematics, rigid_body, wind
from .cables.pulley import Exit
from .motion import Motion
from .robot import Robot
from .rotation import Matrix

__all__ = ["WorldFunctions"]

PUBLISHED = ("wrench_matrix", "cable_lengths", "required_wrench", "acceleration")


class WorldFunctions(Mapping[str, ca.Function]):
    """Map the names of the four functions to build on to them; the others are attributes.

    Inputs have the names that arguments of `Dynamics` have.
    """

    def __init__(self, robot: Robot):
        self._robot = robot

    def __getitem__(self, name: str) -> ca.Function:
        if name not in PUBLISHED:
            raise KeyError(name)
        return getattr(self, name)

    def __iter__(self) -> Iterator[str]:
        return iter(PUBLISHED)

    def __len__(self) -> int:
        return len(PUBLISHED)

    @cached_property
    def wrench_matrix(self) -> ca.Function:
        """Return A, (6, m)."""
        return self._function("wrench_matrix", "pose carrier_pose", A=self._A)

    @cached_property
    def cable_lengths(self) -> ca.Function:
        """Return the lengths, (m, 1) [m]."""
        return self._function("cable_lengths", "pose carrier_pose", lengths=self._exit.lengths)

    @cached_property
    def points(self) -> ca.Function:
        """Return anchors and attachments, (m, 3) each [m]."""
        attachments = kinematics.transform(self._symbols["pose"], self._robot.attachments)
        return self._function("points", "pose carrier_pose", anchors=self._anchors.T, attachments=attachments.T)

    @cached_property
    def exits(self) -> ca.Function:
        """Return where the cables leave their pulleys, (m, 3) [m]."""
        return self._function("exits", "pose carrier_pose", exits=self._exit.points.T)

    @cached_property
    def required_wrench(self) -> ca.Function:
        """Return w, (6, 1) [N, N m], without wind."""
        return self._function("required_wrench", " ".join(Motion._fields), w=self._w)

    @cached_property
    def required_wrench_in_wind(self) -> ca.Function:
        """Return w, (6, 1) [N, N m]."""
        names = " ".join([*Motion._fields, "wind"])
        return self._function("required_wrench_in_wind", names, w=self._w - self._W_e)

    @cached_property
    def aerodynamic_wrench(self) -> ca.Function:
        """Return W_e, (6, 1) [N, N m]."""
        return self._function("aerodynamic_wrench", "pose velocity wind", W_e=self._W_e)

    @cached_property
    def acceleration(self) -> ca.Function:
        """Return the platform's acceleration, (6, 1) [m/s^2, rad/s^2], without wind."""
        result = self._acceleration(self._pull)
        return self._function("acceleration", "pose velocity tensions carrier_pose", acceleration=result)

    @cached_property
    def acceleration_in_wind(self) -> ca.Function:
        """Return the platform's acceleration, (6, 1) [m/s^2, rad/s^2]."""
        result = self._acceleration(self._pull + self._W_e)
        return self._function("acceleration_in_wind", "pose velocity tensions carrier_pose wind", acceleration=result)

    @cached_property
    def coupled_acceleration(self) -> ca.Function:
        """Return the accelerations of the platform, (6, 1), and of the carriers, (c, 6) [m/s^2, rad/s^2]."""
        robot, symbols = self._robot, self._symbols
        gravity, carriers = np.array(robot.gravity), []
        for index, carrier in enumerate(robot.carriers):
            at, rate = symbols["carrier_pose"][index, :].T, symbols["carrier_velocity"][index, :].T
            pull = forward.pull_on_carrier(robot, index, self._exit, at, symbols["tensions"])
            own = carrier.acceleration(at, rate, symbols["thrust"][index], symbols["torque"][index, :].T, pull, gravity)
            carriers.append(ca.SX.zeros(1, 6) if own is None else own.T)
        return self._function(
            "coupled_acceleration",
            "pose velocity tensions carrier_pose carrier_velocity thrust torque",
            acceleration=self._acceleration(self._pull),
            carrier_acceleration=ca.vertcat(*carriers),
        )

    @cached_property
    def linearisation(self) -> ca.Function:
        """Return A, (12, 12), and B, (12, m), of the motion about a state."""
        names = ("pose", "velocity", "tensions")
        pose, velocity, tensions = (self._symbols[name] for name in names)
        rate = ca.vertcat(velocity, self._acceleration(self._pull))
        A, B = ca.jacobian(rate, ca.vertcat(pose, velocity)), ca.jacobian(rate, tensions)
        return self._function("linearisation", "pose velocity tensions carrier_pose", A=ca.densify(A), B=ca.densify(B))

    @cached_property
    def tension_stiffness(self) -> ca.Function:
        """Return K, (6, 6) [N/m, N, N m], under constant tensions."""
        return self._function("tension_stiffness", "pose tensions carrier_pose", K=self._K_t)

    @cached_property
    def stiffness(self) -> ca.Function:
        """Return K, (6, 6) [N/m, N, N m], of elastic cables."""
        K = elasticity.cable_stiffness(self._robot, self._A, self._exit.lengths, self._symbols["tensions"])
        return self._function("stiffness", "pose tensions carrier_pose", K=self._K_t + K)

    def _function(self, name: str, inputs: str, **outputs: Matrix) -> ca.Function:
        names = inputs.split()
        symbols = [self._symbols[name] for name in names]
        return ca.Function(name, symbols, list(outputs.values()), names, list(outputs))

    @cached_property
    def _symbols(self) -> dict[str, ca.SX]:
        count = len(self._robot.carriers)
        others = {"tensions": (self._robot.m,), "wind": (3,), "thrust": (count,), "torque": (count, 3)}
        return Motion.symbols(count, 6)._asdict() | {name: ca.SX.sym(name, *size) for name, size in others.items()}

    @cached_property
    def _anchors(self) -> Matrix:
        return kinematics.anchors(self._robot.anchors, self._robot.carrier_of_cable, self._symbols["carrier_pose"])

    @cached_property
    def _axes(self) -> Matrix:
        return kinematics.axes(self._robot.pulley_axes, self._robot.carrier_of_cable, self._symbols["carrier_pose"])

    @cached_property
    def _exit(self) -> Exit:
        """Return how the cables run."""
        robot = self._robot
        return kinematics.cables(
            robot.attachments, self._symbols["pose"], self._anchors, self._axes, robot.pulley_radii
        )

    @cached_property
    def _A(self) -> Matrix:
        com = np.array(self._robot.platform.com)
        return kinematics.wrench_matrix(self._robot.attachments, com, self._symbols["pose"], self._exit.directions)

    @cached_property
    def _w(self) -> Matrix:
        motion = (self._symbols[name] for name in ("pose", "velocity", "acceleration"))
        return rigid_body.inertial_wrench(self._robot, *motion)

    @cached_property
    def _W_e(self) -> Matrix:
        return wind.aerodynamic_wrench(self._robot, *(self._symbols[name] for name in ("pose", "velocity", "wind")))

    @cached_property
    def _K_t(self) -> Matrix:
        pose, tensions = self._symbols["pose"], self._symbols["tensions"]
        return elasticity.tension_stiffness(self._robot, pose, self._anchors, self._axes, tensions)

    @property
    def _pull(self) -> Matrix:
        return self._A @ self._symbols["tensions"]

    def _acceleration(self, wrench: Matrix) -> Matrix:
        return forward.platform_acceleration(self._robot, self._symbols["pose"], self._symbols["velocity"], wrench)
