"""`Plan`: what a planner found, with its faces: dataset, file, figures, film, report."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from ..figures import animation, style
from ..netcdf import save_netcdf
from ..writing import whole_file
from .reports.drawings import drawings
from .reports.finding import Finding
from .reports.report import as_text
from .reports.report_page import page
from .reports.scene import scene
from .reports.trajectory import trajectory

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["Plan"]


class Plan(Finding):
    """A planned motion, what its audit saw, and the ways to look at it; its data are those of `Finding`."""

    @cached_property
    def trajectory(self) -> xr.Dataset:
        """The motion in {G} and the audited tensions over time, sampled at the task's output rate, units as attributes.

        Dimensions: time, coordinate (x, y, z, roll, pitch, yaw), carrier, cable (from 1).
        """
        return trajectory(self).dataset()

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the trajectory as NetCDF, whole or not at all; `xarray.load_dataset` reads it.

        Raises
        ------
        InputError
            If the place cannot be written to.
        """
        return save_netcdf(trajectory(self), Path(file))

    def plot(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Draw path, views, tensions, base offset, other limits and convergence as PNG files in `folder`; their paths.

        What there is nothing of has no figure: no convergence where no solver ran, no base where all is ground.
        """
        return [style.save(drawn, Path(folder) / f"{name}.png") for name, drawn in self.figures().items()]

    def figures(self) -> dict[str, Figure]:
        """Draw what `plot` saves, by name: `path`, `views`, `tensions`, ...; to show in a notebook or save another way.

        A name is missing where there is nothing to draw, as for `plot`.
        """
        return {name: drawing.figure for name, drawing in drawings(self, self.trajectory).items()}

    def animate(self, file: str | os.PathLike[str], speed: float = 1.0, fps: float = 20.0) -> Path:
        """Draw the robot in motion as a film: GIF, or MP4 if ffmpeg is installed; the suffix decides.

        Cables are coloured by tension, and grey where no tensions exist.

        Parameters
        ----------
        file
            Ends in .gif or .mp4.
        speed
            Seconds of the motion in one second of the film; 1 is real time.
        fps
            Frames a second. GIF counts in hundredths of a second: it gets the nearest rate, at most 50, and the motion
            keeps its speed.

        Raises
        ------
        InputError
            If the suffix, the speed or the rate are none that can be, or the place cannot be written to.
        """
        path = Path(file)
        when = animation.timing(path, self.scenario.duration, speed, fps)
        return animation.draw(scene(self, when.times), when, path)

    def report(self) -> str:
        """What a person wants to know, as text: the verdict in the first line, then the facts that it rests on."""
        return as_text(self)

    def save_report(self, file: str | os.PathLike[str]) -> Path:
        """Write the report as one HTML file with its figures inside, whole or not at all.

        It loads nothing from anywhere, so that it can be mailed and kept. A method of its own, and not an argument of
        `report`: what returns text writes no files, and `save_report` is found beside `save`.

        Raises
        ------
        InputError
            If the place cannot be written to.
        """
        path = Path(file)
        with whole_file(path) as temporary:
            temporary.write_text(page(self, self.trajectory), encoding="utf-8")
        return path
