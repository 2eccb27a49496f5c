"""`WorldFunctions`: kinematics and dynamics of a robot in {G} as CasADi Functions, each built when it is first used."""

from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np

from . import elasticity, kinematics, rigid_body
from .arrays import Motion
from .cables.pulley import Exit
from .robot import Robot
from .rotation import Matrix

PUBLISHED = ("wrench_matrix", "cable_lengths", "required_wrench", "acceleration")


class WorldFunctions:
    """The functions of a robot, whose inputs have the names that arguments of `Dynamics` have."""

    def __init__(self, robot: Robot):
        self._robot = robot
        self._built: dict[str, ca.Function] = {}

    def function(self, name: str) -> ca.Function:
        """Return one of the functions in `_DEFINITIONS`."""
        if name not in self._built:
            inputs, define = _DEFINITIONS[name]
            names, outputs = inputs.split(), define(self)
            symbols = [self._symbols[name] for name in names]
            self._built[name] = ca.Function(name, symbols, list(outputs.values()), names, list(outputs))
        return self._built[name]

    @cached_property
    def _symbols(self) -> dict[str, ca.SX]:
        count = len(self._robot.carriers)
        others = {"tensions": (self._robot.m,), "wind": (3,), "thrust": (count,), "torque": (count, 3), "load": (10,)}
        return Motion.symbols(count, 6)._asdict() | {name: ca.SX.sym(name, *size) for name, size in others.items()}

    @cached_property
    def _anchors(self) -> Matrix:
        return kinematics.anchors(self._robot, self._symbols["carrier_pose"])

    @cached_property
    def _axes(self) -> Matrix:
        return kinematics.axes(self._robot, self._symbols["carrier_pose"])

    @cached_property
    def _exit(self) -> Exit:
        """Return how the cables run."""
        return kinematics.cables(self._robot, self._symbols["pose"], self._anchors, self._axes)

    @cached_property
    def _A(self) -> Matrix:
        return kinematics.wrench_matrix(self._robot, self._symbols["pose"], self._exit.directions)

    @cached_property
    def _w(self) -> Matrix:
        motion = (self._symbols[name] for name in ("pose", "velocity", "acceleration"))
        return rigid_body.inertial_wrench(self._robot, *motion)

    @cached_property
    def _w_load(self) -> Matrix:
        motion = (self._symbols[name] for name in ("pose", "velocity", "acceleration"))
        return rigid_body.carried_wrench(self._robot, self._symbols["load"], *motion)

    @cached_property
    def _W_e(self) -> Matrix:
        return rigid_body.aerodynamic_wrench(
            self._robot, *(self._symbols[name] for name in ("pose", "velocity", "wind"))
        )

    @cached_property
    def _K_t(self) -> Matrix:
        pose, tensions = self._symbols["pose"], self._symbols["tensions"]
        return elasticity.tension_stiffness(self._robot, pose, self._anchors, self._axes, tensions)

    @cached_property
    def _pull(self) -> Matrix:
        return kinematics.cable_wrench(self._robot, self._symbols["pose"], self._exit, self._symbols["tensions"])

    def _acceleration(self, wrench: Matrix) -> Matrix:
        return rigid_body.platform_acceleration(self._robot, self._symbols["pose"], self._symbols["velocity"], wrench)

    def _coupled_acceleration(self) -> dict[str, Matrix]:
        robot, symbols = self._robot, self._symbols
        gravity, carriers = np.array(robot.gravity), []
        for index, carrier in enumerate(robot.carriers):
            at, rate = symbols["carrier_pose"][index, :].T, symbols["carrier_velocity"][index, :].T
            pull = rigid_body.pull_on_carrier(robot, index, self._exit, at, symbols["tensions"])
            own = carrier.acceleration(at, rate, symbols["thrust"][index], symbols["torque"][index, :].T, pull, gravity)
            carriers.append(ca.SX.zeros(1, 6) if own is None else own.T)
        return {"acceleration": self._acceleration(self._pull), "carrier_acceleration": ca.vertcat(*carriers)}

    def _linearisation(self) -> dict[str, Matrix]:
        pose, velocity, tensions = (self._symbols[name] for name in ("pose", "velocity", "tensions"))
        rate = ca.vertcat(velocity, self._acceleration(self._pull))
        A, B = ca.jacobian(rate, ca.vertcat(pose, velocity)), ca.jacobian(rate, tensions)
        return {"A": ca.densify(A), "B": ca.densify(B)}

    def _points(self) -> dict[str, Matrix]:
        attachments = kinematics.transform(self._symbols["pose"], self._robot.attachments)
        return {"anchors": self._anchors.T, "attachments": attachments.T}

    def _stiffness(self) -> dict[str, Matrix]:
        K = elasticity.cable_stiffness(self._robot, self._A, self._exit.lengths, self._symbols["tensions"])
        return {"K": self._K_t + K}


def _slopes(values: Matrix, of: WorldFunctions) -> Matrix:
    return ca.densify(ca.jacobian(values, of._symbols["pose"]))


_PLACE, _PULLED, _STATE = "pose carrier_pose", "pose tensions carrier_pose", "pose velocity tensions carrier_pose"
_MOTION = " ".join(Motion._fields)
# The inputs of each function, and its outputs by name.
_DEFINITIONS: dict[str, tuple[str, Callable[[WorldFunctions], dict[str, Matrix]]]] = {
    "wrench_matrix": (_PLACE, lambda of: {"A": of._A}),  # (6, m)
    "cable_lengths": (_PLACE, lambda of: {"lengths": of._exit.lengths}),  # (m, 1)
    "length_jacobian": (_PLACE, lambda of: {"J": _slopes(of._exit.lengths, of)}),  # (m, 6)
    "cable_wrench": (_PULLED, lambda of: {"W": of._pull}),  # (6, 1)
    "wrench_jacobian": (_PULLED, lambda of: {"D": _slopes(of._pull, of)}),  # (6, 6)
    "points": (_PLACE, WorldFunctions._points),  # (m, 3) each
    "exits": (_PLACE, lambda of: {"exits": of._exit.points.T}),  # (m, 3)
    "required_wrench": (_MOTION, lambda of: {"w": of._w}),  # (6, 1)
    "required_wrench_in_wind": (f"{_MOTION} wind", lambda of: {"w": of._w - of._W_e}),  # (6, 1)
    "carried_wrench": ("pose velocity acceleration load", lambda of: {"w": of._w_load}),  # (6, 1)
    "aerodynamic_wrench": ("pose velocity wind", lambda of: {"W_e": of._W_e}),  # (6, 1)
    "acceleration": (_STATE, lambda of: {"acceleration": of._acceleration(of._pull)}),  # (6, 1)
    "acceleration_in_wind": (
        f"{_STATE} wind",
        lambda of: {"acceleration": of._acceleration(of._pull + of._W_e)},  # (6, 1)
    ),
    "coupled_acceleration": (
        f"{_STATE} carrier_velocity thrust torque",
        WorldFunctions._coupled_acceleration,  # (6, 1) and (c, 6)
    ),
    "linearisation": (_STATE, WorldFunctions._linearisation),  # (12, 12) and (12, m)
    "tension_stiffness": (_PULLED, lambda of: {"K": of._K_t}),  # (6, 6)
    "stiffness": (_PULLED, WorldFunctions._stiffness),  # (6, 6)
}
