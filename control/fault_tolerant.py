"""`FaultTolerant`: control of a team of flying carriers that continues without one that has lost its thrust."""

import inspect
from collections.abc import Sequence
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
from typing_extensions import override

from ..base.inputs import InputError, required
from ..base.text import quantity_row
from ..models.files import AnyRobot, as_robot
from ..models.points import shortest_way
from ..models.robot import Robot
from ..statics.formation import formation
from .as_floats import as_floats
from .controller import Command, Controller, Reference, State
from .predictive import Predictive
from .stability import PERIOD, closed_loop
from .watch import HandOver, lost_carrier

BLENDED = 1.0  # [s], in which the others go to their new formation
APART = 0.01  # [s], of references that are announced
SETTLED = 3.0  # [s], from which their motion is as predicted again
ROOM = 0.2  # of the cables' length: reach of the others, which have to move far
STEEP = 0.2  # [rad]: into the nearest formation with a smaller tilt, a team moves in balance
LEVELS = 1.0, 10.0, 30.0, 80.0  # weights of the tilt in a formation, tried in turn
NEAR = 0.05  # of the robot's length, and of it in a second: where and how fast a platform is that has come to rest


def _orders(*coefficients: float) -> list[np.polynomial.Polynomial]:
    """Return a polynomial and two derivatives."""
    return [np.polynomial.Polynomial(coefficients).deriv(order) for order in range(3)]


# Polynomials that begin with an offset of 1, or with a rate of 1, without acceleration, and end at rest at 0.
FADES = _orders(1, 0, 0, -10, 15, -6), _orders(0, 1, 0, -6, 8, -3)


class Others(Predictive):
    """Control those that are left, in a motion that begins far from what predictions describe."""

    watched_from = -np.inf  # [s]

    @override
    def _compare(self, time: float, dt: float, reference: Reference) -> None:
        if time >= self.watched_from:
            super()._compare(time, dt, reference)
        else:
            self._watch.interrupt()


class Rest(NamedTuple):
    """The team without one carrier and its cables: which are left, its controller, and the offsets of its formation."""

    carriers: np.ndarray  # indices, (c - 1,)
    cables: np.ndarray  # likewise
    controller: Others
    tilt: np.ndarray  # roll and pitch of the platform, (2,) [rad]
    carrier_pose: np.ndarray  # position from the platform and angles, (c - 1, 6), for a yaw of zero
    tensions: np.ndarray  # [N]


class FaultTolerant(Controller):
    """Control a team of flying carriers with `Predictive`, even after one of them has lost its thrust.

    A carrier is treated as lost if a force along gravity of 0.7 of its weight is not explained by its thrust, its
    weight and its cables. Its cables are then released (`Command.released`), and the others take 1 s to reach a
    formation in which they carry the platform at the planned position. Formations and controllers are computed at
    construction for the loss of each carrier, see `statics.formation`. If there is none, a warning gives the missing
    wrench, and nothing changes when that carrier is lost. If the platform tilts in a formation, the loss is simulated
    at home, where the load may fall faster than the others can lean their cables. Formations with less tilt are then
    tried, and if the others reach none of them, a warning says so, and nothing changes either.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file, with flying carriers alone and
            cables of fixed length.
        options: Arguments of `Predictive`, for the team and for the remaining carriers.

    Attributes:
        lost: Time and description of a loss, a `HandOver`; None without one.

    Raises:
        InputError: If the robot has other carriers or winches, or an argument has a wrong value.
    """

    def __init__(self, robot: AnyRobot, **options: Any):
        known = inspect.signature(Predictive).parameters
        if unknown := [name for name in options if name not in known or name == "robot"]:
            raise InputError(f"{unknown[0]} must be an argument of Predictive, one of {', '.join(list(known)[1:])}")
        self.robot = as_robot(robot)
        other = [carrier.name for carrier in self.robot.carriers if not carrier.actuators]
        if other or self.robot.fixed_lengths is None:
            reason = f"the carrier {other[0]!r}, which does not fly" if other else "winches"
            raise InputError(f"robot must be a team of flying carriers with cables of fixed length, got {reason}")
        self._team = Predictive(self.robot, **options)
        self._rests: list[Rest | None] = [None] * len(self.robot.carriers)
        self.reset()
        for index in range(len(self._rests)):
            self._prepare(index, options)

    def _prepare(self, index: int, options: dict[str, Any]) -> None:
        """Find a formation of the others that they reach, the nearest one or one with less tilt, or warn."""
        known = "a formation exists, but the platform tilts too fast for the others to reach it"
        reason = f"{self.robot.name} loses its load without {self.robot.carriers[index].name}: {known}"
        for level in LEVELS:
            rest = _without(self.robot, index, options, level)
            if isinstance(rest, str):
                reason = rest if level == LEVELS[0] else reason
                break
            self._rests[index] = rest
            if (level == LEVELS[0] and np.linalg.norm(rest.tilt) < STEEP) or self._settles(index):
                return
        self._rests[index] = None
        if reason:
            warn(reason, stacklevel=3)

    def _settles(self, index: int) -> bool:
        """Return whether the others bring the platform to rest where it was, after a loss at rest at home."""
        size, home, still = self.robot.length, self.robot.home, 0.0
        for k, (now, _) in enumerate(closed_loop(self, self.robot, self._team._statics, lost=index)):
            off = float(np.linalg.norm(now.pose[:3] - home[:3]))
            rate = float(np.linalg.norm(now.velocity * np.repeat([1.0, size], 3)))
            still = still + PERIOD if k * PERIOD > BLENDED and max(off, rate) < NEAR * size else 0.0
            if still > BLENDED / 2 or not off < size:
                break
        self.reset()
        return still > 0.0

    @override
    def reset(self) -> None:
        self._team.reset()
        self.lost: HandOver | None = None
        self._rest: Rest | None = None
        self._announced: tuple[Sequence[Reference], float, float] | None = None

    @override
    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        self._team.follow(references, period, start)
        self._announced = references, period, start

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        if self._rest is None:
            command = self._team.step(time, state, reference)
            state, reference = self._as_floats(state, reference)
            found = self._team.handed_over
            lost = None if found is None else found.carrier
            if lost is None:
                lost = lost_carrier(self.robot, self._team.disturbance_of_carriers[0])
            if self.lost is not None or lost is None:
                return command
            self._lose(float(time), lost, state, reference)
            if self._rest is None:
                return command
        else:
            state, reference = self._as_floats(state, reference)
        return self._alone(self._rest, time, state, reference)

    def _as_floats(self, state: State, reference: Reference) -> tuple[State, Reference]:
        state = as_floats(required("state", state, State), self.robot, None)
        return state, as_floats(required("reference", reference, Reference), self.robot, None)

    def _lose(self, time: float, index: int, state: State, reference: Reference) -> None:
        """Remember that a carrier is lost, and take the controller of the others, if there is one."""
        name, rest = self.robot.carriers[index].name, self._rests[index]
        goes_on = "its cables are released" if rest is not None else "the others cannot carry the platform"
        self.lost, self._rest = HandOver(time, f"{name} has lost its thrust: {goes_on}"), rest
        if rest is None:
            return
        rest.controller.reset()
        rest.controller.watched_from, self._foreseen = time + SETTLED, time
        now = np.vstack([state.pose, state.carrier_pose[rest.carriers]])
        rates = np.vstack([state.velocity, state.carrier_velocity[rest.carriers]])
        self._off = np.stack([now, rates]) - self._target(rest, reference)[:2]
        self._off[0] = shortest_way(self._off[0])

    def _foresee(self, rest: Rest, time: float) -> None:
        """Announce references of the next seconds to the controller of the others, which takes 10 ms."""
        if self._announced is None or time < self._foreseen:
            return
        (references, period, start), stride = self._announced, max(1, round(APART / self._announced[1]))
        first, coming = max(0, int((time - start) / period)), []
        for k in range(first, first + round(2 * BLENDED / period) + 1, stride):
            one = as_floats(references[min(k, len(references) - 1)], self.robot, None)
            coming.append(self._of_rest(rest, start + k * period, one))
        rest.controller.follow(coming, stride * period, start + first * period)
        self._foreseen = time + BLENDED

    def _target(self, rest: Rest, reference: Reference) -> np.ndarray:
        """Return the motion of platform and others in their formation at the planned position, (3, 1 + c, 6)."""
        result = np.zeros((3, 1 + len(rest.carriers), 6))
        for order, motion in enumerate(reference[:3]):
            result[order, 0], result[order, 1:, :3] = motion, motion[:3]
        result[0, 0, 3:5] += rest.tilt
        c, s = np.cos(reference.pose[5]), np.sin(reference.pose[5])
        aim = rest.carrier_pose.copy()
        aim[:, :2] = aim[:, :2] @ np.array([[c, s], [-s, c]])
        result[0, 1:] += aim
        result[0, 1:, 5] = reference.carrier_pose[rest.carriers, 5]
        return result

    def _of_rest(self, rest: Rest, time: float, reference: Reference) -> Reference:
        """Return the reference of the others: from where they were at the loss to their formation."""
        assert self.lost is not None
        motion, s = self._target(rest, reference), (time - self.lost.time) / BLENDED
        if s < 1.0:
            for order, (pose, velocity) in enumerate(zip(FADES[0], FADES[1], strict=True)):
                motion[order] += (pose(s) * self._off[0] + BLENDED * velocity(s) * self._off[1]) / BLENDED**order
        (pose, velocity, acceleration), others = motion[:, 0], motion[:, 1:]
        return Reference(pose, velocity, acceleration, others[0], others[1], others[2], rest.tensions, reference.load)

    def _alone(self, rest: Rest, time: float, state: State, reference: Reference) -> Command:
        """Return the command of the others, as one of the team."""
        pulls = None if state.tensions is None else state.tensions[rest.cables]
        carriers = state.carrier_pose[rest.carriers], state.carrier_velocity[rest.carriers]
        own = State(state.pose, state.velocity, carriers[0], carriers[1], pulls, state.time)
        self._foresee(rest, time)
        given = rest.controller.step(time, own, self._of_rest(rest, time, reference))
        assert given.actuation is not None
        still, c = np.zeros_like(state.carrier_pose), len(state.carrier_pose)
        changes = {
            "tensions": np.zeros(self.robot.m),
            "carrier_pose": state.carrier_pose.copy(),
            "carrier_velocity": state.carrier_velocity.copy(),
            "carrier_acceleration": still,
            "actuation": np.zeros((c, given.actuation.shape[1])),
        }
        for name, whole in changes.items():
            whole[rest.cables if name == "tensions" else rest.carriers] = getattr(given, name)
        return given._replace(**changes, released=~np.isin(np.arange(self.robot.m), rest.cables))


def _without(robot: Robot, index: int, options: dict[str, Any], level: float) -> Rest | str:
    """Return the team without a carrier and its cables, or why it cannot carry the platform; "" without carriers."""
    data, lengths = robot.model_dump(), robot.fixed_lengths
    assert lengths is not None
    carriers = np.delete(np.arange(len(robot.carriers)), index)
    cables = np.flatnonzero(robot.carrier_of_cable != index)
    data["carriers"] = [data["carriers"][i] for i in carriers]
    data["cables"] = [{**data["cables"][i], "length": float(lengths[i])} for i in cables]
    if len(carriers) == 0:
        return ""
    home, name = robot.home, robot.carriers[index].name
    found = formation(Robot.model_validate(data), home, robot.carrier_home[carriers], lengths[cables], level)
    if not found.exists:
        force, moment = quantity_row(found.missing[:3], "N"), quantity_row(found.missing[3:], "N m")
        lacks = f"a force of {force} and a moment of {moment} about the CoM are missing"
        return f"{robot.name} cannot rest without {name}: {lacks}"
    data["platform"]["home"] = found.pose.tolist()
    for carrier, pose in zip(data["carriers"], found.carrier_pose.tolist(), strict=True):
        carrier["home"] = pose
    c, s = np.cos(home[5]), np.sin(home[5])
    offsets = found.carrier_pose.copy()
    offsets[:, :3] -= home[:3]
    offsets[:, :2] = offsets[:, :2] @ np.array([[c, -s], [s, c]])
    options = {"reach": (ROOM * float(lengths.mean()), 0.0), **options}
    controller = Others(Robot.model_validate(data), **options)
    return Rest(carriers, cables, controller, found.pose[3:5] - home[3:5], offsets, found.tensions)
