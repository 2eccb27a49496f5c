"""Winds of simulations: constant, with gusts, or a user's function."""

from typing import Any

import numpy as np
from typing_extensions import override

from ..base.errors import InputError
from ..base.inputs import shown
from ..models import air
from ..models.robot import Robot
from .experiment import Wind


class ConstantWind:
    """The same wind at all times."""

    def __init__(self, velocity: np.ndarray):
        self._velocity = velocity

    @override
    def __str__(self) -> str:
        return f"{' '.join(f'{part:g}' for part in self._velocity)} m/s"

    def __call__(self, times: np.ndarray, seed: int) -> np.ndarray:
        """Return it, (K, 3) [m/s]."""
        return air.constant(times, self._velocity.tolist())


class Gusts(ConstantWind):
    """Dryden turbulence about a mean wind, with half the intensity vertically."""

    def __init__(self, velocity: np.ndarray, intensity: float):
        super().__init__(velocity)
        self._intensity = intensity

    @override
    def __str__(self) -> str:
        return f"{super().__str__()} with gusts of {self._intensity:g} m/s"

    def __call__(self, times: np.ndarray, seed: int) -> np.ndarray:
        """Return the wind of a seed, (K, 3) [m/s]."""
        intensity = (self._intensity, self._intensity, self._intensity / 2)
        return air.dryden(times, self._velocity.tolist(), intensity, seed=seed)


def read_wind(robot: Robot, wind: Any, gusts: float) -> Wind | None:
    """Return the wind from the arguments of `simulate`, see there.

    Raises `InputError` if the robot has no `platform.aero`, or an argument has a wrong value.
    """
    if wind is None:
        if gusts:
            raise InputError(f"gusts must be 0 without a wind, got {gusts:g} m/s")
        return None
    if robot.platform.aero is None:
        raise InputError(f"wind must be None for robot {robot.name!r}, which has no platform.aero, got a wind")
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
        raise InputError(f"wind must be three numbers from -1000 to 1000 m/s or a function of times, got {shown(wind)}")
    return Gusts(velocity, gusts) if gusts else ConstantWind(velocity)
