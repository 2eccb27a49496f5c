"""Shade where the platform could rest along each slider, with all other coordinates as they are."""

from collections.abc import Callable
from threading import Condition, Thread

import numpy as np

from ..figures import style
from ..models import Robot
from ..workspace import Places, StaticEquilibrium
from .sliders import Slider

PLACES = 48  # of a strip, about one for every other pixel
QUIET = 0.15  # [s] after the last change
HOLDS, FAILS = style.colour(2), "#e8e8e8"
# Places a strip above the track of a slider in a folder of viser's panel, between its label and its number.
STRIP = "height:4px;margin:-30px calc(0.625rem + 3.84rem) 26px calc(0.625rem + 6.87em);pointer-events:none"


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
