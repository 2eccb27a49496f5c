"""`Predictive`: model predictive control with limits of tensions and carriers."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any
from warnings import warn

import numpy as np
from typing_extensions import override

from ..base.inputs import InputError, number, whole_number
from ..core import control_aim, control_stages
from ..models.files import AnyRobot, as_robot
from ..models.shapes import Shape
from ..solvers.horizon import Horizon
from ..solvers.in_place import InPlace
from ..statics.distribution import tensions as tensions_at
from .as_floats import ROUNDING, as_floats
from .bandwidths import CASCADE, PATIENT, STILL, bandwidths_for, correcting, noise_of_change
from .carrier_references import moved_coordinates
from .computed_torque import ComputedTorque
from .controllability import needs_carriers
from .controller import HOLD, OTHERWISE, SHIFTED, SOFT, Command, Reference, State
from .keep_out import Surroundings
from .noise import Noise
from .preview import STEEPEST, Preview, later, turns
from .settings import reach_of, set_reach
from .stability import grows
from .watch import BLIND, KNOWN, PAUSE, QUICK, STEEP, UNSTABLE, HandOver, Watch, flaw_of_carriers
from .weights import ripple, stage_at_home, terminal, weights

TOLERANCE = 1e-6  # of the residuals of a solution
ITERATIONS, COLD_ITERATIONS = 20, 30
NEARLY, GOOD = 0.1, 1e-3  # residuals, not converged, of an iterate for the next step to begin with, and of one to use
USUAL_REACH = 0.06  # of the cables' mean length
SWINGING = 0.45  # the same as the next of carriers that correct errors, and with which they return to their reference
FASTEST = 1.2  # over a stage, or a longer time between steps: bandwidth that commands held so long permit
FIRM = 1.0  # of the slope of the cost at the end, a robot's length off: the penalty of tube and bodies
NEAR = 0.5  # of the largest acceleration of a carrier: beyond, it is bounded


class Predictive(ComputedTorque):
    """Control a robot by model predictive control within its tension limits.

        min  sum of |x - x_ref|^2 + |u - u_ref|^2 over the stages     s.t.  the robot's dynamics,  t_min <= t <= t_max

    The controls are the tensions, and the accelerations of the carriers that may leave their reference. Only the
    controls have hard limits, so the problem is always feasible. Each step linearises the dynamics about the last
    solution, shifted in time, and solves one quadratic program (`solvers.horizon`): a real-time iteration. Disturbances
    are estimated as by `ComputedTorque` and predicted to be constant.

    Each step uses the new solution (status "as planned"), or the last one while it lasts ("shifted plan"), or the
    command of a `ComputedTorque` with its default gains that runs in parallel ("soft wrench", "hold"). A step is also
    "soft wrench" if its solution leaves an error that the `ComputedTorque` has no tensions to correct.

    The velocity that the model predicts for the commands is compared with the measured one (control/watch.py). The
    parallel `ComputedTorque` takes over until `reset` ("not as modelled") if a tenth of the weight, in addition to the
    noise of `sensors`, is unexplained over about 50 ms, or if there is no solution for that long. It also takes over if
    noise of the velocity requires more tension than the limits permit, if a carrier loses its thrust or turns too late
    (core/control/turning.c), or if a pitch goes beyond 1.5 rad. With a warning, it controls the robot from the start if
    the loop is unstable at home because carriers turn before they accelerate, as with cables that begin below the CoM.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        bandwidth: Closed-loop bandwidth [rad/s] away from limits, a number or one for each coordinate of the pose.
            Default: 40, but less if carriers correct errors, as they do with cables of fixed length, with fewer cables
            than degrees of freedom, or if they can move and their cables hardly turn the platform: 8 for teams with
            cables of fixed length, 6 for towing robots with winches, and less if long cables lean too slowly for it
            (control/bandwidths.py). Limited to 1.2 / `stage`, or 0.45 / `stage` if carriers correct errors.
        stages, stage: Number of stages, and duration of each [s]. Default: 20 of 0.015 s; of 0.03 s if carriers may
            leave their reference, because they are slower; of 0.025 s if carriers correct errors. In slow loops, stages
            become as long as the steps, at most 0.21 s. A loop is slow if both the period given to `follow` and the
            steps (the first two, or three in a row) are longer than two default stages, or one if carriers fly. A
            given duration is kept, with a warning if steps are more than 1.2 / `bandwidth` apart.
        reach: Intended maximum deviation of carriers from their reference: position [m] and attitude [rad]. A soft
            scale, not a limit: at this deviation a carrier costs as much as a tension error of 5 % of the robot's
            weight. With cables of fixed length it is at least 2 % of their length. Default: 0, but 6 % of the cables'
            length if carriers correct errors. A flying carrier that does not correct errors is moved by the
            compensation of `ComputedTorque`, not by the solution.
        carrier_bandwidth, carrier_acceleration: Bandwidth with which carriers return to their reference [rad/s]
            (default: 2, but 6 if carriers correct errors, at most a sixth of `attitude`), and their largest
            acceleration in addition to the reference's [m/s^2 and rad/s^2].
        tube: Largest distance of the platform from its reference [m] (default: no limit).
        keep_out: Bodies in {G} that the platform's frame and attachments should avoid, as in a task's `keep_out`. Exact
            penalties enforce tube and bodies wherever the tensions allow. The reference may pass through a body.
        observer: Bandwidth of the disturbance estimates [rad/s], 0: none. Default: 60; 20 if carriers correct errors.
        rate, place, attitude, patience, tension_loop, tension_lag, rotor_lag, sensors: See `ComputedTorque`. The
            sensors never make a bandwidth larger than its default.

    Attributes:
        handed_over: Time and reason of a hand-over to computed torque, a `HandOver`; None without one.

    Raises:
        InputError: If an argument has a wrong value, a carrier has no cable or more than three cables of fixed length,
            or the pitch at home is beyond 1.5 rad.
    """

    batches = False
    handed_over: HandOver | None

    def __init__(
        self,
        robot: AnyRobot,
        bandwidth: Any = None,
        stages: int = 20,
        stage: float | None = None,
        reach: tuple[float, float] | None = None,
        carrier_bandwidth: float | None = None,
        carrier_acceleration: float = 5.0,
        rate: Any = None,
        tube: float | None = None,
        keep_out: Sequence[Shape | dict[str, Any]] = (),
        observer: float | None = None,
        place: float | None = None,
        attitude: float | None = None,
        patience: float = 0.05,
        tension_loop: float = 0.0,
        tension_lag: float = 0.005,
        rotor_lag: float = 0.0,
        sensors: Noise | Mapping[str, Any] | None = None,
    ):
        the_robot = as_robot(robot)
        correct = the_robot.fixed_lengths is not None or needs_carriers(the_robot)
        if (given := reach) is None:
            lengths = np.linalg.norm(the_robot.home_anchors - the_robot.home_attachments, axis=1)
            reach = (USUAL_REACH * float(lengths.mean()) if correct else 0.0, 0.0)
        far = reach_of(the_robot, reach)
        # Carriers that fly are slow, and react as with `ComputedTorque`, unless they have to correct.
        flies = np.array([bool(carrier.efforts) for carrier in the_robot.carriers])
        reacts = far * flies[:, None] * (not correct)
        far = far - reacts
        self._strongest = number("carrier_acceleration", carrier_acceleration, 0.0, 1e4)
        usual = correcting(the_robot, self._strongest) if correct else PATIENT if far.any() else STILL
        rotors = number("rotor_lag", rotor_lag, 0.0, 0.1)
        own = bandwidths_for(the_robot, usual, sensors, rotors, bandwidth, observer, attitude)
        self._bandwidth = own.bandwidth
        if carrier_bandwidth is None:
            carrier_bandwidth = min(usual.carrier_bandwidth, own.attitude / CASCADE)
        self._returning = number("carrier_bandwidth", carrier_bandwidth, 1e-3, 1e3)
        self._stages = whole_number("stages", stages, 1, 200)
        self._stage = number("stage", usual.stage if stage is None else stage, 1e-4, 10.0)
        loops: dict[str, Any] = {"rate": rate, "place": place, "attitude": own.attitude, "patience": patience}
        self._beside = ComputedTorque(the_robot, reach=given, sensors=sensors, rotor_lag=rotor_lag, **loops)
        loops |= {"tension_loop": tension_loop, "tension_lag": tension_lag, "rotor_lag": rotor_lag}
        super().__init__(the_robot, observer=own.observer, reach=reach, **loops)
        self._settings["lowers"] = 0  # the watch finds a lag, and the other controller bears it
        self._known_age, self._beside._ahead = self._beside._known_age, None  # drives do not follow its commands
        if self._ahead is not None:
            self._ahead.amplify(own.lead, own.lag)
        set_reach(self._settings, reacts)
        self._followed, self._far = np.flatnonzero(flies & ~far.any(axis=1)), (far, flies)
        # Cables of a fixed length have the tensions that carriers make of them, whatever is commanded.
        self._has_winches = the_robot.fixed_lengths is None
        rest = tensions_at(self.robot, self.robot.home, method="soft-wrench")
        self._statics = np.asarray(rest.tensions)
        self._preview = Preview(self.robot, self._statics * (not self._has_winches))
        self._surroundings = Surroundings(self.robot, tube, keep_out)
        scale = np.repeat([1.0, self.robot.length], 3) * self.robot.dof_mask
        loud = None if correct else ripple(self.robot, self._limits, 2 * self._bandwidth + self._settings["observer"])
        blind, noise = BLIND if self._has_winches else QUICK, noise_of_change(self.robot, sensors)
        self._watch = Watch(scale, self.robot.force_scale / self.robot.platform.mass, noise, loud, blind)
        self._from_the_start: HandOver | None = None
        self._steps, self._adapts = np.array([np.nan]), stage is None
        self._fastest = SWINGING if correct else FASTEST
        fastest = self._fastest / max(self._bandwidth.max(), ROUNDING)
        within = (1 if self._flies else 2) * self._stage
        self._longest_stage = max(self._stage, min(fastest, within) if self._adapts else fastest) + ROUNDING
        self._usual_longest = min(self._longest_stage, self._slow_loops.longest_inner)
        self.reset()
        slowest = float(self._bandwidth.min())
        if flies.any() and grows(self, self.robot, rest, slowest, self._known_age, rotors):
            self.handed_over = self._from_the_start = HandOver(-np.inf, UNSTABLE)
            warn(f"{self.robot.name} is controlled by computed torque: {UNSTABLE}", stacklevel=2)

    def _lay_out(self, stage: float) -> None:
        """Prepare the program with stages of a duration [s], without a solution."""
        if self._steps[0] != stage or self._turned != self._settings["attitude"]:
            self._steps, self._turned = np.full(self._stages, stage), float(self._settings["attitude"])
            self._times = np.concatenate([[0.0], np.cumsum(self._steps)])
            # If commands took effect only after more than half of the stages, nothing would be left to decide.
            delay = min(2.0 / self._turned, self._times[-1] / 2), stage
            self._moved, reaches = moved_coordinates(self.robot, *self._far, self._strongest, self._boxes, delay)
            self._sizes = self._stages, 12 + 2 * self._moved.count, self.robot.m + self._moved.count
            self._room = self._limits.rate * self._times[1:, None]  # for tensions, until the end of each stage
            self._preview.lay_out(self._steps, self._moved)
            self._horizon = self._program(reaches)
        count, n, u = self._sizes
        self._guess, self._solved = (np.zeros((count + 1, n)), np.zeros((count, u))), np.nan  # and when it was [s]
        self._is_near, self._tethers = False, self._moved.tethers  # whether the next may start from it; its coordinates
        self._moved.reset()

    @override
    def _slow_down(self, period: float, late: float) -> None:
        """Let a stage last as long as a command if references are as far apart, or warn of given stages."""
        longest, stage = self._longest, self._steps[0]
        if self._flies:
            super()._slow_down(period, late)
        if period <= self._longest_stage:
            longest = self._longest_stage
        elif not self._adapts:
            longest = np.inf
            warn(
                f"stage must be at least {period:.3g} s, the time between steps, or bandwidth must be lower",
                stacklevel=2,
            )
        elif period <= min(PAUSE, self._preview.period + ROUNDING):
            longest, stage = period + ROUNDING, period
        self._longest = min(longest + late, self._longest) if self._flies else longest
        if stage != self._steps[0] or self._turned != self._settings["attitude"]:
            self._lay_out(stage)

    @override
    def _speed_up(self) -> None:
        super()._speed_up()
        self._lay_out(self._stage)

    def _program(self, reaches: np.ndarray) -> Horizon:
        """Return the program of all steps, with their common costs."""
        count, m, f = self._sizes[0], self.robot.m, self._moved.count
        A, B = stage_at_home(self.robot, self._moved, self._steps[0], self._statics)
        moves = A[6:12, 12 : 12 + f] / self._steps[0]
        part, most = self._turned / self._attitude, self._fastest / self._steps[0]
        bandwidth, returning = np.minimum(part * self._bandwidth, most), min(part * self._returning, most)
        self._weights = weights(self.robot, bandwidth, reaches, returning, self._steps[0], moves)
        self._efforts = np.concatenate([np.ones(m), (self._weights.states[12 : 12 + f]) / self._steps[0]])
        self._end = terminal(A, B, self._weights)
        self._penalty = FIRM * self.robot.length * float(np.diag(self._end)[:3].max())
        h = Horizon(*self._sizes, self._surroundings.rows)
        h.tolerance, h.iterations_max = TOLERANCE, ITERATIONS
        h.Q[:count], h.Q[count], h.R[:] = np.diag(self._weights.states), self._end, np.diag(self._weights.controls)
        return h

    @override
    def _forget(self) -> None:
        super()._forget()
        self._beside.reset()
        self._watch.reset()
        self.handed_over = self._from_the_start
        self._before = -1e300, np.zeros((1, 1, 12)), np.zeros((1, 6))  # time, motions and disturbance, last measured
        self._preview.reset()
        self._lay_out(self._stage)

    @override
    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        """Receive the future references; accelerations are interpolated linearly, and constant after the last one."""
        with self._alone:
            self._preview.follow(references, period, start)

    @override
    def _step(self, time: float, state: State, reference: Reference) -> Command:
        (dt, state, reference), time = self._measure(time, state, reference), float(time)
        if np.ndim(state.pose) != 1:
            raise InputError(f"state must be of one robot, got {len(self._wanted)} of them")
        reference = as_floats(reference, self.robot, None)
        if self.handed_over is None:
            self._compare(time, dt, reference)
        if self._ahead is not None:
            self._beside._agree(self)  # what the drives have made of the last command
        self._beside._turning = None if self.handed_over is None else self._turning  # of the orders that are sent
        beside = self._beside.step(time, state, reference)
        unexplained = np.array(self._watch.unexplained)
        if self.handed_over is not None:
            answered = np.array(OTHERWISE if beside.answered != HOLD else HOLD, dtype=np.int8)
            self._agree(self._beside)
            tensions = self._sent(beside.tensions[None])[0]
            return beside._replace(tensions=tensions, answered=answered, unexplained=unexplained)
        tensions, proof = self._predict(time, dt, reference), self._nowhere  # also without cables, or overloaded
        instead = np.reshape(beside.answered, 1), (beside.direction[None], np.reshape(beside.shortfall, 1))
        if tensions is None:
            tensions, (answered, proof) = beside.tensions[None], instead
            if np.isfinite(self._problems.w).all():
                self._watch.interrupt()
            else:
                self._watch.skip(dt)
            self._moved.rest(self._steps[0], self._carriers[0])
        elif beside.answered == SOFT and (self._is_missing or self._deviation.stays(self._horizon.states[:, :6])):
            answered, proof = instead
        else:
            answered = self._as_planned if self._solved == time else np.full(1, SHIFTED, dtype=np.int8)
        command = self._command(tensions, answered, proof, alone=True)
        self._beside._agree(self)
        if self._turning is not None and self.handed_over is None:
            self.handed_over = flaw_of_carriers(time, self.robot, self._of_carriers[0], self._turning[0], self._turned)
        return command._replace(unexplained=unexplained)

    def _compare(self, time: float, dt: float, reference: Reference) -> None:
        """Compare the motion with the prediction, and hand over if they differ."""
        if not np.isfinite(self._problems.w).all():
            return
        # The comparison is for the time of the measurement, because observers and predictions know no more.
        motions, (before, start, known) = self._measured if self._late is None else self._late, self._before
        if self._seen <= before:
            return
        if not self._carried.is_later(self._seen):  # of tensions that bore another load
            self._watch.interrupt()
        end, otherwise = start.copy(), KNOWN * (self._cables["known"] - self._cables["then"])
        models = self._carried.records_between(before, self._seen)
        self._sent_lately.move_on(time - before, models, end, otherwise, known, self._accelerations)
        self._before = self._seen, motions.copy(), self._platform["disturbance"].copy()
        found = self._watch.compare(self._seen, self._seen - before, motions[0, 0, 6:], (end - start)[0, 0, 6:])
        self.handed_over = found and found._replace(time=time)
        if found and self._beside._settings["reacts"]:
            self._moved.now(dt, self._measured[0], self._preview.moved_of(self._preview.rows([reference])))
            if (offsets := self._moved.offsets(np.stack(reference[3:6], axis=1))) is not None:
                memory, (offset, rate) = self._beside._of_carriers[0], offsets
                memory["offset"], memory["offset_rate"] = offset - dt * rate, rate  # this step adds the rest

    @property
    @override
    def disturbance_of_carriers(self) -> np.ndarray:
        """Return the estimated disturbance force on each flying carrier, (1, c, 3) [N]."""
        return (super() if self.handed_over is None else self._beside).disturbance_of_carriers

    @property
    @override
    def problems(self) -> InPlace:
        """Return the problem of the parallel computed torque: wrench matrix, wrench and bounds of the tensions."""
        return self._beside.problems

    def _predict(self, time: float, dt: float, reference: Reference) -> np.ndarray | None:
        """Return the tensions of the next stage, (1, m), by a new solution or the last one; None without any."""
        bounds, now = self._problems.bounds[:, 0], self._preview.rows([reference])
        if self._tethers is not self._moved.tethers:  # the last solution has other coordinates
            self._solved, self._tethers = np.nan, self._moved.tethers
        placed = self._moved.now(dt, self._measured[0], self._preview.moved_of(now))
        if not all(np.isfinite(part).all() for part in (self._problems.w, *now[:2])):
            self._solved = np.nan
            return None
        start = np.concatenate([self._measured[0, 0], *placed])
        wanted, carriers, planned, ramps, loads = self._preview.at(time, now, start[3:6])
        if max(np.abs(wanted[:, 4]).max(), abs(start[4])) > STEEPEST:
            self.handed_over = HandOver(time, STEEP)
            return None
        states, controls = self._shifted(time, start, wanted, planned)
        h, m = self._horizon, self.robot.m
        for which in self._followed:  # carriers that fly are where they are, not where they should be
            carriers[:, which, :3] += self._measured[0, 1 + which, :3] - carriers[0, which, :3]
        of_carriers, disturbance = (self._moved.freed, self._moved.tethers), self._platform["disturbance"][0]
        for load, own in loads:
            about = self._steps[own], disturbance, carriers[own], states[own], controls[own]
            control_stages(self._carried.record(load), *of_carriers, *about, h.A[own], h.B[own], h.c[own])
        h.c += ramps
        # The model knows what the reference does not, the estimated disturbance: a solution would be off by a balance
        # of errors and tensions for as long as it stays.
        control_aim(self.robot.length, h.A, h.B, h.c, self._steps, self._efforts, wanted, planned)
        for k, more in enumerate(under_way := self._moved.under_way()):
            h.c[k] += h.B[k, :, m:] @ (planned[k, m:] + more)
            h.B[k, :, m:] = 0.0
        if self._surroundings.rows:
            self._surroundings.write(h, states, wanted, self._penalty)
        self._write_bounds(controls, planned)
        # What is left of errors and tensions near the reference must not drown in the rounding of large numbers.
        h.start[:], h.states[:], h.controls[:] = start, states, controls
        h.relative_to(wanted, planned[:-1])
        warm = self._is_near and isfinite(self._solved)  # not with what is left of another flight
        h.iterations_max = ITERATIONS if warm else COLD_ITERATIONS
        h.solve(warm=warm)
        worst = max(residual if residual >= 0 else np.inf for residual in h.residuals)  # infinite for nan
        self._is_near = h.converged or (not warm and worst <= NEARLY)
        if worst <= GOOD:
            self._guess = states, controls = h.states + wanted, h.controls + planned[:-1]
            self._solved, self._watch.solved = time, self._seen
        elif not time - self._solved <= self._stages * self._stage + ROUNDING:  # no longer in slow loops
            return None
        pulls = np.minimum(np.maximum(controls[:1, :m], bounds[0]), bounds[1])
        acceleration = (states[1] - states[0] - ramps[0])[6:12] / self._steps[0]
        more = np.clip((controls - planned[:-1])[len(under_way), m:], -self._strongest, self._strongest)
        self._moved.write_carriers(planned[0, m:], more, acceleration, self._carriers[0])
        return pulls

    def _shifted(
        self, time: float, start: np.ndarray, wanted: np.ndarray, planned: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the states and controls for the linearisation: the last solution, or a decay of the error."""
        if time - self._solved <= self._times[-1]:  # as where a command is taken from it
            states, controls = (later(part, (time - self._solved) / self._steps[0]) for part in self._guess)
            states[:, 3:6] += turns(start[3:6] - states[0, 3:6])
        else:
            states, controls = wanted.copy(), np.zeros(self._guess[1].shape)
            states[:, :12] += np.exp(-self._bandwidth.min() * self._times)[:, None] * (start - wanted[0])[:12]
            controls[:] = planned[:-1]
        states[0] = start
        return states, controls

    def _write_bounds(self, controls: np.ndarray, planned: np.ndarray) -> None:
        """Write the limits of tensions, including their rate limits, and of the carriers' accelerations."""
        h, m, (low, high, _) = self._horizon, self.robot.m, self._limits
        h.u_min[:, :m], h.u_max[:, :m] = low, high
        if isfinite(self._solved):
            last = self._cables["last"][0]
            h.u_min[:, :m] = np.minimum(np.maximum(low, last - self._room), high)
            h.u_max[:, :m] = np.maximum(np.minimum(high, last + self._room), low)
        if self._moved.count:
            # A bound that is far away costs iterations, since accelerations cost so much less than tensions.
            usual = planned[:-1, m:]
            most = np.where(np.abs(controls[:, m:] - usual) > NEAR * self._strongest, self._strongest, np.inf)
            h.u_min[:, m:], h.u_max[:, m:] = usual - most, usual + most
        if (cut := self.cut[0]).any():
            h.u_min[:, :m][:, cut] = h.u_max[:, :m][:, cut] = 0.0
