"""How good a robot is at given rows, by functions that share no code with the search; and what binds at the optimum."""

from typing import NamedTuple

import numpy as np

from ..models import Robot
from ..models.dynamics import dynamics_of
from ..models.points import in_frame
from ..solvers import TensionProblem, capacity_margin, solve_batch
from ..solvers.margin import margins
from ..statics.stiffness import natural_frequencies
from ..workspace.conditions.interference import cable_distances, outside
from ..workspace.feasibility import NEAREST
from .evaluation import Evaluation, Rows
from .goal import Goal
from .linear_programs import LITTLE, multipliers
from .room import Room
from .variables import Variables

_JUDGED = 100  # worst rows, by `capacity_margin`
_CONVERGED = 1e-3  # of the margin that is maximised, or of `LITTLE`: what a program still gains at a local optimum
_SMALL = 1e-6


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


class Binding(NamedTuple):
    """A required wrench that limits the margin.

    Its weight is its share of the multipliers, which sum to one. The direction, outward and of length one in newtons,
    is where the reserve is least, and the cables, counted from 0, are at t_max or t_min there.
    """

    pose: np.ndarray  # (6,)
    wrench: np.ndarray  # (6,), about the CoM in {G} [N, N m]
    weight: float
    direction: np.ndarray  # (6,), as in `Certificate`
    at_max: tuple[int, ...]
    at_min: tuple[int, ...]


class Advice(NamedTuple):
    """The gain per unit of a change, to first order: of margin or frequency, or by which mean t_max or cost falls."""

    change: str
    gain: float
    unit: str


class Reasons(NamedTuple):
    """Binding wrenches, changes that would help, and whether the layout is a local optimum."""

    binding: tuple[Binding, ...]
    advice: tuple[Advice, ...]
    local_optimum: bool
    at_bounds: int
    of_margin: bool  # whether the gains are of margin, which is maximised or still less than required


def reasons(evaluation: Evaluation, goal: Goal, y: np.ndarray) -> Reasons:
    """Return the reasons why the goal of a layout is not reached further."""
    variables, rows = evaluation.variables, evaluation.rows
    robot, found = variables.robot, multipliers(evaluation, goal, y)
    kept = np.flatnonzero(robot.dof_mask)
    direction = np.zeros((found.rows.size, 6))
    if found.rows.size:
        direction[:, kept] = found.direction * robot.wrench_scale[kept]
    total = float(found.weights.sum())
    binding = [
        Binding(
            rows.poses[rows.pose_of[row]],
            rows.wrenches[row],
            float(weight / total),
            d,
            tuple(np.flatnonzero(pull > _SMALL).tolist()),
            tuple(np.flatnonzero(pull < -_SMALL).tolist()),
        )
        for row, weight, d, pull in zip(found.rows, found.weights, direction, found.pull, strict=True)
    ]
    binding.sort(key=lambda one: -one.weight)
    margin = float(evaluation.margins(y).min())
    span = variables.high - variables.low
    bound = (span > 0.0) & (np.minimum(y - variables.low, variables.high - y) <= 1e-9 * np.maximum(span, 1.0))
    # Otherwise the margin is as required, and the program improves t_max, cost or frequency.
    of_margin = bool(np.isinf(goal.wanted) or total > 1.0 - _SMALL)
    scale = LITTLE * robot.force_scale
    if of_margin:
        scale = max(scale, abs(margin))
    advice = _advice(robot, found.weights, found.pull, direction, rows.accelerations[found.rows])
    if not of_margin:
        advice[:1] = [Advice("margin lower by 1 N", total, "N/N")]
    if goal.per_hertz or evaluation.room.frequency:
        del advice[1:]  # t_min and mass change the frequencies, too
    advice += _of_boxes(variables, found.by_high, found.by_low)
    unit, name = (1.0, "N/") if of_margin else (goal.unit, f"{goal.unit_text}/")
    return Reasons(
        tuple(binding),
        tuple(Advice(one.change, one.gain / unit, one.unit.replace("N/", name, 1)) for one in advice),
        bool(found.left <= _CONVERGED * scale and evaluation.missing(y) <= 0.0),
        int(bound.sum()),
        of_margin,
    )


def _advice(
    robot: Robot, weights: np.ndarray, pull: np.ndarray, direction: np.ndarray, accelerations: np.ndarray
) -> list[Advice]:
    """Return what stronger cables, a lower smallest tension and a lighter platform would gain."""
    stronger = float(weights @ np.maximum(pull, 0.0).sum(axis=1))
    slacker = -float(weights @ np.minimum(pull, 0.0).sum(axis=1))
    free_to_fall = (accelerations[:, :3] - np.array(robot.gravity)) * robot.dof_mask[:3]
    heavier = -float(weights @ (direction[:, :3] * free_to_fall).sum(axis=1))
    return [
        Advice("t_max of every cable higher by 1 N", stronger, "N/N"),
        Advice("t_min of every cable lower by 1 N", slacker, "N/N"),
        Advice("platform heavier by 1 kg" if heavier > 0.0 else "platform lighter by 1 kg", abs(heavier), "N/kg"),
    ]


def _of_boxes(variables: Variables, by_high: np.ndarray, by_low: np.ndarray) -> list[Advice]:
    """Return what larger boxes of points would gain, by part and axis."""
    sums: dict[tuple[str, str], float] = {}
    for name, up, down in zip(variables.names, by_high, by_low, strict=True):
        _, part, *axis = name.split(".")
        if axis:
            sums[part, axis[0]] = sums.get((part, axis[0]), 0.0) + float(up + down)
    return [
        Advice(f"boxes of {part}s longer by 1 m at each end along {axis}", gain, "N/m")
        for (part, axis), gain in sums.items()
        if gain > _SMALL
    ]
