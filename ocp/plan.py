"""`Plan`: a planned motion and its audit, as data, dataset, file, figures, film and report."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..base.display import Fact
from ..figures.drawn import Filmed
from ..figures.report import Report, Reported
from ..models.motion_file import save_motion
from .reports.report import facts_at_once, headline, report
from .result import PlanData

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from ..base.netcdf import Contents
    from ..figures.scene import Scene


@dataclass(frozen=True, eq=False)
class Plan(PlanData, Filmed, Reported):
    """A planned motion and its audit: `PlanData`, which can also be saved, drawn and reported."""

    def _headline(self) -> str:
        return headline(self)

    def _facts(self) -> Iterable[Fact]:
        return facts_at_once(self)

    @cached_property
    def trajectory(self) -> xr.Dataset:
        """Return the motion in {G} and the audited tensions over time, at the task's output rate, units as attributes.

        Dimensions: time, coordinate (x, y, z, roll, pitch, yaw), carrier, cable (from 1).
        """
        return self._contents.dataset()

    @cached_property
    def _contents(self) -> Contents:
        from .reports.trajectory import trajectory

        return trajectory(self)

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the trajectory atomically: as NetCDF (.nc), which `xarray.load_dataset` reads, or as MCAP (.mcap).

        Raises `InputError` if the file cannot be written.
        """
        return save_motion(self.scenario.robot, self._contents, file)

    def figures(self) -> dict[str, Figure]:
        """Draw the figures of `plot` by name: `path`, `views`, `tensions`, ...; to show in a notebook.

        Figures without content are left out, as in `plot`.
        """
        from .reports.drawings import drawings

        return {name: drawing.figure for name, drawing in drawings(self, self.trajectory).items()}

    @property
    def _film_duration(self) -> float:
        return self.scenario.duration

    def _scene(self, times: np.ndarray) -> Scene:
        from ..statics.scene import scene

        return scene(self.scenario.robot, self.trajectory, times)

    def _report(self) -> Report:
        from .reports.drawings import drawings

        return report(self, lambda: drawings(self, self.trajectory).values())
