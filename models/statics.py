"""Forward geometrico-statics: where the platform comes to rest for given cable lengths and carriers.

An inextensible cable holds the distance of its ends to at most its length and pulls only when it is straight. So the
platform rests where its potential energy has a minimum among the poses that the cables allow,

    min  - m g . c(q)    s.t.    l_i(q) <= L_i,

whose multipliers are the tensions [N]: zero for slack cables, and A t + m g = 0 is its condition of optimality. That
holds for any number of cables. There may be several minima; starts spread over the pose space look for them.

Source: the energy form of the direct geometrico-static problem of Berti, Merlet and Carricato (2016).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..inputs import required, whole_number
from .dynamics import Dynamics
from .robot import Robot
from .rotation import rotation

UNSTABLE = 1e-3  # [Hz]; slower than this counts as neutral
DESCENTS = 4  # from a saddle, along its unstable motion
SAME = 1e-5  # poses nearer than this, in metres and radians times `Robot.length`, are one solution


@dataclass(frozen=True)
class Equilibrium:
    """A pose at which the platform rests stably.

    Attributes
    ----------
    pose
        (6,) in {G} [m, rad].
    tensions
        (m,) [N], zero for slack cables.
    lengths
        Distances of anchors and attachments, (m,) [m].
    energy
        Potential energy relative to the origin of {G} [J].
    residual
        |A t + m g| with moments over `Robot.length` [N].
    neutral
        Whether some motion neither returns nor runs away: then it is one of a family of poses.
    """

    pose: np.ndarray
    tensions: np.ndarray
    lengths: np.ndarray
    energy: float
    residual: float
    neutral: bool = False

    @property
    def slack(self) -> np.ndarray:
        """Return the indices of cables that do not pull."""
        return np.flatnonzero(self.tensions < 1e-6 * max(self.tensions.max(initial=0.0), 1e-12))


def equilibria(
    robot: Robot,
    lengths: np.ndarray,
    carrier_pose: np.ndarray | None = None,
    starts: int = 24,
    seed: int = 0,
) -> list[Equilibrium]:
    """Return stable equilibrium poses for cables of `lengths` (m,) [m], lowest potential energy first.

    Parameters
    ----------
    lengths
        One length > 0 for each cable [m].
    carrier_pose
        (c, 6) in {G}; default: at home.
    starts
        Number of starting poses to try: home, and random ones below and about it.

    Returns
    -------
    list
        Solutions whose residual is below 1e-6 of the weight; empty if the lengths cannot hold the platform together.

    Raises
    ------
    InputError
        If `lengths` or `carrier_pose` has a wrong shape or value, or the robot has no gravity.
    """
    robot = required("robot", robot, Robot)
    starts = whole_number("starts", starts, 1, 1_000_000)
    try:
        longest = np.asarray(lengths, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"lengths must be {robot.m} finite numbers > 0 [m], got {lengths!r}") from None
    if longest.shape != (robot.m,) or not (np.isfinite(longest) & (longest > 0)).all():
        raise InputError(f"lengths must be {robot.m} finite numbers > 0 [m], got {lengths!r}")
    if robot.weight == 0:
        raise InputError(f"gravity must not be zero, got none for robot {robot.name!r}")
    dynamics = Dynamics(robot)
    carriers = robot.carrier_home if carrier_pose is None else carrier_pose
    if dynamics.cable_lengths(robot.home, carriers).ndim != 1:  # checks shape and values too
        raise InputError(f"carrier_pose must have the shape {robot.carrier_home.shape}, got {np.shape(carriers)}")
    carriers = np.asarray(carriers, dtype=float)
    solver = _energy_program(robot, dynamics, carriers)
    poses: list[Equilibrium] = []
    for start in _starts(robot, starts, seed):
        candidate = _descend(robot, dynamics, solver, start, carriers, longest)
        if candidate is not None and not any(_same(robot, candidate, known) for known in poses):
            poses.append(candidate)
    return sorted(poses, key=lambda equilibrium: equilibrium.energy)


def _descend(
    robot: Robot, dynamics: Dynamics, solver: ca.Function, start: np.ndarray, carriers: np.ndarray, longest: np.ndarray
) -> Equilibrium | None:
    """Search for the rest pose from `start`, or return None; a saddle is left along its unstable motion."""
    rows = np.flatnonzero(robot.dof_mask)
    for _ in range(DESCENTS):
        result = solver(x0=start[rows], lbg=-np.inf, ubg=longest**2)
        if not solver.stats()["success"]:
            return None
        pose = robot.home.copy()
        pose[rows] = result["x"].full().ravel()
        pose[3:] = np.arctan2(np.sin(pose[3:]), np.cos(pose[3:]))
        # The constraint is on l^2, whose gradient is 2 l times that of l.
        tensions = np.maximum(result["lam_g"].full().ravel() * 2 * longest, 0.0)
        candidate = _judge(robot, dynamics, pose, carriers, tensions)
        if candidate.residual > 1e-6 * robot.weight:
            return None
        frequencies, modes = dynamics.natural_frequencies(pose, tensions, carriers)
        if not len(frequencies) or frequencies[0] > -UNSTABLE:
            return replace(candidate, neutral=bool(len(frequencies)) and bool(np.abs(frequencies).min() < UNSTABLE))
        turned = Rotation.from_rotvec(0.1 * _unit(modes[:, 0], robot.length)[3:]) * _orientation(pose)
        start = np.concatenate([pose[:3] + 0.1 * _unit(modes[:, 0], robot.length)[:3], turned.as_euler("ZYX")[::-1]])
    return None


def _unit(mode: np.ndarray, length: float) -> np.ndarray:
    """Return a mode scaled so that it moves the platform by about its own size, at most by a radian."""
    return mode / max(np.linalg.norm(mode[:3]) / length, np.linalg.norm(mode[3:]))


def _orientation(pose: np.ndarray) -> Rotation:
    return Rotation.from_euler("ZYX", pose[5:2:-1])


def _energy_program(robot: Robot, dynamics: Dynamics, carriers: np.ndarray) -> ca.Function:
    rows = [int(i) for i in np.flatnonzero(robot.dof_mask)]
    free = ca.SX.sym("q", len(rows))
    pose = ca.SX(robot.home)
    pose[rows] = free
    com = pose[0:3] + rotation(pose[3:6]) @ ca.DM(robot.platform.com)
    energy = -robot.platform.mass * ca.dot(ca.DM(robot.gravity), com)
    squares = dynamics.cable_lengths(pose, carriers) ** 2
    options = {
        "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-11, "constr_viol_tol": 1e-12, "max_iter": 300},
        "print_time": False,
        "error_on_fail": False,
    }
    return ca.nlpsol("rest", "ipopt", {"x": free, "f": energy, "g": squares}, options)


def _starts(robot: Robot, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    poses = np.tile(robot.home, (max(count, 1), 1))
    reach = np.ptp(np.vstack([robot.home_anchors, robot.home[:3]]), axis=0).max() + robot.length
    poses[1:, :3] += rng.uniform(-0.5, 0.5, size=(len(poses) - 1, 3)) * reach
    poses[1:, 3:] += rng.uniform(-np.pi, np.pi, size=(len(poses) - 1, 3)) * [1, 0.45, 1]
    return poses


def _judge(
    robot: Robot, dynamics: Dynamics, pose: np.ndarray, carriers: np.ndarray, tensions: np.ndarray
) -> Equilibrium:
    w = dynamics.required_wrench(pose, np.zeros(6), np.zeros(6))
    missing = (dynamics.wrench_matrix(pose, carriers) @ tensions - w) * robot.dof_mask * robot.wrench_scale
    com = pose[:3] + rotation(ca.DM(pose)[3:6]).full() @ np.array(robot.platform.com)
    energy = -robot.platform.mass * float(np.dot(robot.gravity, com))
    return Equilibrium(pose, tensions, dynamics.cable_lengths(pose, carriers), energy, float(np.linalg.norm(missing)))


def _same(robot: Robot, one: Equilibrium, other: Equilibrium) -> bool:
    if one.neutral and other.neutral and abs(one.energy - other.energy) < 1e-6 * robot.weight * robot.length:
        return bool(np.abs(one.tensions - other.tensions).max() < 1e-4 * robot.weight)  # turned along a free motion
    turns = rotation(ca.DM(one.pose)[3:6]).full() - rotation(ca.DM(other.pose)[3:6]).full()
    apart = np.linalg.norm(one.pose[:3] - other.pose[:3])
    return bool(apart < SAME and np.abs(turns).max() * robot.length < SAME)
