"""What motions of flying carriers require of actuators, cables and winches: `limits_of`, `excess_of`, `worst_of`."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..base.text import quantity
from ..models import points
from ..models.carriers import Actuator, RigidBody
from ..models.part import inertia_matrix
from ..models.robot import Robot
from ..models.trajectory import Motion
from .winch_forces import largest_forces

ACCEPTED = 2e-3  # of a limit's range: what differences of a plan's motion may seem to exceed it by
UNDERSHOOT = 0.1  # of a smallest tension: the same for tensions, so that no cable pushes
ROUNDING = 1e-6  # of a limit's range
# Of second differences: what values reach beyond those at instants, at most. Poses are parabolas between instants;
# accelerations oscillate where the jerk jumps, since they are differences, and so do forces.
OF_POSES, OF_FORCES = 1 / 8, 1.0
LINEAR = 0.0  # the same of tensions, which are linear between instants
LACKING = 0.01  # of the largest tension: a force that no actuator gives


class Row(NamedTuple):
    """A limit: its name, values (d, n) and their range, and what these reach between instants."""

    name: str
    values: np.ndarray
    low: float
    high: float
    between: float = OF_FORCES


class Carriers(NamedTuple):
    """Constants of the carriers of a team, one row a carrier; those that do not fly have no mass and no actuators."""

    flying: np.ndarray  # (k,), the indices of those that fly
    first: np.ndarray  # (c,), of its cables
    holds: np.ndarray  # (c, m), 1 for each of its cables
    anchors: np.ndarray  # (c, 3), where its cables begin, in its frame [m]
    mass: np.ndarray  # (c, 1) [kg]
    inertia: np.ndarray  # (c, 3, 3) [kg m^2]
    actuators: list[tuple[Actuator, ...]]
    commands: list[np.ndarray]  # (6, k), the commands of each unit wrench


@lru_cache(maxsize=4)
def carriers_of(robot: Robot) -> Carriers:
    """Return the constants of a robot's carriers."""
    holds = np.arange(len(robot.carriers))[:, None] == robot.carrier_of_cable
    bodies = [carrier.body or RigidBody(0.0, (0.0,) * 6) for carrier in robot.carriers]
    actuators = [carrier.actuators for carrier in robot.carriers]
    return Carriers(
        flying=np.flatnonzero([bool(each) for each in actuators]),
        first=(first := holds.argmax(axis=1)),
        holds=holds.astype(float),
        anchors=robot.anchors[first],
        mass=np.array([[body.mass] for body in bodies]),
        inertia=np.array([inertia_matrix(body.inertia) for body in bodies]),
        actuators=actuators,
        commands=[np.linalg.pinv(np.reshape([actuator.wrench for actuator in each], (-1, 6))) for each in actuators],
    )


def pull_of(robot: Robot, forces: np.ndarray) -> np.ndarray:
    """Return the pull of the cables of each carrier, (d, n, c, 3) [N], from their forces on the platform."""
    return -(carriers_of(robot).holds @ forces)


def excess_of(rows: list[Row], begins_inside: bool = True, of_plan: bool = False) -> np.ndarray:
    """Return how far limits are exceeded, (k, d, n), relative to their ranges.

    Unless a stop should begin inside, so much as it has first is no excess. What is undefined is infinitely much. The
    motion `of_plan` itself has been audited between its instants. Values between instants are not estimated for several
    durations.
    """
    low, high, between = np.array([row[2:] for row in rows]).T[..., None, None]  # (k, 1, 1) each
    of_tensions = np.minimum(ACCEPTED, UNDERSHOOT * low / _range(low, high) + ROUNDING)
    accepted = np.where(between == LINEAR, of_tensions, ACCEPTED) if of_plan else ROUNDING
    least, most = _reached(rows, of_plan)
    floor = low if begins_inside else np.minimum(low, least[..., :1])
    ceiling = high if begins_inside else np.maximum(high, most[..., :1])
    beyond = np.where(np.isnan(most), np.inf, np.maximum(floor - least, most - ceiling) / _range(low, high))
    return np.where(beyond > accepted, beyond, 0.0)


def worst_of(rows: list[Row], times: np.ndarray, of_plan: bool = False) -> tuple[float, str]:
    """Return the largest excess of one stop, at times (n,), and the text of that limit; empty if there is none."""
    excess = excess_of(rows, of_plan=of_plan)[:, 0]
    k, at = np.unravel_index(np.argmax(excess), excess.shape)
    if excess[k, at] == 0:
        return 0.0, ""
    row, (least, most) = rows[k], (part[k, 0, at] for part in _reached(rows, of_plan))
    value, bound = (least, row.low) if least < row.low else (most, row.high)
    return float(excess[k, at]), f"{row.name}: {quantity(value)} of {bound:g} at {quantity(times[at], 's')}"


def _reached(rows: list[Row], of_plan: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest values that are reached near each instant of one stop, (k, 1, n) each.

    For several durations, (k, d, n), they are the values at the instants: these are too few to tell more.
    """
    values = np.stack([row.values for row in rows])
    if of_plan or values.shape[1] > 1:
        return values, values
    nearest = np.clip(np.arange(-2, values.shape[2]), 0, values.shape[2] - 3)  # `np.pad` takes ten times as long
    bends = np.abs(np.diff(values, 2))[..., nearest]
    low, between = np.array([(row.low, row.between) for row in rows]).T[..., None, None]
    more = between * np.maximum(np.maximum(bends[..., :-2], bends[..., 1:-1]), bends[..., 2:])
    # Sizes are not below zero.
    return np.maximum(values - more, np.where(low == 0, np.minimum(values, 0.0), -np.inf)), values + more


def _range(low: Any, high: Any) -> Any:
    """Return the range of a limit, which is not zero where both ends are the same."""
    return np.maximum(high - low, ROUNDING * np.abs(high))


def limits_of(
    robot: Robot,
    motion: Motion,
    forces: np.ndarray,
    tensions: np.ndarray,
    turning: tuple[np.ndarray, np.ndarray, np.ndarray],
    windings: np.ndarray | None,
    limits_lacking: bool = False,
) -> list[Row]:
    """Return what a motion of the carriers, (d, n, c, 6) each, requires, and the tensions, (d, n, m) [N].

    `forces` are those of the cables on the platform, (d, n, m, 3) [N], and `windings` those of the motors of winches,
    (d, n, m) [N], if the file describes winches.
    `turning` has their rotations and the first and second derivative of these, (d, n, c, 3, 3) each. If
    `limits_lacking`, a carrier that turns about another point than its anchor has a limit for the force that is missing
    from its actuators: it can turn too quickly for its cables to stay taut.
    """
    its, (_, velocity, acceleration), R, pull = carriers_of(robot), motion, turning[0], pull_of(robot, forces)
    down = R.swapaxes(-1, -2)
    spin, spun = (points.axial(down @ part) for part in turning[1:])
    # `np.einsum`, because `@` takes twice as long for each of many small matrices.
    force = np.einsum("...ji,...j", R, its.mass * (acceleration[..., :3] - np.array(robot.gravity)) - pull)
    impulse, change = (np.einsum("...ij,...j", its.inertia, part) for part in (spin, spun))
    on_anchors = np.einsum("...ji,...j", R[..., robot.carrier_of_cable, :, :], -forces)
    moment = change + points.cross(spin, impulse) - its.holds @ points.cross(robot.anchors, on_anchors)
    wrenches = np.concatenate([force, moment], axis=-1)
    speeds, bends = (np.sqrt(np.einsum("...i,...i", part, part)) for part in (velocity[..., :3], acceleration[..., :3]))
    tilts, ranges = np.arccos(np.clip(R[..., 2, 2], -1, 1)), zip(robot.t_min, robot.t_max, strict=True)
    rows = list[Row]()
    for i, (low, high) in enumerate(ranges):
        rows.append(Row(f"tension {i + 1}", tensions[..., i], low, high, LINEAR))
    if windings is not None:
        most = enumerate(largest_forces(robot))
        rows += [
            Row(f"winch_force of cable {i + 1}", windings[..., i], 0.0, high) for i, high in most if np.isfinite(high)
        ]
    for k, carrier in enumerate(robot.carriers):
        wrench, name, own = wrenches[:, :, k], carrier.name, carrier.motion_limits
        commands = wrench @ its.commands[k]
        rows += [Row(f"{a.name} of {name}", commands[..., i], a.low, a.high) for i, a in enumerate(its.actuators[k])]
        if limits_lacking and its.actuators[k] and its.anchors[k].any():
            given = commands @ np.array([a.wrench for a in its.actuators[k]])
            lacking = np.linalg.norm((wrench - given)[..., :3], axis=-1)
            most = max(robot.t_min[its.first[k]], LACKING * robot.t_max[its.first[k]])
            rows.append(Row(f"force perpendicular to the thrust of {name}", lacking, 0.0, most))
        for what, values, largest, between in (
            ("speed", speeds, own.speed, OF_FORCES),
            ("acceleration", bends, own.acceleration, OF_FORCES),
            ("tilt", tilts, own.tilt, OF_POSES),
        ):
            rows += [] if largest is None else [Row(f"{what} of {name}", values[..., k], 0.0, largest, between)]
    return rows
