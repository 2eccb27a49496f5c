"""`doubt`: detect input errors of a log before the fit, which would hide them in wrong parameters.

With the right order of cables, units and convention of angles, the difference between a cable's length at the measured
poses and its reading hardly changes: it is the offset plus the effect of a displaced anchor. So other interpretations
of the log are tried, with the order of cables that has the smallest differences (an assignment problem). An error is
named if the differences become much smaller without it. If they are already as small as the stated standard deviation,
nothing is tried.

Conventions of angles differ little if the platform turns little. With e the differences of the given log and e' those
of another convention, of variance s^2, the sum of e^2 - e'^2 is |e - e'|^2 if the other is right, and has the standard
deviation 2 s |e - e'| (a likelihood ratio). Conventions that cannot be distinguished are named together.
"""

from collections.abc import Iterator
from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.text import quantity
from ...models import points
from ...models.robot import Robot
from ..logs.measurements import Measurements, measured_poses
from .geometry import runs
from .parameters import Parameters

CLEARLY, VERY_CLEARLY = 1.25, 2.0  # times smaller differences
SIGNIFICANT, TOLD_APART = 6.0, 5.0  # standard deviations by which one convention of angles is likelier than another
BY_CHANCE = 3.0  # standard deviations by which the squares of noise may exceed what was stated
LONG_TAIL = 4.0  # median sizes; differences beyond are wrong readings
EXPLAINED = 0.1  # of the change of the readings, which differences are below if lengths and poses belong together
MOST_SAMPLES = 400
FEWEST = 12, 24  # samples of which anchors, and attachments, are taken into account
LARGEST = 10.0  # times the cables' mean length, of a change of readings
FACTORS = {1e-3: "millimetres", 1e-2: "centimetres"}
ANGLES = ("roll", "pitch", "yaw")


class _Reading(NamedTuple):
    """An interpretation of the log: the error that it corrects, the poses, and the factor of the readings."""

    slip: str
    position: np.ndarray
    rotation: np.ndarray
    factor: float = 1.0
    turns: bool = False


def doubt(robot: Robot, measurements: Measurements) -> str | None:
    """Return the probable input error of the log, in one line, or None."""
    parameters = Parameters(robot, ())
    table = parameters.table(parameters.first)
    position, rotation, known = measured_poses(robot, measurements)
    rows = np.flatnonzero(known[:, robot.dof_mask > 0].all(axis=1))
    if len(rows) > MOST_SAMPLES:
        rows = rows[np.linspace(0, len(rows) - 1, MOST_SAMPLES).astype(int)]
    readings = measurements.lengths * table[:, 7]
    if len(rows) < 4:
        return _too_large(robot, readings)
    y, order, sigma = readings[rows], np.arange(robot.m), measurements.sigma.lengths
    first = _Reading("", position[rows], rotation[rows])
    e = _left(robot, parameters, first, y, order[:, None])[:, 0]
    noise = sigma * np.sqrt(1 + BY_CHANCE * np.sqrt(2 / e.size))
    if _root_mean_square(e) <= noise:
        return None
    given = np.inf
    ways: list[tuple[float, float, str]] = []
    turns: list[tuple[np.ndarray, float, str]] = []
    angles = None if measurements.poses is None else measurements.poses[rows, 3:]
    for reading in _ways(first, angles):
        left = _left(robot, parameters, reading, y, np.tile(order, (robot.m, 1))) / abs(reading.factor)
        as_given, assigned, columns = _sizes(np.median(np.abs(left), axis=2))
        if not reading.slip:
            given = as_given
        elif reading.turns:
            turns.append((left[order, order], as_given, reading.slip))
        else:
            ways.append((VERY_CLEARLY * as_given, as_given, reading.slip))
        # Two slips at once are less likely than one.
        least = 1.0 if not reading.slip else CLEARLY if reading.turns else VERY_CLEARLY
        ways.append((VERY_CLEARLY * least * assigned, assigned, _and(reading.slip, columns, order)))
    likeliest = _likeliest(e, turns)
    if likeliest is not None:
        other, size, slip = likeliest
        # Errors that are no noise may seem smaller in another convention by chance.
        ways.append(((1.0 if _root_mean_square(other) <= noise else CLEARLY) * size, size, slip))
    weighted, size, slip = min(way for way in ways if way[2])
    change = float(np.median(np.abs(y - np.median(y, axis=0))))
    if not (weighted < given and size < EXPLAINED * change):
        return None
    return (
        f"{slip}: lengths and poses of the log then agree {quantity(given / max(size, 1e-12), digits=2)} times better"
    )


def _root_mean_square(e: np.ndarray) -> float:
    """Return the size of differences, with a bound on outliers."""
    limit = LONG_TAIL * float(np.median(np.abs(e)))
    return float(np.sqrt((np.clip(e, -limit, limit) ** 2).mean()))


def _likelier(e: np.ndarray, other: np.ndarray) -> float:
    """Return by how many standard deviations the differences `other` are more likely than e, both (m, N)."""
    if not np.isfinite(other).all():
        return -np.inf
    limit = LONG_TAIL * float(np.median(np.abs(other)))
    one, two = np.clip(e, -limit, limit), np.clip(other, -limit, limit)
    spread = 2 * float(np.sqrt((two**2).mean()) * np.linalg.norm(one - two))
    return float((one**2).sum() - (two**2).sum()) / max(spread, 1e-300)


def _likeliest(e: np.ndarray, turns: list[tuple[np.ndarray, float, str]]) -> tuple[np.ndarray, float, str] | None:
    """Return the convention of angles that is much more likely than the given one, with its equivalents."""
    best: tuple[np.ndarray, float, str] | None = None
    for turn in turns:
        if _likelier(e if best is None else best[0], turn[0]) > (SIGNIFICANT if best is None else 0.0):
            best = turn
    if best is None:
        return None
    equals = [text for other, _, text in turns if text != best[2] and _likelier(other, best[0]) < TOLD_APART]
    if len(equals) > 1:
        return (*best[:2], "the angles seem to have another convention, which cannot be determined")
    return (*best[:2], best[2] + "".join(f", or {text.removeprefix('the angles look ')}" for text in equals))


def _too_large(robot: Robot, readings: np.ndarray) -> str | None:
    """Return the error if readings (N, m) change more than any cable of the robot can, or None."""
    length = float(np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean())
    change = float(np.median(np.ptp(readings, axis=0)))
    if change <= LARGEST * length:
        return None
    return (
        f"the lengths look like {FACTORS[1e-3]} read as metres: they change by {quantity(change, 'm', digits=3)}, "
        f"and a cable of {robot.name} is about {quantity(length, 'm', digits=3)} long"
    )


def _ways(first: _Reading, angles: np.ndarray | None) -> Iterator[_Reading]:
    """Yield interpretations of the log, the given one first."""
    yield first
    position, rotation = first.position, first.rotation
    for factor, unit in FACTORS.items():
        yield _Reading(f"the lengths look like {unit} read as metres", position, rotation, factor)
        yield _Reading(f"the positions look like {unit} read as metres", factor * position, rotation)
        both = f"lengths and positions look like {unit} read as metres"
        yield _Reading(both, factor * position, rotation, factor)
    yield _Reading(
        "the lengths seem to have the wrong sign, as if their scales were negative", position, rotation, -1.0
    )
    if angles is None or not np.ptp(angles, axis=0).any():
        return
    whole = Rotation.from_matrix(rotation)
    x, y, z, w = whole.as_quat().T
    scalar_first, scalar_last = (
        Rotation.from_quat(np.column_stack(parts)).as_matrix() for parts in ([y, z, w, x], [w, x, y, z])
    )
    turns = {
        "the angles look like degrees read as radians": points.rotations(np.radians(angles)),
        "the angles look like radians read as degrees": points.rotations(np.degrees(angles)),
        "the orientations look inverted, from {G} to the platform": np.swapaxes(rotation, 1, 2),
        "the quaternions look like (w, x, y, z) read as (x, y, z, w)": scalar_first,
        "the quaternions look like (x, y, z, w) read as (w, x, y, z)": scalar_last,
        "the angles look like a rotation vector": Rotation.from_rotvec(angles).as_matrix(),
    }
    for axes in permutations("xyz"):
        for text, columns in ((", ".join(ANGLES), [0, 1, 2]), (", ".join(ANGLES[::-1]), [2, 1, 0])):
            if "".join(axes) + text == "xyz" + ", ".join(ANGLES):
                continue  # as they are read
            about = angles[:, columns]
            matrices = Rotation.from_euler("".join(axes), about[:, ["xyz".index(axis) for axis in axes]]).as_matrix()
            turns[f"the angles look like {text} about {', '.join(axes)} of {{G}}, one after the other"] = matrices
    for slip, matrices in turns.items():
        yield _Reading(slip, position, matrices, turns=True)


def _left(robot: Robot, parameters: Parameters, reading: _Reading, y: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the differences between the length of cable i and column j, for the columns (m, k), (m, k, N) [m].

    An offset is subtracted and, with enough samples, displacements of anchor and attachment.
    """
    run = runs(robot, parameters.table(parameters.first), reading.position, reading.rotation)
    explained = [np.ones((*run.lengths.shape, 1))]
    if len(y) >= FEWEST[0]:
        explained.append(run.directions)
    if len(y) >= FEWEST[1]:
        explained.append(run.by_geometry[..., 3:6])
    Q = np.linalg.qr(np.concatenate(explained, axis=2))[0]  # (m, N, c)
    differences = run.lengths[:, None] - reading.factor * y.T[columns]
    left = differences - np.matmul(np.matmul(differences, Q), np.swapaxes(Q, 1, 2))
    return left * np.sqrt(len(y) / (len(y) - Q.shape[2]))


def _sizes(apart: np.ndarray) -> tuple[float, float, np.ndarray]:
    """Return the root mean square of differences in the given order and in the best one, and this order (m,)."""
    from scipy.optimize import linear_sum_assignment

    if not np.isfinite(apart).all():
        return np.inf, np.inf, np.arange(len(apart))
    columns = linear_sum_assignment(apart**2)[1]
    rows = np.arange(len(apart))
    return float(np.sqrt((np.diag(apart) ** 2).mean())), float(np.sqrt((apart[rows, columns] ** 2).mean())), columns


def _and(slip: str, columns: np.ndarray, order: np.ndarray) -> str:
    """Return an input error, and the columns of the log that belong to the cables."""
    moved = np.flatnonzero(columns != order)
    if not moved.size:
        return slip
    if moved.size == 2:
        text = f"l{moved[0]} and l{moved[1]} look exchanged"
    else:
        text = f"the cables look like columns {', '.join(f'l{column}' for column in columns)} of the log, in this order"
    return f"{slip}, and {text}" if slip else text
