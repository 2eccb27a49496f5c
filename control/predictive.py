"""`Predictive`: tensions that are best over the next stages, with their limits and those of carriers."""

from __future__ import annotations

import os
from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from typing_extensions import override

from ..distribution import tensions as tensions_at
from ..errors import InputError
from ..inputs import number, shown, whole_number
from ..models.files import as_robot
from ..models.robot import Robot
from ..solvers.horizon import Horizon
from .command import SHIFTED, Command
from .computed_torque import ComputedTorque, positive, reach_of
from .machine import stages as write_stages
from .mechanics import DISTURBANCE, HIGHEST, LOWEST, RATE_MAX
from .reference import Reference
from .state import State
from .weights import terminal, weights

__all__ = ["Predictive"]

TOLERANCE = 1e-6  # of the residuals of a solution
ITERATIONS = 20
GOOD = 1e-3  # residuals of a solution that did not converge and is used all the same
CLOSE = 1e-9  # [m, rad] by which a reference may differ from the one that was announced


class Predictive(ComputedTorque):
    """Control a robot by its motion over the next stages, with the limits of its tensions.

        min  sum of |x - x_ref|^2 + |u - u_ref|^2 over the stages     s.t.  the robot's dynamics,  t_min <= t <= t_max

    Controls are tensions and accelerations of the carriers that may leave their reference, so that the problem has only
    bounds and is always feasible. Each step linearises the dynamics about the last solution, shifted in time, and
    solves one quadratic program (`solvers.horizon`): a real-time iteration. Disturbances are estimated as by
    `ComputedTorque`, and are predicted to stay.

    Each step is answered with the solution ("as planned"), or else with the last one, as long as it lasts ("shifted
    plan"), or as `ComputedTorque` answers ("soft wrench", "hold").

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file. Its winches change the cables' lengths.
    bandwidth
        With which errors decay where no limit is near [rad/s], a number or one for each coordinate of the pose.
    stages, stage
        How many there are, and how long each lasts [s].
    reach
        How far carriers should leave their reference at most: position [m] and attitude [rad]. A weight, and no limit:
        there a carrier costs as much as 5 % of the robot's weight in a tension. Default: they follow their reference.
    carrier_bandwidth, carrier_acceleration
        With which those return [rad/s], and their largest acceleration [m/s^2 and rad/s^2].
    rate
        Largest rate of change of tensions [N/s], a number or one for each cable; default: none.
    observer, place, attitude, patience
        As for `ComputedTorque`.

    Raises
    ------
    InputError
        If an argument has a wrong value, or the robot's cables have fixed lengths.
    """

    batches = False

    def __init__(
        self,
        robot: Robot | str | os.PathLike[str],
        bandwidth: Any = 40.0,
        stages: int = 20,
        stage: float = 0.015,
        reach: tuple[float, float] = (0.0, 0.0),
        carrier_bandwidth: float = 2.0,
        carrier_acceleration: float = 5.0,
        rate: Any = None,
        observer: float = 60.0,
        place: float = 5.0,
        attitude: float = 40.0,
        patience: float = 0.05,
    ):
        the_robot = as_robot(robot)
        if the_robot.fixed_lengths is not None:
            raise InputError(f"robot must have winches, got {the_robot.name!r}, whose cables have fixed lengths")
        far = reach_of(the_robot, reach)
        self._freed = np.ascontiguousarray(np.argwhere(far))  # (f, 2)
        self._far = far[tuple(self._freed.T)]
        self._bandwidth = positive("bandwidth", bandwidth, 6)
        self._strongest = number("carrier_acceleration", carrier_acceleration, 0.0, 1e4)
        count, m, f = whole_number("stages", stages, 1, 200), the_robot.m, len(self._freed)
        self._sizes = count, 12 + 2 * f, m + f
        self._steps = np.full(count, number("stage", stage, 1e-4, 10.0))
        self._times = np.concatenate([[0.0], np.cumsum(self._steps)])
        super().__init__(
            the_robot, observer=observer, rate=rate, reach=reach, place=place, attitude=attitude, patience=patience
        )
        self._reach = np.zeros((0, 6))  # the solution moves carriers, not a reaction
        returning = number("carrier_bandwidth", carrier_bandwidth, 1e-3, 1e3)
        self._weights = weights(self.robot, self._bandwidth, self._far, returning, self._steps[0])
        self._end = self._cost_at_the_end()
        # What all problems share.
        h = self._horizon = Horizon(*self._sizes)
        h.tolerance, h.iterations_max = TOLERANCE, ITERATIONS
        h.Q[:count], h.Q[count], h.R[:] = np.diag(self._weights.states), self._end, np.diag(self._weights.controls)
        h.u_min[:, m:], h.u_max[:, m:] = -self._strongest, self._strongest

    def _cost_at_the_end(self) -> np.ndarray:
        """Return the cost that follows the last stage, (n, n), at rest at home."""
        robot, (_, n, u) = self.robot, self._sizes
        carriers = np.concatenate([robot.carrier_home, np.zeros_like(robot.carrier_home)], axis=1)
        states, controls = np.zeros((1, n)), np.zeros((1, u))
        states[0, :6], states[0, 12 : 12 + len(self._freed)] = robot.home, carriers[tuple(self._freed.T)]
        controls[0, : robot.m] = tensions_at(robot, robot.home, method="soft-wrench").tensions
        A, B, c = np.zeros((1, n, n)), np.zeros((1, n, u)), np.zeros((1, n))
        write_stages()(
            self._robot, self._freed, self._steps[:1], np.zeros(6), carriers[None], states, controls, A, B, c
        )
        return terminal(A[0], B[0], self._weights)

    @override
    def reset(self) -> None:
        super().reset()
        count, n, u = self._sizes
        self._guess = np.zeros((count + 1, n)), np.zeros((count, u))
        self._solved = np.nan  # when it was [s]
        self._placed = np.zeros((3, len(self._freed)))  # commanded place, rate and acceleration of freed coordinates
        self._announced: tuple[float, float, np.ndarray, np.ndarray, np.ndarray] | None = None

    @override
    def follow(self, references: Sequence[Reference], period: float, start: float = 0.0) -> None:
        """Receive the references of the times to come, which the stages look ahead to.

        Parameters
        ----------
        references
            One for each period, from `start` [s] on; beyond the last one its accelerations stay.
        period
            [s].

        Raises
        ------
        InputError
            If an argument has a wrong type or value.
        """
        if (
            not isinstance(references, Sequence)
            or not references
            or not all(isinstance(r, Reference) for r in references)
        ):
            raise InputError(f"references must be a list of References, got {shown(references)}")
        period, start = number("period", period, 1e-9, 1e6), number("start", start, -1e9, 1e9)
        rows = [_row(reference, self.robot.m) for reference in references]
        platform, carriers, tensions = (np.stack(part) for part in zip(*rows, strict=True))
        self._announced = start, period, platform, carriers, tensions

    @override
    def step(self, time: float, state: State, reference: Reference) -> Command:
        """Return the command for the time from `time` [s] until the next step.

        Raises
        ------
        InputError
            If the time is not later than that of the step before, or state or reference are not of this one robot.
        """
        dt = self._measure(time, state, reference)
        if len(self._wanted) != 1 or np.ndim(state.pose) != 1:
            raise InputError(f"state must be of one robot, got {len(self._wanted)} of them")
        self._move(dt, reference)
        tensions, proof = self._predict(time, reference), self._nowhere
        if tensions is None:
            self._order(-self._placed[1] / self._steps[0])  # come to rest
            tensions, answered, proof = self._distribute()
        else:
            answered = self._as_planned if self._solved == time else np.full(1, SHIFTED, dtype=np.int8)
        return self._command(reference, tensions, answered, proof, alone=True)

    def _predict(self, time: float, reference: Reference) -> np.ndarray | None:
        """Return the tensions of the next stage, (1, m), by a new solution or the last one; None without any."""
        bounds = self._problems.bounds[:, 0]
        if not np.isfinite(self._problems.w).all():
            self._solved = np.nan
            return None
        wanted, carriers, planned, ramps = self._look_ahead(time, reference)
        start = np.concatenate([self._measured[0, 0], self._placed[0], self._placed[1]])
        states, controls = self._shifted(time, start, wanted, planned)
        h, m = self._horizon, self.robot.m
        about = self._memory[0, DISTURBANCE], carriers, states, controls
        write_stages()(self._robot, self._freed, self._steps, *about, h.A, h.B, h.c)
        h.c += ramps
        h.start[:], h.r[:] = start, -self._weights.controls * planned[:-1]
        h.q[:-1], h.q[-1] = -self._weights.states * wanted[:-1], -self._end @ wanted[-1]
        self._write_bounds()
        h.states[:], h.controls[:] = states, controls
        h.solve(warm=isfinite(self._solved))
        if h.converged or all(residual <= GOOD for residual in h.residuals):  # false for nan
            self._guess[0][:], self._guess[1][:] = h.states, h.controls
            controls, self._solved = h.controls, time
        elif not time - self._solved <= self._times[-1]:
            return None
        self._order(controls[0, m:])
        return np.clip(controls[:1, :m], *bounds)

    def _look_ahead(self, time: float, reference: Reference) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return states (N + 1, n), carriers (N + 1, c, 12) and controls (N + 1, u) of the reference at all stages.

        It is the one that was announced, if that has this reference now. Beyond it accelerations stay. The last result
        is what the ramps of its accelerations add to states within each stage, (N, n): a control is held for a stage in
        the model and for a period in fact, so that without them it would give the mean of the stage, half a stage
        early.
        """
        now, beyond = _row(reference, self.robot.m), self._times
        parts = [np.repeat(part[None], len(beyond), axis=0) for part in now]
        if self._announced is not None:
            start, period, platform, *others = self._announced
            steps = (time + self._times - start) / period
            at = np.clip(np.rint(steps), 0, len(platform) - 1).astype(int)
            if np.abs(platform[at[0]] - now[0]).max() <= CLOSE:
                parts = [platform[at], *(part[at] for part in others)]
                beyond = period * np.maximum(steps - (len(platform) - 1), 0.0)
        platform, carriers, tensions = parts
        if beyond.any():
            _extrapolate(platform, beyond[:, None])
            _extrapolate(carriers, beyond[:, None, None])
        chosen, coordinate = self._freed.T
        free = [carriers[:, chosen, 6 * order + coordinate] for order in range(3)]
        states = np.concatenate([platform[:, :12], *free[:2]], axis=1)
        states[:, 3:6] += self._turns(states[0, 3:6])
        ramp, dt = np.diff(np.concatenate([platform[:, 12:], free[2]], axis=1), axis=0), self._steps[:, None]
        moved, faster = dt * dt / 6 * ramp, dt / 2 * ramp
        ramps = np.concatenate([moved[:, :6], faster[:, :6], moved[:, 6:], faster[:, 6:]], axis=1)
        controls = np.concatenate([tensions, free[2]], axis=1)
        return states, np.ascontiguousarray(carriers[:, :, :12]), controls, ramps

    def _turns(self, angles: np.ndarray) -> np.ndarray:
        """Return the whole turns that bring angles near to those measured [rad]."""
        return 2 * np.pi * np.rint((self._measured[0, 0, 3:6] - angles) / (2 * np.pi))

    def _move(self, dt: float, reference: Reference) -> None:
        """Move freed coordinates on as they were ordered; they begin where the reference is."""
        place, rate, acceleration = self._placed
        if dt > 0:
            place += dt * rate + dt * dt / 2 * acceleration
            rate += dt * acceleration
        else:
            chosen, coordinate = self._freed.T
            place[:] = reference.carrier_pose[chosen, coordinate]
            rate[:] = reference.carrier_velocity[chosen, coordinate]
            acceleration[:] = 0.0

    def _shifted(
        self, time: float, start: np.ndarray, wanted: np.ndarray, planned: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return states and controls about which the dynamics are linear: those of the last solution, or a decay."""
        late = (time - self._solved) / self._steps[0]
        count = len(self._steps)
        if late <= count:
            before, share = int(late), late - int(late)
            first, second = (np.minimum(np.arange(count + 1) + before + k, count) for k in (0, 1))
            states = (1 - share) * self._guess[0][first] + share * self._guess[0][second]
            first, second = np.minimum(first[:-1], count - 1), np.minimum(second[:-1], count - 1)
            controls = (1 - share) * self._guess[1][first] + share * self._guess[1][second]
            states[:, 3:6] += self._turns(states[0, 3:6])
        else:
            states, controls = wanted.copy(), np.zeros(self._guess[1].shape)
            states[:, :12] += np.exp(-self._bandwidth.min() * self._times)[:, None] * (start - wanted[0])[:12]
            controls[:] = planned[:-1]
        states[0] = start
        return states, controls

    def _write_bounds(self) -> None:
        """Write limits of tensions, as far as their rates let them go, and of the carriers' accelerations."""
        h, m = self._horizon, self.robot.m
        low, high, rate = self._limits[LOWEST], self._limits[HIGHEST], self._limits[RATE_MAX]
        cut = self.cut[0]
        last, room = self._pulls[0, 1], rate * self._times[1:, None]
        if isfinite(self._solved):
            h.u_min[:, :m] = np.minimum(np.maximum(low, last - room), high)
            h.u_max[:, :m] = np.maximum(np.minimum(high, last + room), low)
        else:
            h.u_min[:, :m], h.u_max[:, :m] = low, high
        h.u_min[:, :m][:, cut] = h.u_max[:, :m][:, cut] = 0.0

    def _order(self, accelerations: np.ndarray) -> None:
        """Write how freed coordinates are to move, with accelerations (f,)."""
        self._placed[2] = np.clip(accelerations, -self._strongest, self._strongest)
        chosen, coordinate = self._freed.T
        self._carriers[0, chosen, :, coordinate] = self._placed.T


def _row(reference: Reference, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pose, velocity and acceleration of platform, (18,), and carriers, (c, 18), and the tensions, (m,)."""
    tensions = np.zeros(m) if reference.tensions is None else np.asarray(reference.tensions, dtype=float)
    return np.concatenate(reference[:3]), np.concatenate(reference[3:6], axis=1), tensions


def _extrapolate(motion: np.ndarray, times: np.ndarray) -> None:
    """Move pose and velocity on with their accelerations, (..., 18), by times [s]."""
    motion[..., :6] += times * (motion[..., 6:12] + times / 2 * motion[..., 12:])
    motion[..., 6:12] += times * motion[..., 12:]
