"""Refuse invalid commands of a user's controller, and wrenches of a user's event, with a one-line error."""

from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.inputs import shown
from ..control import ANSWERS, Command
from ..models.robot import Robot
from .events import Event


def check_command(command: Any, robot: Robot, flights: int, time: float) -> None:
    """Check a command of all runs, or of a single one.

    Raises `InputError` if it is no `Command`, or has wrong shapes, numbers that are not finite or an unknown
    status.
    """
    if not isinstance(command, Command):
        raise InputError(f"controller must return a Command from step, got {shown(command)} at t = {time:g} s")
    count, lead = len(robot.carriers), () if flights == 1 else (flights,)
    shapes: dict[str, tuple[int, ...]] = {"tensions": (robot.m,), "answered": ()}
    shapes |= {f"carrier_{part}": (count, 6) for part in ("pose", "velocity", "acceleration")}
    if command.actuation is not None:
        shapes["actuation"] = (count, max(len(carrier.actuators) for carrier in robot.carriers))
    if command.lengths is not None:
        shapes["lengths"] = (robot.m,)
    for name, core in shapes.items():
        values = np.asarray(getattr(command, name))
        if values.shape != (*lead, *core):
            raise InputError(
                f"controller must return {name} of shape {(*lead, *core)}, got shape {values.shape} at t = {time:g} s"
            )
        if values.dtype.kind not in "fiu" or not np.isfinite(values).all():
            raise InputError(f"controller must return finite {name}, got others at t = {time:g} s")
    answered = np.asarray(command.answered)
    if not ((answered >= 0) & (answered < len(ANSWERS))).all():
        raise InputError(
            f"controller must return answered from 0 to {len(ANSWERS) - 1}, got {answered.max()} at t = {time:g} s"
        )


def check_wrench(event: Event, wrench: Any, shape: tuple[int, int], time: float) -> np.ndarray:
    """Return the wrench of an event as an array for all runs, of `shape` (N, 6).

    Raises `InputError` if it has another shape, or numbers that are not finite.
    """
    try:
        values = np.broadcast_to(np.asarray(wrench, dtype=float), shape)
    except (TypeError, ValueError):
        values = np.full(shape, np.nan)
    if not np.isfinite(values).all():
        raise InputError(
            f"events must exert wrenches of six finite numbers, got {shown(wrench)} of {type(event).__name__} "
            f"at t = {time:g} s"
        )
    return values
