"""Choose the range of a slider for each coordinate that can move, and shade where the platform could rest along it."""

from collections.abc import Callable
from threading import Condition, Thread
from typing import NamedTuple

import numpy as np

from ..figures import style
from ..models import Robot
from ..models.part import COORDINATES
from ..workspace import Places, StaticEquilibrium
from .geometry import Geometry

TURN = 1.0  # [rad] to each side of home
BEYOND = 0.25  # of the robot's extent, to each side: also where it cannot be is worth seeing
SHORTEST = 1e-6  # [m] of a range
TILT = 0.6  # [rad] of carriers that have no limit of their own
PLACES = 48  # of a strip, about one for every other pixel
QUIET = 0.15  # [s] after the last change
HOLDS, FAILS = style.colour(2), "#e8e8e8"
# Places a strip above the track of a slider in a folder of viser's panel, between its label and its number.
STRIP = "height:4px;margin:-30px calc(0.625rem + 3.84rem) 26px calc(0.625rem + 6.87em);pointer-events:none"


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


def holding(robot: Robot, settings: list[Slider], pose: np.ndarray, carriers: np.ndarray) -> np.ndarray:
    """Return whether tensions inside their limits hold the platform at rest, (s, `PLACES`) along each of s sliders.

    While one varies, the others keep their values in `pose` (6,) and `carriers` (c, 6) in {G} [m, rad].
    """
    poses, others = np.tile(pose, (len(settings), PLACES, 1)), np.tile(carriers, (len(settings), PLACES, 1, 1))
    for number, setting in enumerate(settings):
        along = np.linspace(setting.low, setting.high, PLACES)
        if setting.carrier is None:
            poses[number, :, setting.coordinate] = along
        else:
            others[number, :, setting.carrier, setting.coordinate] = along
    places = Places(poses.reshape(-1, 6), others.reshape(-1, *carriers.shape))
    return StaticEquilibrium().evaluate(robot, places).reshape(len(settings), PLACES)


def strip(holds: np.ndarray) -> str:
    """Return a strip that is green where `holds` (k,) is true, as HTML."""
    edges = np.flatnonzero(np.diff(holds)) + 1
    stops, ends = [0, *edges], [*edges, len(holds)]
    parts = ", ".join(
        f"{HOLDS if holds[a] else FAILS} {100 * a / len(holds):.1f}% {100 * b / len(holds):.1f}%"
        for a, b in zip(stops, ends, strict=True)
    )
    return f'<div class="towline-strip" style="{STRIP};background:linear-gradient(to right, {parts})"></div>'


class Strips:
    """Strips that are updated a moment after the last change of the pose, until `close`.

    - `robot`, `settings`: the robot and its sliders.
    - `write`: receives the HTML of the strips, one for each slider.
    """

    def __init__(self, robot: Robot, settings: list[Slider], write: Callable[[list[str]], None]):
        self._robot, self._settings, self._write = robot, settings, write
        self._changed, self._closed = Condition(), False
        self._wanted: tuple[np.ndarray, np.ndarray] | None = None  # what the thread is to do next
        Thread(target=self._follow, daemon=True).start()

    def want(self, pose: np.ndarray, carriers: np.ndarray) -> None:
        """Shade the sliders around a pose (6,) with carriers at (c, 6)."""
        with self._changed:
            self._wanted = (pose.copy(), carriers.copy())
            self._changed.notify()

    def close(self) -> None:
        """Stop updating."""
        with self._changed:
            self._closed = True
            self._changed.notify()

    def _follow(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._wanted is not None)
                while not self._closed and self._changed.wait(QUIET):
                    pass  # another change: wait again
                if self._closed or self._wanted is None:
                    return
                wanted, self._wanted = self._wanted, None
            self._write([strip(holds) for holds in holding(self._robot, self._settings, *wanted)])
