"""Draw a film of a replay, as `towline plan --animate` does, independently of any browser."""

import tempfile
from pathlib import Path

from ..figures.animation import FASTEST, draw, timing
from ..statics.scene import scene
from .replay import Replay

RATE = 12.5  # [1/s]
LONGEST = 12.0  # [s] of the film: longer motions are shown faster


def film(replay: Replay) -> bytes:
    """Return a film of the saved instants of a replay as GIF."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.gif"
        speed = min(max(replay.duration / LONGEST, 1.0), FASTEST)
        when = timing(path, replay.duration, float(f"{speed:.2g}"), RATE)
        return draw(scene(replay.robot, replay.dataset, when.times), when, path).read_bytes()
