"""`likely_order`: the order of cables that readings and orientations show where positions are unknown.

Readings change with the position, to first order by three directions: the space that the changes of all cables span is
that of their directions at home, in the right order and in any frame. Orders with the nearest spaces are compared by
how well positions, a heading of the orientations and offsets explain the readings.
"""

from itertools import permutations

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import points
from ...models.robot import Robot
from .geometry import length_of, runs
from .parameters import Parameters

MOST_CABLES = 8  # of which all orders are compared
NEAREST, LIKELY = 200, 6  # orders that are compared by a few samples, and by all
FEW, ALL = 12, 40  # samples
HEADINGS = 6  # from which the descents start
STEPS = 12
FARTHEST, TURN = 0.5, 0.5  # of the cables' mean length and [rad], of a step
NEAR = 0.01  # of the cables' mean length, of differences by wrong anchors
CLEARLY, RIVAL = 5.0, 1.5  # times smaller differences than in the given order, and than in any third one


def likely_order(robot: Robot, lengths: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the column of the readings for each cable, (m,), as given if no other order fits much better.

    The second result is True if no third order fits as well, as of a symmetric robot.

    - `lengths`: unstrained lengths by the readings (N, m) [m], at the orientations `rotation` (N, 3, 3).
    """
    m, home, parameters = robot.m, robot.home[None], Parameters(robot, ())
    same = np.arange(m)
    if m > MOST_CABLES:
        return same, True
    table = parameters.table(parameters.first)
    first = 2 * np.pi * np.arange(HEADINGS) / HEADINGS
    few = np.unique(np.linspace(0, len(lengths) - 1, min(len(lengths), FEW)).astype(int))
    as_given = _descended(robot, table, np.tile(lengths[few], (HEADINGS, 1, 1)), rotation[few], first)[0]
    if as_given.min() < NEAR * length_of(robot):
        return same, True
    directions = runs(robot, table, home[:, :3], points.rotations(home[:, 3:])).by_pose[:, 0, :3]
    basis = np.linalg.svd(directions, full_matrices=False)[0]
    changes = np.linalg.svd(lengths - lengths.mean(axis=0), full_matrices=False)[2][:3]
    given, expected = changes.T @ changes, basis @ basis.T
    orders = np.array(list(permutations(range(m))))  # the first is the given one
    near = (given[orders[:, :, None], orders[:, None]] * expected).sum(axis=(1, 2))
    near[0] = np.inf
    orders = orders[np.argsort(-near)[:NEAREST]]
    k = len(orders)
    first = np.repeat(first, k)
    for count in (FEW, ALL):
        few = np.unique(np.linspace(0, len(lengths) - 1, min(len(lengths), count)).astype(int))
        y = lengths[few][:, orders].swapaxes(0, 1)
        sizes, headings = _descended(robot, table, np.tile(y, (len(first) // k, 1, 1)), rotation[few], first)
        best = sizes.reshape(-1, k).argmin(axis=0) * k + np.arange(k)
        best = best[np.concatenate([[0], 1 + np.argsort(sizes[best[1:]])])][:LIKELY]
        orders, first, k = orders[best % k], headings[best], len(best)
    given_size, least, rival = sizes[best[:3]]
    return (orders[1], bool(RIVAL * least < rival)) if CLEARLY * least < given_size else (same, True)


def _descended(
    robot: Robot, table: np.ndarray, y: np.ndarray, rotation: np.ndarray, heading: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the differences [m] that positions, offsets and headings leave of readings, (S,), and headings (S,) [rad].

    An offset costs as much as a difference of its size in one sample.

    - `y`: readings (S, N, m) [m], at the measured orientations `rotation` (N, 3, 3).
    - `heading`: turns about the vertical to start from, (S,) [rad].
    """
    m, up = robot.m, -np.array(robot.gravity) / np.linalg.norm(robot.gravity)
    x, offsets = np.tile(robot.home[:3], (*y.shape[:2], 1)), np.zeros((len(y), m))
    shared = np.empty((*y.shape, m + 1))  # differences by offsets and by the heading
    shared[..., :m] = -np.eye(m)
    prior = np.diag([*np.ones(m), 0.0])

    def differences() -> tuple[np.ndarray, np.ndarray]:
        R = Rotation.from_rotvec(heading[:, None] * up).as_matrix()[:, None] @ rotation
        run = runs(robot, table, x.reshape(-1, 3), R.reshape(-1, 3, 3))
        e = run.lengths.T.reshape(y.shape) - y - offsets[:, None]
        return e, run.by_pose.swapaxes(0, 1).reshape(*y.shape, 6)

    for _ in range(STEPS):
        e, by = differences()
        shared[..., m] = by[..., 3:] @ up
        shift, inverse = by[..., :3], np.linalg.pinv(by[..., :3])
        rest = shared - shift @ (inverse @ shared)  # that no position explains
        H = np.einsum("snmi,snmj->sij", rest, rest) + prior
        g = np.einsum("snmi,snm->si", rest, e) + np.hstack([offsets, np.zeros((len(y), 1))])
        change = -np.linalg.solve(H + 1e-9 * np.eye(m + 1), g[..., None])[..., 0]
        change[:, m] = np.clip(change[:, m], -TURN, TURN)
        dx = -(inverse @ (e[..., None] + shared @ change[:, None, :, None]))[..., 0]
        size = np.linalg.norm(dx, axis=2, keepdims=True)
        x = x + dx * np.minimum(1.0, FARTHEST * length_of(robot) / np.maximum(size, 1e-12))
        offsets, heading = offsets + change[:, :m], heading + change[:, m]
    e = differences()[0]
    squares = (e**2).sum(axis=(1, 2)) + (offsets**2).sum(axis=1)
    return np.sqrt(np.nan_to_num(squares, nan=np.inf) / e[0].size), heading
