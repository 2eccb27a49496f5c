"""Check the arguments of a controller: `as_floats`, a state or a reference as arrays; `rows_of`, times."""

from numbers import Real
from typing import Any, TypeVar

import numpy as np

from ..base.inputs import FLOAT, InputError, float64, required, shown
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from .controller import Reference, State

Given = TypeVar("Given", State, Reference)

ROUNDING = 1e-9  # [s]
LATEST = 1e300  # [s]: a later time, and one that is not finite, is refused


def is_time(value: object) -> bool:
    """Return whether a value is a valid time [s]."""
    if type(value) is float:  # at a third of the time
        return abs(value) <= LATEST
    number: Any = value
    return isinstance(value, Real) and not isinstance(value, np.timedelta64) and bool(abs(number) <= LATEST)


def measured_at(seen: Any, time: float) -> float:
    """Return when a state was measured, if that is a time up to the step's [s]; otherwise raise InputError."""
    if not is_time(seen) or not float(seen) <= time + ROUNDING:
        raise InputError(f"state.time must be a number up to the step's time, {time:g} s, got {shown(seen)}")
    return float(seen)


def rows_of(state: State) -> int | None:
    """Return the number of robots of a state, or None if its arrays have no leading dimension.

    Raises `InputError` if its pose is no array of (6,) or (N, 6) numbers.
    """
    pose = state.pose
    if type(pose) is np.ndarray and pose.dtype is FLOAT and pose.shape == (6,):  # at a quarter of the time
        return None
    pose = _array("state.pose", state.pose, (6,))
    if pose.ndim > 2:
        raise InputError(f"state.pose must be of shape (6,) or (N, 6), got shape {pose.shape}")
    return None if pose.ndim == 1 else len(pose)


def as_floats(given: Given, robot: Robot, rows: int | None) -> Given:
    """Return a state or a reference with NumPy arrays of float64; nan stays, for a sensor without a value.

    - `robot`: robot of the state or reference.
    - `rows`: leading dimension that arrays may have, or None if they have none.

    Raises `InputError` naming the array that does not fit.
    """
    kind, shape = type(given).__name__.lower(), {"tensions": (robot.m,), "carrier": (len(robot.carriers), 6)}
    arrays: dict[str, Any] = {}
    for name, value in zip(given._fields, given, strict=True):
        core = shape.get(name.partition("_")[0], (6,))
        if type(value) is np.ndarray and value.dtype is FLOAT and value.shape == core:  # at a third of the time
            continue
        if name == "load" and value is not None:
            required("reference.load", value, RigidLoad)
        elif name not in ("time", "load") and not (name == "tensions" and value is None):
            array = arrays[name] = _array(f"{kind}.{name}", value, core)
            if array.ndim > len(core) and (rows is None or array.shape[: -len(core)] != (rows,)):
                accepted = _shape(core) if rows is not None else core
                raise InputError(f"{kind}.{name} must be of shape {accepted}, got shape {array.shape}")
    return given._replace(**arrays) if arrays else given


def _array(name: str, value: Any, core: tuple[int, ...]) -> np.ndarray:
    """Return an array of float64 whose last dimensions are `core`, or raise InputError."""
    if type(value) is np.ndarray and value.dtype is FLOAT and value.shape[-len(core) :] == core:
        return value
    try:
        given = np.asarray(value)
        array = float64(given) if given.dtype.kind in "fiubO" else None
    except Exception:  # whatever the array interface of another library, or an object of an array, raises
        array = None
    if array is None:
        raise InputError(f"{name} must be numbers of shape {_shape(core)}, got {shown(value)}")
    if array.shape[-len(core) :] != core:
        raise InputError(f"{name} must be of shape {_shape(core)}, got shape {array.shape}")
    return array


def _shape(core: tuple[int, ...]) -> str:
    return f"(..., {', '.join(map(str, core))})"
