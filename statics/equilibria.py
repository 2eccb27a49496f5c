"""Forward geometrico-statics: the equilibrium poses for given cable lengths and carriers.

An inextensible cable holds the distance of its ends to at most its length and pulls only when it is straight. So the
platform rests where its potential energy has a minimum among the poses that the cables allow,

    min  - m g . c(q)    s.t.    l_i(q) <= L_i,

whose multipliers are the tensions [N]: zero for slack cables, and A t + m g = 0 is its condition of optimality. That
holds for any number of cables. There may be several minima; starts spread over the pose space look for them.

Near a rest with all cables taut, Newton's method on the same conditions takes a few steps of

    [ K  -A ; -A^T  0 ] (delta ; t) = (m g ; L - l(q))

with the stiffness K at constant tensions. The same matrix gives the derivative of the pose by the lengths.

Source: the energy form of the direct geometrico-static problem of Berti, Merlet and Carricato (2016).
"""

from dataclasses import dataclass, replace
from functools import lru_cache

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

NEWTON = 40  # most steps
UNSTABLE = 1e-3  # [Hz]; slower than this counts as neutral
DESCENTS = 4  # from a saddle, along its unstable motion
SAME = 1e-5  # poses nearer than this, in sizes of the robot and radians, are one solution


@dataclass(frozen=True)
class Equilibrium(Displayed):
    """A stable equilibrium pose.

    Attributes:
        pose: (6,) in {G} [m, rad].
        tensions: (m,) [N], zero for slack cables.
        lengths: Distances between anchors and attachments, (m,) [m].
        energy: Potential energy relative to the origin of {G} [J].
        residual: |A t + m g| with moments over `Robot.length` [N].
        neutral: True if the equilibrium is neutral along some motion, that is, one of a family of poses.
    """

    pose: np.ndarray
    tensions: np.ndarray
    lengths: np.ndarray
    energy: float
    residual: float
    neutral: bool = False

    @property
    def slack(self) -> np.ndarray:
        """Return the indices of slack cables."""
        return np.flatnonzero(self.tensions < 1e-6 * max(self.tensions.max(initial=0.0), 1e-12))


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
        candidate = _descend(robot, start, carriers, longest)
        if candidate is not None and not any(_same(robot, candidate, known) for known in poses):
            poses.append(candidate)
    return sorted(poses, key=lambda equilibrium: equilibrium.energy)


def rest_near(robot: Robot, lengths: np.ndarray, start: np.ndarray, carriers: np.ndarray) -> Equilibrium | None:
    """Return a stable equilibrium near a pose or None, by Newton's method if all cables are taut, else by descent.

    The cables have `lengths` (m,) [m]; the pose is `start` (6,) and those of the carriers (c, 6), in {G}.
    """
    return _newton(robot, lengths, start, carriers) or _descend(robot, start, carriers, lengths)


def _newton(robot: Robot, lengths: np.ndarray, start: np.ndarray, carriers: np.ndarray) -> Equilibrium | None:
    """Return the equilibrium with all cables taut that Newton's method reaches, or None."""
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    n, m = len(rows), robot.m
    weight = robot.platform.mass * np.array([*robot.gravity, 0.0, 0.0, 0.0]) * robot.wrench_scale
    tensions = np.full(m, robot.weight / m)
    pose, com = start.copy(), np.array(robot.platform.com)
    for _ in range(NEWTON):
        system = _newton_system(robot, dynamics, pose, tensions, carriers)
        missing = np.concatenate([weight[rows], lengths - dynamics.cable_lengths(pose, carriers)])
        step = np.linalg.lstsq(system, missing, rcond=1e-12)[0]  # a neutral motion leaves the system singular
        twist = np.zeros(6)
        twist[rows] = step[:n] * robot.wrench_scale[rows]
        size = float(np.linalg.norm(step[:n]))
        if not np.isfinite(size):
            return None
        pose = _displaced(pose, twist * min(1.0, 0.3 * robot.length / max(size, 1e-300)), com)
        tensions = np.maximum(step[n:], 0.0) if size > 1e-3 * robot.length else step[n:]
        if size <= 1e-12 * robot.length:
            break
    reached = _judge(robot, dynamics, pose, carriers, tensions)
    close = np.abs(reached.lengths - lengths).max() <= 1e-9 * max(robot.length, lengths.max())
    if not close or reached.residual > 1e-9 * robot.weight or tensions.min() < -1e-9 * robot.weight:
        return None
    frequencies, _ = dynamics.natural_frequencies(pose, np.maximum(tensions, 0.0), carriers)
    if len(frequencies) and frequencies[0] < -UNSTABLE:
        return None
    return replace(reached, neutral=bool(np.abs(frequencies).min(initial=np.inf) < UNSTABLE))


def sensitivity(robot: Robot, rest: Equilibrium, carriers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives of CoM and rotation vector in {G} by lengths and by a wrench at an equilibrium.

    Carriers, (c, 6), are fixed, and slack cables have no effect. The derivatives are (6, m) [-, rad/m] and (6, 6)
    [m/N, rad/N, m/(N m), rad/(N m)], of a wrench about the CoM. Also return neutral, that is, undetermined motions of
    CoM and rotation vector, (6, k).
    """
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    taut = np.setdiff1d(np.arange(robot.m), rest.slack)
    system = _newton_system(robot, dynamics, rest.pose, rest.tensions, carriers)
    n, kept = len(rows), np.concatenate([np.arange(len(rows)), len(rows) + taut])
    system = system[np.ix_(kept, kept)]
    unit = max(robot.weight, 1e-300) / robot.length
    system[:n, :n] /= unit  # stiffness beside cosines
    U, values, V = np.linalg.svd(system)
    regular = values > 1e-9 * values[0]
    moves, compliance, neutral = np.zeros((6, robot.m)), np.zeros((6, 6)), np.zeros((6, int((~regular).sum())))
    neutral[rows] = V[~regular, :n].T * robot.wrench_scale[rows, None]
    if rest.neutral and np.abs(neutral).max(initial=0.0) <= 1e-6:
        neutral = np.diag(robot.dof_mask)
    inverse = V[regular].T @ (U[:, regular] / values[regular]).T
    moves[np.ix_(rows, taut)] = inverse[:n, n:] * robot.wrench_scale[rows, None]
    compliance[np.ix_(rows, rows)] = inverse[:n, :n] * np.outer(*[robot.wrench_scale[rows]] * 2) / unit
    return moves, compliance, neutral


def _newton_system(
    robot: Robot, dynamics: Dynamics, pose: np.ndarray, tensions: np.ndarray, carriers: np.ndarray
) -> np.ndarray:
    """Return the matrix of Newton's step, rotations times `Robot.length`, in the coordinates that move."""
    rows, scale = np.flatnonzero(robot.dof_mask), robot.wrench_scale
    A = (dynamics.wrench_matrix(pose, carriers) * scale[:, None])[rows]
    K = dynamics.stiffness(pose, tensions, carriers, elastic=False) * np.outer(scale, scale)
    return np.block([[(K + K.T)[np.ix_(rows, rows)] / 2, -A], [-A.T, np.zeros((robot.m, robot.m))]])


def _displaced(pose: np.ndarray, twist: np.ndarray, com: np.ndarray) -> np.ndarray:
    """Return the pose after a small displacement of the CoM and a rotation vector, (6,), in {G}."""
    R = points.rotations(pose[3:])
    turned = Rotation.from_rotvec(twist[3:]).as_matrix() @ R
    return np.concatenate([pose[:3] + R @ com + twist[:3] - turned @ com, points.angles(turned)])


def _descend(robot: Robot, start: np.ndarray, carriers: np.ndarray, longest: np.ndarray) -> Equilibrium | None:
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
        candidate = _judge(robot, dynamics, pose, carriers, tensions)
        if candidate.residual > 1e-6 * robot.weight or (candidate.lengths - longest).max() > 1e-6 * size:
            return None
        frequencies, modes = dynamics.natural_frequencies(pose, tensions, carriers)
        if not len(frequencies) or frequencies[0] > -UNSTABLE:
            return replace(candidate, neutral=bool(np.abs(frequencies).min(initial=np.inf) < UNSTABLE))
        mode = modes[:, 0]
        motion = max(np.linalg.norm(mode[:3]) / robot.length, np.linalg.norm(mode[3:]))  # in robot lengths, radians
        start = _displaced(pose, 0.1 * mode / motion, np.array(robot.platform.com))
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
    apart = np.linalg.norm(one.pose[:3] - other.pose[:3]) / robot.size
    return bool(apart < SAME and np.abs(turns).max() < SAME)
