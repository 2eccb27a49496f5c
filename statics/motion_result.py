"""`MotionResult`: the base of plans and simulations, whose motion is a dataset, a file and a film."""

from __future__ import annotations

import os
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.inputs import file_path
from ..base.netcdf import Contents
from ..figures.drawing import Drawn
from ..models.motion_file import save_motion
from ..models.robot import Robot

if TYPE_CHECKING:
    import xarray as xr


class MotionResult(Drawn):
    """The base of results with a motion over time: platform, carriers and tensions."""

    _contents: Contents  # of the dataset

    @property
    def _of_robot(self) -> Robot:
        raise NotImplementedError

    @cached_property
    def trajectory(self) -> xr.Dataset:
        """Return the motion in {G} and the tensions over time, with units as attributes.

        Dimensions: time, coordinate (x, y, z, roll, pitch, yaw), carrier, cable (from 1); of plans whose acceleration
        jumps also jump.
        """
        return self._contents.dataset()

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the motion atomically: as NetCDF (.nc), which `xarray.load_dataset` reads, or as MCAP (.mcap).

        A plan or a simulation that is computed again gives the same bytes. Raises `InputError` if the file cannot be
        written.
        """
        return save_motion(self._of_robot, self._contents, file)

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
        from ..figures import animation
        from .scene import scene

        path, times = file_path("file", file), self._contents.coordinates["time"].values
        frames = animation.timing(path, float(times[-1] - times[0]), speed, fps)
        return animation.draw(scene(self._of_robot, self.trajectory, frames.times), frames, path)
