"""`Evaluation`: margins, distances and frequencies of many layouts of a robot at given poses, with derivatives.

The characteristic length of the robot's file is kept, whatever the attachments become: a design would otherwise
change the unit in which it is measured.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from .. import core
from ..models import Robot
from ..models.dynamics import dynamics_of
from ..models.mechanics import Mechanics
from ..models.points import rotations
from ..models.record import record_of
from ..ocp.tasks.lay_out import lay_out
from ..ocp.tasks.task import Task
from ..solvers import solve_batch
from ..solvers.margin import Reserves, all_reserves, margins, reserves
from ..statics.stiffness import frequencies_of
from ..workspace.conditions.interference import nearest_points
from .goal import Goal, Outcome
from .requirements import Requirement
from .room import Region, Room
from .variables import Variables, parts

NO_BOUNDS = Room()
ByVariables = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (poses, columns), (k,) each -> (k, p)
INSTANTS, FEW_INSTANTS = 41, 9  # of each task, and for annealing
MOST_SLOW = 40  # lowest frequencies, which a linear program has
MOST_LONG = 4  # longest lengths of each cable, which a linear program has
_STEP = 1e-6  # of the range of a variable, for differences of frequencies
_STEEP = 1e7  # times the length: slopes of a facet whose columns nearly depend on each other say nothing


class Rows(NamedTuple):
    """Poses, and for each of some rows its pose, the required wrench and the acceleration at which it is required."""

    poses: np.ndarray  # (N, 6)
    pose_of: np.ndarray  # (K,), into the poses
    wrenches: np.ndarray  # (K, 6), about the CoM in {G} [N, N m]
    accelerations: np.ndarray  # (K, 6)

    def joined(self, other: "Rows") -> "Rows":
        """Return these rows followed by others."""
        other = other._replace(pose_of=other.pose_of + len(self.poses))
        return Rows(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))

    def only(self, chosen: np.ndarray) -> "Rows":
        """Return some of the rows, by index."""
        poses, pose_of = np.unique(self.pose_of[chosen], return_inverse=True)
        return Rows(self.poses[poses], pose_of, self.wrenches[chosen], self.accelerations[chosen])


def rows_of(robot: Robot, requirements: tuple[Requirement, ...], poses: list[np.ndarray]) -> Rows:
    """Return the rows of some requirements at the given poses of each, (N, 6) each."""
    dynamics, blocks, start = dynamics_of(robot), [], 0
    for requirement, places in zip(requirements, poses, strict=True):
        still = np.zeros_like(places)
        for wrench, acceleration, wind in requirement.demands:
            wanted = dynamics.required_wrench(places, still, np.broadcast_to(acceleration, places.shape), wind=wind)
            indices = start + np.arange(len(places))
            # A guide takes the wrench along a coordinate that cannot move.
            blocks.append((indices, wanted - wrench * robot.dof_mask, np.tile(acceleration, (len(places), 1))))
        start += len(places)
    pose_of, wrenches, accelerations = (np.concatenate(part) for part in zip(*blocks, strict=True))
    return Rows(np.concatenate(poses), pose_of, wrenches, accelerations)


def with_tasks(rows: Rows, robot: Robot, tasks: tuple[Task, ...], count: int = INSTANTS) -> Rows:
    """Return the rows, followed by those of each task that fixes its motion and leaves the carriers at home.

    The wrenches of other tasks depend on the planner's choices, so these tasks are only planned at the end.
    """
    for task in tasks:
        scenario = lay_out(robot, task)
        if not scenario.is_fixed or scenario.carrier_paths:
            continue
        times = np.linspace(0.0, scenario.duration, count)
        motion, carriers = scenario.motion(times, None)
        wrenches = scenario.required_wrench(times, motion, carriers, scenario.wind)
        rows = rows.joined(Rows(motion.pose, np.arange(count), wrenches, motion.acceleration))
    return rows


class Slopes(NamedTuple):
    """Values of some rows and their derivatives by the variables."""

    value: np.ndarray  # (k,)
    by_variables: np.ndarray  # (k, p)


class Evaluation:
    """Evaluate layouts at the rows of requirements.

    - `variables`: variables of the design.
    - `rows`: poses and wrenches.
    - `room`: bounds of distances and lengths (default: none).
    """

    def __init__(self, variables: Variables, rows: Rows, room: Room = NO_BOUNDS):
        robot = variables.robot
        self.variables, self.rows, self.room = variables, rows, room
        self._record = record_of(robot).copy()
        self._mechanics = Mechanics(robot, self._record)
        self._m, self._home = robot.m, np.ascontiguousarray(robot.carrier_home)
        self._kept = np.flatnonzero(robot.dof_mask)
        self._scale = robot.wrench_scale[self._kept]
        self._w = np.ascontiguousarray(rows.wrenches[:, self._kept] * self._scale)
        self._poses = np.ascontiguousarray(rows.poses, dtype=float)
        self._each = len(rows.pose_of) == len(rows.poses) and (rows.pose_of == np.arange(len(rows.poses))).all()
        self._steep = _STEEP * max(1.0, float(np.abs(robot.t_max).max()))
        self._turn = rotations(self._poses[:, 3:])  # (N, 3, 3)
        self._carried = rotations(self._home[robot.carrier_of_cable, 3:])  # (m, 3, 3)
        self.pairs = np.array(list(combinations(range(robot.m), 2)), dtype=int).reshape(-1, 2)
        self._apart = np.flatnonzero(~self._always_together())
        self.pairs = self.pairs[self._apart]

    def margins(self, y: np.ndarray) -> np.ndarray:
        """Return the margins of all rows, (K,) [N]."""
        return margins(*self._problem(y))

    def all_reserves(self, y: np.ndarray) -> np.ndarray:
        """Return the reserves of all rows along all normals, (K, F) [N]."""
        return all_reserves(*self._problem(y))

    def reserves(self, y: np.ndarray, rows: np.ndarray, normals: np.ndarray) -> tuple[Reserves, np.ndarray]:
        """Return the reserves of some rows along one normal each, and their derivatives by the variables, (k, p)."""
        A, w, t_min, t_max = self._problem(y, rows)
        found = reserves(A, w, t_min, t_max, normals)
        m, poses = self._m, np.ascontiguousarray(self._poses[self.rows.pose_of[rows]])
        S = np.empty((len(rows), m, 6, 7))
        core.columns_by_geometry(self._record, poses, self._home, S)
        direction = found.direction * self._scale
        by_points = np.einsum("ki,kmij->kmj", direction, S[:, :, self._kept, :6]) * found.tensions[:, :, None]
        by_layout = np.concatenate(
            [
                by_points[:, :, :3].reshape(len(rows), 3 * m),
                by_points[:, :, 3:].reshape(len(rows), 3 * m),
                np.minimum(found.pull, 0.0),
                np.maximum(found.pull, 0.0),
            ],
            axis=1,
        )
        return found, by_layout @ self.variables.S

    def usable(self, slopes: np.ndarray) -> np.ndarray:
        """Return which rows of slopes (k, p) can be linearised."""
        return np.isfinite(slopes).all(axis=1) & (np.abs(slopes).max(axis=1, initial=0.0) < self._steep)

    def distances(self, y: np.ndarray) -> np.ndarray:
        """Return the distance of each pair of cables at each pose, (N, pairs) [m]."""
        self._place(y)
        distances = np.empty((len(self._poses), self._m * (self._m - 1) // 2))
        core.cable_distances(self._record, self._poses, self._home, distances)
        return distances[:, self._apart]

    def lengths(self, y: np.ndarray) -> np.ndarray:
        """Return the length of each cable at each pose, (N, m) [m]."""
        self._place(y)
        lengths = np.empty((len(self._poses), self._m))
        core.lines(self._record, self._poses, self._home, lengths, None, None, None, None)
        return lengths

    def frequencies(self, y: np.ndarray, rows: np.ndarray | None = None) -> np.ndarray:
        """Return up to two lowest natural frequencies of some rows, default: of all, (k, 2) [Hz].

        They are those with the tensions of least norm that balance each wrench, and 0 where there are none.
        """
        A, w, t_min, t_max = self._problem(y, rows)
        poses = self._poses[self.rows.pose_of if rows is None else self.rows.pose_of[rows]]
        solved = solve_batch(A, w, t_min, t_max, threads=1)
        tensions = np.where(solved.feasible[:, None], solved.tensions, 0.0)
        K = self._mechanics.stiffness(poses, tensions, None, True)
        return np.where(solved.feasible[:, None], frequencies_of(self.variables.robot, K, poses)[:, :2], 0.0)

    def outcome(self, y: np.ndarray, goal: Goal) -> Outcome:
        """Return what counts of a layout."""
        return self.outcome_besides(y, goal, float(self.margins(y).min()))._replace(missing=self.missing(y))

    def outcome_besides(self, y: np.ndarray, goal: Goal, margin: float) -> Outcome:
        """Return what counts besides a known margin, without the room; no frequency where no tensions exist."""
        frequency = float(self.frequencies(y).min()) if goal.per_hertz and margin > 0.0 else 0.0
        cable = float(self.lengths(y).max(axis=0).sum()) if goal.per_metre else 0.0
        return Outcome(margin, 0.0, frequency, cable)

    def frequency_slopes(self, y: np.ndarray) -> Slopes:
        """Return the lowest frequencies of some rows with their derivatives, by differences."""
        rows = np.argsort(self.frequencies(y)[:, 0])[:MOST_SLOW]
        value = self.frequencies(y, rows)
        steps = _STEP * np.maximum(self.variables.high - self.variables.low, _STEP)
        changes = [self.frequencies(y + step, rows) - value for step in np.diag(steps)]
        by_variables = np.array(changes).reshape(y.size, value.size).T / steps
        usable = self.usable(by_variables)
        return Slopes(value.ravel()[usable], by_variables[usable])

    def spaces(self, y: np.ndarray) -> np.ndarray:
        """Return by how much the bounds of the room are kept at each pose, (N, k) [m]; negative where they are not.

        Frequencies are relative to their bound. Of regions a value that is not negative may be too small.
        """
        found = [np.zeros((len(self._poses), 0)), *(values for values, _ in self._bounds(y, exact=False))]
        if self.room.frequency > 0.0:
            least = np.full(len(self._poses), np.inf)
            np.minimum.at(least, self.rows.pose_of, self.frequencies(y)[:, 0])
            found.append(least[:, None] / self.room.frequency - 1.0)
        return np.hstack(found)

    def missing(self, y: np.ndarray) -> float:
        """Return how far the worst bound of the room is missed at some pose [m]."""
        return max(0.0, -float(self.spaces(y).min(initial=np.inf)))

    def space_slopes(self, y: np.ndarray, most: int, below: float) -> Slopes:
        """Return up to `most` of the smallest spaces `below` a value for each bound, with their derivatives."""
        found = [Slopes(np.zeros(0), np.zeros((0, self.variables.size)))]
        for values, slopes in self._bounds(y, exact=True):
            chosen = np.argsort(values, axis=None)[:most]
            chosen = chosen[values.ravel()[chosen] < below]
            found.append(Slopes(values.ravel()[chosen], slopes(*np.unravel_index(chosen, values.shape))))
        if self.room.frequency > 0.0:
            slow = self.frequency_slopes(y)
            found.append(Slopes(slow.value / self.room.frequency - 1.0, slow.by_variables / self.room.frequency))
        return Slopes(*(np.concatenate(part) for part in zip(*found, strict=True)))

    def longest_slopes(self, y: np.ndarray) -> tuple[Slopes, np.ndarray]:
        """Return the largest lengths of each cable with their derivatives, and the cable of each, (k,)."""
        lengths = self.lengths(y)
        poses = np.argsort(-lengths, axis=0)[:MOST_LONG]
        cables = np.broadcast_to(np.arange(self._m), poses.shape).ravel()
        return Slopes(lengths[poses.ravel(), cables], self._by_length(poses.ravel(), cables)), cables

    def _bounds(self, y: np.ndarray, exact: bool) -> Iterator[tuple[np.ndarray, ByVariables]]:
        """Yield by how much each bound of distances, lengths and heights is kept, (N, k) [m], and its derivatives.

        The derivatives by the variables are a function of the indices of the chosen values.
        """
        room, m = self.room, self._m
        if room.clearance > 0.0:
            yield self.distances(y) - room.clearance, lambda poses, pairs: self._by_gap(self._ends(y), poses, pairs)
        if room.limits_lengths:
            lengths = self.lengths(y)
            yield np.hstack([lengths - room.shortest, room.longest - lengths]), self._by_length
        if room.lowest > -np.inf:
            yield self._ends(y)[..., 2] - room.lowest, self._by_height
        for region in room.regions:
            ends = self._ends_for(y, region)
            spaces = region.distances(*ends) - region.least if exact else region.spaces(*ends)
            yield spaces.reshape(-1, m), partial(self._by_region, region, *(end.reshape(-1, m, 3) for end in ends))

    def _by_gap(self, ends: np.ndarray, poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        (i, j), m = self.pairs[pairs].T, self._m
        gap, *shares = nearest_points(ends[poses, m + i], ends[poses, i], ends[poses, m + j], ends[poses, j])
        u = gap / np.maximum(np.linalg.norm(gap, axis=1), 1e-9)[:, None]
        # The nearest point is (1 - share) of the attachment and `share` of the anchor.
        of_i, of_j = (share[:, None] for share in shares)
        slopes = self._by_ends(poses, i, of_i * u, (1.0 - of_i) * u)
        return slopes - self._by_ends(poses, j, of_j * u, (1.0 - of_j) * u)

    def _by_length(self, poses: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return derivatives of lengths at poses; of columns beyond the number of cables, times -1."""
        A = np.empty((len(self._poses), 6, self._m))
        core.lines(self._record, self._poses, self._home, None, A, None, None, None)
        # A cable pulls the attachment towards the anchor along u: its length grows if either moves away from the other.
        cables = columns % self._m
        u = A[poses, :3, cables] * np.where(columns < self._m, 1.0, -1.0)[:, None]
        return self._by_ends(poses, cables, u, -u)

    def _by_height(self, poses: np.ndarray, ends: np.ndarray) -> np.ndarray:
        up, of_anchor = np.array([0.0, 0.0, 1.0]), (ends < self._m)[:, None]
        return self._by_ends(poses, ends % self._m, of_anchor * up, ~of_anchor * up)

    def _by_region(
        self, region: Region, ends: np.ndarray, anchors: np.ndarray, poses: np.ndarray, cables: np.ndarray
    ) -> np.ndarray:
        by_end, by_anchor = region.slopes(ends[poses, cables], anchors[poses, cables])
        if region.riding:
            by_end, by_anchor = (np.einsum("kij,kj->ki", self._turn[poses], each) for each in (by_end, by_anchor))
        return self._by_ends(poses, cables, by_anchor, by_end)

    def _by_ends(self, poses: np.ndarray, cables: np.ndarray, by_anchor: np.ndarray, by_end: np.ndarray) -> np.ndarray:
        """Return derivatives by the variables, (k, p), of those by anchor and attachment of a cable in {G}, (k, 3)."""
        by_points, k = np.zeros((len(cables), 2, self._m, 3)), np.arange(len(cables))
        by_points[k, 0, cables] = np.einsum("kij,ki->kj", self._carried[cables], by_anchor)
        by_points[k, 1, cables] = np.einsum("kij,ki->kj", self._turn[poses], by_end)
        return by_points.reshape(len(cables), 6 * self._m) @ self.variables.S[: 6 * self._m]

    def _place(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Put a layout into the record; return the tension limits."""
        anchors, attachments, t_min, t_max = parts(self.variables.layout(y), self._m)
        cables = self._record["cable"]
        cables["anchor"][: self._m], cables["attachment"][: self._m] = anchors, attachments
        return np.ascontiguousarray(t_min), np.ascontiguousarray(t_max)

    def _problem(self, y: np.ndarray, rows: np.ndarray | None = None) -> tuple[np.ndarray, ...]:
        """Return A, w, t_min and t_max of some rows, default: of all."""
        t_min, t_max = self._place(y)
        poses = self._poses if rows is None else np.ascontiguousarray(self._poses[self.rows.pose_of[rows]])
        A = np.empty((len(poses), 6, self._m))
        core.lines(self._record, poses, self._home, None, A, None, None, None)
        if self._kept.size < 6:
            A = A[:, self._kept]
        A *= self._scale[:, None]
        if rows is None and not self._each:
            A = A[self.rows.pose_of]
        return A, self._w if rows is None else self._w[rows], t_min, t_max

    def _ends(self, y: np.ndarray) -> np.ndarray:
        """Return the anchors and then the attachments in {G}, (N, 2 m, 3) [m]."""
        self._place(y)
        anchors, attachments = (np.empty((len(self._poses), self._m, 3)) for _ in range(2))
        core.ends(self._record, self._poses, self._home, anchors, attachments)
        return np.concatenate([anchors, attachments], axis=1)

    def _ends_for(self, y: np.ndarray, region: Region) -> tuple[np.ndarray, np.ndarray]:
        """Return attachments and anchors in the frame of a region, (N m, 3) each [m]."""
        ends = self._ends(y)
        if region.riding:
            ends = np.einsum("nji,nkj->nki", self._turn, ends - self._poses[:, None, :3])
        anchors, attachments = ends[:, : self._m].reshape(-1, 3), ends[:, self._m :].reshape(-1, 3)
        return np.ascontiguousarray(attachments), np.ascontiguousarray(anchors)

    def _always_together(self) -> np.ndarray:
        """Return which pairs of cables have a common end in every layout, as equal points make them."""
        low, high, m = self.variables.low, self.variables.high, self._m
        layouts = [self.variables.layout(np.random.default_rng(k).uniform(low, high)) for k in range(2)]
        points = [part for layout in layouts for part in parts(layout, m)[:2]]
        i, j = self.pairs.T
        apart = [np.linalg.norm(part[i] - part[j], axis=1) > 1e-9 for part in points]
        carrier = self.variables.robot.carrier_of_cable  # in whose frame an anchor is
        elsewhere = carrier[i] != carrier[j]
        return ~((apart[0] | elsewhere) & apart[1]) & ~((apart[2] | elsewhere) & apart[3])
