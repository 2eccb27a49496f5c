"""`Plant`: simulate a robot with slack cables, winches, wind and disturbances."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base import processors
from ..base.errors import InputError, SolverError
from ..base.inputs import leading, number, one_of, repeated, shown, whole_number
from ..core import run_plant
from ..models.batch import as_array
from ..models.dynamics import dynamics_of
from ..models.files import AnyRobot, as_robot
from ..models.record import FREE, IMPOSED, RESTS, record_of
from . import layout
from .layout import SETTINGS, command_rows, complete, given_or, leading_of, place
from .reading import Reading, sensed

DRIVES = {"lengths": layout.LENGTHS, "rates": layout.RATES, "forces": layout.FORCES, "tensions": layout.TENSIONS}
SHORTEST_STEP, LONGEST_STEP = 1e-12, 1e3  # [s]
STEPS_WORTH_A_THREAD = 20_000  # some 20 milliseconds


class History(NamedTuple):
    """States over time, with leading dimensions of a batch.

    Attributes:
        times: (K,) [s], from 0.
        states: (..., K, n).
        tensions: (..., K, m) [N], at each state, for the command that begins there; at the last state, for the one that
            ends there.
    """

    times: np.ndarray
    states: np.ndarray
    tensions: np.ndarray


class Plant:
    """Simulate a robot's response to commands, step by step.

    The state is one array, (n,), and the plant keeps no other memory: `start` makes a state, `read` reads it, `step`
    and `run` return later ones. Arguments may have leading batch dimensions, which broadcast. The same arguments give
    the same bits.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        drive: Type of the cable commands: unstrained "lengths" [m], "rates" of these [m/s], "forces" [N] of the winch
            motors, or "tensions" [N]. Without a winch in the robot's file, lengths and rates are followed exactly: a
            length is reached, at constant rate, at the end of its step. A winch follows them as a servo loop inside its
            limits.
        contacts: "located": steps end where a cable becomes taut or slack, or a winch begins or stops slipping, which
            keeps the fourth order. "sampled": Runge-Kutta over the kinks, in a third of the time if there are many; for
            elastic cables only.
        stiffness, damping: E A [N] and C [N s/m], a number or one for each cable, instead of the file's values. A cable
            without stiffness does not stretch: it keeps the distance of its ends below its length, and becomes taut in
            an impact.
        carrier_bandwidth, winch_bandwidth: Bandwidths of the servo loops of mobile carriers and of winches [rad/s].
            Robot files have no keys for them.
        tension_lag: Time constant [s] with which tensions follow their commands; 0: exactly.

    Attributes:
        robot: The `Robot`.
        size: Length of a state, n.
        record: The robot in the format of the numeric core, with the plant's stiffness and damping; read-only.
        settings: Drive, contacts and bandwidths in the format of the numeric core, `layout.SETTINGS`.

    Raises:
        InputError: If an argument has a wrong value, forces are commanded to cables without winches, or the robot has
            more cables or carriers than the numeric core supports. Every method raises it for a wrong shape or value.
    """

    def __init__(
        self,
        robot: AnyRobot,
        drive: str = "lengths",
        contacts: str = "located",
        stiffness: float | Sequence[float] | np.ndarray | None = None,
        damping: float | Sequence[float] | np.ndarray | None = None,
        carrier_bandwidth: float = 20.0,
        winch_bandwidth: float = 100.0,
        tension_lag: float = 0.0,
    ):
        self.robot = as_robot(robot)
        self.drive = one_of("drive", drive, DRIVES)
        self.contacts = one_of("contacts", contacts, ("located", "sampled"))
        cables = self.robot.cables
        EA = self._of_cables("stiffness", stiffness, [cable.stiffness or 0.0 for cable in cables])
        C = self._of_cables("damping", damping, [cable.damping or 0.0 for cable in cables])
        if drive == "forces" and any(cable.winch is None for cable in cables):
            first = next(i for i, cable in enumerate(cables) if cable.winch is None)
            raise InputError(f"drive must not be 'forces' unless every cable has a winch, got none in cables[{first}]")
        if contacts == "sampled" and drive != "tensions" and not EA.all():
            first = int(np.flatnonzero(EA == 0)[0])
            raise InputError(
                f"contacts must be 'located' unless all cables stretch, got no stiffness of cables[{first}]"
            )
        self.record = record_of(self.robot).copy()
        self.record["cable"]["stiffness"][: self.robot.m], self.record["cable"]["damping"][: self.robot.m] = EA, C
        self.record.flags.writeable = False
        self.settings = np.array(
            (
                DRIVES[drive],
                contacts == "located",
                number("carrier_bandwidth", carrier_bandwidth, 1e-3, 1e4),
                number("winch_bandwidth", winch_bandwidth, 1e-3, 1e4),
                number("tension_lag", tension_lag, 0.0, 1e3),
            ),
            SETTINGS,
        )
        self._places = layout.BODY * (1 + len(self.robot.carriers))
        self.size = self._places + layout.CABLE_BLOCKS * self.robot.m
        self._command_size = layout.COMMANDS + self.robot.m + layout.CARRIER * len(self.robot.carriers)

    def _of_cables(self, name: str, value: Any, default: list[float]) -> np.ndarray:
        result = repeated(name, default if value is None else value, self.robot.m)
        if not ((result >= 0) & (result < np.inf)).all():
            raise InputError(f"{name} must be finite numbers >= 0, one or one for each cable, got {shown(value)}")
        return result

    def start(
        self,
        pose: Any = None,
        velocity: Any = None,
        carrier_pose: Any = None,
        carrier_velocity: Any = None,
        tensions: Any = None,
        lengths: Any = None,
    ) -> np.ndarray:
        """Return a state, (..., n).

        Args:
            pose, velocity: Pose of the platform frame in {G} [m, rad], (..., 6), and its time derivative; default: at
                home, at rest.
            carrier_pose, carrier_velocity: The same for the carriers, (..., c, 6); velocities of fixed coordinates are
                ignored.
            tensions: Tensions at the start, (..., m) [N]. They determine the unstrained lengths of elastic cables, and
                winches start at the speeds that keep these tensions.
            lengths: Unstrained lengths, (..., m) [m], instead of `tensions`; default: cables without tension at the
                pose.

        Raises:
            InputError: If both tensions and lengths are given, or an argument has a wrong shape or value.
        """
        robot, count = self.robot, len(self.robot.carriers)
        if tensions is not None and lengths is not None:
            raise InputError("lengths must be None if tensions are given, got both")
        poses, velocities = given_or("pose", pose, robot.home), given_or("velocity", velocity, np.zeros(6))
        carriers = given_or("carrier_pose", carrier_pose, robot.carrier_home)
        moving = given_or("carrier_velocity", carrier_velocity, np.zeros((count, 6)))
        pulls, own = given_or("tensions", tensions, np.zeros(robot.m)), given_or("lengths", lengths, np.zeros(robot.m))
        if lengths is not None and not (own >= layout.SHORTEST).all():
            raise InputError(f"lengths must be numbers >= {layout.SHORTEST:g} m, got {own.min():g} m")
        if (pulls < 0).any():
            raise InputError(f"tensions must be numbers >= 0 N, got {pulls.min():g} N")
        of_body = {"pose": poses, "velocity": velocities, "tensions": pulls, "lengths": own}
        of_carriers = {"carrier_pose": carriers, "carrier_velocity": moving}
        batch = leading_of(of_body, of_carriers)
        bodies = np.zeros((*batch, 1 + count, layout.BODY))
        place(bodies[..., 0, :], poses, velocities, np.array(robot.platform.com))
        place(bodies[..., 1:, :], carriers, moving, np.zeros(3))
        motions = self.record["body"]["motion"][1 : 1 + count]
        bodies[..., 1:, layout.VELOCITY : layout.RATE] *= (motions != RESTS)[:, None]
        bodies[..., 1:, layout.RATE :] *= np.isin(motions, (FREE, IMPOSED))[:, None]
        cables = np.zeros((*batch, layout.CABLE_BLOCKS, robot.m))
        if self.drive == "tensions":
            first = pulls
        elif lengths is not None:
            first = own
        else:
            spans = dynamics_of(robot).cable_lengths(poses, carriers)
            first = np.maximum(spans / (1 + self._strain(pulls)), layout.SHORTEST)
        cables[..., layout.LENGTH, :] = cables[..., layout.REFERENCE, :] = first
        states = np.concatenate([bodies.reshape(*batch, -1), cables.reshape(*batch, -1)], axis=-1)
        if tensions is not None and self.drive == "forces":
            along = sensed(robot, states)[1]
            rates = self._places + layout.LENGTH_RATE * robot.m
            states[..., rates : rates + robot.m] = along[..., 1, :] * first / along[..., 0, :]
        return states

    def fixed_lengths(self, tensions: np.ndarray) -> np.ndarray | None:
        """Return unstrained lengths, (..., m) [m], of cables that have the file's fixed lengths under `tensions` [N].

        None if the robot has winches, or the drive of the plant is not "lengths".
        """
        if self.robot.fixed_lengths is None or self.drive != "lengths":
            return None
        return self.robot.fixed_lengths / (1 + self._strain(tensions))

    def _strain(self, tensions: np.ndarray) -> np.ndarray:
        """Return the strains of the cables at rest under tensions, (..., m); 0 of those that do not stretch."""
        EA = self.record["cable"]["stiffness"][: self.robot.m]
        return tensions / np.where(EA > 0, EA, np.inf)

    def command(
        self,
        cables: Any,
        actuation: Any = None,
        carrier_pose: Any = None,
        carrier_velocity: Any = None,
        carrier_acceleration: Any = None,
        wind: Any = None,
        wrench: Any = None,
        carrier_wrench: Any = None,
    ) -> np.ndarray:
        """Pack the commands for a step into rows, (..., k).

        Args:
            cables: (..., m): lengths [m], rates [m/s], forces [N] or tensions [N], depending on the drive.
            actuation: Commands to the actuators of each carrier, (..., c, a): for a quadrotor thrust [N] and torques
                about its axes [N m]. The plant clips them to their limits. Default: zeros.
            carrier_pose, carrier_velocity, carrier_acceleration: Reference of the carriers at the beginning of the
                step, (..., c, 6). It continues to the reference of the next command of a `run`, or with this
                acceleration if there is none. Prescribed carriers follow it exactly; mobile ones with a second-order
                lag, inside their limits of speed and acceleration. Default: at home, at rest. Missing velocities and
                accelerations are derived from the poses of a `run`, see `samples`.
            wind: Velocity of the air in {G} [m/s], (..., 3); default: no aerodynamic forces.
            wrench: Disturbance on the platform: force [N] and moment about the CoM [N m] in {G}, (..., 6).
            carrier_wrench: The same on the carriers, (..., c, 6), such as wind on quadrotors. It moves those that have
                mass.

        Raises:
            InputError: If an argument has a wrong shape or value, or wind is given and the robot's file has no
                `platform.aero`.
        """
        robot, count = self.robot, len(self.robot.carriers)
        if wind is not None and robot.platform.aero is None:
            raise InputError(f"wind must be left out for robot {robot.name!r}, which has no platform.aero")
        actuators = max([len(carrier.actuators) for carrier in robot.carriers])
        home = robot.carrier_home
        parts = {
            "cables": as_array("cables", cables, (robot.m,)),
            "wind": given_or("wind", wind, np.zeros(3)),
            "wrench": given_or("wrench", wrench, np.zeros(6)),
        }
        derivative = np.full(home.shape, 0.0 if carrier_pose is None else np.nan)  # which `complete` replaces
        of_carriers = {
            "actuation": given_or("actuation", actuation, np.zeros((count, actuators))),
            "carrier_wrench": given_or("carrier_wrench", carrier_wrench, np.zeros(home.shape)),
            "carrier_pose": given_or("carrier_pose", carrier_pose, home),
            "carrier_velocity": given_or("carrier_velocity", carrier_velocity, derivative),
            "carrier_acceleration": given_or("carrier_acceleration", carrier_acceleration, derivative),
        }
        if self.drive == "lengths" and not (parts["cables"] >= layout.SHORTEST).all():
            least = parts["cables"].min()
            raise InputError(f"cables must be lengths >= {layout.SHORTEST:g} m, got {least:g} m")
        return command_rows(leading_of(parts, of_carriers), parts, of_carriers, wind is not None)

    def step(self, state: np.ndarray, command: np.ndarray, dt: float, after: np.ndarray | None = None) -> np.ndarray:
        """Return the state [m, rad, s] after `dt` [s] under one command, (..., n).

        Args:
            state, command, dt: As in `run`.
            after: The next command, (..., k). Carriers then continue to its reference as in a `run`; without it their
                acceleration is constant.

        Raises:
            InputError, SolverError: As in `run`.
        """
        try:
            rows = np.stack([command] if after is None else np.broadcast_arrays(command, after), axis=-2)
        except ValueError:
            raise InputError(f"after must be a command like {shown(command)}, got {shown(after)}") from None
        both = isinstance(state, np.ndarray) and isinstance(command, np.ndarray)
        if both and state.shape == (self.size,) and rows.shape[:-2] == () and rows.shape[-1] == self._command_size:
            end = self._step_one(state, rows, number("dt", dt, SHORTEST_STEP, LONGEST_STEP))
            if end is not None:
                return end
        return self._run(state, rows, 1, dt, 1, 1, None).states[..., -1, :]

    def _step_one(self, state: np.ndarray, rows: np.ndarray, dt: float) -> np.ndarray | None:
        """Step from one state, in a third of the time of `run`; return None for errors that `run` reports."""
        if state.dtype != np.float64 or rows.dtype != np.float64:
            return None
        if not math.isfinite(np.vdot(state, state) + np.vdot(rows, rows)):
            return None
        history, tensions = np.empty((1, 2, self.size)), np.empty((1, 2, self.robot.m))
        given = np.ascontiguousarray(state), np.ascontiguousarray(rows)
        run_plant(self.record, self.settings, given[0], given[1], history, tensions, None, 1, dt, 1, 1)
        return history[0, 1] if math.isfinite(np.vdot(history, history)) else None

    def run(
        self,
        state: np.ndarray,
        commands: np.ndarray,
        dt: float,
        substeps: int = 1,
        keep: int = 1,
        threads: int | None = None,
    ) -> History:
        """Simulate a sequence of commands.

        Args:
            state: (..., n), from `start`, `step` or `run`.
            commands: (..., K, k), from `command`: each is held for `dt`.
            dt: Period of the commands [s].
            substeps: Runge-Kutta steps in each period.
            keep: Return the first state and every `keep`-th one after it.
            threads: Number of threads that share the rows of a batch; default: one per processor, at most one per
                20 000 steps. The result does not depend on it.

        Raises:
            InputError: If an argument has a wrong shape or value.
            SolverError: If the simulation diverges, for example because steps are too long for stiff cables.
        """
        rows = np.asarray(commands)
        if rows.ndim < 2 or not rows.shape[-2]:
            raise InputError(f"commands must have the shape (..., K, {self._command_size}), got {shown(commands)}")
        return self._run(state, rows, rows.shape[-2], dt, substeps, keep, threads)

    def _run(
        self, state: np.ndarray, rows: np.ndarray, steps: int, dt: float, substeps: int, keep: int, threads: int | None
    ) -> History:
        """Simulate the first `steps` commands."""
        substeps, keep = whole_number("substeps", substeps, 1, 10**6), whole_number("keep", keep, 1, 10**9)
        period = number("dt", dt, SHORTEST_STEP, LONGEST_STEP)
        states = as_array("state", state, (self.size,))
        if rows.shape[-1] != self._command_size:
            raise InputError(f"commands must have the shape (..., K, {self._command_size}), got {shown(rows)}")
        rows = complete(rows, self.robot.m, len(self.robot.carriers), period)
        rows = as_array("commands", rows, rows.shape[-2:])
        batch = leading({"state": states.shape[:-1], "commands": rows.shape[:-2]})
        count, kept = math.prod(batch), 1 + steps // keep
        history, tensions = np.empty((count, kept, self.size)), np.empty((count, kept, self.robot.m))
        states = np.ascontiguousarray(np.broadcast_to(states, (*batch, self.size)).reshape(count, self.size))
        rows = np.broadcast_to(rows, (*batch, *rows.shape[-2:])).reshape(count, *rows.shape[-2:])
        rows = np.ascontiguousarray(rows)

        def run_rows(begin: int, end: int) -> None:
            some = slice(begin, end)
            given = states[some], rows[some], history[some], tensions[some]
            run_plant(self.record, self.settings, *given, None, steps, period, substeps, keep)

        worth = count * steps * substeps // STEPS_WORTH_A_THREAD
        threads = min(processors.available(), worth) if threads is None else whole_number("threads", threads, 1, 10**4)
        processors.in_threads(run_rows, count, max(1, min(threads, count)))
        if not np.isfinite(history[:, -1]).all():
            raise SolverError(
                f"the motion of {self.robot.name} diverges in steps of {period / substeps:g} s: use more substeps, or "
                "give the cables a stiffness if no pose has the commanded lengths"
            )
        times = period * keep * np.arange(kept)
        return History(times, history.reshape(*batch, kept, -1), tensions.reshape(*batch, kept, -1))

    def read(self, states: np.ndarray) -> Reading:
        """Read `states`, (..., n): poses [m, rad], velocities, lengths."""
        return Reading(self.robot, as_array("states", states, (self.size,)))

    def cut(self, state: np.ndarray, cable: int) -> np.ndarray:
        """Return the state, (..., n) [m, rad, s], with a cable cut: it never pulls again.

        Args:
            state: (..., n).
            cable: Index of the cable, from 0.
        """
        return self._with_condition(state, cable, layout.CUT)

    def stick(self, state: np.ndarray, cable: int) -> np.ndarray:
        """Return the state, (..., n) [m, rad, s], with a winch stuck at its current length. Arguments as in `cut`.

        A cable that is cut stays cut.
        """
        return self._with_condition(state, cable, layout.STUCK)

    def _with_condition(self, state: np.ndarray, cable: int, condition: float) -> np.ndarray:
        result = as_array("state", state, (self.size,)).copy()
        index = whole_number("cable", cable, 0, self.robot.m - 1)
        of_cable = result[..., self._places + layout.CONDITION * self.robot.m + index, None]
        np.maximum(of_cable, condition, out=of_cable)  # what is cut stays so
        return result
