"""Stop a team of flying carriers on the path of its platform: `team_stop_along`.

The platform stays on its path, at a rate r(t) that falls from 1 to 0 with three continuous derivatives. The forces of
the cables on it change with the wrench by the least amount,

    f = f_plan + G^+ (w - w_plan),   G f = sum of (f_i, arm_i x f_i)

so each carrier is where its cable has the direction of its force. If carriers hold several cables, and the cables give
every wrench, tensions change instead, by A^+ (w - w_plan), and the carriers stay on their paths. Their acceleration,
tilt and efforts follow. They, and the tensions, bound how soon the platform can rest; the duration is found by
bisection.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.errors import InputError
from ..base.text import quantity
from ..models import points
from ..models.carriers import Carrier
from ..models.dynamics import dynamics_of
from ..models.part import inertia_matrix
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory

SHORTEST, LONGEST, ATTEMPTS = 0.1, 30.0, 10  # [s] of a stop, and how many durations are tried at once
COARSE, APART = 24, 0.01  # instants of an attempt; [s] between those of the result
SMOOTHED = 0.03  # [s], over which tilt is smoothed: a plan's jerk jumps between its nodes
RESERVE, ACCEPTED = 0.02, 2e-3  # of a limit's range: that attempts keep, and up to which differences are inexact
LONGER, AGAIN = 1.1, 4  # what broke a limit in between takes longer
TINY, RANK = 1e-12, 1e-9  # of a matrix
TILTS = 3  # times that positions are computed from tilts, which follow from accelerations
LACKING = 0.01  # of the largest tension: a force that no actuator gives
INSTANT = 1e-4  # [s], for differences of attitudes
RESTS = 1e-4  # [m/s, rad/s], at the end of a plan
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
    """Return the shortest stop inside the limits that is found, or the one that breaks them least.

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

    end = trajectory.duration or 0.0
    last = [motion[1] for motion in trajectory.at(np.array([end]))]
    rests = max(np.abs(velocity).max() for velocity in last) < RESTS
    longest = min(2 * (end - begins), LONGEST) if rests else LONGEST
    best: TeamStop | None = None
    if longest > SHORTEST:
        durations = np.geomspace(SHORTEST, longest, ATTEMPTS)
        excess = _Stops(robot, trajectory, begins, durations, COARSE).worst(RESERVE)[0]
        duration = float(durations[np.argmax(excess == 0) if (excess == 0).any() else np.argmin(excess)])
        for _ in range(AGAIN):
            found = _Stops(robot, trajectory, begins, np.array([duration]), max(int(duration / APART), 10)).only()
            best = found if best is None or found.excess < best.excess else best
            if best.excess == 0 or LONGER * duration > longest:
                break
            duration *= LONGER
    if best is None or (rests and (best.excess > 0 or begins + best.times[-1] >= end)):
        return _remainder(robot, trajectory, begins)
    return best


def _have_one_each(robot: Robot) -> bool:
    return sorted(robot.carrier_of_cable) == list(range(len(robot.carriers)))


def _give_every_wrench(robot: Robot) -> bool:
    """Return whether cables from one point of each carrier give every wrench, so that carriers may keep their paths."""
    first = [int(np.flatnonzero(robot.carrier_of_cable == owner)[0]) for owner in robot.carrier_of_cable]
    A = robot.wrench_scale[:, None] * dynamics_of(robot).wrench_matrix(robot.home, robot.carrier_home)
    rows = np.flatnonzero(robot.dof_mask)
    return bool((robot.anchors == robot.anchors[first]).all() and np.linalg.matrix_rank(A[rows], RANK) == len(rows))


def _remainder(robot: Robot, trajectory: Trajectory, begins: float) -> TeamStop:
    """Return the rest of a plan that ends at rest, with the limit that it breaks most."""
    left = max((trajectory.duration or 0.0) - begins, SHORTEST)
    times = np.linspace(0.0, left, max(int(left / APART), 10))
    platform, carriers = trajectory.at(begins + times)
    forces, tensions, _ = _forces(robot, trajectory, np.ones(len(times)), platform, platform, carriers)
    rows = _limits_of_tensions(robot, tensions[None])
    for index, carrier in enumerate(robot.carriers):
        pose, velocity, acceleration = motion = tuple(part[None, :, index] for part in carriers)
        before, R, after = (
            points.rotations(pose[..., 3:] + t * velocity[..., 3:] + t**2 / 2 * acceleration[..., 3:])
            for t in (-INSTANT, 0.0, INSTANT)
        )
        turning = R, (after - before) / (2 * INSTANT), (after - 2 * R + before) / INSTANT**2
        anchor, pull = _pull(robot, index, forces[None])
        rows += _limits(carrier, motion, pull, anchor, np.array(robot.gravity), turning)  # type: ignore[arg-type]
    excess, ((_, limit),) = _worst(rows, times[None])
    return TeamStop(times, begins + times, platform, carriers, tensions, float(excess[0]), limit)


def _pull(robot: Robot, index: int, forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the cables of a carrier begin, in its frame (3,) [m], and their pull, (d, n, 3) [N]."""
    cables = np.flatnonzero(robot.carrier_of_cable == index)
    return robot.anchors[cables[0]], -forces[:, :, cables].sum(axis=2)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the cross products (..., 3), as `np.cross` does, in a quarter of its time."""
    before, after = [2, 0, 1], [1, 2, 0]
    return a[..., after] * b[..., before] - a[..., before] * b[..., after]


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
        forces, tensions, before = _forces(robot, trajectory, r[:, 0], platform, flat[0], self.planned)
        self.platform = [part.reshape(*shape, 6) for part in platform]
        self.tensions = tensions.reshape(*shape, -1)
        self._forces, self._before = (part.reshape(*shape, robot.m, 3) for part in (forces, before))
        held = points.attachments(robot, pose)
        lengths = np.linalg.norm(points.anchors(robot, self.planned[0]) - held, axis=-1)
        ends = held + (lengths / tensions)[..., None] * forces
        self._ends = ends.reshape(self._forces.shape)  # of cables on carriers
        self.carriers, self.rows = [], list[Row]()
        for index in range(len(robot.carriers)):
            self._add(index)
        self.rows += _limits_of_tensions(robot, self.tensions)

    def _add(self, index: int) -> None:
        """Add the motion of a carrier and its limits."""
        robot, carrier = self.robot, self.robot.carriers[index]
        cable, gravity = int(np.flatnonzero(robot.carrier_of_cable == index)[0]), np.array(robot.gravity)
        anchor, pull = _pull(robot, index, self._forces)
        pose = self.planned[0][:, index].reshape(*self.tau.shape, 6).copy()
        starts = [part[0, index] for part in self.planned]
        at = np.column_stack([np.zeros((self.tau.size, 5)), pose[..., 5].ravel()])

        def tilt(bend: np.ndarray, pull: np.ndarray) -> np.ndarray:
            return np.asarray(carrier.balanced_tilt(at, bend, pull.reshape(-1, 3), gravity)).reshape(*self.tau.shape, 2)

        # The stop begins with the plan's own tilt, which between the plan's nodes is not quite that of balance.
        planned = pose[..., 3:5].copy()
        usual = tilt(self.planned[2][:, index, :3], _pull(robot, index, self._before)[1])
        for attempt in range(TILTS if anchor.any() else 1):
            pose[..., :3] = self._ends[:, :, cable] - points.rotations(pose[..., 3:]) @ anchor
            if attempt == TILTS - 1:
                break
            bend = self._slopes(pose[..., :3], [part[:3] for part in starts])[1].reshape(-1, 3)
            share = self.rate[..., None]
            pose[..., 3:5] = share * planned + self._smooth(tilt(bend, pull) - share * usual, lands=bool(anchor.any()))
        pose[:, 0] = starts[0]
        motion = pose, *self._slopes(pose, starts)
        self.carriers.append(motion)
        R = points.rotations(pose[..., 3:])
        turning = R, self._slope(R), self._slope(self._slope(R))
        # A carrier that turns about another point than its anchor can do so too quickly for its cables to stay taut.
        most = max(robot.t_min[cable], LACKING * robot.t_max[cable]) if anchor.any() else None
        self.rows += _limits(carrier, motion, pull, anchor, gravity, turning, most)

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

    def worst(self, reserve: float) -> tuple[np.ndarray, list[tuple[float, str]]]:
        """Return `_worst` of its limits; what the plan has itself at the beginning is no excess."""
        return _worst(self.rows, self.times, reserve, begins_inside=False)

    def only(self) -> TeamStop:
        """Return the only stop."""
        excess, ((_, limit),) = self.worst(0.0)
        moved = [np.stack([motion[order][0] for motion in self.carriers], axis=1) for order in range(3)]
        platform = tuple(part[0] for part in self.platform)
        return TeamStop(self.times[0], self.tau[0], platform, tuple(moved), self.tensions[0], float(excess[0]), limit)  # type: ignore[arg-type]


def _forces(
    robot: Robot, trajectory: Trajectory, rate: np.ndarray, platform: Motion, planned: Motion, carriers: Motion
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the forces of the cables on the platform, (n, m, 3), the tensions, (n, m), and the plan's forces [N]."""
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows]
    A = dynamics.wrench_matrix(planned[0], carriers[0])
    before, now = (dynamics.required_wrench(*motion, wind=trajectory.wind) for motion in (planned, platform))
    along = A[:, rows] * scale[:, None]
    tensions = _least(along.swapaxes(1, 2) @ along, along.swapaxes(1, 2) @ (scale * before[:, rows])[..., None])[..., 0]
    missing = before[:, rows] - (A[:, rows] @ tensions[..., None])[..., 0]
    wanted = scale * ((now - before)[:, rows] + (1.0 - rate[:, None]) * missing)
    may_turn = _have_one_each(robot)
    G = scale[:, None] * _wrenches_of_forces(robot, planned[0])[:, rows] if may_turn else along
    turned = G.swapaxes(1, 2)
    change = (turned @ _least(G @ turned, wanted[..., None]))[..., 0]
    directions = A[:, :3].swapaxes(1, 2)
    of_plan = directions * tensions[..., None]
    if may_turn:
        forces = of_plan + change.reshape(of_plan.shape)
        return forces, np.linalg.norm(forces, axis=2), of_plan
    return directions * (tensions + change)[..., None], tensions + change, of_plan


def _wrenches_of_forces(robot: Robot, pose: np.ndarray) -> np.ndarray:
    """Return the wrenches of unit forces of each cable on the platform, at poses (n, 6), (n, 6, 3 m)."""
    arms = points.rotations(pose[:, 3:])[:, None] @ (robot.attachments - np.array(robot.platform.com))[..., None]
    turn = np.empty((*arms.shape[:2], 6, 3))
    turn[..., :3, :] = np.eye(3)
    turn[..., 3:, :] = np.cross(arms.swapaxes(-1, -2), np.eye(3)).swapaxes(-1, -2)
    return np.concatenate(list(np.moveaxis(turn, 1, 0)), axis=-1)


def _worst(
    rows: list[Row], times: np.ndarray, reserve: float = 0.0, begins_inside: bool = True
) -> tuple[np.ndarray, list[tuple[float, str]]]:
    """Return the largest excess of each stop, (d,), relative to a limit's range, and the limit's text.

    A `reserve` of the range counts as beyond. Unless a stop should begin inside, so much as it has first is no excess.
    """
    names, values = [row[0] for row in rows], np.stack([row[1] for row in rows])  # (k, d, n)
    low, high = np.array([row[2:] for row in rows]).T[..., None, None]  # (k, 1, 1) each
    room = reserve * (high - low)
    floor, ceiling = low + room, high - room
    if not begins_inside:
        floor, ceiling = np.minimum(floor, values[..., :1]), np.maximum(ceiling, values[..., :1])
    beyond = np.maximum(floor - values, values - ceiling) / (high - low)
    worst, text = np.zeros(len(times)), [(0.0, "")] * len(times)
    for d, excess in enumerate(beyond.max(axis=(0, 2)).tolist()):
        if excess > ACCEPTED:
            k, at = np.unravel_index(np.argmax(beyond[:, d]), beyond[:, d].shape)
            worst[d], value = excess, values[k, d, at]
            bound = float(low[k, 0, 0] if value < low[k, 0, 0] else high[k, 0, 0])
            text[d] = excess, f"{names[k]}: {quantity(value)} of {bound:g} at {quantity(times[d, at], 's')}"
    return worst, text


def _limits_of_tensions(robot: Robot, tensions: np.ndarray) -> list[Row]:
    """Return the limits of tensions (d, n, m) [N]."""
    limits = zip(robot.t_min, robot.t_max, strict=True)
    return [(f"tension {i + 1}", tensions[..., i], low, high) for i, (low, high) in enumerate(limits)]


def _limits(
    carrier: Carrier,
    motion: Motion,
    pull: np.ndarray,
    anchor: np.ndarray,
    gravity: np.ndarray,
    turning: tuple[np.ndarray, np.ndarray, np.ndarray],
    most_lacking: float | None = None,
) -> list[Row]:
    """Return what a motion of a carrier requires, pulled at its anchor by (d, n, 3) [N].

    A force of up to `most_lacking` [N] may be missing from its actuators (default: any), by which tensions differ.
    `turning` has its rotation and the first and second derivative of that, (d, n, 3, 3) each.
    """
    body, (_, velocity, acceleration), R = carrier.body, motion, turning[0]
    assert body is not None
    down = R.swapaxes(-1, -2)
    spin, spun = (points.axial(down @ part) for part in turning[1:])
    force = (down @ (body.mass * (acceleration[..., :3] - gravity) - pull)[..., None])[..., 0]
    J = inertia_matrix(body.inertia)
    moment = spun @ J + _cross(spin, spin @ J) - _cross(anchor, (down @ pull[..., None])[..., 0])
    wrench, of_commands = np.concatenate([force, moment], axis=-1), np.array([a.wrench for a in carrier.actuators])
    commands, name, own = wrench @ np.linalg.pinv(of_commands), carrier.name, carrier.motion_limits
    rows = [(f"{a.name} of {name}", commands[..., k], a.low, a.high) for k, a in enumerate(carrier.actuators)]
    lacking = np.linalg.norm((wrench - commands @ of_commands)[..., :3], axis=-1)
    for what, values, most in (
        ("force across the thrust", lacking, most_lacking),
        ("speed", np.linalg.norm(velocity[..., :3], axis=-1), own.speed),
        ("acceleration", np.linalg.norm(acceleration[..., :3], axis=-1), own.acceleration),
        ("tilt", np.arccos(np.clip(R[..., 2, 2], -1, 1)), own.tilt),
    ):
        rows += [] if most is None else [(f"{what} of {name}", values, 0.0, most)]
    return rows
