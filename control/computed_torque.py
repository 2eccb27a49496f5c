"""`ComputedTorque`: desired acceleration, the wrench required for it, and the tensions that produce this wrench."""

from collections.abc import Mapping
from typing import Any
from warnings import warn

import numpy as np
from typing_extensions import override

from ..base.inputs import InputError, number, required, shown
from ..core import control_step, control_thrusts
from ..models.files import AnyRobot, as_robot
from ..models.record import record_of
from ..solvers.in_place import InPlace
from .as_floats import ROUNDING, as_floats, is_time, measured_at, rows_of
from .bandwidths import CASCADE, HELD, SWINGING, age_of, bandwidths_for, noise_of, place_for
from .carried_load import CarriedLoad
from .controllability import is_underactuated, uncontrolled
from .controller import NOTHING, NOWHERE, PLANNED, SHIFTED, SOFT, Command, Controller, OneAtATime, Reference, State
from .deviation import Deviation
from .fallback import NEGLIGIBLE, answer_others
from .lag import ROTORS_KEEP, WINCHES_KEEP, RotorLead, TensionLoop, tension_lead
from .late_states import OLDEST, LateStates
from .noise import Noise
from .records import CABLE, CARRIER, PLATFORM, TURNING
from .settings import boxes, limits_of, reach_of, set_reach, settings_of, stay_inside
from .slow_loops import SlowLoops

TAKE_ALONE = -1  # in place of how tensions are solved: `control_step` then only takes state and reference
SOMETHING = 1e-3  # of its upper limit: what a cable is commanded at least for its reports to mean something
QUICK = 6.0  # [rad/s]: the bandwidth of a carrier's deviation, unless a slower loop has to follow it


class ComputedTorque(Controller):
    """Control a robot by its inverse dynamics, with any carriers.

        a* = a_ref + Kd (v_ref - v) + Kp (x_ref - x) + Ki integral of (x_ref - x)
        t  = argmin |t - t_ref|^2    s.t.  A t = w(x, v, a*) - d,  t_min <= t <= t_max,  |t - t_last| <= rate dt

    with errors of the attitude as rotation vectors in the platform's axes, so that no attitude is special, and
    d the disturbance that an observer estimates from the momentum: dp/dt = A t + m g + d. Every state gets a
    command: these tensions if they exist (status "as planned"), otherwise those with the closest wrench ("soft
    wrench"). While state or reference contain nan, the last command moves to the planned tensions as fast as the rate
    permits, and quadrotors finish the turn that they have begun ("hold"). A wrench error up to 0.1 % of the robot's
    weight is accepted. Carriers follow the reference, or deviate from it within their `reach` to help the tensions.
    Quadrotors have separate loops for position and attitude (core/control/thrusts.c).

    A robot is underactuated if it has fewer cables than degrees of freedom, or if the cables of a team cannot turn its
    platform about some axis at home. Its carriers then correct errors too, which damps the swing of loads. Its cables
    keep their tensions in directions in which they hardly change the wrench, and a wrench error of 0.1 % of the weight
    along each cable and 10 % in all is accepted.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        bandwidth: Bandwidth b of the error's decay [rad/s], a number or one for each coordinate of the pose: Kp = b^2.
            Default: 10, but 1.5 if the robot is underactuated, because the load swings with its carriers;
            see `sensors`. If the first two steps, or three in a row, are more than 0.6 / b apart, the defaults of
            `bandwidth` and `observer` are lowered, because the loop is unstable from 1 / b on. Both are restored after
            two steps that are closer together. A given bandwidth is kept, with a warning. If carriers fly, all
            bandwidths are lowered by the same factor, because their attitude loops need steps of at most 0.75 /
            `attitude`, less 1.5 times the mean time for which states are held (without `State.time`: 0.93 times the
            delay of `sensors`), and 0.75 times the remainder of `rotor_lag`. Other carriers that correct errors need
            steps of at most 0.75 / `carrier_bandwidth`. On robots with winches and at least as many cables as degrees
            of freedom, the lag and delay of the motion after the commands are measured. If they leave the loop a margin
            of less than 1.3, all gains are lowered until it is 2, also given ones, until `reset` (core/control/step.c).
        damping: Damping ratio z: Kd = 2 z b.
        integral: Ki [1/s^3], a number or one for each coordinate. It pauses while the status is not "as planned".
        observer: Bandwidth of the estimates of the disturbance and of forces on flying carriers [rad/s]; 0: no
            estimates. Default: 10; see `sensors`.
        rate: Largest rate of change of tensions [N/s], a number or one for each cable (default: no limit).
        reach: Largest deviation of carriers from their reference to help the tensions (see
            `core/control/compensation.c`): position [m] and attitude [rad]. Default: 0, but 0.5 m if the robot is
            underactuated.
        carrier_bandwidth, carrier_acceleration: Bandwidth of the carriers' deviation [rad/s], and its largest
            acceleration [m/s^2 and rad/s^2]. Default of the bandwidth: 6, but at most a sixth of `attitude`, and a
            quarter of `place` if the robot has flying carriers and at least as many cables as degrees of freedom: with
            a larger one, carriers that turn and the damping of their cables make the observer's loop unstable.
        place, attitude: Bandwidths of the position and attitude loops of flying carriers [rad/s]
            (core/control/thrusts.c). Default of `attitude`: 40, or less if the known lags of rotors and sensors require
            it (control/bandwidths.py); of `place`: 5, but at most a sixth of `attitude`. If carriers turn so late that
            the attitude loop would be unstable, `attitude` is lowered to what the measured lag and delay permit
            (core/control/turning.c), `place` and `carrier_bandwidth` by the same factor.
        patience: Time for which the sensor of a cable may report no tension, although one is commanded, until the cable
            is treated as cut [s] and the others replace it. The cable then gets its smallest tension, and is used again
            once its sensor reports a tension. Cables of fixed length are never treated as cut. If no sensor reports a
            tension, the sensors are treated as failed: the commands replace their readings, with the status "soft
            wrench".
        tension_loop: Bandwidth of a loop on measured tensions [rad/s], for winches that do not deliver the commanded
            tensions: the command is corrected until the sensors report the desired tensions, inside the limits of
            tensions and rates. With 0 only the observer compensates the error, in a third of a second; with 20 this
            takes a tenth of a second.
        tension_lag, rotor_lag: Known time constants with which winches and actuators of flying carriers follow commands
            [s]. Commands are sent ahead of time, within limits and rates, so that only 5 ms of the first and 15 ms of
            the second remain. Noise of `sensors` leaves more of the first, up to what the bandwidths permit.
        sensors: Errors and delay of the sensors, a `simulation.Noise` or a mapping (default: unknown). The delay is
            the age of states without a time. The default bandwidths are then the largest that these sensors permit
            (control/bandwidths.py), at most twice those above.

    Raises:
        InputError: If an argument has a wrong value, or these sensors are too slow to control the robot.
    """

    batches = True

    def __init__(
        self,
        robot: AnyRobot,
        bandwidth: Any = None,
        damping: Any = 1.0,
        integral: Any = 0.0,
        observer: float | None = None,
        rate: Any = None,
        reach: tuple[float, float] | None = None,
        carrier_bandwidth: float | None = None,
        carrier_acceleration: float = 5.0,
        place: float | None = None,
        attitude: float | None = None,
        patience: float = 0.05,
        tension_loop: float = 0.0,
        tension_lag: float = 0.005,
        rotor_lag: float = 0.0,
        sensors: Noise | Mapping[str, Any] | None = None,
    ):
        self.robot, self._alone = as_robot(robot), OneAtATime()
        few, self._limits = is_underactuated(self.robot), limits_of(self.robot, rate)
        rotors, usual = number("rotor_lag", rotor_lag, 0.0, 0.1), SWINGING if few else HELD
        loops = bandwidths_for(self.robot, usual, sensors, rotors, bandwidth, observer, attitude)
        held, age = place_for(loops.attitude, place), 0.0 if sensors is None else age_of(noise_of(sensors))
        self._known_age = age * (age <= OLDEST)  # of states without a time
        if carrier_bandwidth is None:
            steady = not few and any(carrier.efforts for carrier in self.robot.carriers)
            carrier_bandwidth = held / 4 if steady else min(QUICK, loops.attitude / CASCADE)
        gains = loops.bandwidth, damping, integral, loops.observer
        of_carriers = carrier_bandwidth, carrier_acceleration, held
        self._settings = settings_of(self.robot, self._limits, *gains, *of_carriers, patience)
        self._reach = far = reach_of(self.robot, (0.5 if few else 0.0, 0.0) if reach is None else reach)
        set_reach(self._settings, far)
        self._settings["attitude"] = self._attitude = loops.attitude
        self._flies = bool(self._settings["by_wrench"].any())
        self._slow_loops = SlowLoops(self._settings, bandwidth is None, usual.bandwidth, min(rotors, ROTORS_KEEP))
        self._usual_longest = self._slow_loops.longest
        loop, lag = number("tension_loop", tension_loop, 0.0, 1e3), number("tension_lag", tension_lag, 0.0, 1.0)
        self._ahead = tension_lead(self.robot, self._limits, lag, rotors)
        if self._ahead is not None:
            self._ahead.amplify(loops.lead, loops.lag)
        self._loop = TensionLoop(loop, WINCHES_KEEP if self._ahead is None else 0.0, *self._limits) if loop else None
        self._little = np.maximum(self._limits.low, SOMETHING * self._limits.high)
        self._boxes = boxes(self.robot) if far.any() else None
        self._robot, self._carried = record_of(self.robot), CarriedLoad(self.robot)
        self._lead = RotorLead(self.robot, rotors) if rotors else None
        self._is_plain = not self._flies and not far.any() and self._loop is None and self._ahead is None
        self._negligible, self._deviation = NEGLIGIBLE * self.robot.force_scale, Deviation(self.robot)
        self._begin(1)

    @override
    def reset(self) -> None:
        with self._alone:
            self._forget()

    def _forget(self) -> None:
        self._begin(1)

    @property
    def disturbance(self) -> np.ndarray:
        """Return the estimated disturbance force [N] and moment about the CoM [N m] on the platform, (n, 6)."""
        return self._platform["disturbance"].copy()

    @property
    def disturbance_of_carriers(self) -> np.ndarray:
        """Return the estimated disturbance force on each flying carrier, (n, c, 3) [N]."""
        return self._of_carriers["force"].copy()

    @property
    def uncontrolled(self) -> np.ndarray:
        """Return wrench directions that the controller cannot change at home, (k, 6), moments over the length [N]."""
        return uncontrolled(self.robot, self._reach)

    @property
    def cut(self) -> np.ndarray:
        """Return which cables are treated as cut, (n, m)."""
        return self._cables["is_cut"] > 0

    @property
    def problems(self) -> InPlace:
        """Return the problem of the last step, for each row: wrench matrix, wrench and bounds of the tensions."""
        return self._problems

    def _begin(self, rows: int) -> None:
        """Create the memory for one robot, or for each row of a batch."""
        m, count = self.robot.m, len(self.robot.carriers)
        self._time: float | None = None
        self._elapsed = 0.0
        self._slow_loops.reset()
        self._carried.reset()
        self._robot = record_of(self.robot)
        self._seen = 0.0
        self._late: np.ndarray | None = None  # motions when they were measured, if that is not now
        self._accelerations = bytes(8 * rows * count * 6)  # of carriers, as ordered last
        self._otherwise = np.zeros((rows, m))  # measured minus commanded tensions, over the age of states [N]
        self._measured, self._wanted = np.zeros((rows, 1 + count, 12)), np.zeros((rows, 18))
        self._carriers = np.zeros((rows, count, 3, 6))  # how they should move
        self._cables, self._platform = np.zeros((rows, m), CABLE), np.zeros(rows, PLATFORM)
        self._platform["integrates"] = 1
        ComputedTorque._speed_up(self)
        self._of_carriers = np.zeros((rows, count), CARRIER)
        self._actuation = np.zeros((rows, count, max(len(carrier.actuators) for carrier in self.robot.carriers)))
        self._sent_lately = LateStates(rows * m, self._actuation)
        self._turning = np.zeros(rows, TURNING) if self._flies else None
        self._problems = problems = InPlace(rows, 6, m, self.robot.length, bool(self._settings["corrects"]))
        memory = self._cables, self._platform, self._of_carriers
        self._arrays = self._measured, self._wanted, self._carriers, *memory, problems.memory
        for part in (self._loop, self._ahead, self._lead):
            if part is not None:
                part.reset()
        self._nowhere = np.full((rows, 6), np.nan), np.full(rows, np.nan)
        self._paused = False  # whether the integral of a row does
        self._as_planned = np.full(rows, PLANNED, dtype=np.int8)
        self._is_as_planned: tuple[Any, np.ndarray, np.ndarray] = (np.int8(PLANNED), NOWHERE, NOTHING)

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        with self._alone:
            return self._step(time, state, reference)

    def _step(self, time: float, state: State, reference: Reference) -> Command:
        _, state, reference = self._measure(time, state, reference, self._problems.solves)
        problems, proof = self._problems, self._nowhere
        if self._optimal == len(self._wanted) and problems.is_exact:
            if self._paused:
                self._platform["integrates"] = 1
            self._paused = False
            simple = self._is_plain and self._is_one and not self._is_missing
            if simple and not self._are_far:  # the rest, at a fifth of the time
                tensions = problems.tensions[0].copy()
                ordered: Any = reference.carrier_acceleration  # any array that the core can read
                self._accelerations = memoryview(ordered).tobytes()
                return Command(tensions, *reference[3:6], *self._is_as_planned)
            tensions, answered = problems.tensions.copy(), self._as_planned
        else:
            problems.solve_others()
            answered = answer_others(self.robot, problems, self._cables["last"])
            tensions, proof = problems.tensions.copy(), (problems.direction.copy(), problems.shortfall.copy())
            self._platform["integrates"] = answered == PLANNED
        self._paused = answered is not self._as_planned
        return self._command(tensions, answered, proof, self._is_one)

    def _measure(
        self, time: float, state: State, reference: Reference, solves: int = 0
    ) -> tuple[float, State, Reference]:
        """Update the memory, write the problem of this step, and solve it if wanted, see `core.control_step`.

        Return the time since the last one [s], or 0, and the state and the reference as arrays.
        """
        if not isinstance(state, State):
            required("state", state, State)
        if not isinstance(reference, Reference):
            required("reference", reference, Reference)
        if not is_time(time):
            raise InputError(f"time must be a finite number [s], got {shown(time)}")
        time, rows = float(time), rows_of(state)
        self._is_one = rows is None
        if (count := 1 if rows is None else rows) != len(self._wanted):
            self._begin(count)
        dt = 0.0 if self._time is None else time - self._time
        if not (dt > 0 or self._time is None):
            raise InputError(
                f"time must increase from step to step until reset(), got {time:g} s after {self._time:g} s"
            )
        if reference.load is not self._carried.load:
            self._robot = self._carried.change(reference.load, -np.inf if self._time is None else time)
        self._senses = state.tensions is not None
        seen = time - self._known_age if state.time is None else measured_at(state.time, time)
        since = 0.0 if self._time is None else seen - self._seen
        late = self._slow_loops.late_by(time - seen, state.time is not None, since, dt) if self._flies else 0.0
        if dt + late > self._longest and not 0 < self._elapsed <= self._longest - late:
            self._slow_down(min(dt, self._elapsed or dt), late)
        elif self._usual_longest < self._longest < np.inf and 0 < max(dt, self._elapsed) <= self._usual_longest - late:
            self._speed_up()
        own, scales = (self._robot, self._settings), (self._problems.length, *self._deviation.most)
        if self._ahead is not None:
            self._ahead.pass_time(dt, self._cables["given"])
        if self._lead is not None:
            self._lead.turn(dt, self._actuation, self._of_carriers["ordered"])
        given, observes = self._cables["given"].tobytes(), self._carried.is_later(seen)
        fixed = dt, since if observes else 0.0, *scales, solves
        if time - seen <= ROUNDING and since == dt and observes:
            try:
                done = control_step(*fixed, state, reference, *own, None, *self._arrays)
            except (ValueError, TypeError, BufferError):  # they need not be arrays of float64, which the core reads
                state, reference = self._as_floats(state, reference)
                done = control_step(*fixed, state, reference, *own, None, *self._arrays)
            self._sent_lately.remember(given, dt)
            self._late = None
        else:
            state, reference = self._as_floats(state, reference)
            control_step(0.0, 0.0, *scales, TAKE_ALONE, state, reference, *own, None, *self._arrays)
            cables, age = self._cables, time - seen
            # The difference from the commands is smoothed over the age, and taken to stay as it is. Unsmoothed, it
            # would make the loop unstable if the true age differed.
            share = min(since / age, 1.0) if age > ROUNDING else 1.0
            self._otherwise += share * (cables["known"] - cables["then"] - self._otherwise)
            self._sent_lately.remember(given, dt, state.tensions, reference.tensions)
            self._sent_lately.commanded(cables, age, since, dt, self._senses)
            models = self._carried.records_between(seen, time)
            memory = self._measured, self._otherwise, self._platform["disturbance"], self._accelerations
            late = self._sent_lately.move_on(age, models, *memory, flies=self._flies)
            seen_so = self._measured.copy() if late is None else late
            done = control_step(*fixed, None, None, *own, late if observes else seen_so, *self._arrays)
            self._late = seen_so
            if not observes:
                self._carried.continue_observer(self._platform, seen_so[:, 0])
        self._planned, (missing, self._optimal, self._are_far) = self._carriers[:, :, 2].copy(), done
        self._is_missing = missing > 0  # cables or their sensors
        self._time, self._seen, self._elapsed = time, seen, dt
        return dt, state, reference

    def _agree(self, sender: "ComputedTorque") -> None:
        """Take over the command that another controller of the same robot has sent, as if it were the own one."""
        self._cables["last"], self._cables["given"] = sender._cables["last"], sender._cables["given"]
        self._actuation[:], self._accelerations = sender._actuation, sender._accelerations
        self._platform["attitude"] = sender._platform["attitude"]
        self._of_carriers["ordered"] = sender._of_carriers["ordered"]
        if sender._lead is not None and self._lead is not None:
            self._lead.agree(sender._lead)

    def _slow_down(self, period: float, late: float) -> None:
        """Lower bandwidths for late states and commands that are held for a period [s], or warn of given ones."""
        self._longest, most = self._slow_loops.slow_down(period + late)
        self._platform["attitude"] = np.minimum(self._platform["attitude"], self._settings["attitude"])
        if most < np.inf:
            warn(f"bandwidth must be at most {most:.3g} rad/s for steps {period:.3g} s apart", stacklevel=2)

    def _speed_up(self) -> None:
        """Use the usual bandwidths."""
        self._slow_loops.speed_up()
        self._platform["attitude"], self._longest = self._attitude, self._usual_longest

    def _command(
        self, tensions: np.ndarray, answered: np.ndarray, proof: tuple[np.ndarray, np.ndarray], alone: bool
    ) -> Command:
        """Return the command from tensions (N, m) and the motion of the carriers."""
        if self._is_missing:
            tensions = np.where(self.cut, self._little, tensions)  # so that one that is not cut reports it
            unheard = (self._platform["silent"] > 1) & ((answered == PLANNED) | (answered == SHIFTED))
            answered = np.where(unheard, SOFT, answered).astype(np.int8)
        self._cables["last"] = self._cables["given"] = tensions
        carriers = self._carriers.copy()
        if answered is not self._as_planned:
            self._go_on(carriers)
        if self._boxes is not None:
            stay_inside(carriers, *self._boxes)
        carriers = carriers[0] if alone else carriers
        moving = carriers[..., 0, :], carriers[..., 1, :], carriers[..., 2, :]
        # Carriers that fly turn before they accelerate, so what a solution adds does not act within a state's age.
        self._accelerations = (np.nan_to_num(self._planned) if self._flies else moving[2]).tobytes()
        actuation = None
        if self._flies:
            memory = self._cables, self._platform, self._of_carriers, self._turning, self._actuation
            given = self._measured, self._carriers, tensions, *memory
            lacking = control_thrusts(self._elapsed, self._robot, self._settings, *given)
            actuation = self._actuation.copy() if self._lead is None else self._lead.sent(self._actuation)
            if lacking > self._negligible:
                most = self._of_carriers["lacking"].max(axis=1)
                lacks = (answered == PLANNED) & (most > self._negligible)
                answered = np.where(lacks, SOFT, answered).astype(np.int8)
                proof = proof[0], np.where(lacks, most, proof[1])
        tensions = self._sent(tensions)
        if self._are_far:
            answered = self._deviation.status(answered, self._measured[:, 0, :6], self._wanted[:, :6])
        if alone:
            own = None if actuation is None else actuation[0]
            return Command(tensions[0], *moving, answered[0], proof[0][0], proof[1][0], own)
        return Command(tensions, *moving, answered, *proof, actuation)

    def _go_on(self, carriers: np.ndarray) -> None:
        """Let carriers, (N, c, 3, 6), with nan in their reference go on as measured."""
        unknown = ~np.isfinite(carriers).all(axis=(2, 3))
        measured = self._measured[:, 1:].reshape(*unknown.shape, 2, 6)
        carriers[unknown, :2], carriers[unknown, 2] = measured[unknown], 0.0

    def _sent(self, wanted: np.ndarray) -> np.ndarray:
        """Return the commands to the winches that produce the desired tensions, (N, m) [N]."""
        if self._ahead is not None:
            wanted = self._ahead.sent(wanted, self._elapsed)
        if self._loop is None:
            return wanted
        reports = self._cables["measured"] if self._senses else None
        return self._loop.sent(self._elapsed, wanted, self._cables["then"], reports, self.cut)

    def _as_floats(self, state: State, reference: Reference) -> tuple[State, Reference]:
        rows = len(self._wanted)
        return as_floats(state, self.robot, rows), as_floats(reference, self.robot, rows)
