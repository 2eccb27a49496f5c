"""`Drawn` and `Filmed`: results that are saved as figures, and as films."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ..base.inputs import file_path
from . import style
from .drawing import Drawing
from .scene import Scene


class Drawn:
    """The base of results with figures: `plot` saves those that `figures` draws."""

    __slots__ = ()

    def figures(self) -> dict[str, style.Figure]:
        """Draw what `plot` saves, by the names of the files without suffix."""
        raise NotImplementedError

    def plot(self, folder: str | os.PathLike[str], format: str = "png") -> list[Path]:
        """Save the figures in `folder`, as wide as a journal's column (88 mm), and return their paths.

        A figure without content is left out.

        Args:
            format: png, pdf or svg.

        Raises `InputError` if the format is another, or a file cannot be written.
        """
        return style.save_all(self.figures, folder, format)

    def _drawings(self) -> list[Drawing]:
        """Draw the figures of a report's page, with their names as captions."""
        return [Drawing(name.replace("_", " ").capitalize(), figure) for name, figure in self.figures().items()]


class Filmed(Drawn):
    """The base of results with figures and a film."""

    __slots__ = ()

    @property
    def _film_duration(self) -> float:
        """Return how long the motion takes [s]."""
        raise NotImplementedError

    def _scene(self, times: np.ndarray) -> Scene:
        """Return the robot at the given times [s]."""
        raise NotImplementedError

    def animate(self, file: str | os.PathLike[str], speed: float = 1.0, fps: float = 20.0) -> Path:
        """Draw the robot in motion as a film: GIF, or MP4 if ffmpeg is installed; the suffix decides.

        Cables are coloured by tension, and grey where no tensions exist.

        Args:
            file: Ends in .gif or .mp4.
            speed: Seconds of the motion in one second of the film; 1 is real time.
            fps: Frames per second. GIF counts in hundredths of a second: the nearest rate is taken, at most 50, and the
                motion keeps its speed.

        Raises `InputError` if the suffix, the speed or the rate is not valid, or the file cannot be written.
        """
        from . import animation

        path = file_path("file", file)
        frames = animation.timing(path, self._film_duration, speed, fps)
        return animation.draw(self._scene(frames.times), frames, path)
