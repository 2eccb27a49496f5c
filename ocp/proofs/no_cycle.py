"""Prove that no cycle has tensions: `no_cycle`.

A cycle ends with the momentum, and the angular momentum about a fixed point, with which it begins. Along any periodic
direction f of forces and constant direction c of moments about that point, the mean wrench of cables and weight is
therefore the mean of m p . f'' (integration by parts), with the position p of the CoM. If the platform does not turn,
the moments about its CoM are balanced at all times, so c may change, too.

A cable of tension t gives t x along (f, c), x = (f + c x a) . u, with its lever a and its direction u. If in the mean
all cables together give less than weight and momentum take, wherever the tube lets the platform be, there is no cycle.
Linear programs find directions at nodes of the path, linear between them, for some poses; the poses that they leave
unproven are added for the next program. About each place the tube is a box of offsets, in which x differs from a mean
of those at the corners by at most half the square of half its size times the second derivative, summed over the
offsets. What the cables give is convex in (f, c), so between two places it is at most the mean of both, each with the
poses between them.
If the planner chooses the duration, f is constant, and the worst place counts instead of the mean.
"""

import numpy as np

from ...models.points import placed
from ...solvers import solve_batch
from ..audits.excess import TENSIONS, Excess
from ..audits.tensions import scaled
from ..tasks.ends import platform_ends
from ..tasks.paths import RestPath
from ..tasks.scenario import ATTITUDE, Scenario

PLACES, FEW = 1000, 40  # along the path; from one node of the linear program to the next
ROUNDS = 6  # of linear programs
CERTAIN = 1e-6  # of the weight
CURVED = 2 / 3**0.5  # the second derivative of a cable's direction is at most this over its length squared


def no_cycle(scenario: Scenario) -> list[Excess]:
    """Return by how much the mean wrench of every cycle misses the weight, if it must miss it, else nothing."""
    robot, tube = scenario.robot, scenario.task.tube
    still = all(isinstance(path, RestPath) for path in scenario.carrier_paths.values()) and not scenario.carrier_free
    known = scenario.wind is None and not (scenario.relative or scenario.phases.all or robot.pulley_radii.any())
    bounded = np.isfinite(tube.radius) and np.isfinite(scenario.bounds()).all()
    if not (still and known and bounded) or platform_ends(scenario.task) != "periodic" or _rests(scenario):
        return []
    cycle = Cycle(scenario)
    pairs = {(k, corner) for k in range(0, PLACES, FEW) for corner in (0, cycle.corners - 1)}
    for _ in range(ROUNDS):
        if (directions := cycle.directions(sorted(pairs))) is None:
            break
        short, worst = cycle.shortfall(directions)
        if short > CERTAIN:
            why = "in the mean over every cycle, because a cycle ends with the momentum with which it starts"
            return [Excess(TENSIONS, "platform", None, short * robot.force_scale, 0.0, "N", "at most", why)]
        if pairs >= worst:
            break
        pairs |= worst
    return []


def _rests(scenario: Scenario) -> bool:
    """Return whether tensions hold the platform at rest everywhere on its path (somewhere if the duration is free)."""
    motion, carriers = scenario.motion(np.linspace(0.0, scenario.duration, PLACES), None)
    still = np.zeros_like(motion.pose)
    A = scenario.dynamics.wrench_matrix(motion.pose, carriers.pose)
    w = scenario.dynamics.required_wrench(motion.pose, still, still)
    held = solve_batch(scaled(scenario, A), scaled(scenario, w), *scenario.bounds()).feasible
    return bool(held.all() if scenario.duration_range is None else held.any())


class Cycle:
    """The tube about the path of a cycle, and the wrenches that cables give at its places and their corners.

    Forces are in parts of the weight.

    Attributes:
        poses: Poses of the path at n places, (n, 6).
        half: Half the size of the box of offsets from it, (6,).
        corners: Number of corners k of this box.
    """

    def __init__(self, scenario: Scenario):
        robot, tube = scenario.robot, scenario.task.tube
        motion, carriers = scenario.motion(np.arange(PLACES) / PLACES * scenario.duration, None)
        self.poses, self._fixed = motion.pose, scenario.duration_range is None
        self._low, self._high = (bound / robot.force_scale for bound in scenario.bounds())
        self._inertia = robot.platform.mass / robot.force_scale * (PLACES / FEW / scenario.duration) ** 2
        self._force = robot.platform.mass / robot.force_scale * np.array(robot.gravity)
        # Guides are parallel to the axes about which a platform turns, so they have no moments about these.
        self._length, self._rows = robot.length, np.flatnonzero(robot.dof_mask)
        self.half = np.zeros(6)
        self.half[list(scenario.platform_free)] = [
            tube.turn if i in ATTITUDE else tube.radius for i in scenario.platform_free
        ]
        self._balanced = not (self.half[3:].any() or motion.velocity[:, 3:].any())
        anchors = scenario.dynamics.points(motion.pose[:1], carriers.pose[:1])[0][0]
        body = np.vstack([robot.attachments, robot.platform.com])
        middle = placed(motion.pose, body)  # (n, m + 1, 3)
        self._com = middle[:, -1] - middle[:, -1].mean(axis=0)
        signs = np.stack(np.meshgrid(*[[-1.0, 1.0] if each else [0.0] for each in self.half]), axis=-1).reshape(-1, 6)
        self.corners = len(signs)
        self._hang(anchors, placed(motion.pose[:, None] + signs * self.half, body), middle[:, -1].mean(axis=0))
        reach, speeds = np.linalg.norm(body, axis=1), np.abs(motion.velocity)
        fastest = np.linalg.norm(speeds[:, :3], axis=1).max() + speeds[:, 3:].sum(axis=1).max() * reach
        self._bound(np.linalg.norm(anchors - middle[:, :-1], axis=-1), reach, scenario.duration / PLACES * fastest)

    def _hang(self, anchors: np.ndarray, points: np.ndarray, middle: np.ndarray) -> None:
        """Compute directions and levers of the cables, and what the weight takes, at the corners of all places.

        Args:
            anchors: In {G}, (m, 3) [m].
            points: Attachments and CoM in {G}, (n, k, m + 1, 3) [m].
            middle: The mean position of the CoM in {G}, (3,) [m].
        """
        attachments, com = points[..., :-1, :], points[..., -1:, :]
        lines = anchors - attachments
        self._u = lines / np.linalg.norm(lines, axis=-1, keepdims=True)
        # Moments are about the CoM if they are balanced at all times, or else about the mean of its positions.
        about, ends = (com, attachments) if self._balanced else (middle, anchors)
        self._levers = np.broadcast_to(ends - about, lines.shape)
        moments = np.cross((com - about)[..., 0, :], self._force) / self._length
        self._taken = -np.concatenate([0 * moments + self._force, moments], axis=-1)  # (n, k, 6)

    def _bound(self, lengths: np.ndarray, reach: np.ndarray, beside: np.ndarray) -> None:
        """Bound how far cables and CoM in the tube, and between places, differ from those at corners of places.

        Args:
            lengths: Of the cables on the path, (n, m) [m].
            reach: Distances of attachments and CoM from the platform's origin, (m + 1,) [m].
            beside: Twice what these move at most until halfway between two places, (m + 1,) [m].
        """
        shifts, turns = self.half[:3], self.half[3:]
        moved = np.linalg.norm(shifts) + turns.sum() * reach  # from a place to its corners, at most
        nearest = lengths - (moved + beside)[:-1]
        nearest[nearest <= 0.0] = np.nan  # nothing is known then
        # First and second derivatives of the directions of cables and of the CoM: between places and between corners.
        bent = reach[:-1] / nearest + CURVED * (reach[:-1] / nearest) ** 2
        curved = CURVED * shifts @ shifts / nearest**2 + turns @ turns * bent
        self._off = beside[:-1] / nearest + curved / 2  # (n, m)
        self._off_com = 0.0 if self._balanced else beside[-1] + reach[-1] * (turns @ turns) / 2
        self._spread = shifts + turns.sum() * reach[-1]  # of the CoM in the tube, along each axis [m]

    def directions(self, pairs: list[tuple[int, int]]) -> np.ndarray | None:
        """Return the directions (n, 6) along which the cables are short by most at `pairs` of place and corner.

        None if they are short along none.

        The unknowns of the linear program are the rows of the directions; for each cable of each pair, at most what it
        gives along its own; the shortfalls; and by how much the place in the tube may reduce what momentum takes. Where
        the duration is fixed, the mean of the shortfalls at the nodes counts, otherwise the smallest.
        """
        from scipy import sparse
        from scipy.optimize import linprog

        m, p = self._u.shape[2], len(pairs)
        at, corner = np.array(pairs).T
        node, forces, rows = at // FEW, self._rows < 3, self._rows_of_directions()
        x = (self._matrices(at, corner) @ rows[node]).reshape(p * m, -1)  # of t x in terms of the directions
        taken = np.einsum("pr,pri->pi", self._taken[at, corner][:, self._rows], rows[node])
        bent = self._bent(rows[:, forces])
        momentum = np.einsum("nri,nr->i", bent, self._com[::FEW, self._rows[forces]]) / len(rows)
        bent = bent.reshape(-1, rows.shape[2])
        spread = np.tile(self._spread[self._rows[forces]], len(rows)) / len(rows)
        which = node if self._fixed else 0 * node  # of the shortfalls
        counts, shortfalls = sparse.csr_array((np.ones(p), (np.arange(p), which))), int(which.max()) + 1
        given, lost, sums = sparse.eye_array(p * m), sparse.eye_array(len(bent)), np.kron(np.eye(p), np.ones(m))
        blocks = [
            [np.tile(self._low, p)[:, None] * x, -given, None, None],  # low x <= given
            [np.tile(self._high, p)[:, None] * x, -given, None, None],  # high x <= given
            [-taken, sums, counts, None],  # all that is given, and the shortfall, <= taken
            [bent, None, None, -lost],  # |m f''| <= lost
            [-bent, None, None, -lost],
        ]
        least = sparse.block_array(blocks, format="csr")
        cost = np.concatenate([-momentum, np.zeros(p * m), np.full(shortfalls, -1 / shortfalls), spread])
        bounds = [(-1, 1)] * rows.shape[2] + [(None, None)] * (len(cost) - rows.shape[2])
        found = linprog(cost, A_ub=least, b_ub=np.zeros(2 * p * m + p + 2 * len(bent)), bounds=bounds, method="highs")
        if not found.success or -found.fun <= CERTAIN:
            return None
        at_nodes = np.zeros((len(rows) + 1, 6))
        at_nodes[:-1, self._rows] = rows @ found.x[: rows.shape[2]]
        at_nodes[-1] = at_nodes[0]
        places = np.arange(PLACES) / FEW
        directions = np.stack([np.interp(places, range(len(at_nodes)), row) for row in at_nodes.T], axis=1)
        return directions / np.linalg.norm(directions, axis=1).max()

    def _rows_of_directions(self) -> np.ndarray:
        """Return the r rows of the directions at all nodes in terms of u unknowns, (nodes, r, u).

        A row has an unknown for each node if it may change along the path, otherwise one.
        """
        nodes = PLACES // FEW
        own = [nodes if (self._fixed if row < 3 else self._balanced) else 1 for row in self._rows]
        unknown = np.split(np.eye(sum(own)), np.cumsum(own)[:-1])
        return np.stack([np.broadcast_to(row, (nodes, sum(own))) for row in unknown], axis=1)

    def _matrices(self, at: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Return the transposed wrench matrices of pairs of place and corner, (p, m, r), moments over the length."""
        u, levers = self._u[at, corner], self._levers[at, corner]
        return np.concatenate([u, np.cross(levers, u) / self._length], axis=2)[..., self._rows]

    def shortfall(self, directions: np.ndarray) -> tuple[float, set[tuple[int, int]]]:
        """Return a lower bound of the shortfall along directions (n, 6) in the whole tube, and where it is smallest.

        The latter are pairs of place and corner, one for each node.
        """
        f, c = directions[:, None, None, :3], directions[:, None, None, 3:] / self._length
        along = f + np.cross(c, self._levers)  # (n, k, m, 3)
        x = np.einsum("nkmi,nkmi->nkm", along, self._u) + np.linalg.norm(along, axis=-1) * self._off[:, None]
        taken = np.einsum("nki,ni->nk", self._taken, directions)
        taken -= np.linalg.norm(np.cross(self._force, c[:, 0]), axis=-1) * self._off_com
        missing = taken - np.maximum(self._low * x, self._high * x).sum(axis=-1)
        bent, least = self._bent(directions[::FEW, :3]), missing.min(axis=1)
        momentum = (bent * self._com[::FEW] - np.abs(bent) * self._spread).sum(axis=1).mean()
        short = float(momentum + (least.mean() if self._fixed else least.min()))
        return short, {(k, int(missing[k].argmin())) for k in range(0, PLACES, FEW)}

    def _bent(self, f: np.ndarray) -> np.ndarray:
        """Return m f'' at the nodes for directions f (nodes, ...), which are linear between them: means of impulses."""
        return self._inertia * (np.roll(f, 1, axis=0) + np.roll(f, -1, axis=0) - 2 * f)
