"""`likely_order`: the order of cables that readings and orientations show where positions are unknown.

Readings change with the position, to first order by three directions: the space that the changes of all cables span is
that of their directions at home, in the right order and in any frame. Orders with the nearest spaces are compared by
their likelihoods with the best positions, heading of the orientations and offsets.
"""

from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import points
from ...models.robot import Robot
from .differences import PLAUSIBLE
from .geometry import length_of, runs
from .parameters import Parameters

MOST_CABLES = 8  # of which all orders are compared
NEAREST, LIKELY = 200, 8  # orders that are compared by a few samples, and by all
FEW, ALL = 12, 40  # samples
HEADINGS = 6  # from which the descents start
STEPS = 15
TINY = 1e-6  # so that matrices have an inverse
FARTHEST, TURN = 0.5, 0.5  # of the cables' mean length and [rad], of a step
LENGTHS, TURNS = 5e-4, np.radians(0.5)  # least noise, of the cables' mean length and [rad]
OFFSETS = 0.01  # of the cables' mean length; smaller offsets are no more likely
CLEARLY = 30.0  # of -2 times the logarithm of a likelihood ratio
UNEXPLAINED = 3.0  # times the squares that noise leaves: another robot, or orientations of another sensor
HALF = np.diag([-1.0, 1, -1])  # on both sides, this is a reflection of orientations
MOUNTS = Rotation.create_group("O").as_matrix()
UPWARD = [MOUNTS[np.argmax(MOUNTS[:, 2] @ axis)] for axis in np.vstack([np.eye(3), -np.eye(3)])]


class Likely(NamedTuple):
    """The most likely order of cables, and the heading of the orientations.

    Attributes:
        columns: Column of the readings for each cable, (m,).
        sure: False if a third order is about as likely, as of a symmetric robot or of four cables.
        heading: Turn about the vertical from the measured orientations [rad]; 0 if they are as likely without it.
        explained: True if noise and displaced anchors explain the readings in the given order.
    """

    columns: np.ndarray
    sure: bool = True
    heading: float = 0.0
    explained: bool = False


def likely_order(robot: Robot, lengths: np.ndarray, rotation: np.ndarray, noise: tuple[float, float]) -> Likely:
    """Return the most likely order of cables, the given one if no other is much more likely.

    Left-handed axes of the orientations, and for the given order any axes, are compared as well.

    - `lengths`: unstrained lengths by the readings (N, m) [m], at the orientations `rotation` (N, 3, 3).
    - `noise`: standard deviations of readings [m] and of orientations about each axis [rad].
    """
    m, home, parameters = robot.m, robot.home[None], Parameters(robot, ())
    same = np.arange(m)
    if m > MOST_CABLES:
        return Likely(same)
    least_noise = LENGTHS * length_of(robot), TURNS
    model = _Model(robot, parameters.table(parameters.first), *np.maximum(noise, least_noise))
    few, many = (np.unique(np.linspace(0, len(lengths) - 1, min(len(lengths), n)).astype(int)) for n in (FEW, ALL))
    count = len(many) * (m - 3)  # of differences that positions leave
    as_given, heading = model.heading(lengths[many], rotation[many])
    if as_given < count + CLEARLY:
        return Likely(same, True, heading, True)
    directions = runs(robot, model.table, home[:, :3], points.rotations(home[:, 3:])).by_pose[:, 0, :3]
    basis = np.linalg.svd(directions, full_matrices=False)[0]
    changes = np.linalg.svd(lengths - lengths.mean(axis=0), full_matrices=False)[2][:3]
    given, expected = changes.T @ changes, basis @ basis.T
    others = np.array(list(permutations(range(m))))[1:]  # without the given one
    near = (given[others[:, :, None], others[:, None]] * expected).sum(axis=(1, 2))
    others = others[np.argsort(-near)[:NEAREST]]
    framed = np.array([up @ rotation @ mount for up in UPWARD for mount in MOUNTS])
    framed = np.array([rotation, HALF @ rotation @ HALF, *framed])
    orders = np.concatenate([others, others, np.tile(same, (len(framed), 1))])
    axes = np.concatenate([np.repeat([0, 1], len(others)), np.arange(len(framed))])
    best = np.argsort(model.costs(lengths[few][:, orders].swapaxes(0, 1), framed[axes][:, few], False)[0])[:LIKELY]
    orders, axes = orders[best], axes[best]
    costs, _ = model.costs(lengths[many][:, orders].swapaxes(0, 1), framed[axes][:, many], True)
    order, least = orders[np.argmin(costs)], float(costs.min())
    clearly = least + CLEARLY * max(1.0, least / count)
    as_given = min(as_given, costs[(orders == same).all(axis=1)].min(initial=np.inf))
    if least > UNEXPLAINED * count or as_given < clearly:
        return Likely(same)
    heading = model.heading(lengths[many][:, order], rotation[many])[1] if axes[np.argmin(costs)] == 0 else 0.0
    return Likely(order, bool(costs[(orders != order).any(axis=1)].min(initial=np.inf) > clearly), heading)


class _Model(NamedTuple):
    """A robot whose readings and orientations have noise, and whose anchors may be displaced."""

    robot: Robot
    table: np.ndarray  # parameters of the cables in the file, (m, 15)
    length: float  # standard deviation of readings [m]
    turn: float  # standard deviation of orientations about each axis [rad]

    def heading(self, y: np.ndarray, rotation: np.ndarray) -> tuple[float, float]:
        """Return the cost of readings (N, m) [m], and the turn about the vertical [rad], 0 if none is as likely."""
        (cost,), (heading,) = self.costs(y[None], rotation[None], True)
        without = self._descended(y[None], rotation[None], np.zeros(1), True, False)[0][0]
        turn = np.arctan2(np.sin(heading), np.cos(heading))
        clear = without > cost + CLEARLY * max(1.0, cost / (len(y) * (self.robot.m - 3)))
        return float(cost), float(turn) if clear else 0.0

    def costs(self, y: np.ndarray, rotation: np.ndarray, displaced: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return -2 times the log-likelihoods (S,) of readings with the best positions, headings and offsets.

        The second result is these headings, (S,) [rad], relative to the measured orientations.

        Anchors may be displaced by `PLAUSIBLE` if `displaced`. How large the offsets are is unknown.

        - `y`: readings (S, N, m) [m], at the measured orientations `rotation` (S, N, 3, 3).
        """
        first = np.repeat(2 * np.pi * np.arange(HEADINGS) / HEADINGS, len(y))
        y, rotation = np.tile(y, (HEADINGS, 1, 1)), np.tile(rotation, (HEADINGS, 1, 1, 1))
        costs, headings = (one.reshape(HEADINGS, -1) for one in self._descended(y, rotation, first, displaced))
        best = costs.argmin(axis=0), np.arange(costs.shape[1])
        return costs[best], headings[best]

    def _descended(
        self, y: np.ndarray, rotation: np.ndarray, heading: np.ndarray, displaced: bool, turning: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the `costs` and headings near those to start from, (S,) [rad], or at these if not `turning`."""
        robot, m, scale = self.robot, self.robot.m, length_of(self.robot)
        up = -np.array(robot.gravity) / max(np.linalg.norm(robot.gravity), 1e-12)
        x, few = np.tile(robot.home[:3], (*y.shape[:2], 1)), OFFSETS * scale
        shared = np.zeros((len(y), m + 1 + 3 * m * displaced))  # offsets, heading and displacements of anchors
        by, weights = np.zeros((*y.shape, shared.shape[1])), np.zeros(shared.shape)
        by[..., :m] = -np.eye(m)
        weights[:, :m], weights[:, m + 1 :] = few**-2, (PLAUSIBLE * scale) ** -2
        own = np.arange(m)[:, None], m + 1 + np.arange(3 * m * displaced).reshape(-1, 3)
        steps = STEPS
        while True:
            R = Rotation.from_rotvec((heading + shared[:, m])[:, None] * up).as_matrix()[:, None] @ rotation
            run = runs(robot, self.table, x.reshape(-1, 3), R.reshape(-1, 3, 3))
            by_pose = run.by_pose.swapaxes(0, 1).reshape(*y.shape, 6)
            by[..., m] = by_pose[..., 3:] @ up * turning
            if displaced:
                by[:, :, *own] = run.by_geometry[..., :3].swapaxes(0, 1).reshape(*y.shape, 3)
            turns, still = self.turn * by_pose[..., 3:], shared * (np.arange(shared.shape[1]) != m)
            e = run.lengths.T.reshape(y.shape)[..., None] - y[..., None] + by @ still[:, None, :, None]
            noise = self.length**2 * np.eye(m) + turns @ turns.swapaxes(2, 3)
            whiten = np.linalg.inv(np.linalg.cholesky(np.nan_to_num(noise)))
            e, by_shared, shift = whiten @ e, whiten @ by, whiten @ by_pose[..., :3]
            spread = (shared[:, :m] ** 2).mean(axis=1) + few**2
            if not steps:
                penalty = m * np.log(spread / few**2) + (weights * shared**2)[:, m + 1 :].sum(axis=1)
                return np.nan_to_num((e**2).sum(axis=(1, 2, 3)) + penalty, nan=np.inf), heading + shared[:, m]
            steps -= 1
            weights[:, :m] = 1 / spread[:, None]
            across = shift.swapaxes(2, 3)
            inverse = np.linalg.solve(across @ shift + TINY / self.length**2 * np.eye(3), across)
            rest = by_shared - shift @ (inverse @ by_shared)  # that no position explains
            H = np.einsum("snmi,snmj->sij", rest, rest) + weights[:, None] * np.eye(shared.shape[1])
            g = np.einsum("snmi,snm->si", rest, e[..., 0]) + weights * shared
            change = -np.linalg.solve(H + TINY * np.eye(shared.shape[1]), g[..., None])[..., 0]
            change[:, m] = np.clip(change[:, m], -TURN, TURN)
            dx = -(inverse @ (e + by_shared @ change[:, None, :, None]))[..., 0]
            size = np.linalg.norm(dx, axis=2, keepdims=True)
            x, shared = x + dx * np.minimum(1.0, FARTHEST * scale / np.maximum(size, 1e-12)), shared + change
