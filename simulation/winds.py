"""Winds of simulations: constant, with gusts, or a user's function."""

from typing import Any

import numpy as np
from typing_extensions import override

from ..base.errors import InputError
from ..base.inputs import shown
from ..models import air
from ..models.robot import Robot
from .experiment import Wind


class MeanWind:
    """A mean wind [m/s] with Dryden turbulence about it, half as intense vertically; an intensity of 0: none."""

    def __init__(self, velocity: np.ndarray, intensity: float):
        self._velocity, self._intensity = velocity.tolist(), intensity

    @override
    def __str__(self) -> str:
        gusts = f" with gusts of {self._intensity:g} m/s" if self._intensity else ""
        return f"{' '.join(f'{part:g}' for part in self._velocity)} m/s{gusts}"

    def __call__(self, times: np.ndarray, seed: int) -> np.ndarray:
        """Return the wind of a seed, (K, 3) [m/s]."""
        if not self._intensity:
            return air.constant(times, self._velocity)
        intensity = (self._intensity, self._intensity, self._intensity / 2)
        return air.dryden(times, self._velocity, intensity, seed=seed)


def read_wind(robot: Robot, wind: Any, gusts: float) -> Wind | None:
    """Return the wind from the arguments of `simulate`, see there.

    Raises `InputError` if the robot has no `platform.aero`, or an argument has a wrong value.
    """
    if wind is None:
        if gusts:
            raise InputError(f"gusts must be 0 without a wind, got {gusts:g} m/s")
        return None
    if robot.platform.aero is None:
        raise InputError(f"wind must be left out for robot {robot.name!r}, which has no platform.aero")
    if callable(wind):
        function: Any = wind
        if gusts:
            raise InputError(f"gusts must be 0 with a wind that is a function, got {gusts:g} m/s")
        return function
    try:
        velocity = np.asarray(wind, dtype=float)
    except (TypeError, ValueError, OverflowError):
        velocity = np.empty(0)
    if velocity.shape != (3,) or not (np.abs(velocity) <= 1e3).all():
        accepted = "three numbers from -1000 to 1000 m/s or a function of times and a seed"
        raise InputError(f"wind must be {accepted}, got {shown(wind)}")
    return MeanWind(velocity, gusts)
