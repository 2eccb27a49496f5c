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

from ..base.display import Displayed
from ..base.inputs import InputError, finite_array, required, whole_number
from ..models import points
from ..models.dynamics import Dynamics, dynamics_of
from ..models.elasticity import frequency, whitened, whitening
from ..models.robot import Robot
from ..models.rotation import rotation

UNSTABLE = 1e-3  # [Hz]; slower than this counts as neutral
DESCENTS = 4  # from a saddle, along its unstable motion
SAME = 1e-5  # poses nearer than this, in sizes of the robot and radians, are one solution
NEWTON = 60  # most steps
SETTLED = 1e-6  # robot lengths: after shorter steps, errors of tensions and lengths are far below `ROUNDING`
ROUNDING = 1e-9  # of the weight and the length
SLACK = 1e-3  # of the weight: a cable that would pull less at the start is slack there


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
        pose = points.shortest_way(pose)
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
        start = points.moved(pose, 0.1 * mode / motion, robot.platform.com)
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


def _same(robot: Robot, one: Equilibrium, other: Equilibrium) -> bool:
    if one.neutral and other.neutral and abs(one.energy - other.energy) < 1e-6 * robot.weight * robot.length:
        return bool(np.abs(one.tensions - other.tensions).max() < 1e-4 * robot.weight)  # turned along a free motion
    turns = rotation(ca.DM(one.pose)[3:6]).full() - rotation(ca.DM(other.pose)[3:6]).full()
    apart = np.linalg.norm(one.pose[:3] - other.pose[:3]) / robot.size
    return bool(apart < SAME and np.abs(turns).max() < SAME)


def rest_near(robot: Robot, lengths: np.ndarray, start: np.ndarray, carriers: np.ndarray) -> Equilibrium | None:
    """Return a stable equilibrium near a pose, or None; arguments as for `rests_near`, for one pose."""
    rests, found = rests_near(robot, lengths[None], start[None], carriers[None])
    return rests.only(0) if found[0] else None


def rests_near(
    robot: Robot, lengths: np.ndarray, starts: np.ndarray, carriers: np.ndarray
) -> tuple[Equilibrium, np.ndarray]:
    """Return stable equilibria near poses, and which of them were found, (N,); others have no meaning.

    The cables have `lengths` (N, m) [m]; the poses are `starts` (N, 6) and those of the carriers (N, c, 6), in {G}.
    If Newton's method finds none, a descent of the potential energy is tried.
    """
    rests, found = _newton(robot, lengths, starts, carriers)
    for row in np.flatnonzero(~found):
        rest = descend(robot, starts[row], carriers[row], lengths[row])
        if rest is not None:
            rests.put(row, rest)
            found[row] = True
    return rests, found


def sensitivity(robot: Robot, rests: Equilibrium, carriers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the derivatives of CoM and rotation vector in {G} by lengths and by a wrench at N equilibria.

    Carriers, (N, c, 6), are fixed, and slack cables have no effect. The derivatives are (N, 6, m) [-, rad/m] and
    (N, 6, 6) [m/N, rad/N, m/(N m), rad/(N m)], of a wrench about the CoM. Also return neutral, that is, undetermined
    motions of CoM and rotation vector, (N, 6, k), of which some are zero.
    """
    rows = np.flatnonzero(robot.dof_mask)
    count, n, m, scale = len(rests.pose), len(rows), robot.m, robot.wrench_scale[rows, None]
    system = _system(robot, dynamics_of(robot), rests.pose, rests.tensions, carriers, rests.taut)
    values, V = np.linalg.eigh(system)
    sizes = np.abs(values)
    regular = sizes > 1e-9 * sizes.max(axis=1, keepdims=True)
    inverse = (V / np.where(regular, values, np.inf)[:, None]) @ V.swapaxes(1, 2)
    moves, compliance = np.zeros((count, 6, m)), np.zeros((count, 6, 6))
    moves[:, rows] = inverse[:, :n, n:] * rests.taut[:, None] * scale
    compliance[:, rows[:, None], rows] = inverse[:, :n, :n] * scale * scale.T / _unit(robot)
    neutral = np.zeros((count, 6, max(n + m, 6)))
    neutral[:, rows, : n + m] = V[:, :n] * ~regular[:, None] * scale
    lost = rests.neutral & (np.abs(neutral).max(axis=(1, 2)) <= 1e-6)
    neutral[lost, :, :6] = np.diag(robot.dof_mask)
    return moves, compliance, neutral


def _newton(
    robot: Robot, lengths: np.ndarray, starts: np.ndarray, carriers: np.ndarray
) -> tuple[Equilibrium, np.ndarray]:
    """Return the equilibria that Newton's method reaches, and which of them are stable, (N,)."""
    dynamics, rows = dynamics_of(robot), np.flatnonzero(robot.dof_mask)
    n, unit = len(rows), _unit(robot)
    weight = (robot.platform.mass * np.array([*robot.gravity, 0.0, 0.0, 0.0]) * robot.wrench_scale)[rows] / unit
    pose = starts.copy()
    A = (dynamics.wrench_matrix(pose, carriers) * robot.wrench_scale[:, None])[:, rows]
    tensions = -np.linalg.pinv(np.nan_to_num(A), 1e-9) @ weight * unit
    taut = tensions > SLACK * robot.weight  # as it would be if it rested at the start
    taut |= not weight.any()  # where nothing pulls, poses at which the cables are just straight come nearest to a rest
    left = np.arange(len(lengths))
    for _ in range(NEWTON):
        system = _system(robot, dynamics, pose[left], tensions[left], carriers[left], taut[left])
        beyond = dynamics.cable_lengths(pose[left], carriers[left]) - lengths[left]
        missing = np.hstack([np.tile(weight, (len(left), 1)), np.where(taut[left], -beyond, 0.0)])
        usable = np.isfinite(system).all(axis=(1, 2)) & np.isfinite(missing).all(axis=1)
        left, system, beyond, missing = left[usable], system[usable], beyond[usable], missing[usable]
        if not left.size:
            break
        # A neutral motion leaves the system singular.
        step = (np.linalg.pinv(system, 1e-12, hermitian=True) @ missing[..., None])[..., 0]
        size = np.linalg.norm(step[:, :n], axis=1) / robot.length
        twist = np.zeros((len(left), 6))
        twist[:, rows] = step[:, :n] * robot.wrench_scale[rows] * np.minimum(1.0, 0.3 / np.maximum(size, 0.3))[:, None]
        pose[left] = points.moved(pose[left], twist, robot.platform.com)
        pulls = step[:, n:] * unit
        far = size > 1e-3
        tensions[left] = np.where(far[:, None], np.maximum(pulls, 0.0), pulls)
        pushing = (pulls < -ROUNDING * robot.weight) & (pulls == pulls.min(axis=1, keepdims=True))
        longer = ~taut[left] & (beyond > (2.0 * size[:, None] + ROUNDING) * robot.length)
        changed = np.where((size <= SETTLED)[:, None], pushing | longer, False)
        taut[left] ^= changed
        left = left[(size > 1e-12) | changed.any(axis=1)]
    reached = judge(robot, dynamics, pose, carriers, tensions)
    off = np.where(taut, np.abs(reached.lengths - lengths), reached.lengths - lengths).max(axis=1)
    found = off <= ROUNDING * np.maximum(robot.length, lengths.max(axis=1))
    found &= (reached.residual <= ROUNDING * robot.weight) & (tensions.min(axis=1) >= -ROUNDING * robot.weight)
    lowest, nearest = np.zeros(len(found)), np.zeros(len(found))
    lowest[found], nearest[found] = _frequencies(robot, dynamics, pose[found], tensions[found], carriers[found])
    return replace(reached, neutral=nearest < UNSTABLE), found & (lowest >= -UNSTABLE)


def _frequencies(
    robot: Robot, dynamics: Dynamics, pose: np.ndarray, tensions: np.ndarray, carriers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest natural frequency of N equilibria, negative if unstable, and the one nearest to zero [Hz].

    Both refer to motions that taut cables of constant lengths permit; large numbers if there are none.
    """
    rows = np.flatnonzero(robot.dof_mask)
    C = whitening(robot, pose)
    K = whitened(robot, dynamics.stiffness(pose, np.maximum(tensions, 0.0), carriers, elastic=False), C)
    taut = tensions > ROUNDING * np.maximum(tensions.max(axis=1, keepdims=True), 1e-300)
    A = C @ (dynamics.wrench_matrix(pose, carriers) * taut[:, None])[:, rows]
    held = A @ np.linalg.pinv(A, 1e-9)
    free = np.eye(len(rows)) - held
    above = 1.0 + np.abs(K).sum(axis=(1, 2))  # of all squares
    squares = np.linalg.eigvalsh(free @ K @ free + above[:, None, None] * held)
    found = frequency(squares)
    return found[:, 0], np.abs(found).min(axis=1)


def _system(
    robot: Robot, dynamics: Dynamics, pose: np.ndarray, tensions: np.ndarray, carriers: np.ndarray, taut: np.ndarray
) -> np.ndarray:
    """Return the matrices of Newton's step, (N, n + m, n + m), in the n coordinates that move.

    Rotations are multiplied by `Robot.length`, forces divided by the weight over that; a slack cable has the tension 0.
    """
    rows, scale = np.flatnonzero(robot.dof_mask), robot.wrench_scale
    n, m = len(rows), robot.m
    A = (dynamics.wrench_matrix(pose, carriers) * scale[:, None])[:, rows]
    K = dynamics.stiffness(pose, tensions, carriers, elastic=False) * np.outer(scale, scale) / _unit(robot)
    system = np.zeros((len(pose), n + m, n + m))
    system[:, :n, :n] = ((K + K.swapaxes(1, 2)) / 2)[:, rows[:, None], rows]
    system[:, :n, n:] = -A * taut[:, None]
    system[:, n:, :n] = system[:, :n, n:].swapaxes(1, 2)
    system[:, range(n, n + m), range(n, n + m)] = ~taut
    return system


def _unit(robot: Robot) -> float:
    """Return the force over a length that makes stiffness comparable to cosines [N/m]."""
    return max(robot.weight, 1e-300) / robot.length
