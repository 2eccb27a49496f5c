"""`Dynamics`: a robot's kinematics and dynamics as CasADi Functions, called with arrays or with symbols."""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError
from . import elasticity, forward, kinematics, rigid_body, wind
from .batch import call
from .cables.pulley import Exit
from .relative_dynamics import Array, RelativeDynamics
from .robot import QuadrotorCarrier, Robot


def dynamics_of(robot: Robot) -> Dynamics:
    """Return the `Dynamics` of a robot, kept for the next call."""
    key: Any = robot  # frozen, so it has a hash, which a type checker does not see
    return _dynamics_of(key)


@lru_cache(maxsize=16)
def _dynamics_of(robot: Any) -> Dynamics:
    return Dynamics(robot)


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
        arguments = {"pose": pose, "carrier_pose": self._carriers(carrier_pose)}
        return call(self.functions["wrench_matrix"], arguments, matrices=("A",))["A"]

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
        """W_e: force [N] and moment about the CoM [N m] of the air, (..., 6), in {G}; see `models.wind`.

        Arguments as in `required_wrench`.
        """
        arguments = {"pose": pose, "velocity": velocity, "wind": wind}
        return call(self._aerodynamic, arguments)["W_e"]

    def acceleration(
        self,
        pose: Array,
        velocity: Array,
        tensions: Array,
        carrier_pose: Array | None = None,
        wind: Array | None = None,
    ) -> Array:
        """Forward dynamics: the second time derivative of `pose` under the tensions, (..., 6) [m/s^2, rad/s^2].

        Parameters
        ----------
        pose, velocity
            (x, y, z, roll, pitch, yaw) of the platform frame in {G} and its time derivative, (..., 6).
        tensions
            (..., m) [N]; taken as they are, also beyond their limits.
        carrier_pose
            (..., c, 6); None: at home.
        wind
            Velocity of the air in {G} [m/s], (..., 3); None: no air at all.
        """
        arguments = {"pose": pose, "velocity": velocity, "tensions": tensions}
        arguments["carrier_pose"] = self._carriers(carrier_pose)
        if wind is None:
            return call(self.functions["acceleration"], arguments)["acceleration"]
        return call(self._acceleration_in_wind, arguments | {"wind": wind})["acceleration"]

    def coupled_acceleration(
        self,
        pose: Array,
        velocity: Array,
        carrier_pose: Array,
        carrier_velocity: Array,
        tensions: Array,
        thrust: Array,
        torque: Array,
    ) -> tuple[Array, Array]:
        """Forward dynamics of platform and quadrotor carriers as one system: each cable pulls at both of its ends.

        Parameters
        ----------
        pose, velocity
            Of the platform frame in {G}, (..., 6).
        carrier_pose, carrier_velocity
            Of the carriers in {G}, (..., c, 6).
        tensions
            (..., m) [N].
        thrust
            Of each carrier along its z axis, (..., c) [N].
        torque
            Of each carrier about its axes, (..., c, 3) [N m].

        Returns
        -------
        Accelerations of the platform, (..., 6), and of the carriers, (..., c, 6); carriers of other kinds have zero.
        """
        arguments = {
            "pose": pose,
            "velocity": velocity,
            "carrier_pose": carrier_pose,
            "carrier_velocity": carrier_velocity,
            "tensions": tensions,
            "thrust": thrust,
            "torque": torque,
        }
        result = call(self._coupled, arguments)
        return result["acceleration"], result["carrier_acceleration"]

    def linearise(
        self, pose: Array, velocity: Array, tensions: Array, carrier_pose: Array | None = None
    ) -> tuple[Array, Array]:
        """Linearised forward dynamics, d(dx)/dt = A dx + B dt about a state x = (pose, velocity) and tensions.

        Arguments as in `acceleration`.

        Returns
        -------
        A, (..., 12, 12) [1/s, 1/s^2], and B, (..., 12, m) [m/s^2 and rad/s^2 per N]. The tensions stay as they are when
        the platform moves; for elastic cables see `stiffness`.
        """
        arguments = {"pose": pose, "velocity": velocity, "tensions": tensions}
        arguments["carrier_pose"] = self._carriers(carrier_pose)
        result = call(self._linearisation, arguments, matrices=("B",))
        return result["A"], result["B"]

    def stiffness(self, pose: Array, tensions: Array, carrier_pose: Array | None = None, elastic: bool = True) -> Array:
        """Stiffness K about the CoM in {G}, (..., 6, 6) [N/m, N, N m]: a small displacement delta makes -K delta.

        delta is (translation of the CoM [m], rotation vector [rad]).

        Parameters
        ----------
        pose, carrier_pose
            As in `wrench_matrix`.
        tensions
            (..., m) [N].
        elastic
            True: the cables stretch, each needs its `stiffness`; False: their tensions stay, only geometry counts.

        Raises
        ------
        InputError
            If `elastic` and a cable has no stiffness.
        """
        if elastic:
            for index, cable in enumerate(self.robot.cables):
                if cable.stiffness is None:
                    raise InputError(
                        f"cables[{index}].stiffness: robot {self.robot.name!r} has none; accepted: E A > 0 [N] for "
                        "every cable, or elastic=False"
                    )
        arguments = {"pose": pose, "tensions": tensions, "carrier_pose": self._carriers(carrier_pose)}
        return call(self._stiffness if elastic else self._tension_stiffness, arguments)["K"]

    def natural_frequencies(
        self, pose: np.ndarray, tensions: np.ndarray, carrier_pose: np.ndarray | None = None, elastic: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Natural frequencies of small motions about an equilibrium, undamped.

        Parameters
        ----------
        pose, tensions, carrier_pose
            An equilibrium: (6,), (m,) [N] and (c, 6). Cables with zero tension are slack and do not count.
        elastic
            False: inextensible cables, which leave 6 - rank motions (none if the platform is held on all sides).

        Returns
        -------
        Frequencies, ascending (k,) [Hz], negative where the motion is unstable, and modes (6, k): twists of
        translation of the CoM [m] and rotation vector [rad] in {G}.
        """
        tensions = np.asarray(tensions, dtype=float)
        K = self.stiffness(pose, tensions, carrier_pose, elastic=elastic)
        rows = np.flatnonzero(self.robot.dof_mask)
        free = np.eye(6)[:, rows]
        if not elastic:
            taut = tensions > 1e-9 * max(tensions.max(initial=0.0), 1e-300)
            A = self.wrench_matrix(pose, carrier_pose)[rows][:, taut]
            U, sigma, _ = np.linalg.svd(A)
            rank = int((sigma > 1e-9 * sigma.max(initial=1e-300)).sum())
            free = free @ U[:, rank:]
        return elasticity.frequencies(K, elasticity.spatial_inertia(self.robot, np.asarray(pose, dtype=float)), free)

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
    def _acceleration_in_wind(self) -> ca.Function:
        names = ["pose", "velocity", "tensions", "carrier_pose"]
        symbols = _symbols(self.robot, names)
        pose, velocity, tensions, carriers = symbols
        air = ca.SX.sym("wind", 3)
        pull = self.wrench_matrix(pose, carriers) @ tensions
        wrench = pull + wind.aerodynamic_wrench(self.robot, pose, velocity, air)
        acceleration = forward.platform_acceleration(self.robot, pose, velocity, wrench)
        return ca.Function("acceleration_in_wind", [*symbols, air], [acceleration], [*names, "wind"], ["acceleration"])

    @cached_property
    def _coupled(self) -> ca.Function:
        robot = self.robot
        names = ["pose", "velocity", "tensions", "carrier_pose", "carrier_velocity"]
        symbols = _symbols(robot, names)
        pose, velocity, tensions, carriers, rates = symbols
        thrust, torque = ca.SX.sym("thrust", self._count), ca.SX.sym("torque", self._count, 3)
        A, run = self.wrench_matrix(pose, carriers), _run(robot, pose, carriers)
        accelerations = []
        for index, carrier in enumerate(robot.carriers):
            if isinstance(carrier, QuadrotorCarrier):
                at, rate = carriers[index, :].T, rates[index, :].T
                pull = forward.pull_on_carrier(robot, index, run, at, tensions)
                inputs = (thrust[index], torque[index, :].T)
                accelerations.append(
                    forward.quadrotor_acceleration(carrier, np.array(robot.gravity), at, rate, *inputs, pull).T
                )
            else:
                accelerations.append(ca.SX.zeros(1, 6))
        acceleration = forward.platform_acceleration(robot, pose, velocity, A @ tensions)
        outputs = [acceleration, ca.vertcat(*accelerations)]
        return ca.Function(
            "coupled_acceleration",
            [*symbols, thrust, torque],
            outputs,
            [*names, "thrust", "torque"],
            ["acceleration", "carrier_acceleration"],
        )

    @cached_property
    def _linearisation(self) -> ca.Function:
        names = ["pose", "velocity", "tensions", "carrier_pose"]
        symbols = _symbols(self.robot, names)
        pose, velocity, tensions, carriers = symbols
        state = ca.vertcat(pose, velocity)
        rate = ca.vertcat(velocity, self.acceleration(pose, velocity, tensions, carriers))
        outputs = [ca.densify(ca.jacobian(rate, state)), ca.densify(ca.jacobian(rate, tensions))]
        return ca.Function("linearisation", symbols, outputs, names, ["A", "B"])

    @cached_property
    def _tension_stiffness(self) -> ca.Function:
        names = ["pose", "tensions", "carrier_pose"]
        symbols = _symbols(self.robot, names)
        pose, tensions, carriers = symbols
        owner = self.robot.carrier_of_cable
        anchors = kinematics.anchors(self.robot.anchors, owner, carriers)
        axes = kinematics.axes(self.robot.pulley_axes, owner, carriers)
        K = elasticity.tension_stiffness(self.robot, pose, anchors, axes, tensions)
        return ca.Function("tension_stiffness", symbols, [K], names, ["K"])

    @cached_property
    def _stiffness(self) -> ca.Function:
        names = ["pose", "tensions", "carrier_pose"]
        symbols = _symbols(self.robot, names)
        pose, tensions, carriers = symbols
        A, lengths = self.wrench_matrix(pose, carriers), self.cable_lengths(pose, carriers)
        K = self._tension_stiffness(*symbols) + elasticity.cable_stiffness(self.robot, A, lengths, tensions)
        return ca.Function("stiffness", symbols, [K], names, ["K"])

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


def _symbols(robot: Robot, names: list[str]) -> list[ca.SX]:
    """Symbols of the shapes that these arguments have."""
    count = len(robot.carriers)
    shapes = {"tensions": (robot.m, 1)}
    return [ca.SX.sym(name, *shapes.get(name, (count, 6) if name.startswith("carrier") else (6, 1))) for name in names]


def _run(robot: Robot, pose: ca.SX, carriers: ca.SX) -> Exit:
    """How the cables run in {G}."""
    anchors = kinematics.anchors(robot.anchors, robot.carrier_of_cable, carriers)
    axes = kinematics.axes(robot.pulley_axes, robot.carrier_of_cable, carriers)
    return kinematics.cables(robot.attachments, pose, anchors, axes, robot.pulley_radii)


def _world_functions(robot: Robot) -> dict[str, ca.Function]:
    names = ["pose", "velocity", "acceleration", "carrier_pose", "carrier_velocity", "carrier_acceleration"]
    motion = _symbols(robot, names)
    pose, velocity, acceleration, carriers = motion[:4]
    (tensions,) = _symbols(robot, ["tensions"])
    run = _run(robot, pose, carriers)
    A = kinematics.wrench_matrix(robot.attachments, np.array(robot.platform.com), pose, run.directions)
    w = rigid_body.inertial_wrench(robot, pose, velocity, acceleration)
    forward_acceleration = forward.platform_acceleration(robot, pose, velocity, A @ tensions)
    place, state = [pose, carriers], [pose, velocity, tensions, carriers]
    place_names, state_names = ["pose", "carrier_pose"], ["pose", "velocity", "tensions", "carrier_pose"]
    return {
        "wrench_matrix": ca.Function("wrench_matrix", place, [A], place_names, ["A"]),
        "cable_lengths": ca.Function("cable_lengths", place, [run.lengths], place_names, ["lengths"]),
        "required_wrench": ca.Function("required_wrench", motion, [w], names, ["w"]),
        "acceleration": ca.Function("acceleration", state, [forward_acceleration], state_names, ["acceleration"]),
    }
