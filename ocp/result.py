"""`Plan`: the motion that a planner found, what the audit says of it, and its file."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models.parsing import to_yaml
from ..writing import whole_file
from .audit import Audit
from .scenario import Deviation, Scenario

if TYPE_CHECKING:
    import xarray as xr

COORDINATES = ["x", "y", "z", "roll", "pitch", "yaw"]


class PlanStatus(StrEnum):
    """What a plan is; its values are plain strings."""

    FEASIBLE = "feasible"
    """The audit saw no violation anywhere."""

    INFEASIBLE = "infeasible"
    """The task fixes the motion, and it cannot be: at some time no tensions give the wrench that it needs, proven by
    the certificate, or it leaves a carrier's or drive's limits, told by the audit's `excess`."""

    NOT_FOUND = "not-found"
    """The planner found no motion without violation. The certificate and the `excess` are those of the closest motion
    that it found, and prove no more."""


@dataclass(frozen=True)
class Plan:
    """A planned motion and what its audit saw.

    Attributes
    ----------
    scenario
        The robot and the task, laid out.
    status
        See `PlanStatus`.
    deviation
        What was chosen: the free coordinates and tensions at the nodes; None if the task fixes the motion.
    audit
        The dense evaluation that decides on feasibility.
    build_s, solve_s
        Wall time to build and to solve [s], over all attempts.
    iterations, message
        Of the last run of the solver; its own words.
    iterates
        Rows of (iteration, objective, infeasibility) of all runs of the solver, in order: where the iteration falls
        back to 0 another run begins.
    """

    scenario: Scenario
    status: PlanStatus
    deviation: Deviation | None
    audit: Audit
    build_s: float
    solve_s: float
    iterations: int = 0
    message: str = ""
    iterates: tuple[tuple[int, float, float], ...] = ()

    @property
    def feasible(self) -> bool:
        """Whether the audit saw every tension inside its limits, and all else that the task and the robot limit too."""
        return self.status is PlanStatus.FEASIBLE

    @property
    def tension_min(self) -> float | None:
        """Smallest audited tension [N]; None if at some time there are none."""
        return float(self.audit.tensions.min()) if np.isfinite(self.audit.tensions).all() else None

    @property
    def tension_max(self) -> float | None:
        """Largest audited tension [N]; None if at some time there are none."""
        return float(self.audit.tensions.max()) if np.isfinite(self.audit.tensions).all() else None

    @property
    def margin(self) -> float | None:
        """Smallest distance of any audited tension from its limits [N]; None if at some time there are none."""
        robot = self.scenario.robot
        inside = np.minimum(self.audit.tensions - robot.t_min, robot.t_max - self.audit.tensions)
        return float(inside.min()) if np.isfinite(inside).all() else None

    @property
    def tracking_error_max(self) -> float:
        """Largest distance of the platform from its path [m]."""
        return float(self.audit.tracking_error.max())

    @cached_property
    def certificate(self) -> dict[str, Any] | None:
        """Why there is no feasible motion: where, when and by how much; None for a feasible plan.

        The keys of `solvers.Certificate.as_dict`, `time` [s], and `wind` [m/s] of a task with a box of winds; the
        direction is in {G}.
        """
        if self.feasible or self.audit.certificate is None:
            return None
        at: dict[str, Any] = {"time": self.audit.certificate_time}
        if self.audit.certificate_wind is not None:
            at["wind"] = list(self.audit.certificate_wind)
        return at | self.audit.certificate.as_dict()

    @cached_property
    def trajectory(self) -> xr.Dataset:
        """The motion in {G} and the audited tensions over time, sampled at the task's output rate, units as attributes.

        Dimensions: time, coordinate (x, y, z, roll, pitch, yaw), carrier, cable (from 1).
        """
        import xarray as xr

        robot, task = self.scenario.robot, self.scenario.task
        rows = self._output_rows()
        seen = self.audit

        def over(dims: tuple[str, ...], values: np.ndarray, unit: str, about: str) -> Any:
            return dims, values, {"units": unit, "long_name": about}

        body, base = ("time", "coordinate"), ("time", "carrier", "coordinate")
        names = {"pose": "m, rad", "velocity": "m/s, rad/s", "acceleration": "m/s^2, rad/s^2"}
        variables = {}
        for name, part, carrier_part in zip(names, seen.motion, seen.carriers, strict=True):
            variables[name] = over(body, part[rows], names[name], f"{name} of the platform frame in G")
            variables[f"carrier_{name}"] = over(base, carrier_part[rows], names[name], f"{name} of each carrier in G")
        variables["tensions"] = over(("time", "cable"), seen.tensions[rows], "N", "cable tensions")
        about = "tensions of least norm without limits; negative: to push"
        variables["tensions_unlimited"] = over(("time", "cable"), seen.tensions_unlimited[rows], "N", about)
        variables["violation"] = over(("time",), seen.violation[rows], "N", "missing wrench, moments over length")
        variables["tracking_error"] = over(("time",), seen.tracking_error[rows], "m", "distance from the path")
        variables["t_min"] = over(("cable",), robot.t_min, "N", "smallest tension allowed")
        variables["t_max"] = over(("cable",), robot.t_max, "N", "largest tension allowed")
        attributes = {
            "title": f"towline plan of {robot.name}: {task.name}",
            "status": self.status.value,
            "robot": to_yaml(robot),
            "task": to_yaml(task),
            "report": json.dumps(self.summary()),
        }
        coordinates = {
            "time": ("time", seen.times[rows], {"units": "s"}),
            "coordinate": COORDINATES,
            "carrier": [carrier.name for carrier in robot.carriers],
            "cable": np.arange(1, robot.m + 1),
        }
        return xr.Dataset(variables, coordinates, attributes)

    def summary(self) -> dict[str, Any]:
        """What `towline plan --json` prints, ready for JSON; numbers that do not exist are None."""
        return {
            "feasible": self.feasible,
            "status": self.status.value,
            "tension_min": self.tension_min,
            "tension_max": self.tension_max,
            "margin": self.margin,
            "tracking_error_max": self.tracking_error_max,
            "build_s": self.build_s,
            "solve_s": self.solve_s,
            "iterations": self.iterations,
            "solver_message": self.message,
            "audit": self.audit.summary(),
            "certificate": self.certificate,
        }

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the trajectory as NetCDF, whole or not at all; `xarray.load_dataset` reads it.

        Raises
        ------
        InputError
            If the place cannot be written to.
        """
        path = Path(file)
        with whole_file(path) as temporary:
            self.trajectory.to_netcdf(temporary, engine="h5netcdf")
        return path

    def plot(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Draw path, tensions, base offset and convergence as PNG files in `folder`; their paths.

        There is no convergence where no solver ran: the task fixed the motion.
        """
        from ..figures import style
        from ..figures.convergence import convergence
        from ..figures.plan import draw

        drawn = draw(self.trajectory, Path(folder))
        if self.iterates:
            drawn.append(style.save(convergence(self.iterates), Path(folder) / "convergence.png"))
        return drawn

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
        from ..figures import animation
        from .scene import scene

        path = Path(file)
        when = animation.timing(path, self.scenario.duration, speed, fps)
        return animation.draw(scene(self, when.times), when, path)

    def report(self) -> str:
        """What a person wants to know, as text: the verdict in the first line, then the facts that it rests on."""
        from .report import as_text

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
        from .report_page import page

        path = Path(file)
        with whole_file(path) as temporary:
            temporary.write_text(page(self), encoding="utf-8")
        return path

    def _output_rows(self) -> np.ndarray:
        """Rows of the audit that are saved: at equal times, and each of them audited."""
        return np.arange(0, len(self.audit.times), (len(self.audit.times) - 1) // self.scenario.output_samples)
