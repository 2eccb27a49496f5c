"""All figures of a plan, by name: what `Plan.plot` saves and the report's page shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...figures import plan as figures
from ...figures.convergence import convergence
from ...figures.drawing import Drawing
from ...figures.limits import limits
from ...figures.views import views
from .finding import Finding
from .limited import limited
from .scene import scene
from .trajectory import output_rows

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["drawings"]

INSTANTS = 60  # of carriers' ways in the views


def drawings(found: Finding, trajectory: xr.Dataset) -> dict[str, Drawing]:
    """The figures by the names of their files, without suffix; those of nothing are left out."""
    times = np.linspace(0.0, found.scenario.duration, INSTANTS)
    drawn = {
        "path": Drawing("Path of the platform and places of the carriers", figures.path(trajectory)),
        "views": Drawing("From above and from the side", views(scene(found, times))),
        "tensions": Drawing("Tensions against their limits", figures.tensions(trajectory)),
    }
    if (trajectory["carrier_kind"] != "ground").any():
        drawn["base"] = Drawing("Carriers beside and above the platform", figures.base_offset(trajectory))
    rows = output_rows(found)
    if quantities := limited(found, rows):
        drawn["limits"] = Drawing("What else is limited", limits(found.audit.times[rows], quantities))
    if found.iterates:
        drawn["convergence"] = Drawing("How the solver came to it", convergence(found.iterates))
    return drawn
