"""Choose the range of a slider for each coordinate of platform and carriers that can move."""

from typing import NamedTuple

import numpy as np

from ..models import Robot
from ..models.part import COORDINATES
from .geometry import Geometry

TURN = 1.0  # [rad] to each side of home
BEYOND = 0.25  # of the robot's extent, to each side: also where it cannot be is worth seeing
SHORTEST = 1e-6  # [m] of a range
TILT = 0.6  # [rad] of carriers that have no limit of their own


class Slider(NamedTuple):
    """A slider for one coordinate."""

    carrier: int | None  # index of its carrier, or None for the platform
    coordinate: int  # index in (x, y, z, roll, pitch, yaw)
    low: float  # [m] or [rad]
    high: float  # likewise
    step: float  # likewise

    @property
    def label(self) -> str:
        """Return name and unit."""
        return f"{COORDINATES[self.coordinate]} [{'m' if self.coordinate < 3 else 'rad'}]"


def sliders(robot: Robot, geometry: Geometry) -> list[Slider]:
    """Return the sliders of the platform, then those of each carrier.

    The platform can move through the box around the robot and a little beyond. Carriers can move through their
    reach boxes, unless the drive mode fixes them. Those without one can move by half the robot's size to each side,
    and tilt up to the limit of the robot file.
    """
    home = robot.home
    found = []
    for coordinate, name in enumerate(COORDINATES):
        if name in robot.platform.dof:
            at, extent = home[coordinate], geometry.extent
            low, high = at - TURN, at + TURN
            if coordinate < 3:
                beyond = BEYOND * (extent.high - extent.low)[coordinate]
                low, high = extent.low[coordinate] - beyond, extent.high[coordinate] + beyond
            found.append(_slider(None, coordinate, low, high, at))
    for index, carrier in enumerate(robot.carriers):
        limits = carrier.motion_limits
        tilt = limits.tilt or TILT
        spans = [geometry.extent.size / 2] * 3 + [tilt, tilt, TURN]
        for k in carrier.free_coordinates(robot.drive):
            at = carrier.home[k]
            low, high = at - spans[k], at + spans[k]
            if limits.reach is not None and k < 3:
                low, high = limits.reach.min[k], limits.reach.max[k]
            found.append(_slider(index, k, low, high, at))
    return [slider for slider in found if slider.high > slider.low]


def whole_steps(low: float, high: float) -> tuple[float, float, float]:
    """Return ends of a slider that are whole steps around a range, and the step: a power of ten, a 200th or less."""
    step, digits = _step(max(high - low, SHORTEST))
    first = float(np.floor(low / step))
    last = max(float(np.ceil(high / step)), first + 1.0)
    return round(first * step, digits), round(last * step, digits), step


def _slider(carrier: int | None, coordinate: int, low: float, high: float, home: float) -> Slider:
    """Return a slider whose ends are whole steps inside the range, so that they are round numbers."""
    if not high > low:
        return Slider(carrier, coordinate, float(home), float(home), 1.0)
    step, digits = _step(high - low)
    inner_low = round(float(np.ceil(low / step - 1e-6)) * step, digits)
    inner_high = round(float(np.floor(high / step + 1e-6)) * step, digits)
    return Slider(carrier, coordinate, min(inner_low, float(home)), max(inner_high, float(home)), step)


def _step(span: float) -> tuple[float, int]:
    """Return the step of a slider, a power of ten, a 200th of its span or less, and how many decimals it has."""
    digits = int(np.ceil(-np.log10(span / 200)))
    return 10.0**-digits, max(digits, 0)
