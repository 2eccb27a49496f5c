"""Stop a robot on the path of its plan, as soon as its tensions permit: `stop_along`.

The robot follows its path at a rate r(t) that falls from 1 to 0, at each time by the least u = dr/dt inside its limits
(`path_limits.PathLimits`).
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import groupby
from typing import NamedTuple

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory
from ..solvers import TensionProblem, certify, solve_batch
from ..solvers.in_place import RHO
from .continuation import RESTS, continued
from .distribution import wrench_problem
from .path_limits import FASTEST, STEP, STILL, WINDOW, PathLimits, instants_of
from .stop_result import Stop
from .team_stops import team_stop_along
from .winch_forces import overloaded_winch

PARTS = 8  # of a step, between which a stop is audited and given
# One after the other: the reserve, a share of what the cables can give along each normal, and whether a robot goes on
# through places in which it cannot rest.
ATTEMPTS = (0.002, True), (0.02, True), (0.1, True), (0.002, False)
LITTLE = 1e-3  # of the robot's forces: a wrench that is missed by less matters less than the time to stop
LONGEST = 60.0  # [s]
AT_ONCE = 16  # stops that are audited
MISSING = 1e-7  # of the robot's forces: a wrench that is missed by less is given


def stop_along(robot: Robot, trajectory: Trajectory, time: float) -> Stop:
    """Stop as `control.stop` does, on a trajectory with a duration.

    Raises `InputError` if the robot has flying carriers with other cables than `control.stop` describes.
    """
    return next(_stops_along(robot, trajectory, np.array([min(time, trajectory.duration or 0.0)])))


def _stops_along(robot: Robot, trajectory: Trajectory, times: np.ndarray) -> Iterator[Stop]:
    """Yield the stops that begin at some times."""
    for load, begin in groupby(times.tolist(), trajectory.load_at):
        for found in _unloaded(robot if load is None else load.on(robot), trajectory, list(begin)):
            yield replace(found, robot=robot, load=load)


def _unloaded(robot: Robot, trajectory: Trajectory, times: list[float]) -> Iterator[Stop]:
    """Yield the stops of a robot that carries nothing else."""
    end = trajectory.duration or 0.0
    if any(carrier.efforts for carrier in robot.carriers):
        for begins in times:
            time, tau, platform, carriers, tensions, _, limit = team_stop_along(robot, trajectory, begins)
            yield Stop(robot, float(tau[0]), float(tau[-1]), time, platform, carriers, tensions, None, limit)
        return
    trajectory = continued(trajectory, together=False)
    end = min(2 * end, trajectory.duration or 0.0)  # of the period after a periodic plan
    instants = cache(lambda window: instants_of(robot, trajectory, WINDOW * window))  # for all stops and attempts
    bounds = cache(lambda window, reserve: instants(window).bounds(reserve))
    for first in range(0, len(times), AT_ONCE):
        best, tried = dict[float, _Tried](), set[tuple[float, bytes]]()  # times and laws
        for attempt in (*ATTEMPTS, None):
            laws = {
                each: _braking(PathLimits(bounds, each, end, *attempt)) if attempt else _planned(trajectory, each, end)
                for each in times[first : first + AT_ONCE]
                if each not in best or best[each].rank[0]
            }
            # Few cables give hardly any other wrench than the plan's, so several attempts are the same motion.
            made = {each: (each, np.stack(law).tobytes()) for each, law in laws.items() if law is not None}
            laws = {each: _refined(law) for each, law in laws.items() if law is not None and made[each] not in tried}
            tried.update(made.values())
            for each, audited in zip(laws, _audited(robot, trajectory, [*laws.values()]) if laws else (), strict=True):
                best[each] = min([*([best[each]] if each in best else []), audited], key=lambda its: its.rank)
        for _, found, worst in best.values():
            yield found if worst is None else replace(found, certificate=certify(worst))


def beginnings(trajectory: Trajectory, period: float) -> np.ndarray:
    """Return the times, at most `period` apart, at which stops of a trajectory with a duration begin, (n,) [s]."""
    end = trajectory.duration or 0.0
    return np.linspace(0.0, end, int(np.ceil(end / period - 1e-9)) + 1)


def longest_stop_along(robot: Robot, trajectory: Trajectory, times: np.ndarray) -> Stop:
    """Return the longest of the stops that begin at some times, or the first infeasible one."""
    return max(_stops_along(robot, trajectory, times), key=lambda its: (not its.feasible, its.duration))


class _Tried(NamedTuple):
    rank: tuple[bool, int, bool, float]  # of two that miss little, or nearly the same, the shorter one is better
    stop: Stop
    worst: TensionProblem | None  # of the instant whose wrench is missed most; None if none is


class _Law(NamedTuple):
    """The time in the plan [s], the rate and its derivative [1/s] over time, (n,) each."""

    times: np.ndarray
    tau: np.ndarray
    rate: np.ndarray
    slope: np.ndarray


def _braking(limits: PathLimits) -> _Law:
    """Return the law of the shortest stop."""
    t, tau, rate, u = 0.0, limits.begins, 1.0, 0.0
    rows = [(t, tau, rate, u)]
    while rate > STILL and t < LONGEST:
        landing = -2 * rate / u if u < 0 else np.inf
        if landing <= 1.5 * STEP:  # u becomes 0 as the rate does
            rows.append((t + landing, tau + landing * rate / 3, 0.0, 0.0))
            break
        end = max(rate + STEP * u, 0.0)
        least, most = limits.at(tau + STEP * (rate + end) / 2, end)
        least = max(least, -(rate + STEP * u / 2) / STEP)  # so that a step is left for landing
        after = min(max(least, -FASTEST), most, 2 * (1 - rate) / STEP - u)
        tau += STEP * rate + STEP**2 * (2 * u + after) / 6
        t, rate, u = t + STEP, rate + STEP * (u + after) / 2, after
        rows.append((t, tau, rate, u))
    return _Law(*np.array(rows).T)


def _planned(trajectory: Trajectory, begins: float, end: float) -> _Law | None:
    """Return the plan's own law until it rests, soon or at its end, which brakes hardest if it is fastest; or None."""
    early, late = begins, min(begins + WINDOW, end)
    for _ in range(4):  # at a corner the platform rests for an instant
        tau = np.append(np.linspace(early, late, 200), end)
        speed = np.max([np.abs(motion[1]).reshape(len(tau), -1).max(axis=1) for motion in trajectory.at(tau)], axis=0)
        soon, near = int(speed[:-1].argmin()), tau[1] - tau[0]
        early, late = max(tau[soon] - near, begins), min(tau[soon] + near, end)
    rests = float(tau[soon if speed[soon] <= RESTS else -1])
    if min(speed[soon], speed[-1]) > RESTS or rests - begins < STEP:
        return None
    tau = np.linspace(begins, rests, int((rests - begins) / STEP) + 2)
    return _Law(tau - begins, tau, np.ones_like(tau), np.zeros_like(tau))


def _refined(law: _Law) -> _Law:
    """Return a law with more instants in each step, in which u is linear."""
    t, tau, rate, u = (part[:-1, None] for part in law)
    into = np.diff(law.times)[:, None] * np.arange(PARTS) / PARTS
    jerk = np.diff(law.slope)[:, None] / np.diff(law.times)[:, None]
    inside = (
        t + into,
        tau + into * (rate + into * (u / 2 + into * jerk / 6)),
        rate + into * (u + into * jerk / 2),
        u + into * jerk,
    )
    return _Law(*(np.append(its.ravel(), part[-1]) for part, its in zip(law, inside, strict=True)))


def _slowed(motion: Motion, law: _Law) -> Motion:
    """Return pose, velocity and acceleration of a motion that follows a law."""
    pose, velocity, acceleration = motion
    rate, slope = (part.reshape(-1, *[1] * (pose.ndim - 1)) for part in law[2:])
    return pose, rate * velocity, rate**2 * acceleration + slope * velocity


def _audited(robot: Robot, trajectory: Trajectory, laws: list[_Law]) -> Iterator[_Tried]:
    """Yield the stops of some laws, of which there is one at least."""
    law, dynamics = _Law(*(np.concatenate(parts) for parts in zip(*laws, strict=True))), dynamics_of(robot)
    platform, carriers = trajectory.at(law.tau)
    slowed, moved = _slowed(platform, law), _slowed(carriers, law)
    A = dynamics.wrench_matrix(platform[0], carriers[0]) * robot.dof_mask[:, None]
    w = dynamics.required_wrench(*slowed, wind=trajectory.wind) * robot.dof_mask
    near = np.zeros(robot.m) if trajectory.tensions is None else np.nan_to_num(trajectory.tensions(law.tau))
    near, rows = np.broadcast_to(near, (len(w), robot.m)), np.flatnonzero(robot.dof_mask)
    few = robot.m < len(rows)  # cables, which miss nearly every wrench by a little, as in plans
    given = A[:, rows], w[:, rows], robot.t_min, robot.t_max
    exact = solve_batch(*given, t_ref=near, length=robot.length, rho=RHO if few else None)
    tensions, rest = exact.tensions, ~(exact.feasible | few)
    if rest.any():
        nearest = solve_batch(
            A[rest], w[rest], robot.t_min, robot.t_max, t_ref=near[rest], length=robot.length, rho=RHO
        )
        tensions[rest] = nearest.tensions
    missing = np.linalg.norm((w - (A @ tensions[:, :, None])[..., 0]) * robot.wrench_scale, axis=1) / robot.force_scale
    lengths, last = dynamics.cable_lengths(platform[0], carriers[0]), 0
    most = LITTLE if few else MISSING
    for own in laws:
        some = slice(last, last := last + len(own.times))
        at = some.start + int(np.argmax(missing[some]))
        worst = wrench_problem(robot, A[at], w[at]) if missing[at] > most else None
        limit = overloaded_winch(robot, own.times, lengths[some], tensions[some])
        body, bases = ((x[some], v[some], a[some]) for x, v, a in (slowed, moved))
        found = Stop(robot, float(own.tau[0]), float(own.tau[-1]), own.times, body, bases, tensions[some], None, limit)
        rank = (worst is not None or bool(limit), round(missing[at] / LITTLE), bool(limit), found.duration)
        yield _Tried(rank, found, worst)
