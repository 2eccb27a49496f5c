"""Forward geometrico-statics: the equilibrium poses for given cable lengths and carriers.

An inextensible cable holds the distance of its ends to at most its length and pulls only when it is straight. So the
platform rests where its potential energy has a minimum among the poses that the cables allow,

    min  - m g . c(q)    s.t.    l_i(q) <= L_i,

whose multipliers are the tensions [N]: zero for slack cables, and A t + m g = 0 is its condition of optimality. That
holds for any number of cables. There may be several minima; starts spread over the pose space look for them.

Source: the energy form of the direct geometrico-static problem of Berti, Merlet and Carricato (2016).
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from ..base.display import Displayed
from ..base.errors import InputError
from ..base.inputs import finite_array, required, whole_number
from ..models import points
from ..models.dynamics import Dynamics, dynamics_of
from ..models.robot import Robot
from ..models.rotation import rotation

UNSTABLE = 1e-3  # [Hz]; slower than this counts as neutral
DESCENTS = 4  # from a saddle, along its unstable motion
SAME = 1e-5  # poses nearer than this, in sizes of the robot and radians, are one solution


@dataclass(frozen=True)
class Equilibrium(Displayed):
    """A stable equilibrium pose, or as many as the leading dimension of the arrays says.

    Attributes:
        pose: (..., 6) in {G} [m, rad].
        tensions: (..., m) [N], zero for slack cables.
        lengths: Distances between anchors and attachments, (..., m) [m].
        energy: Potential energy relative to the origin of {G} [J].
        residual: |A t + m g| with moments over `Robot.length` [N].
        neutral: True if the equilibrium is neutral along some motion, that is, one of a family of poses.
    """

    pose: np.ndarray
    tensions: np.ndarray
    lengths: np.ndarray
    energy: Any
    residual: Any
    neutral: Any = False

    @property
    def taut(self) -> np.ndarray:
        """Return which cables pull, (..., m)."""
        return self.tensions >= 1e-6 * np.maximum(self.tensions.max(axis=-1, initial=0.0, keepdims=True), 1e-12)

    @property
    def slack(self) -> np.ndarray:
        """Return the indices of the slack cables of one equilibrium."""
        return np.flatnonzero(~self.taut)

    def only(self, which: Any) -> "Equilibrium":
        """Return some of several equilibria."""
        return Equilibrium(*(value[which] for value in vars(self).values()))

    def put(self, which: Any, other: "Equilibrium") -> None:
        """Replace one of several equilibria."""
        for name, value in vars(other).items():
            getattr(self, name)[which] = value


def equilibria(
    robot: Robot, lengths: np.ndarray, carrier_pose: np.ndarray | None = None, starts: int = 24, seed: int = 0
) -> list[Equilibrium]:
    """Return stable equilibrium poses for cables of `lengths` (m,) [m], lowest potential energy first.

    Args:
        lengths: Length > 0 of each cable [m].
        carrier_pose: (c, 6) in {G}; default: at home.
        starts: Number of initial poses to try: home, and random ones below and around it.

    Returns:
        list: Solutions with a residual below 1e-6 of the weight; empty if no pose has these lengths.

    Raises `InputError` if `lengths` or `carrier_pose` has a wrong shape or value, or the robot has no gravity.
    """
    robot = required("robot", robot, Robot)
    starts = whole_number("starts", starts, 1, 1_000_000)
    longest, home = finite_array("lengths", lengths, (robot.m,)), robot.carrier_home
    if not (longest > 0).all():
        raise InputError(f"lengths must be numbers > 0 [m], got {longest.min():g}")
    if robot.weight == 0:
        raise InputError(f"gravity must not be zero, got none for robot {robot.name!r}")
    carriers = finite_array("carrier_pose", home if carrier_pose is None else carrier_pose, home.shape)
    poses: list[Equilibrium] = []
    for start in _starts(robot, starts, seed):
        candidate = descend(robot, start, carriers, longest)
        if candidate is not None and not any(_same(robot, candidate, known) for known in poses):
            poses.append(candidate)
    return sorted(poses, key=lambda equilibrium: equilibrium.energy)


def descend(robot: Robot, start: np.ndarray, carriers: np.ndarray, longest: np.ndarray) -> Equilibrium | None:
    """Search for the equilibrium pose from `start`, or return None; it leaves saddles along their unstable motion."""
    dynamics, solver, rows = dynamics_of(robot), _energy_program(robot), np.flatnonzero(robot.dof_mask)
    size, units = robot.size, _units(robot)
    for _ in range(DESCENTS):
        result = solver(x0=(start / units)[rows], p=carriers.T.ravel(), lbg=-np.inf, ubg=(longest / size) ** 2)
        if not solver.stats()["success"]:
            return None
        pose = robot.home.copy()
        pose[rows] = result["x"].full().ravel() * units[rows]
        pose[3:] = np.arctan2(np.sin(pose[3:]), np.cos(pose[3:]))
        # The constraint is on l^2, whose gradient is 2 l times that of l.
        tensions = np.maximum(result["lam_g"].full().ravel() * robot.weight * 2 * longest / size, 0.0)
        candidate = judge(robot, dynamics, pose, carriers, tensions)
        if candidate.residual > 1e-6 * robot.weight or (candidate.lengths - longest).max() > 1e-6 * size:
            return None
        frequencies, modes = dynamics.natural_frequencies(pose, tensions, carriers)
        if not len(frequencies) or frequencies[0] > -UNSTABLE:
            return replace(candidate, neutral=bool(np.abs(frequencies).min(initial=np.inf) < UNSTABLE))
        mode = modes[:, 0]
        motion = max(np.linalg.norm(mode[:3]) / robot.length, np.linalg.norm(mode[3:]))  # in robot lengths, radians
        start = displaced(pose, 0.1 * mode / motion, np.array(robot.platform.com))
    return None


@lru_cache(maxsize=16)
def _energy_program(robot: Robot) -> ca.Function:
    """Return the program of a robot, in its size and its weight; the carriers' poses are its parameter [m, rad]."""
    dynamics = dynamics_of(robot)
    carriers = ca.SX.sym("carriers", *robot.carrier_home.shape)
    rows = [int(i) for i in np.flatnonzero(robot.dof_mask)]
    free = ca.SX.sym("q", len(rows))
    pose = ca.SX(robot.home)
    pose[rows] = free * _units(robot)[rows]
    com = pose[0:3] + rotation(pose[3:6]) @ ca.DM(robot.platform.com)
    energy = -robot.platform.mass * ca.dot(ca.DM(robot.gravity), com) / (robot.weight * robot.size)
    squares = (dynamics.cable_lengths(pose, carriers) / robot.size) ** 2
    options = {
        "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-11, "constr_viol_tol": 1e-12, "max_iter": 300},
        "print_time": False,
        "error_on_fail": False,
    }
    return ca.nlpsol("rest", "ipopt", {"x": free, "p": ca.vec(carriers), "f": energy, "g": squares}, options)


def _units(robot: Robot) -> np.ndarray:
    """Return the units of the energy program's coordinates, (6,) [m, rad]."""
    return np.repeat([robot.size, 1.0], 3)


def _starts(robot: Robot, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    poses = np.tile(robot.home, (count, 1))
    poses[1:, :3] += rng.uniform(-0.5, 0.5, size=(len(poses) - 1, 3)) * robot.size
    poses[1:, 3:] += rng.uniform(-np.pi, np.pi, size=(len(poses) - 1, 3)) * [1, 0.45, 1]
    return poses


def judge(
    robot: Robot, dynamics: Dynamics, pose: np.ndarray, carriers: np.ndarray, tensions: np.ndarray
) -> Equilibrium:
    """Return poses (..., 6) under tensions (..., m), with what is missing for their balance."""
    w = dynamics.required_wrench(pose, np.zeros(6), np.zeros(6))
    pull = (dynamics.wrench_matrix(pose, carriers) @ tensions[..., None])[..., 0]
    missing = np.linalg.norm((pull - w) * robot.dof_mask * robot.wrench_scale, axis=-1)
    com = pose[..., :3] + points.rotations(pose[..., 3:]) @ np.array(robot.platform.com)
    energy = -robot.platform.mass * (com @ np.array(robot.gravity))
    return Equilibrium(pose, tensions, dynamics.cable_lengths(pose, carriers), energy, missing)


def displaced(pose: np.ndarray, twist: np.ndarray, com: np.ndarray) -> np.ndarray:
    """Return poses after small displacements of the CoM and rotation vectors, (..., 6) each, in {G}."""
    R = points.rotations(pose[..., 3:])
    turned = Rotation.from_rotvec(twist[..., 3:]).as_matrix() @ R
    return np.concatenate([pose[..., :3] + twist[..., :3] + (R - turned) @ com, points.angles(turned)], axis=-1)


def _same(robot: Robot, one: Equilibrium, other: Equilibrium) -> bool:
    if one.neutral and other.neutral and abs(one.energy - other.energy) < 1e-6 * robot.weight * robot.length:
        return bool(np.abs(one.tensions - other.tensions).max() < 1e-4 * robot.weight)  # turned along a free motion
    turns = rotation(ca.DM(one.pose)[3:6]).full() - rotation(ca.DM(other.pose)[3:6]).full()
    apart = np.linalg.norm(one.pose[:3] - other.pose[:3]) / robot.size
    return bool(apart < SAME and np.abs(turns).max() < SAME)
