"""Stop a team of flying carriers on the path of its platform: `team_stop_along`.

The platform stays on its path, at a rate r(t) that falls from 1 to 0 with three continuous derivatives. The forces of
the cables on it change with the wrench by the least amount,

    f = f_plan + G^+ (w - w_plan),   G f = sum of (f_i, arm_i x f_i)

so each carrier is where its cable has the direction of its force. If carriers hold several cables, and the cables give
every wrench, tensions change instead, by A^+ (w - w_plan), and the carriers stay on their paths. Their acceleration,
tilt and efforts follow. They, and the tensions, bound how soon the platform can rest: of some durations, the shortest
that keeps all limits is taken.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..base.errors import InputError
from ..base.text import quantity
from ..models import points
from ..models.carriers import Actuator
from ..models.dynamics import dynamics_of
from ..models.part import inertia_matrix
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory
from .continuation import RESTS, before, continued, faded, slopes

SHORTEST, LONGEST = 0.1, 10.0  # the shortest stop [s], and the longest one over a usual one
ATTEMPTS, USUAL = 8, 2.5  # durations that are tried, all at once, and a usual one, of sqrt(length / g)
CLOSE = 1.5  # times the least excess: of stops that break limits, the shortest with less is taken
LEAST = 1.7  # times that carriers need at their largest acceleration: the rate falls up to 2.2 times its mean
COARSE, FINE, APART = 24, 150, 0.01  # instants of an attempt, and at most of the result; [s] between those, at least
SMOOTHED = 0.03  # [s], over which tilt is smoothed: a plan's jerk jumps between its nodes
ACCEPTED = 2e-3  # of a limit's range, up to which differences are inexact
LONGER, AGAIN = 1.03, 3  # at least, and how often: what broke a limit in between takes longer
TINY, RANK = 1e-12, 1e-9  # of a matrix
TILTS = 3  # times that positions are computed from tilts, which follow from accelerations
LACKING = 0.01  # of the largest tension: a force that no actuator gives
INSTANT = 1e-4  # [s], for differences of attitudes
MOST_FADING = 4.0, 20.0  # derivatives of log(tension) at the end of a plan [1/s, 1/s^2]: larger ones are noise
SLACK = 1e-4  # of the largest tension: smallest tension at the end of a plan
# Of s = t / duration, with three continuous derivatives, and with five, since anchors that turn need two more.
RATE = np.polynomial.Polynomial([1, 0, 0, 0, -35, 84, -70, 20])
SMOOTHER = np.polynomial.Polynomial([1, 0, 0, 0, 0, 0, -462, 1980, -3465, 3080, -1386, 252])
Row = tuple[str, np.ndarray, float, float]  # a limit: name, values (d, n), and their range


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

    A plan that ends at rest is followed to its end if no stop is shorter.

    Raises `InputError` if the robot is no team of flying carriers with a cable of fixed length each, or with cables of
    fixed length that begin at one point of each and give every wrench at home.
    """
    flying = [carrier.body is not None and bool(carrier.actuators) for carrier in robot.carriers]
    if not all(flying) or robot.fixed_lengths is None or not (_have_one_each(robot) or _give_every_wrench(robot)):
        raise InputError(
            "a stop must be of a team whose carriers fly with one cable of fixed length each, or with cables from one "
            "point of each that give every wrench, or of a robot with carriers of kind ground, prescribed or mobile, "
            f"got {robot.name!r}"
        )

    end, trajectory = trajectory.duration or 0.0, continued(trajectory, together=True)
    last = [motion[1] for motion in trajectory.at(np.array([end]))]
    rests = max(np.abs(velocity).max() for velocity in last) < RESTS
    left = end - begins if rests else np.inf
    speeds = np.linalg.norm(trajectory.at(np.array([begins]))[1][1][0, :, :3], axis=1)
    braking = speeds / [carrier.motion_limits.acceleration or np.inf for carrier in robot.carriers]  # [s]
    soonest = max(SHORTEST, LEAST * float(braking.max()))
    usual = USUAL * np.sqrt(robot.fixed_lengths.max() / np.linalg.norm(robot.gravity))
    longest = min(LONGEST * max(usual, soonest), max(2 * left, soonest))
    durations = np.geomspace(soonest, longest, ATTEMPTS)
    durations, best = durations[durations < left], None
    if len(durations):
        excess = np.array([each for each, _ in _Stops(robot, trajectory, begins, durations, COARSE).worst])
        duration = float(durations[np.argmax(excess <= CLOSE * excess.min())])
        # With more instants more is exceeded: where no attempt keeps the limits, the result does not either.
        for _ in range(AGAIN if excess.min() == 0 else not rests):
            count = int(np.clip(duration / APART, 10, FINE))
            found = _Stops(robot, trajectory, begins, np.array([duration]), count).only()
            best = found if best is None or found.excess < best.excess else best
            duration *= max(np.sqrt(1.0 + found.excess), LONGER)  # accelerations are as its inverse square
            if best.excess == 0 or duration >= min(left, longest):
                break
    return _remainder(robot, trajectory, begins) if best is None or (rests and best.excess > 0) else best


def _have_one_each(robot: Robot) -> bool:
    return sorted(robot.carrier_of_cable) == list(range(len(robot.carriers)))


def _give_every_wrench(robot: Robot) -> bool:
    """Return whether cables from one point of each carrier give every wrench, so that carriers may keep their paths."""
    own = _carriers_of(robot).anchors[robot.carrier_of_cable]
    A = robot.wrench_scale[:, None] * dynamics_of(robot).wrench_matrix(robot.home, robot.carrier_home)
    rows = np.flatnonzero(robot.dof_mask)
    return bool((robot.anchors == own).all() and np.linalg.matrix_rank(A[rows], RANK) == len(rows))


def _remainder(robot: Robot, trajectory: Trajectory, begins: float) -> TeamStop:
    """Return the rest of a plan that ends at rest, with the limit that it breaks most."""
    left = max((trajectory.duration or 0.0) - begins, SHORTEST)
    times = np.linspace(0.0, left, max(int(left / APART), 10))
    platform, carriers = trajectory.at(begins + times)
    forces, tensions, _ = _forces(robot, trajectory, np.ones(len(times)), platform, platform, carriers, times - left)
    pose, velocity, acceleration = motion = tuple(part[None] for part in carriers)
    before, R, after = (
        points.rotations(pose[..., 3:] + t * velocity[..., 3:] + t**2 / 2 * acceleration[..., 3:])
        for t in (-INSTANT, 0.0, INSTANT)
    )
    turning = R, (after - before) / (2 * INSTANT), (after - 2 * R + before) / INSTANT**2
    rows = _limits(robot, motion, forces[None], tensions[None], turning)  # type: ignore[arg-type]
    return TeamStop(times, begins + times, platform, carriers, tensions, *_worst(rows, times[None])[0])


class _Carriers(NamedTuple):
    """Constants of the carriers of a team, one row a carrier."""

    first: np.ndarray  # (c,), of its cables
    holds: np.ndarray  # (c, m), 1 for each of its cables
    anchors: np.ndarray  # (c, 3), where its cables begin, in its frame [m]
    mass: np.ndarray  # (c, 1) [kg]
    inertia: np.ndarray  # (c, 3, 3) [kg m^2]
    actuators: list[tuple[Actuator, ...]]
    commands: list[np.ndarray]  # (6, k), the commands of each unit wrench


@lru_cache(maxsize=4)
def _carriers_of(robot: Robot) -> _Carriers:
    holds = np.arange(len(robot.carriers))[:, None] == robot.carrier_of_cable
    bodies = [carrier.body for carrier in robot.carriers if carrier.body is not None]
    actuators = [carrier.actuators for carrier in robot.carriers]
    return _Carriers(
        first=(first := holds.argmax(axis=1)),
        holds=holds.astype(float),
        anchors=robot.anchors[first],
        mass=np.array([[body.mass] for body in bodies]),
        inertia=np.array([inertia_matrix(body.inertia) for body in bodies]),
        actuators=actuators,
        commands=[np.linalg.pinv([actuator.wrench for actuator in each]) for each in actuators],
    )


def _pull(robot: Robot, forces: np.ndarray) -> np.ndarray:
    """Return the pull of the cables of each carrier, (d, n, c, 3) [N], from their forces on the platform."""
    return -(_carriers_of(robot).holds @ forces)


def _least(square: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution of square systems; if they are singular, nearly that of least norm."""
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
        forces, tensions, balance = _forces(robot, trajectory, r[:, 0], platform, flat[0], self.planned, after)
        self.platform = [part.reshape(*shape, 6) for part in platform]
        self.tensions = tensions.reshape(*shape, -1)
        self._forces, self._before = (part.reshape(*shape, robot.m, 3) for part in (forces, balance))
        of_cables = dynamics_of(robot).cable_lengths
        lengths = of_cables(pose, self.planned[0])
        if (after > 0).any():  # the plan's last ones
            lengths[after > 0] = of_cables(
                *(motion[0] for motion in trajectory.at(np.array([trajectory.duration or 0.0])))
            )
        lengths = r * lengths + (1.0 - r) * np.array(robot.fixed_lengths)
        ends = points.attachments(robot, pose) + (lengths / tensions)[..., None] * forces
        self._ends = ends.reshape(self._forces.shape)  # of cables on carriers
        self.carriers = self._motions()
        R = points.rotations(self.carriers[0][..., 3:])
        turning = R, self._slope(R), self._slope(self._slope(R))
        rows = _limits(robot, self.carriers, self._forces, self.tensions, turning, limits_lacking=True)
        self.worst = _worst(rows, self.times, begins_inside=False)

    def _motions(self) -> Motion:
        """Return pose, velocity and acceleration of the carriers, (d, n, c, 6) each."""
        its, turns = _carriers_of(self.robot), bool(self.robot.anchors.any())
        planned = [part.reshape(*self.tau.shape, -1, 6) for part in self.planned]
        pose, starts = planned[0].copy(), [part[0] for part in self.planned]
        # The stop begins with the plan's own tilt, which between the plan's nodes is not quite that of balance.
        usual = self._tilts(planned[2], self._before)
        for attempt in range(TILTS if turns else 1):
            pose[..., :3] = self._ends[:, :, its.first]
            if turns:
                pose[..., :3] -= (points.rotations(pose[..., 3:]) @ its.anchors[..., None])[..., 0]
            if attempt == TILTS - 1:
                break
            bend = self._slopes(pose[..., :3], [part[:, :3] for part in starts])[1]
            share = self.rate[..., None, None]
            change = self._tilts(bend, self._forces) - share * usual
            pose[..., 3:5] = share * planned[0][..., 3:5] + self._smooth(change, lands=turns)
        pose[:, 0] = starts[0]
        return pose, *self._slopes(pose, starts)

    def _tilts(self, bends: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return roll and pitch, (d, n, c, 2) [rad], that balance accelerations of carriers and forces of cables."""
        bends, pulls = (part.reshape(self.tau.size, -1, part.shape[-1]) for part in (bends, _pull(self.robot, forces)))
        gravity = np.array(self.robot.gravity)
        tilts = np.empty((*bends.shape[:2], 2))
        for k, carrier in enumerate(self.robot.carriers):
            tilts[:, k] = carrier.balanced_tilt(self.planned[0][:, k], bends[:, k], pulls[:, k], gravity)
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
        """Return the only stop."""
        platform, carriers = (tuple(part[0] for part in motion) for motion in (self.platform, self.carriers))
        return TeamStop(self.times[0], self.tau[0], platform, carriers, self.tensions[0], *self.worst[0])  # type: ignore[arg-type]


def _forces(
    robot: Robot,
    trajectory: Trajectory,
    kept: np.ndarray,
    platform: Motion,
    planned: Motion,
    carriers: Motion,
    after: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the forces of the cables on the platform, (n, m, 3), the tensions, (n, m), and the plan's forces [N].

    `kept`, (n,), is the share of the plan's imbalance that remains, and `after`, (n,) [s], the time after the plan's
    end, from which its tensions fade to constants: those that balance an extrapolated motion can be negative.
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
    now = dynamics_of(robot).required_wrench(*platform, wind=trajectory.wind)
    wanted = scale * (now - (A @ tensions[..., None])[..., 0] - kept[:, None] * missing)[:, rows]
    may_turn = _have_one_each(robot)
    G = scale[:, None] * (_wrenches_of_forces(robot, planned[0]) if may_turn else A)[:, rows]
    turned = G.swapaxes(1, 2)
    change = (turned @ _least(G @ turned, wanted[..., None]))[..., 0]
    directions = A[:, :3].swapaxes(1, 2)
    of_plan = directions * tensions[..., None]
    if may_turn:
        forces = of_plan + change.reshape(of_plan.shape)
        return forces, np.linalg.norm(forces, axis=2), of_plan
    return directions * (tensions + change)[..., None], tensions + change, of_plan


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


def _worst(rows: list[Row], times: np.ndarray, begins_inside: bool = True) -> list[tuple[float, str]]:
    """Return the largest excess of each stop, relative to a limit's range, and the text of that limit.

    Unless a stop should begin inside, so much as it has first is no excess. What is undefined is infinitely much.
    """
    names, values = [row[0] for row in rows], np.stack([row[1] for row in rows])  # (k, d, n)
    low, high = np.array([row[2:] for row in rows]).T[..., None, None]  # (k, 1, 1) each
    floor = low if begins_inside else np.minimum(low, values[..., :1])
    ceiling = high if begins_inside else np.maximum(high, values[..., :1])
    beyond = np.where(np.isnan(values), np.inf, np.maximum(floor - values, values - ceiling) / (high - low))
    worst = [(0.0, "")] * len(times)
    for d, excess in enumerate(beyond.max(axis=(0, 2)).tolist()):
        if excess > ACCEPTED:
            k, at = np.unravel_index(np.argmax(beyond[:, d]), beyond[:, d].shape)
            value = values[k, d, at]
            bound = float(low[k, 0, 0] if value < low[k, 0, 0] else high[k, 0, 0])
            worst[d] = excess, f"{names[k]}: {quantity(value)} of {bound:g} at {quantity(times[d, at], 's')}"
    return worst


def _limits(
    robot: Robot,
    motion: Motion,
    forces: np.ndarray,
    tensions: np.ndarray,
    turning: tuple[np.ndarray, np.ndarray, np.ndarray],
    limits_lacking: bool = False,
) -> list[Row]:
    """Return what a motion of the carriers, (d, n, c, 6) each, requires, and the tensions, (d, n, m) [N].

    `forces` are those of the cables on the platform, (d, n, m, 3) [N].
    `turning` has their rotations and the first and second derivative of these, (d, n, c, 3, 3) each. If
    `limits_lacking`, a carrier that turns about another point than its anchor has a limit for the force that is missing
    from its actuators: it can turn too quickly for its cables to stay taut.
    """
    its, (_, velocity, acceleration), R, pull = _carriers_of(robot), motion, turning[0], _pull(robot, forces)
    down = R.swapaxes(-1, -2)
    spin, spun = (points.axial(down @ part) for part in turning[1:])
    force = (down @ (its.mass * (acceleration[..., :3] - np.array(robot.gravity)) - pull)[..., None])[..., 0]
    impulse, change = ((its.inertia @ part[..., None])[..., 0] for part in (spin, spun))
    moment = change + points.cross(spin, impulse) - points.cross(its.anchors, (down @ pull[..., None])[..., 0])
    wrenches = np.concatenate([force, moment], axis=-1)
    speeds, bends = (np.linalg.norm(part[..., :3], axis=-1) for part in (velocity, acceleration))
    tilts, ranges = np.arccos(np.clip(R[..., 2, 2], -1, 1)), zip(robot.t_min, robot.t_max, strict=True)
    rows = [(f"tension {i + 1}", tensions[..., i], low, high) for i, (low, high) in enumerate(ranges)]
    for k, carrier in enumerate(robot.carriers):
        wrench, name, own = wrenches[:, :, k], carrier.name, carrier.motion_limits
        commands = wrench @ its.commands[k]
        rows += [(f"{a.name} of {name}", commands[..., i], a.low, a.high) for i, a in enumerate(its.actuators[k])]
        if limits_lacking and its.anchors[k].any():
            given = commands @ np.array([a.wrench for a in its.actuators[k]])
            lacking = np.linalg.norm((wrench - given)[..., :3], axis=-1)
            most = max(robot.t_min[its.first[k]], LACKING * robot.t_max[its.first[k]])
            rows.append((f"force perpendicular to the thrust of {name}", lacking, 0.0, most))
        for what, values, largest in (
            ("speed", speeds, own.speed),
            ("acceleration", bends, own.acceleration),
            ("tilt", tilts, own.tilt),
        ):
            rows += [] if largest is None else [(f"{what} of {name}", values[..., k], 0.0, largest)]
    return rows
