"""Stop a team of flying carriers on the path of its platform: `team_stop_along`.

The platform stays on its path, at a rate r(t) that falls from 1 to 0 with three continuous derivatives. The forces of
the cables on it change with the wrench by the least amount,

    f = f_plan + G^+ (w - w_plan),   G f = sum of (f_i, arm_i x f_i)

so each carrier is where its cable has the direction of its force. Its acceleration, tilt and efforts follow. They, and
the tensions, bound how soon the platform can rest; the duration is found by bisection.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..base.errors import InputError
from ..base.text import quantity
from ..models import points
from ..models.carriers import Carrier
from ..models.dynamics import dynamics_of
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory

SHORTEST, LONGEST, ATTEMPTS = 0.1, 30.0, 10  # [s] of a stop, and how many durations are tried at once
COARSE, APART = 24, 0.01  # instants of an attempt; [s] between those of the result
SMOOTHED = 0.03  # [s], over which tilt is smoothed: a plan's jerk jumps between its nodes
RESERVE, ACCEPTED = 0.02, 2e-3  # of a limit's range: that attempts keep, and up to which differences are inexact
LONGER, AGAIN = 1.1, 4  # what broke a limit in between takes longer
TINY = 1e-12  # of a matrix
RESTS = 1e-4  # [m/s, rad/s], at the end of a plan
RATE = np.polynomial.Polynomial([1, 0, 0, 0, -35, 84, -70, 20])  # of s = t / duration
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

    Raises `InputError` if the robot is no team of flying carriers with a cable of fixed length each.
    """
    flying = [carrier.body is not None and bool(carrier.actuators) for carrier in robot.carriers]
    alone = sorted(robot.carrier_of_cable) == list(range(len(robot.carriers)))
    if not all(flying) or not alone or robot.fixed_lengths is None:
        raise InputError(
            "a stop must be of a team whose carriers fly with one cable of fixed length each, or of a robot with "
            f"carriers of kind ground, prescribed or mobile, got {robot.name!r}"
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


def _remainder(robot: Robot, trajectory: Trajectory, begins: float) -> TeamStop:
    """Return the rest of a plan that ends at rest; of its limits, those of tensions are checked."""
    left = max((trajectory.duration or 0.0) - begins, SHORTEST)
    times = np.linspace(0.0, left, max(int(left / APART), 10))
    platform, carriers = trajectory.at(begins + times)
    dynamics = dynamics_of(robot)
    A, w = dynamics.wrench_matrix(platform[0], carriers[0]), dynamics.required_wrench(*platform, wind=trajectory.wind)
    tensions = (np.linalg.pinv(A) @ w[..., None])[..., 0]
    beyond = np.maximum(robot.t_min - tensions, tensions - robot.t_max) / (robot.t_max - robot.t_min)
    k, i = np.unravel_index(np.argmax(beyond), beyond.shape)
    if not beyond[k, i] > ACCEPTED:
        return TeamStop(times, begins + times, platform, carriers, tensions, 0.0, "")
    bound = robot.t_min[i] if tensions[k, i] < robot.t_min[i] else robot.t_max[i]
    limit = f"tension {i + 1}: {quantity(tensions[k, i])} of {bound:g} at {quantity(times[k], 's')}"
    return TeamStop(times, begins + times, platform, carriers, tensions, float(beyond[k, i]), limit)


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
        self.rate, slope = np.tile(RATE(s), (len(T), 1)), RATE.deriv()(s) / T
        self.tau = begins + T * RATE.integ()(s)
        shape = self.tau.shape
        flat = trajectory.at(self.tau.ravel())
        r, u = self.rate.reshape(-1, 1), slope.reshape(-1, 1)
        (pose, velocity, acceleration), self.planned = flat
        platform = pose, r * velocity, r**2 * acceleration + u * velocity
        forces, tensions = _forces(robot, trajectory, r[:, 0], platform, flat[0], self.planned)
        self.platform = [part.reshape(*shape, 6) for part in platform]
        self.tensions, self._forces = tensions.reshape(*shape, -1), forces.reshape(*shape, robot.m, 3)
        held = points.attachments(robot, pose)
        lengths = np.linalg.norm(points.anchors(robot, self.planned[0]) - held, axis=-1)
        ends = held + (lengths / tensions)[..., None] * forces
        self._ends = ends.reshape(self._forces.shape)  # of cables on carriers
        self.carriers, self.rows = [], list[Row]()
        for index in range(len(robot.carriers)):
            self._add(index)
        highs = zip(robot.t_min, robot.t_max, strict=True)
        self.rows += [(f"tension {i + 1}", self.tensions[..., i], *its) for i, its in enumerate(highs)]

    def _add(self, index: int) -> None:
        """Add the motion of a carrier and its limits."""
        robot, carrier = self.robot, self.robot.carriers[index]
        cable, gravity = int(np.flatnonzero(robot.carrier_of_cable == index)[0]), np.array(robot.gravity)
        anchor, forces = robot.anchors[cable], self._forces[:, :, cable]
        pose = self.planned[0][:, index].reshape(*self.tau.shape, 6).copy()
        starts = [part[0, index] for part in self.planned]
        yaw = pose[..., 5].ravel()
        for _ in range(1 + anchor.any()):
            pose[..., :3] = self._ends[:, :, cable] - points.rotations(pose[..., 3:]) @ anchor
            bend = self._slopes(pose[..., :3], [part[:3] for part in starts])[1].reshape(-1, 3)
            at = np.column_stack([np.zeros((len(yaw), 5)), yaw])
            tilt = np.asarray(carrier.balanced_tilt(at, bend, -forces.reshape(-1, 3), gravity))
            pose[..., 3:5] = self._smooth(tilt.reshape(*self.tau.shape, 2))
        pose[:, 0] = starts[0]
        motion = pose, *self._slopes(pose, starts)
        self.carriers.append(motion)
        self.rows += _limits(carrier, motion, -forces, anchor, gravity, self._slope)

    def _slopes(self, values: np.ndarray, starts: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return two derivatives by differences, which begin as the plan's do and end at rest."""
        result = [values]
        for start in starts[1:]:
            result.append(self._slope(result[-1]))
            result[-1][:, 0], result[-1][:, -1] = start, 0.0
        return result[1], result[2]

    def _slope(self, values: np.ndarray) -> np.ndarray:
        return np.gradient(values, axis=1) / self.h.reshape(-1, *[1] * (values.ndim - 1))

    def _smooth(self, values: np.ndarray) -> np.ndarray:
        for _ in range(2 * round(float((SMOOTHED / self.h[-1]) ** 2)) if len(self.h) == 1 else 0):
            values[:, 1:-1] += (values[:, :-2] - 2 * values[:, 1:-1] + values[:, 2:]) / 4
        return values

    def worst(self, reserve: float) -> tuple[np.ndarray, list[tuple[float, str]]]:
        """Return the largest excess of each stop, (d,), relative to a limit's range, and the limit's text.

        What the plan has itself at the beginning is none. Attempts keep a `reserve` of the range.
        """
        worst, text = np.zeros(len(self.h)), [(0.0, "")] * len(self.h)
        for name, values, low, high in self.rows:
            room, first = reserve * (high - low), values[:, :1]
            floor, ceiling = np.minimum(low + room, first), np.maximum(high - room, first)
            beyond = np.maximum(floor - values, values - ceiling) / (high - low)
            k = np.argmax(beyond, axis=1)
            for d in np.flatnonzero(beyond[np.arange(len(k)), k] > np.maximum(worst, ACCEPTED)):
                worst[d], value = beyond[d, k[d]], values[d, k[d]]
                bound = low if value < low else high
                text[d] = worst[d], f"{name}: {quantity(value)} of {bound:g} at {quantity(self.times[d, k[d]], 's')}"
        return worst, text

    def only(self) -> TeamStop:
        """Return the only stop."""
        excess, ((_, limit),) = self.worst(0.0)
        moved = [np.stack([motion[order][0] for motion in self.carriers], axis=1) for order in range(3)]
        platform = tuple(part[0] for part in self.platform)
        return TeamStop(self.times[0], self.tau[0], platform, tuple(moved), self.tensions[0], float(excess[0]), limit)  # type: ignore[arg-type]


def _forces(
    robot: Robot, trajectory: Trajectory, rate: np.ndarray, platform: Motion, planned: Motion, carriers: Motion
) -> tuple[np.ndarray, np.ndarray]:
    """Return the forces of the cables on the platform, (n, m, 3), and the tensions, (n, m) [N]."""
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    scale = robot.wrench_scale[rows]
    A = dynamics.wrench_matrix(planned[0], carriers[0])
    before, now = (dynamics.required_wrench(*motion, wind=trajectory.wind) for motion in (planned, platform))
    along = A[:, rows] * scale[:, None]
    tensions = _least(along.swapaxes(1, 2) @ along, along.swapaxes(1, 2) @ (scale * before[:, rows])[..., None])[..., 0]
    missing = before[:, rows] - (A[:, rows] @ tensions[..., None])[..., 0]
    wanted = scale * ((now - before)[:, rows] + (1.0 - rate[:, None]) * missing)
    arms = points.rotations(planned[0][:, 3:])[:, None] @ (robot.attachments - np.array(robot.platform.com))[..., None]
    turn = np.zeros((*arms.shape[:2], 6, 3))
    turn[..., :3, :] = np.eye(3)
    x, y, z = np.moveaxis(arms[..., 0], -1, 0)
    turn[..., 3, 1], turn[..., 3, 2], turn[..., 4, 0] = -z, y, z
    turn[..., 4, 2], turn[..., 5, 0], turn[..., 5, 1] = -x, -y, x
    G = scale[:, None] * np.concatenate(list(np.moveaxis(turn, 1, 0)), axis=-1)[:, rows]  # (n, k, 3 m)
    forces = A[:, :3].swapaxes(1, 2) * tensions[..., None]
    turned = G.swapaxes(1, 2)
    forces = forces + (turned @ _least(G @ turned, wanted[..., None])).reshape(forces.shape)
    return forces, np.linalg.norm(forces, axis=2)


def _limits(
    carrier: Carrier,
    motion: Motion,
    pull: np.ndarray,
    anchor: np.ndarray,
    gravity: np.ndarray,
    slope: Callable[[np.ndarray], np.ndarray],
) -> list[Row]:
    """Return what a motion of a carrier requires, pulled at its anchor by (d, n, 3) [N]."""
    body, (pose, velocity, acceleration) = carrier.body, motion
    assert body is not None
    R = points.rotations(pose[..., 3:])
    down = R.swapaxes(-1, -2)
    turning = down @ slope(R)
    spin = np.stack([turning[..., 2, 1], turning[..., 0, 2], turning[..., 1, 0]], axis=-1)
    xx, yy, zz, xy, xz, yz = body.inertia
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    force = (down @ (body.mass * (acceleration[..., :3] - gravity) - pull)[..., None])[..., 0]
    moment = slope(spin) @ J + np.cross(spin, spin @ J) - np.cross(anchor, (down @ pull[..., None])[..., 0])
    by_command = np.linalg.pinv(np.array([actuator.wrench for actuator in carrier.actuators]).T)
    commands, name, own = np.concatenate([force, moment], axis=-1) @ by_command.T, carrier.name, carrier.motion_limits
    rows = [(f"{a.name} of {name}", commands[..., k], a.low, a.high) for k, a in enumerate(carrier.actuators)]
    for what, values, most in (
        ("speed", np.linalg.norm(velocity[..., :3], axis=-1), own.speed),
        ("acceleration", np.linalg.norm(acceleration[..., :3], axis=-1), own.acceleration),
        ("tilt", np.arccos(np.clip(R[..., 2, 2], -1, 1)), own.tilt),
    ):
        rows += [] if most is None else [(f"{what} of {name}", values, 0.0, most)]
    return rows
