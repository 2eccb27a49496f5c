"""`Stop`: a motion from an instant of a plan to rest."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.display import Displayed, Fact
from ..base.netcdf import Contents
from ..base.text import quantity
from ..models.motion_file import dimensions, motion_variables, over
from ..models.parsing import to_yaml
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from ..models.trajectory import Motion
from ..solvers import Certificate

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Stop(Displayed):
    """A motion from an instant of a plan to rest, on the plan's path.

    Attributes:
        robot: The robot.
        begins, ends: Times in the plan [s]: where the stop begins, and where on the path it ends.
        times: From 0 to its duration, (n,) [s].
        platform, carriers: Pose, velocity and acceleration in {G} at these times: (n, 6) each, and (n, c, 6) each.
        tensions: (n, m) [N]; where none exist inside the limits, those with the closest wrench.
        certificate: Certificate of the instant with the largest shortfall; None if tensions inside their limits always
            exist.
        limit: The limit of flying carriers, or of the force of a winch, that is exceeded most, with value and time;
            empty if none is.
        load: Load of the platform from the beginning of the stop until the robot rests; default: no load.
    """

    robot: Robot
    begins: float
    ends: float
    times: np.ndarray
    platform: Motion
    carriers: Motion
    tensions: np.ndarray
    certificate: Certificate | None
    limit: str = ""
    load: RigidLoad | None = None

    @property
    def duration(self) -> float:
        """Return the time until the robot rests [s]."""
        return float(self.times[-1])

    @property
    def distance(self) -> float:
        """Return the length of the path of the platform until it rests [m]."""
        return float(np.linalg.norm(np.diff(self.platform[0][:, :3], axis=0), axis=1).sum())

    @property
    def feasible(self) -> bool:
        """Return whether tensions and carriers stay inside their limits from the beginning to the end."""
        return self.certificate is None and not self.limit

    def to_dict(self) -> dict[str, Any]:
        """Return "begins", "ends" and "duration" [s], "distance" [m] and "feasible", for JSON."""
        return {name: getattr(self, name) for name in ("begins", "ends", "duration", "distance", "feasible")}

    @property
    def trajectory(self) -> xr.Dataset:
        """Return the motion and its tensions over time, as `Plan.trajectory` does; `simulate` follows it."""
        return self._contents.dataset()

    @property
    def _contents(self) -> Contents:
        variables = motion_variables(self.platform, self.carriers)
        variables["tensions"] = over(("time", "cable"), self.tensions, "N", "cable tensions")
        status = "feasible" if self.feasible else "not-found"
        attributes = {"title": f"{self.robot.name}, stop", "status": status, "robot": to_yaml(self.robot)}
        if self.load is not None:  # as a plan of one phase has it
            variables["phase_load"] = over(("phase",), np.array([self.load.mass]), "kg", "mass of the load")
            variables["phase_start"] = over(("phase",), np.zeros(1), "s", "start of the phase")
            attributes["task"] = json.dumps({"phases": [{"load": self.load.model_dump()}]})
        return Contents(variables, dimensions(self.robot, self.times), attributes)

    def _headline(self) -> str:
        return f"{'stop' if self.feasible else 'stop beyond limits'} in {quantity(self.duration, 's')}"

    def _facts(self) -> list[Fact]:
        tensions = f"{quantity(self.tensions.min(), 'N')} to {quantity(self.tensions.max(), 'N')}"
        facts = [("begins", quantity(self.begins, "s")), ("path", quantity(self.distance, "m")), ("tensions", tensions)]
        broken = self.limit or (self.certificate and self.certificate.describe())
        return [*facts, ("limits", broken)] if broken else facts
