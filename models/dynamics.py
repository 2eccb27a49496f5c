"""`Dynamics`: a robot's kinematics and dynamics, called with arrays or with symbols."""

from __future__ import annotations

from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from ..base.display import Displayed
from ..base.inputs import InputError, flag, required
from . import elasticity
from .arrays import Array, Motion, one_array, several_arrays
from .batch import SYMBOLIC, as_array, call, is_symbolic
from .files import AnyRobot, as_robot
from .mechanics import Mechanics
from .part import LARGEST
from .record import fits
from .relative_dynamics import RelativeDynamics
from .robot import Robot
from .world_functions import PUBLISHED, WorldFunctions


def dynamics_of(robot: Robot) -> Dynamics:
    """Return the `Dynamics` of a robot, kept for the next call."""
    return _dynamics_of(required("robot", robot, Robot))


@lru_cache(maxsize=16)
def _dynamics_of(robot: Robot) -> Dynamics:
    return Dynamics(robot)


class Dynamics(Displayed):
    """Kinematics and dynamics of one robot, for arrays and CasADi expressions.

    Everything is in {G}; `relative` has the form of paper F (docs/theory.md), in the frame {A} of a single carrier.
    Arrays may have leading batch dimensions, which broadcast. If `pose` is a CasADi SX or MX, the result is one too.

    The numeric core evaluates arrays if it supports the quantity and the size of the robot, otherwise CasADi.

    `robot` is a `Robot`, the name of one in the library, or the path of a robot file. Raises `InputError` if it is none
    of these. Every method raises it, in one line, for an argument of a wrong shape or value.
    """

    def __init__(self, robot: AnyRobot):
        self.robot = as_robot(robot)
        self._functions = WorldFunctions(self.robot)

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """Return the CasADi Functions by name, with named inputs and outputs."""
        return {name: self._functions.function(name) for name in PUBLISHED}

    def __reduce__(self) -> tuple[type[Dynamics], tuple[Robot]]:
        """Pickle the robot alone: its functions are built again."""
        return Dynamics, (self.robot,)

    @one_array
    def wrench_matrix(self, pose: Array, carrier_pose: Array | None = None) -> Array:
        """Return the wrench matrix A, (..., 6, m), in {G}.

        Each column is the force [N per N] and the moment about the platform's CoM [N m per N] of one cable.

        - `pose`: (x, y, z, roll, pitch, yaw) of the platform frame in {G} [m, rad], (..., 6).
        - `carrier_pose`: the same of each carrier, (..., c, 6); default: at home.
        """
        return self._line("wrench_matrix", pose, carrier_pose)

    @one_array
    def cable_lengths(self, pose: Array, carrier_pose: Array | None = None) -> Array:
        """Return the distance from anchor to attachment of each cable [m], (..., m). Arguments as in `wrench_matrix`.

        Over a pulley it is the length of the cable from the anchor around the sheave to the attachment.
        """
        return self._line("cable_lengths", pose, carrier_pose)

    @one_array
    def length_jacobian(self, pose: Array, carrier_pose: Array | None = None) -> Array:
        """Return the derivative of the cable lengths with respect to the pose, (..., m, 6) [-, m].

        Arguments as in `wrench_matrix`.
        """
        return self._line("length_jacobian", pose, carrier_pose)

    @one_array
    def cable_wrench(self, pose: Array, tensions: Array, carrier_pose: Array | None = None) -> Array:
        """Return the wrench A t of the cables: force [N] and moment about the CoM [N m], in {G}, (..., 6).

        Arguments as in `wrench_jacobian`. As an expression it has fewer operations than A t, and so have its
        derivatives.
        """
        return self._call("cable_wrench", pose=pose, tensions=tensions, carrier_pose=carrier_pose)["W"]

    @one_array
    def wrench_jacobian(self, pose: Array, tensions: Array, carrier_pose: Array | None = None) -> Array:
        """Return the derivative of A t with respect to the pose at constant tensions, (..., 6, 6).

        Arguments as in `wrench_matrix`; `tensions` are (..., m) [N]. For displacements of the CoM and turns about it
        see `stiffness`.
        """
        if numeric := self._numeric(pose, tensions, carrier_pose):
            return numeric.wrench_jacobian(pose, tensions, carrier_pose)
        return self._call("wrench_jacobian", pose=pose, tensions=tensions, carrier_pose=carrier_pose)["D"]

    @several_arrays
    def points(self, pose: Array, carrier_pose: Array | None = None) -> tuple[Array, Array]:
        """Return the anchors and the attachments of the cables in {G}, (..., m, 3) each [m].

        Arguments as in `wrench_matrix`.
        """
        if numeric := self._numeric(pose, carrier_pose):
            return numeric.points(pose, carrier_pose)
        result = self._call("points", pose=pose, carrier_pose=carrier_pose)
        return result["anchors"], result["attachments"]

    @one_array
    def exits(self, pose: Array, carrier_pose: Array | None = None) -> Array:
        """Return where each cable leaves its pulley in {G}, (..., m, 3) [m]; the anchor of a cable without a pulley.

        Arguments as in `wrench_matrix`. The exit is nan for an attachment inside the sheave, where no cable is tangent.
        """
        if is_symbolic(pose) or self.robot.pulley_radii.any():
            return self._call("exits", pose=pose, carrier_pose=carrier_pose)["exits"]
        return self.points(pose, carrier_pose)[0]

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
        """Return the required wrench w of a motion, with A t = w.

        It is force [N] and moment about the CoM [N m], in {G}, (..., 6): inertia and velocity terms minus gravity and
        wind. The carrier motion does not enter w; its arguments exist for symmetry with `relative`, where it causes the
        disturbance D_B.

        - `pose`, `velocity`, `acceleration`: (x, y, z, roll, pitch, yaw) of the platform frame in {G} and its time
          derivatives, (..., 6).
        - `carrier_pose`, `carrier_velocity`, `carrier_acceleration`: the same of each carrier, (..., c, 6); default: at
          home and at rest.
        - `wind`: velocity of the air in {G} [m/s], (..., 3); default: no aerodynamic forces. Raises `InputError` if
          the robot's file has no `platform.aero`.
        """
        motion = Motion(pose, velocity, acceleration, carrier_pose, carrier_velocity, carrier_acceleration)
        if (wind is None or self.robot.platform.aero) and (numeric := self._numeric(*motion, wind)):
            return numeric.required_wrench(motion, wind)
        return self._in_wind("required_wrench", wind, **motion.arguments(self.robot.carrier_home))["w"]

    @one_array
    def carried_wrench(self, pose: Array, velocity: Array, acceleration: Array, load: Array) -> Array:
        """Return the wrench that a load fixed to the platform needs in addition to `required_wrench`, (..., 6), in {G}.

        It is force [N] and moment about the platform's CoM [N m], weight included. Arguments as in
        `required_wrench`. The `load` is (..., 10): mass [kg], CoM in the platform frame (3) [m], and the inertia about
        that CoM in platform axes (Ixx, Iyy, Izz, Ixy, Ixz, Iyz) [kg m^2].
        """
        motion = {"pose": pose, "velocity": velocity, "acceleration": acceleration}
        return self._call("carried_wrench", load=load, **motion)["w"]

    @one_array
    def aerodynamic_wrench(self, pose: Array, velocity: Array, wind: Array) -> Array:
        """Return W_e: force [N] and moment about the CoM [N m] of the air, (..., 6), in {G}; see `models.rigid_body`.

        Arguments as in `required_wrench`.
        """
        return self._call("aerodynamic_wrench", pose=pose, velocity=velocity, wind=wind)["W_e"]

    @one_array
    def acceleration(
        self,
        pose: Array,
        velocity: Array,
        tensions: Array,
        carrier_pose: Array | None = None,
        wind: Array | None = None,
    ) -> Array:
        """Return the second time derivative of `pose` under the tensions, (..., 6) [m/s^2, rad/s^2].

        Arguments as in `required_wrench`; `tensions`, (..., m) [N], may be beyond their limits.
        """
        state = {"pose": pose, "velocity": velocity, "tensions": tensions, "carrier_pose": carrier_pose}
        return self._in_wind("acceleration", wind, **state)["acceleration"]

    @several_arrays
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
        """Return the accelerations of platform, (..., 6), and quadrotor carriers, (..., c, 6), as one system.

        A cable pulls at both its ends. Carriers of other kinds have zero.

        - `pose`, `velocity`: of the platform frame in {G}, (..., 6).
        - `carrier_pose`, `carrier_velocity`: of the carriers in {G}, (..., c, 6).
        - `tensions`: (..., m) [N].
        - `thrust`, `torque`: of each carrier along its z axis, (..., c) [N], and about its axes, (..., c, 3) [N m].
        """
        carriers = {"carrier_pose": carrier_pose, "carrier_velocity": carrier_velocity}
        given = {"tensions": tensions, "thrust": thrust, "torque": torque}
        result = self._call("coupled_acceleration", pose=pose, velocity=velocity, **carriers, **given)
        return result["acceleration"], result["carrier_acceleration"]

    @several_arrays
    def linearise(
        self, pose: Array, velocity: Array, tensions: Array, carrier_pose: Array | None = None
    ) -> tuple[Array, Array]:
        """Linearise the dynamics about a state (pose, velocity) and tensions.

        Deviations x of the state and u of the tensions obey dx/dt = A x + B u to first order. Arguments as in
        `acceleration`. Returns A, (..., 12, 12) [1/s, 1/s^2], and B, (..., 12, m) [m/s^2 and rad/s^2 per N]. The
        tensions are constant when the platform moves; for elastic cables see `stiffness`.
        """
        state = {"pose": pose, "velocity": velocity, "tensions": tensions, "carrier_pose": carrier_pose}
        result = self._call("linearisation", **state)
        return result["A"], result["B"]

    @one_array
    def stiffness(self, pose: Array, tensions: Array, carrier_pose: Array | None = None, elastic: bool = True) -> Array:
        """Return the stiffness K about the CoM in {G}, (..., 6, 6) [N/m, N, N m].

        A small displacement delta, the translation of the CoM [m] and a rotation vector [rad], makes the wrench
        -K delta.

        - `pose`, `carrier_pose`: as in `wrench_matrix`.
        - `tensions`: (..., m) [N].
        - `elastic`: True: elastic cables, each with its `stiffness`; False: constant tensions, only the geometry
          changes.

        Raises:
            InputError: If `elastic` and a cable has no stiffness.
        """
        if flag("elastic", elastic):
            for index, cable in enumerate(self.robot.cables):
                if cable.stiffness is None:
                    raise InputError(
                        f"cables[{index}].stiffness must be E A > 0 [N] for every cable, got none in robot "
                        f"{self.robot.name!r}"
                    )
        if numeric := self._numeric(pose, tensions, carrier_pose):
            return numeric.stiffness(pose, tensions, carrier_pose, elastic)
        name = "stiffness" if elastic else "tension_stiffness"
        return self._call(name, pose=pose, tensions=tensions, carrier_pose=carrier_pose)["K"]

    def natural_frequencies(
        self, pose: ArrayLike, tensions: ArrayLike, carrier_pose: ArrayLike | None = None, elastic: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Compute the natural frequencies of small undamped motions about an equilibrium.

        Returns frequencies, ascending (k,) [Hz], negative where the motion is unstable, and modes (6, k): twists of
        translation of the CoM [m] and rotation vector [rad] in {G}.

        - `pose`, `tensions`, `carrier_pose`: an equilibrium: (6,), (m,) [N] and (c, 6). Cables with zero tension are
          slack and are ignored.
        - `elastic`: False: inextensible cables, which permit 6 - rank motions, or none.

        Raises:
            InputError: If an argument has a wrong shape or value, or `elastic` and a cable has no stiffness.
        """
        home = self.robot.carrier_home
        places = home if carrier_pose is None else carrier_pose
        given = {"pose": (pose, (6,)), "tensions": (tensions, (self.robot.m,)), "carrier_pose": (places, home.shape)}
        pose, tensions, carrier_pose = checked = [as_array(name, value, core) for name, (value, core) in given.items()]
        for (name, (_, core)), array in zip(given.items(), checked, strict=True):
            if array.shape != core:
                raise InputError(f"{name} must have the shape {core}, got {array.shape}")
            if (largest := np.abs(array).max()) > LARGEST:
                raise InputError(f"{name} must be numbers up to {LARGEST:g}, got {largest:g}")
        K = self.stiffness(pose, tensions, carrier_pose, elastic=elastic)
        rows, C = np.flatnonzero(self.robot.dof_mask), elasticity.whitening(self.robot, pose)
        free = C.T  # twists, one a column
        if not elastic:
            taut = tensions > 1e-9 * max(tensions.max(initial=0.0), 1e-300)
            U, sigma, _ = np.linalg.svd(C @ self.wrench_matrix(pose, carrier_pose)[rows][:, taut])
            free = C.T @ U[:, int((sigma > 1e-9 * sigma.max(initial=1e-300)).sum()) :]
        squares, modes = np.linalg.eigh(elasticity.whitened(self.robot, K, free.T))
        return elasticity.frequency(squares), np.eye(6)[:, rows] @ free @ modes

    @cached_property
    def relative(self) -> RelativeDynamics:
        """Return the form of paper F, in the frame {A} of the robot's only carrier.

        Raises `InputError` if the robot has more than one carrier: then no carrier's frame is {A}.
        """
        return RelativeDynamics(self.robot)

    @cached_property
    def _core(self) -> Mechanics | None:
        """Return the mechanics by the numeric core; None if it has no room for the robot."""
        return Mechanics(self.robot) if fits(self.robot) else None

    def _numeric(self, *arguments: Array) -> Mechanics | None:
        """Return what evaluates such arguments without CasADi, or None."""
        for argument in arguments:
            if isinstance(argument, SYMBOLIC):
                return None
        return self._core

    def _line(self, name: str, pose: Array, carrier_pose: Array | None) -> Array:
        """Return what has one output and needs the poses alone."""
        if numeric := self._numeric(pose, carrier_pose):
            return numeric.line(name, pose, carrier_pose)
        return next(iter(self._call(name, pose=pose, carrier_pose=carrier_pose).values()))

    def _call(self, name: str, **arguments: Array) -> dict[str, Array]:
        """Evaluate one of the functions, with its carriers at home if `carrier_pose` is None."""
        if "carrier_pose" in arguments and arguments["carrier_pose"] is None:
            arguments["carrier_pose"] = self.robot.carrier_home
        return call(self._functions.function(name), arguments, matrices=("A", "B", "J"))

    def _in_wind(self, name: str, wind: Array | None, **arguments: Array) -> dict[str, Array]:
        """Evaluate one of the functions that exist without and with wind."""
        return self._call(name, **arguments) if wind is None else self._call(f"{name}_in_wind", wind=wind, **arguments)
