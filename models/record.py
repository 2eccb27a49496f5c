"""A robot as the plain record that the numeric core reads: `record_of`, and the layout of core/robot.h."""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..core import MOST_CABLES, MOST_CARRIERS
from .carriers import Carrier
from .part import COORDINATES, inertia_matrix
from .robot import Robot

RESTS, FREE, LAGGED, IMPOSED = range(4)  # `towline_motion`
MOST_ACTUATORS = 6

_ACTUATOR = np.dtype([("wrench", "f8", 6), ("low", "f8"), ("high", "f8")])
_BODY = np.dtype(
    [
        ("motion", "i4"),
        ("actuators", "i4"),
        ("mass", "f8", 3),
        ("inverse_mass", "f8", 3),
        ("inertia", "f8", (3, 3)),
        ("inverse_inertia", "f8", (3, 3)),
        ("speed_max", "f8"),
        ("acceleration_max", "f8"),
        ("actuator", _ACTUATOR, MOST_ACTUATORS),
    ]
)
_CABLE = np.dtype(
    [
        ("carrier", "i4"),
        ("has_winch", "i4"),
        ("anchor", "f8", 3),
        ("attachment", "f8", 3),
        ("axis", "f8", 3),
        *((name, "f8") for name in ("radius", "stiffness", "damping")),
        *((f"winch_{name}", "f8") for name in ("inertia", "friction", "speed_max", "force_max")),
    ]
)
RECORD = np.dtype(
    [
        *((name, "i4") for name in ("carriers", "cables", "printed_aero", "has_aero")),
        ("mass", "f8"),
        ("com", "f8", 3),
        ("gravity", "f8", 3),
        ("drag", "f8"),
        ("lift", "f8"),
        ("freedom", "f8", 6),
        ("force_scale", "f8"),
        ("length_scale", "f8"),
        ("body", _BODY, 1 + MOST_CARRIERS),
        ("cable", _CABLE, MOST_CABLES),
    ]
)


def fits(robot: Robot) -> bool:
    """Return whether the core has room for all cables, carriers and actuators of a robot."""
    return not any(_misfits(robot))


@lru_cache(maxsize=16)
def record_of(robot: Robot) -> np.ndarray:
    """Return the record of a robot, of `RECORD`, shape (); it is kept for the next call and cannot be written to.

    Stiffness and damping are from the file, 0 where it has none. Raises `InputError` if the robot has more
    cables, carriers or actuators than the core has room for.
    """
    for misfit in _misfits(robot):
        raise InputError(misfit)
    record = np.zeros((), RECORD)
    record["carriers"], record["cables"], record["mass"] = len(robot.carriers), robot.m, robot.platform.mass
    record["com"], record["gravity"], record["freedom"] = robot.platform.com, robot.gravity, robot.dof_mask
    record["force_scale"] = robot.force_scale
    record["length_scale"] = max(np.abs(robot.home_anchors).max(), np.abs(robot.home_attachments).max(), 1.0)
    if aero := robot.platform.aero:
        pressure = 0.5 * aero.air_density * aero.area
        record["has_aero"], record["printed_aero"] = True, aero.form == "printed"
        record["drag"], record["lift"] = pressure * aero.drag, pressure * aero.lift
    _write_platform(record["body"][0], robot)
    for body, carrier in zip(record["body"][1:], robot.carriers, strict=False):
        _write_carrier(body, carrier, robot)
    _write_cables(record["cable"][: robot.m], robot)
    record.flags.writeable = False
    return record


def _misfits(robot: Robot) -> Iterator[str]:
    """Yield a message for each thing of which the robot has more than the core has room for."""
    whose = f"robot {robot.name!r}"
    counts = [(whose, "cables", MOST_CABLES, robot.m), (whose, "carriers", MOST_CARRIERS, len(robot.carriers))]
    counts += [(f"carrier {each.name}", "actuators", MOST_ACTUATORS, len(each.actuators)) for each in robot.carriers]
    for owner, name, most, count in counts:
        if count > most:
            yield f"{owner} must have at most {most} {name}, got {count}"


def _write_platform(body: np.ndarray, robot: Robot) -> None:
    turning = [name for name in COORDINATES[3:] if name in robot.platform.dof]
    inverse = np.zeros((3, 3))
    if len(turning) == 3:
        inverse = np.linalg.inv(robot.inertia)
    elif turning:  # about one axis, which then is the same in {G} and in the platform
        axis = COORDINATES[3:].index(turning[0])
        inverse[axis, axis] = 1 / robot.inertia[axis, axis]
    _write_mass(body, robot.platform.mass, robot.dof_mask[:3], robot.inertia, inverse)


def _write_mass(body: Any, mass: float, moves: np.ndarray, inertia: np.ndarray, inverse_inertia: np.ndarray) -> None:
    body["motion"] = FREE
    body["mass"], body["inverse_mass"] = mass * moves, moves / mass
    body["inertia"], body["inverse_inertia"] = inertia, inverse_inertia


def _write_carrier(body: Any, carrier: Carrier, robot: Robot) -> None:
    limits = carrier.motion_limits
    if carrier.body is not None:
        inertia = inertia_matrix(carrier.body.inertia)
        _write_mass(body, carrier.body.mass, np.ones(3), inertia, np.linalg.inv(inertia))
        body["actuators"] = len(carrier.actuators)
        for place, actuator in zip(body["actuator"], carrier.actuators, strict=False):
            place["wrench"], place["low"], place["high"] = actuator.wrench, actuator.low, actuator.high
    elif not carrier.free_coordinates(robot.drive):
        body["motion"] = RESTS
    elif limits.acceleration is not None:
        body["motion"] = LAGGED
        body["speed_max"] = np.inf if limits.speed is None else limits.speed
        body["acceleration_max"] = limits.acceleration
    else:
        body["motion"] = IMPOSED


def _write_cables(rows: np.ndarray, robot: Robot) -> None:
    rows["carrier"], rows["anchor"], rows["attachment"] = robot.carrier_of_cable, robot.anchors, robot.attachments
    rows["axis"], rows["radius"] = robot.pulley_axes, robot.pulley_radii
    for row, cable in zip(rows, robot.cables, strict=True):
        row["stiffness"], row["damping"] = cable.stiffness or 0.0, cable.damping or 0.0
        if winch := cable.winch:
            row["has_winch"] = True
            for name in ("inertia", "friction", "speed_max", "force_max"):
                row[f"winch_{name}"] = getattr(winch, name)
