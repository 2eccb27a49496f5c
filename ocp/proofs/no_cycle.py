"""Prove that no cycle has tensions: `no_cycle`.

At the end of a cycle the platform has the momentum with which it began, and the angular momentum about a fixed point.
So the mean wrench of the cables about this point balances the mean weight, however fast the cycle is. Along a direction
(f, c) of wrenches a cable of tension t gives t x, x = (f + c x a) . u, with its anchor a and its direction u. If along
one direction all cables together give less than the weight takes, wherever the tube lets the platform be, there is no
cycle. Linear programs find the direction for some poses, to which they add those that it leaves unproven. About each
place of the path the tube is a box of offsets, in which x differs from a mean of those at the corners by at most half
the square of half its size times the second derivative, summed over the offsets.
"""

import numpy as np

from ...models.points import placed
from ...solvers import solve_batch
from ..audits.excess import TENSIONS, Excess
from ..audits.tensions import scaled
from ..tasks.ends import platform_ends
from ..tasks.paths import RestPath
from ..tasks.scenario import ATTITUDE, Scenario

PLACES, FEW = 201, 10  # along the path; between those of the first linear program
ROUNDS, WORST = 8, 4  # of linear programs; poses that each adds
CERTAIN = 1e-6  # of the weight


def no_cycle(scenario: Scenario) -> list[Excess]:
    """Return by how much the mean wrench of every cycle misses the weight, if it must miss it, else nothing."""
    robot, tube = scenario.robot, scenario.task.tube
    still = all(isinstance(path, RestPath) for path in scenario.carrier_paths.values()) and not scenario.carrier_free
    known = scenario.wind is None and not (scenario.relative or scenario.phases.all or robot.pulley_radii.any())
    if not (still and known and np.isfinite(tube.radius)) or platform_ends(scenario.task) != "periodic":
        return []
    cycle = _Cycle(scenario)
    if cycle.rests_somewhere:
        return []
    poses = cycle.poses[::FEW]
    for _ in range(ROUNDS):
        if (direction := cycle.direction(poses)) is None:
            break
        short, worst = cycle.shortfall(direction)
        if short > 0.0:
            why = "in the mean over every cycle, because a cycle ends with the momentum with which it starts"
            return [Excess(TENSIONS, "platform", None, short, 0.0, "N", "at most", why)]
        poses = np.concatenate([poses, worst])
    return []


class _Cycle:
    """The tube about the path of a cycle, and the wrenches about a fixed point that cables give there."""

    def __init__(self, scenario: Scenario):
        robot, tube = scenario.robot, scenario.task.tube
        motion, carriers = scenario.motion(np.linspace(0.0, scenario.duration, PLACES), None)
        self._scenario, self._carriers, self.poses = scenario, carriers.pose, motion.pose  # (n, 6)
        self.anchors = scenario.dynamics.points(motion.pose[:1], carriers.pose[:1])[0][0]
        self.about = motion.pose[:, :3].mean(axis=0)
        self.low, self.high = scenario.bounds()
        self.force, self.length = robot.platform.mass * np.array(robot.gravity), robot.length
        self.least = CERTAIN * robot.force_scale
        free = robot.dof_mask > 0
        # The force of a guide has no moment about an axis that is parallel to it.
        turns = free[3:] & np.roll(free[:3], -1) & np.roll(free[:3], -2)
        self.rows = np.flatnonzero(np.append(free[:3], turns))
        self.arms = np.vstack([robot.attachments, robot.platform.com])
        self.half = np.zeros(6)  # of a box of offsets
        self.half[list(scenario.platform_free)] = [
            tube.turn if i in ATTITUDE else tube.radius for i in scenario.platform_free
        ]
        # Twice what the reference moves to halfway between two places.
        step = scenario.duration / (PLACES - 1)
        fastest = np.linalg.norm(motion.velocity[:, :3], axis=1).max()
        turning = np.abs(motion.velocity[:, 3:]).sum(axis=1).max()
        self.beside = step * (fastest + turning * np.linalg.norm(self.arms, axis=1))  # of each point, (m + 1,) [m]

    @property
    def rests_somewhere(self) -> bool:
        """Return whether tensions hold the platform at rest at some place of the path: then no direction exists."""
        scenario, still = self._scenario, np.zeros_like(self.poses)
        A = scenario.dynamics.wrench_matrix(self.poses, self._carriers)
        w = scenario.dynamics.required_wrench(self.poses, still, still)
        return bool(solve_batch(scaled(scenario, A), scaled(scenario, w), self.low, self.high).feasible.any())

    def direction(self, poses: np.ndarray) -> np.ndarray | None:
        """Return the direction along which the cables are short by most at all of `poses` (k, 6), if there is one."""
        from scipy.optimize import linprog

        points = placed(poses, self.arms)
        u = self._lines(points) / self._lengths(points)[..., None]
        A = np.concatenate([u, np.cross(self.anchors - self.about, u) / self.length], axis=2)
        moment = np.cross(points[:, -1] - self.about, self.force) / self.length
        taken = np.hstack([np.broadcast_to(-self.force, moment.shape), -moment])[:, self.rows]
        k, m, _ = A.shape
        A, each = A[..., self.rows].reshape(k * m, -1), np.eye(k * m)
        # Unknowns: the direction, what each cable gives along it at most, and the least shortfall.
        gives = [np.hstack([np.tile(t, k)[:, None] * A, -each, 0 * A[:, :1]]) for t in (self.low, self.high)]
        short = np.hstack([-taken, np.kron(np.eye(k), np.ones(m)), np.ones((k, 1))])
        bounds = [(-1, 1)] * A.shape[1] + [(None, None)] * (k * m + 1)
        cost, zero = -np.eye(short.shape[1])[-1], np.zeros(2 * k * m + k)
        found = linprog(cost, A_ub=np.vstack([*gives, short]), b_ub=zero, bounds=bounds, method="highs")
        if not found.success or found.x[-1] <= self.least:
            return None
        direction, given = np.zeros(6), found.x[: len(self.rows)]
        direction[self.rows] = given / np.linalg.norm(given)
        return direction

    def shortfall(self, direction: np.ndarray) -> tuple[float, np.ndarray]:
        """Return a lower bound of the shortfall along a direction in the whole tube [N], and where it is smallest.

        The latter are poses (k, 6) of corners.
        """
        f, c = direction[:3], direction[3:] / self.length
        along, taken = f + np.cross(c, self.anchors - self.about), np.cross(self.force, c)
        signs = np.stack(np.meshgrid(*[[-1.0, 1.0] if half else [0.0] for half in self.half]), axis=-1).reshape(-1, 6)
        corners = self.poses[:, None] + signs * self.half
        points = placed(corners, self.arms)
        x = np.einsum("...ij,ij->...i", self._lines(points), along) / self._lengths(points)
        weight = -self.force @ f - (points[..., -1, :] - self.about) @ taken
        # First and second derivatives of points and directions: `beside` the places, and between corners.
        arms, moves, turns = np.linalg.norm(self.arms, axis=1), self.half[:3], self.half[3:]
        travel = np.linalg.norm(moves) + arms * turns.sum() + self.beside
        nearest = self._lengths(placed(self.poses, self.arms)) - travel[:-1]
        if (nearest <= 0.0).any():
            return 0.0, corners[:0, 0]
        bent = arms[:-1] / nearest + 3 * (arms[:-1] / nearest) ** 2
        off = self.beside[:-1] / nearest + (moves @ moves * 3 / nearest**2 + turns @ turns * bent) / 2
        x += (np.linalg.norm(along, axis=1) * off)[:, None]
        weight -= np.linalg.norm(taken) * (self.beside[-1] + arms[-1] * (turns @ turns) / 2)
        lacking = weight - np.maximum(self.low * x, self.high * x).sum(axis=-1)
        worst = np.argsort(lacking.ravel())[:WORST]
        return float(lacking.min() - self.least), corners.reshape(-1, 6)[worst]

    def _lines(self, points: np.ndarray) -> np.ndarray:
        return self.anchors - points[..., :-1, :]

    def _lengths(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(self._lines(points), axis=-1)
