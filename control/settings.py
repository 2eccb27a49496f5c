"""`settings_of`: check the arguments of a controller and convert them for the core; `boxes`, where carriers may be."""

from typing import Any, NamedTuple

import numpy as np

from ..base.inputs import InputError, number, repeated, shown
from ..models.batch import as_array
from ..models.robot import Robot
from .controllability import is_underactuated
from .records import CONTROLLER

SLOW = 20.0  # [rad/s], with which observers learn that tensions differ from their commands, see core/control/heard.c

LEAN = 1.5  # tangent of the cone of forces, over the tangent of the largest tilt in plans
LEVEL, STEEPEST = 0.6, 1.5  # [rad]: at least and at most this tilt, since a push may need more than a gentle plan


class Limits(NamedTuple):
    """Limits of tensions and of their rates, each (m,)."""

    low: np.ndarray  # [N]
    high: np.ndarray  # likewise
    rate: np.ndarray  # [N/s], infinite without a limit


def limits_of(robot: Robot, rate: Any) -> Limits:
    """Return the limits of a robot's tensions, with one largest rate, one for each cable [N/s], or None."""
    fastest = np.full(robot.m, np.inf) if rate is None else positive("rate", rate, robot.m)
    return Limits(np.asarray(robot.t_min), np.asarray(robot.t_max), fastest)


def settings_of(
    robot: Robot,
    limits: Limits,
    bandwidth: Any,
    damping: Any,
    integral: Any,
    observer: float,
    carrier_bandwidth: float,
    carrier_acceleration: float,
    place: float,
    patience: float,
) -> np.ndarray:
    """Return the settings of `ComputedTorque`, whose arguments these are, a record (); the reach is zero.

    Raises `InputError` if an argument has a wrong value.
    """
    settings = np.zeros((), CONTROLLER)
    w, z = positive("bandwidth", bandwidth, 6), positive("damping", damping, 6)
    settings["kp"], settings["kd"], settings["ki"] = w**2, 2 * z * w, positive("integral", integral, 6)
    settings["observer"] = number("observer", observer, 0.0, 1e4)
    settings["carrier_bandwidth"] = number("carrier_bandwidth", carrier_bandwidth, 0.0, 1e3)
    settings["carrier_acceleration"] = number("carrier_acceleration", carrier_acceleration, 0.0, 1e4)
    settings["corrects"] = is_underactuated(robot)
    patience = number("patience", patience, 1e-6, 1e6)
    # Cables of a fixed length have no winch that could be off: their tensions are what carriers make of them.
    has_winches = robot.fixed_lengths is None
    settings["lowers"] = has_winches and not settings["corrects"]
    settings["learning"], settings["patience"] = (SLOW, patience) if has_winches else (0.0, np.inf)
    settings["place"] = number("place", place, 0.1, 1e3)
    for name, values in limits._asdict().items():
        settings["limits"][name][: robot.m] = values
    for index, carrier in enumerate(robot.carriers):
        if own := carrier.actuators:
            roll, pitch = robot.carrier_home[index, 3:5]
            most = max(LEVEL, carrier.motion_limits.tilt or STEEPEST, np.arccos(np.cos(roll) * np.cos(pitch)))
            settings["lean"][index] = LEAN * np.tan(min(most, STEEPEST))
            settings["by_wrench"][index, : len(own)] = np.linalg.pinv(np.array([each.wrench for each in own]).T)
    return settings


def set_reach(settings: np.ndarray, reach: np.ndarray) -> None:
    """Set the largest deviation of carriers from their reference, (c, 6) [m, rad]; zeros: none."""
    settings["reach"][: len(reach)] = reach
    settings["reacts"] = reach.any()


def reach_of(robot: Robot, reach: Any) -> np.ndarray:
    """Return the largest deviation of each coordinate of each carrier, (c, 6) [m, rad]."""
    far = as_array("reach", reach, (2,))
    if far.shape != (2,) or not ((far >= 0) & (far <= [1e3, 1.0])).all():
        raise InputError(f"reach must be a distance [m] and an angle up to 1 rad, got {shown(reach)}")
    result = np.zeros((len(robot.carriers), 6))
    for row, carrier in zip(result, robot.carriers, strict=True):
        free = list(carrier.free_coordinates(robot.drive))
        row[free] = np.repeat(far, 3)[free]
        if carrier.efforts:
            row[3:] = 0.0  # its attitude follows from its thrust
    return result


def positive(name: str, value: Any, size: int) -> np.ndarray:
    """Return numbers from 0 on, one or `size` of them, as (size,)."""
    result = repeated(name, value, size)
    if not ((result >= 0) & (result <= 1e9)).all():
        raise InputError(f"{name} must be numbers from 0 to 1e9, one or {size}, got {shown(value)}")
    return result


def boxes(robot: Robot) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the smallest and largest coordinates of the carriers' reach, (c, 3) each [m]; None if it is unlimited."""
    each = [carrier.motion_limits.reach for carrier in robot.carriers]
    if not any(each):
        return None
    low = np.array([(-np.inf,) * 3 if box is None else box.min for box in each])
    return low, np.array([(np.inf,) * 3 if box is None else box.max for box in each])


def stay_inside(carriers: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
    """Clip the carriers' motions, (N, c, 3, 6), to their boxes, (c, 3) [m]."""
    place = carriers[:, :, 0, :3]
    outside = (place < low) | (place > high)
    if outside.any():
        np.clip(place, low, high, out=place)
        carriers[:, :, 1, :3][outside] = carriers[:, :, 2, :3][outside] = 0.0
