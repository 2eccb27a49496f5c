"""Stop a team of flying carriers on the path of its platform: `team_stop_along`.

The platform stays on its path, at a rate r(t) that falls from 1 to 0 with three continuous derivatives. The forces of
the cables on it change with the wrench by the least amount,

    f = f_plan + G^+ (w - w_plan),   G f = sum of (f_i, arm_i x f_i)

so each carrier is where its cable has the direction of its force. If carriers hold several cables, and the cables give
every wrench, tensions change instead, by A^+ (w - w_plan), and the carriers stay on their paths. Their acceleration,
tilt and efforts follow. They, and the tensions, bound how soon the platform can rest: of some durations, the shortest
that keeps all limits is taken. If carriers hold one cable each, winches keep the lengths of the plan; otherwise lengths
follow from the tilts of the carriers.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.errors import InputError
from ..models import points
from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory
from .continuation import RESTS, before, continued, faded, slopes
from .team_limits import carriers_of, excess_of, limits_of, pull_of, worst_of
from .winch_forces import forces_of_winches, has_winches

SHORTEST, LONGEST = 0.1, 10.0  # the shortest stop [s], and the longest one over a usual one
ATTEMPTS, USUAL = 12, 2.5  # durations that are tried, all at once, and a usual one, of sqrt(length / g)
CLOSE = 1.5  # times the least excess: of stops that break limits, the shortest with less is taken
LEAST = 1.7  # times that carriers need at their largest acceleration: the rate falls up to 2.2 times its mean
COARSE, FINE, APART = 24, 150, 0.01  # instants of an attempt, and at most of the result; [s] between those, at least
SMOOTHED = 0.03  # [s], over which tilt is smoothed: a plan's jerk jumps between its nodes
LONGER, AGAIN = 1.03, 4  # at least, then its third and ninth power, and how often: what broke a limit takes longer
TINY, RANK = 1e-12, 1e-9  # of a matrix
ROUNDING = 1e-6  # [s]
TILTS = 3  # times that positions are computed from tilts, which follow from accelerations
INSTANT = 1e-4  # [s], for differences of attitudes
MOST_FADING = 4.0, 20.0  # derivatives of log(tension) at the end of a plan [1/s, 1/s^2]: larger ones are noise
SLACK = 1e-4  # of the largest tension: smallest tension at the end of a plan
# Polynomials of s = t / duration with three continuous derivatives, and with five, as anchors that turn need two more.
RATE = np.polynomial.Polynomial([1, 0, 0, 0, -35, 84, -70, 20])
SMOOTHER = np.polynomial.Polynomial([1, 0, 0, 0, 0, 0, -462, 1980, -3465, 3080, -1386, 252])


class TeamStop(NamedTuple):
    """A stop of a team: times, times in the plan, motions, tensions, and the limit that it breaks most."""

    times: np.ndarray  # (n,) [s]
    tau: np.ndarray  # (n,) [s]
    platform: Motion
    carriers: Motion
    tensions: np.ndarray  # (n, m) [N]
    excess: float  # of the limit, relative to it; 0: none is broken
    limit: str  # name, value and time; empty if none is broken


def team_stop_along(robot: Robot, trajectory: Trajectory, begins: float) -> TeamStop:
    """Return the shortest stop inside the limits that is found, or the shortest that breaks them nearly the least.

    A plan that ends at rest is followed to its end if no shorter stop is found inside the limits, or breaks them less.

    Raises `InputError` if the flying carriers of the robot have several cables that do not give every wrench at home,
    or several of fixed length that begin at different points of a carrier.
    """
    if not (_have_one_each(robot) or _give_every_wrench(robot)):
        raise InputError(
            "a stop must be of a robot whose flying carriers have one cable each, or cables that give every wrench "
            f"(cables of fixed length must begin at one point of each carrier), got {robot.name!r}"
        )

    fly = len(carriers_of(robot).flying) == len(robot.carriers)
    end, trajectory = trajectory.duration or 0.0, continued(trajectory, together=fly)
    rests = max(np.abs(motion[1]).max() for motion in trajectory.at(np.array([end]))) < RESTS
    left = end - begins if rests else np.inf
    speeds = np.linalg.norm(trajectory.at(np.array([begins]))[1][1][0, :, :3], axis=1)
    braking = speeds / [carrier.motion_limits.acceleration or np.inf for carrier in robot.carriers]  # [s]
    soonest = max(SHORTEST, LEAST * float(braking.max()))
    longest_cable = dynamics_of(robot).cable_lengths(robot.home, robot.carrier_home).max()
    usual = USUAL * np.sqrt(longest_cable / np.linalg.norm(robot.gravity))
    longest = min(LONGEST * max(usual, soonest), max(left, soonest))
    durations = np.geomspace(soonest, longest, ATTEMPTS, endpoint=not rests)
    durations = durations[durations < left]  # none if the plan rests sooner; only the soonest without gravity
    excess = _Stops(robot, trajectory, begins, durations, COARSE).excess if len(durations) else durations
    within = bool((excess == 0).any())
    found = [_remainder(robot, trajectory, begins)] if rests and not within else []
    if len(durations) and not (found and found[0].excess == 0):
        kept = durations[excess <= CLOSE * excess.min()]
        duration = float(kept[0])
        # With more instants more is exceeded: where no attempt keeps the limits, the result does not either.
        for again in range(AGAIN if within else 1):
            count = int(np.clip(duration / APART, 10, FINE))
            found.append(_Stops(robot, trajectory, begins, np.array([duration]), count).only())
            # Accelerations are as its inverse square.
            longer = duration * max(np.sqrt(1.0 + found[-1].excess), LONGER ** (3**again))
            after = [*kept[kept > (longer if again else duration)].tolist(), longer]
            duration = after[0] if again else min(after[0], longer)
            if found[-1].excess == 0 or duration >= longest:
                break
        if rests and within and found[-1].excess > 0:
            found.append(_remainder(robot, trajectory, begins))
    return min(found, key=lambda its: its.excess)


def _have_one_each(robot: Robot) -> bool:
    """Return whether all carriers fly, with one cable each."""
    return sorted(robot.carrier_of_cable) == carriers_of(robot).flying.tolist() == list(range(len(robot.carriers)))


def _give_every_wrench(robot: Robot) -> bool:
    """Return whether the cables give every wrench, and let flying carriers tilt while these keep their paths."""
    A = robot.wrench_scale[:, None] * dynamics_of(robot).wrench_matrix(robot.home, robot.carrier_home)
    rows = np.flatnonzero(robot.dof_mask)
    own = carriers_of(robot).anchors[robot.carrier_of_cable]
    tilt = robot.fixed_lengths is None or bool((robot.anchors == own).all())
    return tilt and bool(np.linalg.matrix_rank(A[rows], RANK) == len(rows))


def _remainder(robot: Robot, trajectory: Trajectory, begins: float) -> TeamStop:
    """Return the rest of a plan that ends at rest, with the limit that it breaks most."""
    left = (trajectory.duration or 0.0) - begins
    left = left if left > ROUNDING else APART  # no instant after the end, where accelerations may jump to zero
    times = np.linspace(0.0, left, max(int(left / APART), 10))
    platform, carriers = trajectory.at(begins + times)
    forces, tensions, _ = _forces(robot, trajectory, np.ones(len(times)), platform, platform, carriers, times - left)
    pose, velocity, acceleration = motion = tuple(part[None] for part in carriers)
    before, R, after = (
        points.rotations(pose[..., 3:] + t * velocity[..., 3:] + t**2 / 2 * acceleration[..., 3:])
        for t in (-INSTANT, 0.0, INSTANT)
    )
    turning = R, (after - before) / (2 * INSTANT), (after - 2 * R + before) / INSTANT**2
    windings = _windings(robot, times[None], platform[0][None], pose, tensions[None])
    rows = limits_of(robot, motion, forces[None], tensions[None], turning, windings)  # type: ignore[arg-type]
    return TeamStop(times, begins + times, platform, carriers, tensions, *worst_of(rows, times, of_plan=True))


def _windings(
    robot: Robot, times: np.ndarray, platform: np.ndarray, carriers: np.ndarray, tensions: np.ndarray
) -> np.ndarray | None:
    """Return the forces of the motors of winches, (d, n, m) [N]; None if the file describes none.

    - `times`: (d, n) [s].
    - `platform`, `carriers`: poses, (d, n, 6) and (d, n, c, 6).
    - `tensions`: (d, n, m) [N].
    """
    if not has_winches(robot):
        return None
    lengths = dynamics_of(robot).cable_lengths(platform, carriers)
    return np.stack([forces_of_winches(robot, *each) for each in zip(times, lengths, tensions, strict=True)])


def _least(square: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution of square systems; if they are singular, nearly the one of least norm."""
    size = np.trace(square, axis1=1, axis2=2)[:, None, None]
    return np.linalg.solve(square + TINY * size * np.eye(square.shape[1]), right)


class _Stops:
    """Stops of d durations, (d,) [s], at n instants each: arrays are (d, n, ...)."""

    def __init__(self, robot: Robot, trajectory: Trajectory, begins: float, durations: np.ndarray, count: int):
        self.robot, self.h = robot, durations / count
        self.times = self.h[:, None] * np.arange(count + 1)
        s, T = np.linspace(0.0, 1.0, count + 1), durations[:, None]
        rate = SMOOTHER if robot.anchors.any() else RATE
        self.rate, slope = np.tile(rate(s), (len(T), 1)), rate.deriv()(s) / T
        self.tau = begins + T * rate.integ()(s)
        shape = self.tau.shape
        flat = trajectory.at(self.tau.ravel())
        r, u = self.rate.reshape(-1, 1), slope.reshape(-1, 1)
        (pose, velocity, acceleration), self.planned = flat
        platform = pose, r * velocity, r**2 * acceleration + u * velocity
        after = self.tau.ravel() - (trajectory.duration or 0.0)
        self._given = trajectory, r[:, 0], platform, flat[0], self.planned, after
        self.platform = [part.reshape(*shape, 6) for part in platform]
        self._before = self._balance()
        lengths = dynamics_of(robot).cable_lengths(pose, self.planned[0])
        if robot.fixed_lengths is not None:
            if (after > 0).any():  # the plan's last ones
                ends = trajectory.at(np.array([trajectory.duration or 0.0]))
                lengths[after > 0] = dynamics_of(robot).cable_lengths(*(motion[0] for motion in ends))
            lengths = r * lengths + (1.0 - r) * np.array(robot.fixed_lengths)
        along = (lengths.reshape(self.tensions.shape) / self.tensions)[..., None] * self._forces
        self._ends = points.attachments(robot, pose).reshape(along.shape) + along  # of cables on carriers
        self.carriers = self._motions()
        R = points.rotations(self.carriers[0][..., 3:])
        turning = R, self._slope(R), self._slope(self._slope(R))
        windings = _windings(robot, self.times, self.platform[0], self.carriers[0], self.tensions)
        rows = limits_of(robot, self.carriers, self._forces, self.tensions, turning, windings, limits_lacking=True)
        self._rows, self.excess = rows, excess_of(rows, begins_inside=False).max(axis=(0, 2))  # of each stop, (d,)

    def _balance(self, carriers: np.ndarray | None = None) -> np.ndarray:
        """Find forces and tensions, with carriers (d, n, c, 6), or those of the plan; return the plan's forces."""
        forces, tensions, balance = _forces(self.robot, *self._given, carriers)
        self.tensions = tensions.reshape(*self.tau.shape, -1)
        self._forces, balance = (part.reshape(*self.tau.shape, self.robot.m, 3) for part in (forces, balance))
        return balance

    def _motions(self) -> Motion:
        """Return pose, velocity and acceleration of the carriers, (d, n, c, 6) each."""
        its, turns = carriers_of(self.robot), bool(self.robot.anchors.any())
        flying, keep = its.flying, self.robot.fixed_lengths is None and not _have_one_each(self.robot)
        planned = [part.reshape(*self.tau.shape, -1, 6) for part in self.planned]
        pose, starts = planned[0].copy(), [part[0] for part in self.planned]
        # The stop begins with the plan's own tilt, which between the plan's nodes is not quite the tilt of balance.
        usual = self._tilts(planned[2], self._before)
        for attempt in range(TILTS if turns else 1):
            if not keep:
                places = self._ends[:, :, its.first[flying]]
                if turns:
                    arms = its.anchors[flying][..., None]
                    places -= (points.rotations(pose[:, :, flying, 3:]) @ arms)[..., 0]
                pose[:, :, flying, :3] = places
            if attempt == TILTS - 1:
                break
            bend = self._slopes(pose[..., :3], [part[:, :3] for part in starts])[1]
            share = self.rate[..., None, None]
            change = self._tilts(bend, self._forces) - share * usual
            tilts = share * planned[0][:, :, flying, 3:5] + self._smooth(change, lands=turns)
            pose[:, :, flying, 3:5] = tilts
            if keep and turns:
                self._balance(pose)
        pose[:, 0] = starts[0]
        return pose, *self._slopes(pose, starts)

    def _tilts(self, bends: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return roll and pitch of the k flying carriers, (d, n, k, 2) [rad], that balance accelerations and cables."""
        bends, pulls = (
            part.reshape(self.tau.size, -1, part.shape[-1]) for part in (bends, pull_of(self.robot, forces))
        )
        flying, gravity = carriers_of(self.robot).flying, np.array(self.robot.gravity)
        tilts = np.empty((self.tau.size, len(flying), 2))
        for row, k in enumerate(flying):
            carrier = self.robot.carriers[k]
            tilts[:, row] = carrier.balanced_tilt(self.planned[0][:, k], bends[:, k], pulls[:, k], gravity)
        return tilts.reshape(*self.tau.shape, -1, 2)

    def _slopes(self, values: np.ndarray, starts: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return two derivatives by differences, which begin as the plan's do and end at rest."""
        result = [values]
        for start in starts[1:]:
            result.append(self._slope(result[-1]))
            result[-1][:, 0], result[-1][:, -1] = start, 0.0
        return result[1], result[2]

    def _slope(self, values: np.ndarray) -> np.ndarray:
        slope = np.empty_like(values)  # `np.gradient`, in a third of the time
        slope[:, 1:-1] = (values[:, 2:] - values[:, :-2]) / 2
        slope[:, 0], slope[:, -1] = values[:, 1] - values[:, 0], values[:, -1] - values[:, -2]
        return slope / self.h.reshape(-1, *[1] * (values.ndim - 1))

    def _smooth(self, values: np.ndarray, lands: bool) -> np.ndarray:
        """Smooth a result; the last value stays, or, if it `lands`, the last slope is zero."""
        for _ in range(2 * round(float((SMOOTHED / self.h[-1]) ** 2)) if len(self.h) == 1 else 0):
            last = (values[:, -2] - values[:, -1]) / 2
            values[:, 1:-1] += (values[:, :-2] - 2 * values[:, 1:-1] + values[:, 2:]) / 4
            values[:, -1] += last if lands else 0.0
        return values

    def only(self) -> TeamStop:
        """Return the only stop; if it breaks limits, with what it breaks at its beginning, as the plan does."""
        platform, carriers = (tuple(part[0] for part in motion) for motion in (self.platform, self.carriers))
        worst = worst_of(self._rows, self.times[0]) if self.excess[0] > 0 else (0.0, "")
        return TeamStop(self.times[0], self.tau[0], platform, carriers, self.tensions[0], *worst)  # type: ignore[arg-type]


def _forces(
    robot: Robot,
    trajectory: Trajectory,
    kept: np.ndarray,
    platform: Motion,
    planned: Motion,
    carriers: Motion,
    after: np.ndarray,
    tilted: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the forces of the cables on the platform, (n, m, 3), the tensions, (n, m), and the plan's forces [N].

    `kept`, (n,), is the share of the plan's imbalance that remains, and `after`, (n,) [s], the time after the plan's
    end, from which its tensions fade to constants: those that balance an extrapolated motion can be negative.
    `tilted` has the poses of the carriers, (..., c, 6), if these differ from the plan's, `carriers`.
    """
    rows = np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows]
    end = trajectory.duration or 0.0
    A, tensions, missing = _of_plan(robot, trajectory, end + np.minimum(after, 0.0), planned, carriers)
    if (beyond := after[:, None] > 0).any():
        last = _of_plan(robot, trajectory, before(end), *trajectory.at(before(end)))
        value, *rates = slopes(np.log(np.maximum(last[1], SLACK * robot.t_max)))  # so that all tensions stay positive
        rates = [np.clip(rate, -most, most) for rate, most in zip(rates, MOST_FADING, strict=True)]
        tensions = np.where(beyond, np.exp(faded((value, *rates), np.maximum(after, 0.0))[0]), tensions)
        missing = np.where(beyond, last[2][2:], missing)
    of_plan = A[:, :3].swapaxes(1, 2) * tensions[..., None]
    if tilted is not None:
        A = dynamics_of(robot).wrench_matrix(planned[0], tilted.reshape(carriers[0].shape))
    now = dynamics_of(robot).required_wrench(*platform, wind=trajectory.wind)
    wanted = scale * (now - (A @ tensions[..., None])[..., 0] - kept[:, None] * missing)[:, rows]
    may_turn = _have_one_each(robot)
    G = scale[:, None] * (_wrenches_of_forces(robot, planned[0]) if may_turn else A)[:, rows]
    turned = G.swapaxes(1, 2)
    change = (turned @ _least(G @ turned, wanted[..., None]))[..., 0]
    if may_turn:
        forces = of_plan + change.reshape(of_plan.shape)
        return forces, np.linalg.norm(forces, axis=2), of_plan
    return A[:, :3].swapaxes(1, 2) * (tensions + change)[..., None], tensions + change, of_plan


def _of_plan(
    robot: Robot, trajectory: Trajectory, times: np.ndarray, planned: Motion, carriers: Motion
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return wrench matrices (n, 6, m), the tensions that balance a plan best, (n, m), and missing wrenches (n, 6).

    If several tensions balance it, they are those nearest to the plan's, for which its carriers tilt.
    """
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows]
    A = dynamics.wrench_matrix(planned[0], carriers[0])
    w = dynamics.required_wrench(*planned, wind=trajectory.wind)
    along = A[:, rows] * scale[:, None]
    transposed = along.swapaxes(1, 2)
    near = np.zeros((len(w), robot.m, 1))
    if robot.m > len(rows) and trajectory.tensions is not None:
        near = np.nan_to_num(trajectory.tensions(times))[..., None]
    tensions = near + _least(transposed @ along, transposed @ ((scale * w[:, rows])[..., None] - along @ near))
    return A, tensions[..., 0], w - (A @ tensions)[..., 0]


def _wrenches_of_forces(robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Return the wrenches of unit forces of each cable on the platform, at poses (n, 6), (n, 6, 3 m)."""
    arms = points.rotations(pose[:, 3:])[:, None] @ (robot.attachments - np.array(robot.platform.com))[..., None]
    turn = np.empty((*arms.shape[:2], 6, 3))
    turn[..., :3, :] = np.eye(3)
    turn[..., 3:, :] = points.cross(arms.swapaxes(-1, -2), np.eye(3)).swapaxes(-1, -2)
    return turn.swapaxes(1, 2).reshape(len(pose), 6, -1)
