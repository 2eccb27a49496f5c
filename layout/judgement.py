"""`judge`: how good a robot is at given rows, by functions that share no code with the search."""

from typing import NamedTuple

import numpy as np

from ..models import Robot
from ..models.dynamics import dynamics_of
from ..models.points import in_frame
from ..solvers import TensionProblem, capacity_margin, solve_batch
from ..solvers.margins import margins
from ..statics.stiffness import natural_frequencies
from ..workspace.conditions.interference import cable_distances, outside
from ..workspace.feasibility import NEAREST
from .evaluation import Rows
from .room import Room

_JUDGED = 100  # worst rows, by `capacity_margin`


class Judgement(NamedTuple):
    """The distances, lengths and frequency of a robot at some rows."""

    clearance: float  # smallest distance between two cables without a common end [m]
    closest: tuple[tuple[int, int], np.ndarray] | None  # these cables, counted from 0, and the pose (6,)
    lengths: tuple[float, float]  # shortest and longest length of a cable [m]
    distances: tuple[tuple[str, float], ...]  # name of each region, and the distance of cables from it [m]
    height: float  # of the lowest end of a cable [m]
    cable: float  # sum of the longest lengths of all cables [m]
    frequency: float | None  # lowest natural frequency [Hz]; None if it does not count

    def keeps(self, room: Room) -> bool:
        """Return whether the robot keeps the bounds of a room."""
        pairs = zip(self.distances, room.regions, strict=True)
        regions = all(distance > 0.0 and distance >= region.least for (_, distance), region in pairs)
        lengths = room.shortest <= self.lengths[0] and self.lengths[1] <= room.longest
        frequency = self.frequency is None or self.frequency >= room.frequency
        return self.clearance >= room.clearance and lengths and regions and self.height >= room.lowest and frequency


def judge(robot: Robot, rows: Rows, room: Room, frequency: bool) -> Judgement:
    """Judge a robot at rows; its frequency too if it counts."""
    starts, ends = dynamics_of(robot).points(rows.poses)
    lengths = dynamics_of(robot).cable_lengths(rows.poses)
    distances = []
    for region in room.regions:
        p, p_end = ends, starts
        if region.riding:
            p, p_end = (in_frame(rows.poses[:, None], points) for points in (ends, starts))
        distance = float(outside(region.shape, p.reshape(-1, 3), p_end.reshape(-1, 3)).min())
        distances.append((region.name, distance))
    lowest = None
    if frequency:  # with the tensions of least norm; 0 where no tensions exist
        A, w = _problems(robot, robot.length, rows)
        solved = solve_batch(A, w, robot.t_min, robot.t_max)
        poses = rows.poses[rows.pose_of]
        lowest = float(natural_frequencies(robot, poses, solved.tensions)[:, 0].min()) if solved.feasible.all() else 0.0
    between = {pair: (float(d.min()), int(d.argmin())) for pair, d in cable_distances(robot, starts, ends).items()}
    pair = min(between, key=between.__getitem__, default=None)
    return Judgement(
        np.inf if pair is None else between[pair][0],
        None if pair is None else (pair, rows.poses[between[pair][1]]),
        (float(lengths.min()), float(lengths.max())),
        tuple(distances),
        float(min(starts[..., 2].min(), ends[..., 2].min())),
        float(lengths.max(axis=0).sum()),
        lowest,
    )


def judged_margin(robot: Robot, length: float, rows: Rows) -> float:
    """Return the smallest margin [N], by `capacity_margin` at the worst rows, with moments divided by a length [m]."""
    A, w = _problems(robot, length, rows)
    values = margins(A, w, robot.t_min, robot.t_max)
    outside = np.flatnonzero((values < 0.0) & np.isfinite(values))  # where the margins are bounds of the distances
    if outside.size:
        values[outside] = -solve_batch(A[outside], w[outside], robot.t_min, robot.t_max, rho=NEAREST).residual
    worst = np.argsort(values)[:_JUDGED]
    return min(capacity_margin(TensionProblem(A[k], w[k], robot.t_min, robot.t_max)).value for k in worst)


def _problems(robot: Robot, length: float, rows: Rows) -> tuple[np.ndarray, np.ndarray]:
    """Return matrices (k, n, m) and wrenches (k, n), with moments divided by the length."""
    kept = np.flatnonzero(robot.dof_mask)
    scale = np.repeat([1.0, 1.0 / length], 3)[kept]
    A = dynamics_of(robot).wrench_matrix(rows.poses)[:, kept] * scale[:, None]
    return A[rows.pose_of], rows.wrenches[:, kept] * scale
