"""`LengthControl`: for winches that take lengths, as most industrial ones do."""

from collections.abc import Mapping, Sequence
from typing import Any
from warnings import warn

import numpy as np
from typing_extensions import override

from ..base.inputs import InputError, number, repeated, required, shown
from ..base.text import quantity
from ..models.dynamics import dynamics_of
from ..models.files import AnyRobot, as_robot
from ..models.points import axial, rotations
from ..models.trajectory import Motion, moved_on
from .as_floats import as_floats, is_time, measured_at, rows_of
from .bandwidths import age_of, noise_of
from .controller import HOLD, OFF, PLANNED, Command, Controller, Reference, State
from .deviation import Deviation
from .lag import SHORTEST, Lag
from .length_gains import LengthGains
from .noise import Noise
from .open_loop import planned_command

SHARE, STRAIN = 0.05, 0.005  # of the robot's length, and of the longest cable: the default of `most`
DAMPED = 0.002  # [s/m]: damping of unknown cables, in terms of their stiffness
PERIOD = 1e-3  # [s]: assumed for the steps at the first one
QUICKEST = 2e-3  # [s]: in which winches follow that are said to have no lag
SAMPLED = 2000  # references that are looked at before a run
HELD = 0.2  # [s]: a robot whose pose stays the same for longer does not move
MEMORY = 1.0  # [s], of references, and of the largest age of poses, on which gains depend


class LengthControl(Controller):
    r"""Command the unstrained lengths of the plan, ahead of the winches, with a correction by the measured pose.

        L0 = l(x) / (1 + s) + J (P e + I * integral of e)

    where s are the strains at which cables with the stiffness EA and the file's damping have the planned tensions, x is
    the planned pose, J the Jacobian of the lengths, and e the error of the measured pose, with a rotation vector in
    {G}. Winches with a lag get the lengths with which they reach l(x) / (1 + s) at the end of the period; e and its
    integral are extrapolated over the lag to first order. Tensions of a robot with more cables than degrees of freedom
    follow from the lengths; they are not controlled. Winches that hold a length for a long period move unevenly:
    `follow` warns if this stretches cables as much as the planned tensions do.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file. Its carriers must not fly.
        stiffness: E A [N], a number or one for each cable, instead of the file's values; infinity for a cable that does
            not stretch (also the default of a cable without a value in the file, if there are no more cables than
            degrees of freedom).
        damping: C [N s/m], a number or one for each cable, instead of the file's values; 0.002 s/m times
            `stiffness` is assumed for a cable without stiffness in the file.
        lag: Time constant with which the winches follow their commands [s], which the lengths make up for.
        proportional, integral: P, and I [1/s]; 0 and 0 for lengths without correction. The default is the largest, up
            to 4 and 10, with which no oscillation of the platform on its cables grows (control/length_gains.py). It
            depends on the largest age of the measured pose (from its `time`, or else from `sensors`), and is 0 for
            cables with no damping. If poses are late and have no `time`, pass `sensors` or the gains: the default gains
            are for current poses, and oscillations would grow. The age of a pose without `time` is assumed to be the
            delay of the sensors plus the time since the pose last changed (at most 0.2 s), and the pose is compared
            with the plan of that earlier time.
        most: Largest correction of a length [m]; default: 5 % of `Robot.length`, but at least 0.5 % of the longest
            cable, about as much as that cable may stretch. At this value the integral stops, and the status is "hold".
        sensors: Errors and delay of the sensors, a `simulation.Noise` or a mapping (default: unknown). The default of P
            is then so small that noise of the pose changes tensions by at most 1 % of their range.

    Attributes:
        stiffness: E A that the controller assumes for each cable, (m,) [N]; infinity for one that does not stretch.
        corrects: Whether it corrects lengths by the measured pose.

    Raises:
        InputError: If an argument has a wrong value, the robot has flying carriers, or its cables have fixed lengths.
    """

    batches = True
    drive = "lengths"

    def __init__(
        self,
        robot: AnyRobot,
        stiffness: float | Sequence[float] | np.ndarray | None = None,
        lag: float = 0.0,
        proportional: float | None = None,
        integral: float | None = None,
        most: float | None = None,
        sensors: Noise | Mapping[str, Any] | None = None,
        damping: float | Sequence[float] | np.ndarray | None = None,
    ):
        self.robot = as_robot(robot)
        flying = [carrier.name for carrier in self.robot.carriers if carrier.actuators]
        if flying or self.robot.fixed_lengths is not None:
            reason = f"the flying carrier {flying[0]!r}" if flying else "cables of fixed length"
            raise InputError(f"robot must be one with winches and without flying carriers, got {reason}")
        given = [cable.stiffness or np.inf for cable in self.robot.cables] if stiffness is None else stiffness
        if stiffness is None and np.isinf(given).any() and self.robot.m > self.robot.dof_mask.sum():
            raise InputError(
                "stiffness must be given, as an argument or in the robot's file, for a robot with more cables than "
                f"degrees of freedom, because its tensions depend on it, got none for {self.robot.name!r}"
            )
        self.stiffness = repeated("stiffness", given, self.robot.m)
        if not (self.stiffness > 0).all():
            raise InputError(f"stiffness must be positive, one or one for each cable, got {shown(stiffness)}")
        unknown = np.where(np.isfinite(self.stiffness), DAMPED * self.stiffness, 0.0)
        each = zip(self.robot.cables, unknown.tolist(), strict=True)
        own = [(cable.damping or 0.0) if cable.stiffness else usual for cable, usual in each]
        self._damping = repeated("damping", own if damping is None else damping, self.robot.m)
        if not (self._damping >= 0).all():
            raise InputError(f"damping must be at least 0, one or one for each cable, got {shown(damping)}")
        lengths = np.linalg.norm(self.robot.home_anchors - self.robot.home_attachments, axis=1)
        usual = max(SHARE * self.robot.length, STRAIN * float(lengths.max()))
        self._lag = number("lag", lag, 0.0, 1.0)
        gains = ("proportional", proportional, 100.0), ("integral", integral, 1e3)
        self._given = [None if gain is None else number(name, gain, 0.0, most) for name, gain, most in gains]
        noise = None if sensors is None else noise_of(sensors)
        self._delay, self._longest = (0.0, 0.0) if noise is None else (noise.delay, 2 * age_of(noise) - noise.delay)
        self._gains = LengthGains(self.robot, self.stiffness, self._damping, self._lag, noise)
        self.corrects = bool(self._gains_for(PERIOD, np.array(self._longest)).any())
        if None in self._given and not self.corrects:
            least = quantity(float(self._damping.min()), "N s/m")
            warn(
                f"lengths of {self.robot.name!r} are not corrected by the measured pose, because oscillations on "
                f"cables with a damping of {least} would grow",
                stacklevel=2,
            )
        self._most = number("most", usual if most is None else most, 0.0, 1e3)
        self._dynamics, self._deviation = dynamics_of(self.robot), Deviation(self.robot)
        self.reset()

    @override
    def reset(self) -> None:
        self._time: float | None = None
        self._sum: np.ndarray | None = None  # integral of the error, (..., 6)
        self._period = np.inf  # of the references [s], inf: unknown
        self._winches, self._sent = Lag(self._lag), np.zeros(0)  # and their lengths without corrections, (..., m)
        self._strain: np.ndarray | None = None  # commanded at the last step, (..., m)
        self._pose = np.zeros(0)  # last measured, (..., 6)
        self._held = self._unseen = self._oldest = np.zeros(0)  # as `_age_of` has them, (...) [s]
        self._seen = np.zeros(0, dtype=int)  # status at the last pose that was used, (...)
        self._blind = np.zeros(0)  # time since then, (...) [s]; inf: there was none, or it is too old
        self._past: list[tuple[float, Motion]] = []  # times and references of earlier steps
        self._errors: tuple[np.ndarray, ...] = ()  # of pose and of speeds of the cables, at the last step

    @override
    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        """Learn the period; warn if lengths that step once per period change tensions by more than their mean."""
        self._period = number("period", period, 1e-6, 1e3)
        lag = max(self._lag, QUICKEST)
        lead, stride = _lead(lag, self._period), 1 + len(references) // SAMPLED
        uneven = lead - lag - lag * np.log(lead / lag)  # [s]: largest lead of a winch that reaches a ramp at its end
        some = [as_floats(required("references", one, Reference), self.robot, None) for one in references[::stride]]
        if len(some) < 2 or any(one.tensions is None for one in some) or np.isinf(self.stiffness).any():
            return
        lengths = self._dynamics.cable_lengths(*(np.array([one[part] for one in some]) for part in (0, 3)))
        speeds = np.abs(np.diff(lengths, axis=0)) / (stride * self._period)
        swings = uneven * speeds * self.stiffness / lengths[1:]  # (K - 1, m) [N]
        pulls = np.array([one.tensions for one in some[1:]], dtype=float).mean(axis=1)
        beyond = np.nan_to_num(swings.max(axis=1) - pulls)
        if beyond.max() > 0:
            swing, pull = (quantity(float(one[beyond.argmax()]), "N") for one in (swings.max(axis=1), pulls))
            warn(
                f"lengths commanded every {quantity(self._period, 's')} would change tensions by up to {swing}, more "
                f"than the mean planned tension, {pull}, unless the winches interpolate: make the period shorter",
                stacklevel=2,
            )

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        """Return the lengths for the time from `time` [s] on, with the planned tensions and motion of the carriers.

        The correction needs the pose of the state, and with a lag its velocity. If they are missing, the last
        correction is kept, and after 0.2 s the status is "hold". A state is compared with the plan at its time; a pose
        that is older than 1 s is treated as missing, with the status "hold" at once.

        Raises:
            InputError: If an argument has a wrong shape or value, the lengths of the reference overflow, or no tensions
                are planned for cables that stretch.
        """
        rows = rows_of(required("state", state, State))
        state = as_floats(state, self.robot, rows)
        reference = as_floats(required("reference", reference, Reference), self.robot, rows)
        if not is_time(time) or (self._time is not None and not float(time) > self._time):
            raise InputError(f"time must be a finite number that increases from step to step, got {shown(time)}")
        measured = None if state.time is None else measured_at(state.time, float(time))
        dt = 0.0 if self._time is None else float(time) - self._time
        period = min(dt or np.inf, self._period)  # until the next step; more than that may have passed since the last
        period = period if np.isfinite(period) else PERIOD
        tensions, lengths_of = self._tensions_of(reference), self._dynamics.cable_lengths
        far = lengths_of(*(moved_on(part, period)[0] for part in (reference[:3], reference[3:6])))
        strain = self._strained(dt, tensions, far)
        if not (np.isfinite(far).all() and np.isfinite(strain).all()):
            raise InputError(f"reference must have finite lengths of cables, got pose {shown(reference.pose.tolist())}")
        age = self._age_of(None if measured is None else float(time) - measured, dt, state)
        if np.shape(self._winches.value) != far.shape:
            self._winches.value = lengths_of(reference.pose, reference.carrier_pose) / (1.0 + strain)
        elif dt > 0:
            self._winches.follow(self._sent, dt)
        given, lead = self._winches.value, _lead(self._lag, period)
        self._sent = given + lead / period * (far / (1.0 + strain) - given)
        planned = self._planned_at(float(time) - age, float(time), reference)
        forgotten = age > MEMORY  # the plan of its time
        state = state._replace(pose=np.where(forgotten[..., None], np.nan, state.pose))
        self._blind = np.where(forgotten, np.inf, self._blind + dt)
        corrected, status = self._correction(dt, period, lead - period, planned, state, reference)
        lengths, self._strain, self._time = self._sent + corrected, strain, float(time)
        command = planned_command(self.robot, reference, rows)
        return command._replace(answered=status, lengths=np.broadcast_to(lengths, command.tensions.shape))

    def _age_of(self, age: float | None, dt: float, state: State) -> np.ndarray:
        """Return the ages of the measured poses, (...) [s], estimated if `age` is None, and remember the largest ones.

        Each robot of a batch has its own time since its pose changed, and since one was measured.
        """
        if self._pose.shape != state.pose.shape:
            self._pose, self._held = np.full_like(state.pose, np.nan), np.zeros(state.pose.shape[:-1])
            self._unseen, self._oldest = np.zeros_like(self._held), np.full_like(self._held, self._longest)
            self._seen, self._blind = np.full(self._held.shape, HOLD), np.full_like(self._held, np.inf)
            self._past = []
        known, old = np.isfinite(state.pose), self._pose
        pose = np.where(known, state.pose, old)
        stays = ((pose == old) | np.isnan(pose)).all(axis=-1)
        self._held = np.where(stays, np.minimum(self._held + dt, HELD), 0.0)
        self._pose, self._unseen = pose, np.where(known.all(axis=-1), 0.0, self._unseen + dt)
        # A robot at rest has the same pose for long, which is no reason for smaller gains.
        largest = self._unseen + (self._longest if age is None else age)
        self._oldest = np.maximum(np.maximum(largest, self._oldest * np.exp(-dt / MEMORY)), self._longest)
        return self._delay + self._held if age is None else np.full_like(self._held, age)

    def _planned_at(self, measured: np.ndarray, time: float, reference: Reference) -> Motion:
        """Return the reference of the platform at the times of measured poses, (...) [s], and remember this one."""
        shape = (*measured.shape, 6)
        pose, velocity, acceleration = (np.array(np.broadcast_to(part, shape)) for part in reference[:3])
        self._past.append((time, (pose, velocity, acceleration)))
        while len(self._past) > 1 and self._past[1][0] <= max(float(measured.min(initial=time)), time - MEMORY):
            self._past.pop(0)
        at = np.searchsorted([begins for begins, _ in self._past[1:]], measured, side="right")
        if (at == (first := int(at.max(initial=0)))).all():
            begins, motion = self._past[first]
            return moved_on(motion, (measured - begins)[..., None])
        motions = [np.stack([self._past[k][1][part][row] for row, k in enumerate(at)]) for part in range(3)]
        since = measured - np.array([self._past[k][0] for k in at])
        return moved_on((motions[0], motions[1], motions[2]), since[:, None])

    def _tensions_of(self, reference: Reference) -> np.ndarray:
        """Return the planned tensions, (..., m) [N]; they may jump, and are not extrapolated."""
        tensions = reference.tensions
        if tensions is not None and np.isfinite(tensions).all():
            return tensions
        if np.isfinite(self.stiffness).any():
            raise InputError(f"reference.tensions must be planned for cables that stretch, got {shown(tensions)}")
        return np.zeros(self.robot.m)

    def _strained(self, dt: float, tensions: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Return the strains s at which damped cables have these tensions, t = EA s + C L0 ds/dt, (..., m)."""
        strain, settling = tensions / self.stiffness, self._damping * lengths / self.stiffness  # [s]
        if self._strain is not None and self._strain.shape == strain.shape:
            strain = strain + np.exp(-dt / np.maximum(settling, 1e-9)) * (self._strain - strain)
        return strain

    def _correction(
        self, dt: float, period: float, lead: float, planned: Motion, state: State, reference: Reference
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the corrections of lengths [m], (..., m), and the status (...): "hold" where one is at its bound."""
        pose, velocity, _ = planned
        carriers, jacobian, free = reference.carrier_pose, self._dynamics.length_jacobian, self.robot.dof_mask
        with np.errstate(over="ignore", invalid="ignore"):  # of states that overflow
            turned, attitude = (rotations(one[..., 3:]) for one in (pose, state.pose))
            error, between = pose - state.pose, turned @ attitude.swapaxes(-1, -2)
            error[..., 3:] = axial(between)
            behind = np.zeros((*error.shape[:-1], 1))  # planned minus measured speeds of the cables, (..., m) [m/s]
            if lead:
                wanted, measured = (velocity * free)[..., None], (state.velocity * free)[..., None]
                seen_at = np.where(np.isfinite(state.pose), state.pose, pose)  # what is missing is not `known` below
                behind = (jacobian(pose, carriers) @ wanted - jacobian(seen_at, carriers) @ measured)[..., 0]
            known = np.asarray(np.isfinite(error).all(axis=-1) & np.isfinite(behind).all(axis=-1))
        before = np.zeros_like(error) if self._sum is None or self._sum.shape != error.shape else self._sum
        total = before + dt * np.where(known[..., None], error * free, 0.0)
        last = self._errors if [one.shape for one in self._errors] == [error.shape, behind.shape] else (0.0, 0.0)
        seen = zip((error * free, behind), last, strict=True)
        self._errors = error, behind = tuple(np.where(known[..., None], now, before) for now, before in seen)
        A = self._dynamics.wrench_matrix(reference.pose, carriers)  # (..., 6, m)
        proportional, integral = self._gains_for(period, self._oldest)
        with np.errstate(over="ignore", invalid="ignore"):  # of states that overflow
            ahead = proportional * error + integral * (total + lead * error)
            if any(com := self.robot.platform.com):  # about which A has the moments
                ahead[..., :3] += np.cross(ahead[..., 3:], turned @ np.array(com))
            wanted = proportional * lead * behind - (A.swapaxes(-1, -2) @ ahead[..., None])[..., 0]
        beyond = np.asarray(~(np.abs(wanted) <= self._most).all(axis=-1))
        self._sum = np.where(beyond[..., None], before, total)
        far = self._deviation.are_far(state.pose, pose, between)
        self._seen = np.where(known, np.where(far, OFF, PLANNED), self._seen)
        self._blind = np.where(known, 0.0, self._blind)
        status = np.where(beyond | (self._blind > HELD), HOLD, self._seen).astype(np.int8)
        return np.clip(np.nan_to_num(wanted), -self._most, self._most), status

    def _gains_for(self, dt: float, ages: np.ndarray) -> np.ndarray:
        """Return P and I [1/s], given or by default, (2, ..., 1), for poses of ages (...) [s] and steps of `dt` [s]."""
        gains = np.empty((2, *ages.shape, 1))
        for age in set(ages.ravel().tolist()):
            usual = self._gains.at(dt, age) if None in self._given else (0.0, 0.0)
            for gain, own, other in zip(gains, self._given, usual, strict=True):
                gain[ages == age] = other if own is None else own
        return gains


def _lead(lag: float, period: float) -> float:
    """Return how far ahead [s] the lengths of a ramp, held for a period, are commanded to be reached at its end."""
    return period / -float(np.expm1(-period / max(lag, SHORTEST)))
