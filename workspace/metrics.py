"""Metrics: numbers that describe how good a configuration is, for many at once.

`sample` computes them at the samples that it keeps, and the condition `MetricInRange` compares them with limits.
Moments are divided by the characteristic length of the robot, `Robot.length`, where they meet forces.
"""

from collections.abc import Callable, Iterator, Sequence
from math import comb
from typing import Any, NamedTuple

import numpy as np

from ..base.inputs import InputError, one_of, shown
from ..models import Robot
from ..models.dynamics import dynamics_of
from ..models.points import anchors, attachments
from ..solvers import solve_batch
from ..solvers.available_wrench import facets
from ..statics.stiffness import natural_frequencies
from .conditions.interference import least_distance
from .conditions.margin import Margin
from .feasibility import rest_wrench, scaled, wrench_matrices, wrench_rows
from .places import Places, check_places

_PLACES_AT_ONCE, _NUMBERS_AT_ONCE = 2048, 2**21
_SURE = 1e8  # condition numbers squared up to here are those of A A' to eight digits
_NONE = 1e-9  # of a unit vector: this much of it is rounding


class Metric(NamedTuple):
    """A number that describes a configuration."""

    unit: str
    about: str
    values: Callable[[Robot, Places], np.ndarray]  # (n,); nan where it has none


def metric_values(metric: str, robot: Robot, places: Places) -> np.ndarray:
    """Return a metric at each of n configurations, (n,), in the unit `METRICS[metric].unit`.

    It is nan where tensions or a pose at rest are needed and do not exist.

    Raises `InputError` if an argument has a wrong type or value, or the metric does not apply to the robot.
    """
    check_places(robot, places)
    return METRICS[one_of("metric", metric, METRICS)].values(robot, places)


def metric_names(metrics: Any) -> tuple[str, ...]:
    """Return the names of metrics, given as one name or several; raise InputError for others."""
    names = (metrics,) if isinstance(metrics, str) else metrics
    if not isinstance(names, Sequence):
        raise InputError(f"metrics must be names, any of {', '.join(METRICS)}, got {shown(metrics)}")
    return tuple(dict.fromkeys(one_of("metrics", name, METRICS) for name in names))


def _some_matrices(robot: Robot, places: Places) -> Iterator[tuple[slice, np.ndarray]]:
    """Yield wrench matrices like `wrench_matrices`, so few that arrays made of them stay in the cache."""
    rows = wrench_rows(robot)
    normals = rows.size * comb(robot.m, rows.size - 1)  # numbers, of facets
    step = min(_PLACES_AT_ONCE, max(1, _NUMBERS_AT_ONCE // max(normals, 1)))
    for part, A in wrench_matrices(robot, places, rows):
        for start in range(0, len(A), step):
            some = A[start : start + step]
            yield slice(part.start + start, part.start + start + len(some)), some


def _condition_number(robot: Robot, places: Places) -> np.ndarray:
    rows, found = wrench_rows(robot), np.full(len(places), np.inf)
    if robot.m < rows.size:
        return found
    for part, A in _some_matrices(robot, places):
        squares = np.linalg.eigvalsh(A @ A.swapaxes(-1, -2))  # in half the time of singular values
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = squares[:, -1] / squares[:, 0]
            unsure = np.flatnonzero(~((ratio > 0) & (ratio < _SURE)))
            sigma = np.linalg.svd(A[unsure], compute_uv=False)
            result = np.sqrt(np.abs(ratio))
            result[unsure] = sigma[:, 0] / sigma[:, -1]
        found[part] = result
    return found


def _tension_factor(robot: Robot, places: Places) -> np.ndarray:
    """Return the largest r for which tensions between r and 1 give no wrench: no facet's plane may exclude zero.

    Along its normal such tensions give at most the sum of the positive pulls less r times the sum of the negative ones.
    """
    found = np.empty(len(places))
    for part, A in _some_matrices(robot, places):
        walls = facets(A, np.zeros(robot.m), np.ones(robot.m))
        less, more = np.sort([walls.high, -walls.low], axis=0)
        ratio = np.divide(less, more, out=np.ones_like(less), where=more > _NONE)
        found[part] = np.maximum(ratio.min(axis=1), 0.0)
    return found


def _at_rest(robot: Robot, places: Places) -> Iterator[tuple[np.ndarray, np.ndarray, Places]]:
    """Yield indices of configurations, the tensions of least norm that hold them at rest (k, m) [N], and themselves."""
    rows = wrench_rows(robot)
    w = scaled(robot, rest_wrench(robot), rows)
    for part, A in _some_matrices(robot, places):
        solved = solve_batch(A, w, robot.t_min, robot.t_max, threads=1)
        held = np.flatnonzero(solved.feasible)
        yield part.start + held, solved.tensions[held], places.only(part).only(held)


def _natural_frequency(robot: Robot, places: Places) -> np.ndarray:
    found = np.full(len(places), np.nan)
    for at, tensions, held in _at_rest(robot, places):
        found[at] = natural_frequencies(robot, held.pose, tensions, held.carriers)[:, 0]
    return found


def _stiffness(robot: Robot, places: Places, turning: bool) -> np.ndarray:
    """Return the least stiffness in any direction of translation or rotation; the other motions are free."""
    rows = wrench_rows(robot)
    which = np.flatnonzero((rows >= 3) == turning)
    if not which.size:
        motion = "turn" if turning else "move"
        raise InputError(f"metric must be another one for robot {robot.name!r}, whose platform does not {motion}")
    found = np.full(len(places), np.nan)
    for at, tensions, held in _at_rest(robot, places):
        K = dynamics_of(robot).stiffness(held.pose, tensions, held.carriers)[:, rows[:, None], rows]
        values, vectors = np.linalg.eigh((K + K.swapaxes(-1, -2)) / 2)
        stable = values[:, 0] > 0
        some = vectors[stable][:, which]
        compliance = (some / values[stable, None]) @ some.swapaxes(-1, -2)
        found[at] = 0.0
        found[at[stable]] = 1.0 / np.linalg.eigvalsh(compliance)[:, -1]
    return found


def _largest(robot: Robot, places: Places, basis: np.ndarray) -> np.ndarray:
    """Return how much the wrench at rest can change, (n,) [N]; nan where it is not available.

    Along `basis` if that is one direction, (rows,), or in every direction of the space of several, (k, rows).
    """
    w, found = scaled(robot, rest_wrench(robot), wrench_rows(robot)), np.empty(len(places))
    near = _NONE * max(float(np.linalg.norm(w)), _NONE)
    for part, A in _some_matrices(robot, places):
        walls = facets(A, robot.t_min, robot.t_max)
        along, pulls = walls.normals @ w, walls.normals @ basis.T
        held = np.linalg.norm(np.einsum("nij,nj->ni", walls.outside, w - walls.offset), axis=1) <= near
        most = np.full(len(A), np.inf)
        for sign, reserve in ((1.0, walls.high - along), (-1.0, along - walls.low)):
            needed = sign * pulls if basis.ndim == 1 else np.linalg.norm(pulls, axis=2)
            held &= reserve.min(axis=1) >= -near
            possible = np.divide(reserve, needed, out=np.full_like(reserve, np.inf), where=needed > _NONE)
            most = np.minimum(most, possible.min(axis=1))
        flat = np.abs(walls.outside @ basis.T).reshape(len(A), -1).max(axis=1) > _NONE
        found[part] = np.where(held, np.where(flat, 0.0, np.maximum(most, 0.0)), np.nan)
    return found


def _payload(robot: Robot, places: Places) -> np.ndarray:
    if robot.weight == 0:
        raise InputError(f"metric must be another one for robot {robot.name!r} without gravity, got 'payload'")
    w = scaled(robot, rest_wrench(robot), wrench_rows(robot))
    return _largest(robot, places, w / np.linalg.norm(w)) * robot.platform.mass / np.linalg.norm(w)


def _acceleration(robot: Robot, places: Places) -> np.ndarray:
    rows = wrench_rows(robot)
    return _largest(robot, places, np.eye(rows.size)[rows < 3]) / robot.platform.mass


def _cable_distance(robot: Robot, places: Places) -> np.ndarray:
    return least_distance(robot, anchors(robot, places.carriers), attachments(robot, places.pose))


_AT_REST = "with the tensions of least norm at rest"
METRICS: dict[str, Metric] = {
    "margin": Metric("N", "capacity margin at rest", lambda robot, places: Margin().margins(robot, places)),
    "natural_frequency": Metric("Hz", f"lowest natural frequency {_AT_REST}", _natural_frequency),
    "translational_stiffness": Metric(
        "N/m",
        f"least force per displacement of the CoM in any direction {_AT_REST}",
        lambda robot, places: _stiffness(robot, places, turning=False),
    ),
    "rotational_stiffness": Metric(
        "N m",
        f"least moment per angle about any axis {_AT_REST}",
        lambda robot, places: _stiffness(robot, places, turning=True),
    ),
    "condition_number": Metric("1", "condition number of the wrench matrix", _condition_number),
    "dexterity": Metric(
        "1", "reciprocal of the condition number", lambda robot, places: 1.0 / _condition_number(robot, places)
    ),
    "tension_factor": Metric(
        "1", "largest value of smallest / largest tension, over all tensions with A t = 0", _tension_factor
    ),
    "payload": Metric("kg", "largest additional mass at the CoM at rest", _payload),
    "acceleration": Metric("m/s^2", "largest acceleration from rest in every direction", _acceleration),
    "cable_distance": Metric("m", "smallest distance between two cables", _cable_distance),
}
