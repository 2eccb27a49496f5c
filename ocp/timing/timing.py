"""`Timing`: the fastest time law along a path, or where along the path there is none."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...base.display import BLUE, Displayed, Fact, picture
from ...base.errors import InputError
from ...base.inputs import file_path, real_array, required, shown
from ...base.text import quantity
from ...base.writing import whole_file
from ...figures.report import Part, Report, Reported, Section
from ...models.parsing import to_yaml
from ...solvers import Certificate, TensionProblem
from ..audits.waypoint_distance import WaypointDistance, waypoint_distance
from ..tasks.paths import (
    AnyPath,
    Curve,
    Motion,
    PathBase,
    TimedPath,
)
from ..tasks.status import MotionStatus
from ..tasks.task import GivenBase, HoldBase, Task
from ..warnings.instants import Instants
from ..warnings.leaves_its_points import leaves_its_points
from ..warnings.warnings import warnings
from .bottlenecks import Bottleneck, bottlenecks
from .parametrised_path import ParametrisedPath, PathLimits

LOOKS = 2001  # at the motion, for warnings and the distance from waypoints


@dataclass(frozen=True, eq=False)
class Timing(Displayed, Reported):
    """The fastest time law along a path, or where along the path there is none.

    Attributes
    ----------
    status
        See `MotionStatus`. If infeasible, at `at` no tensions inside their limits give the wrench that the path needs,
        whatever the speed and acceleration; at the ends, for the platform to rest there. If not-found, every place of
        the grid allows some speed, but no law joins them, or none that passes the audit.
    parametrised
        The robot and the geometry that was timed.
    limits
        The limits beside those of the tensions.
    margin
        How far every tension stays inside its limits [N].
    s
        Grid, (n,), the fraction of the path's own time, from 0 to 1.
    sd
        ds/dt on the grid, (n,) [1/s]; nan if not feasible.
    sdd
        d2s/dt2, constant on each interval of the grid, (n - 1,) [1/s^2]; nan if not feasible.
    violation
        The largest missing wrench in the audit [N], moments over `Robot.length`; nan without a law.
    at
        If not feasible: s of the certificate, or where the search ended.
    certificate
        If infeasible: proof along a wrench direction on which no allowed speed and acceleration helps. It is that of
        `problem`, and the one with the largest shortfall along the grid.
    problem
        The tension problem at `at` for the speed and acceleration that come nearest; at the ends, for rest.
    blocked
        All grid points s at which there is such a proof.
    name
        Name of the task.
    """

    status: MotionStatus
    parametrised: ParametrisedPath
    limits: PathLimits
    margin: float
    s: np.ndarray
    sd: np.ndarray
    sdd: np.ndarray
    violation: float = float("nan")
    at: float | None = None
    certificate: Certificate | None = None
    problem: TensionProblem | None = None
    blocked: np.ndarray = field(default_factory=lambda: np.zeros(0))
    name: str = "task"

    @property
    def _about(self) -> str:
        return f"{self.parametrised.robot.name}, {self.name}"

    def _headline(self) -> str:
        return f"{self._about}: {self.status.value.upper()}, {self._summary()}"

    def _summary(self) -> str:
        if self.feasible:
            return f"shortest duration {quantity(self.duration, 's', 6)}"
        place = f"s = {self.at:.4g}"
        if self.certificate is None:
            return f"the search ended at {place}"
        return f"short by {quantity(self.certificate.shortfall, 'N')} at {place}"

    def _facts(self) -> Iterable[Fact]:
        why = [] if self.certificate is None else self.certificate._facts()
        audit = [("worst violation", quantity(self.violation, "N", 3))] if self.feasible else []
        return [*why, ("margin", quantity(self.margin, "N")), *audit, ("grid", f"{len(self.s)} points")]

    def _picture(self) -> str:
        return picture([(self.s, self.sd, BLUE)], "s [-]", "ds/dt [1/s]")

    @property
    def feasible(self) -> bool:
        """Return whether there is a law whose audit reports no violation."""
        return self.status is MotionStatus.FEASIBLE

    @property
    def duration(self) -> float | None:
        """Return how long the motion takes [s]; None if there is none."""
        return self.path.natural_duration if self.feasible else None

    @property
    def path(self) -> TimedPath:
        """Return the platform's path with its time law, for a task.

        Raises
        ------
        InputError
            If there is no law.
        """
        return self.timed(self.parametrised.path)

    def task(self, name: str = "timed") -> Task:
        """Return a task with this `name` that fixes this motion of platform and carriers, for `plan` to audit.

        Raises
        ------
        InputError
            If there is no law.
        """
        parametrised, carriers = self.parametrised, self.parametrised.robot.carriers
        base: HoldBase | GivenBase = HoldBase(kind="hold")
        if parametrised.carriers:
            paths: dict[str, AnyPath] = {
                carriers[index].name: self.timed(path) if index in parametrised.moving else path
                for index, path in parametrised.carriers.items()
            }
            base = GivenBase(kind="given", paths=paths)
        wind = None if parametrised.wind is None else (0.0, 0.0, 0.0)
        return Task(name=name, path=self.path, base=base, margin=self.margin, wind=wind)

    def motion(self, times: np.ndarray) -> tuple[Motion, Motion]:
        """Return the motion of platform, (n, 6) each, and carriers, (n, c, 6) each, in {G} at `times` [s] (n,).

        Raises
        ------
        InputError
            If there is no law.
        """
        instants = real_array("times", times).astype(float, copy=False)
        if instants.ndim != 1 or not np.isfinite(instants).all():
            raise InputError(f"times must be finite numbers of shape (n,) [s], got {shown(times)}")
        s, sd, sdd = self.path.law(instants)
        platform, carriers = self.parametrised.at(s)
        return platform.timed(sd, sdd), carriers.timed(sd, sdd)

    @cached_property
    def waypoint_distance(self) -> WaypointDistance | None:
        """Return the largest distance at which the motion passes a waypoint, as `Plan` does; None without a law too."""
        if not self.feasible:
            return None
        path, seconds = self.path, self.path.natural_duration or 0.0
        times = np.unique(np.concatenate([path.times, np.linspace(0.0, seconds, LOOKS)]))

        def pose_at(instants: np.ndarray) -> np.ndarray:
            return path.at(instants, seconds).pose

        return waypoint_distance(path.stations(seconds), times, pose_at(times), pose_at)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Return what a person should know of the motion, as `Plan` does; nothing without a law."""
        if not self.feasible:
            return ()
        times = self.path.time_at(np.linspace(0.0, 1.0, LOOKS))
        platform, carriers = self.motion(times)
        seen = Instants(self.parametrised.dynamics, times, platform.pose, carriers.pose)
        return (*leaves_its_points(self.parametrised.path), *warnings(seen))

    @cached_property
    def bottlenecks(self) -> list[Bottleneck]:
        """Return the stretches of the path on each of which one limit keeps the motion from being faster, in order.

        The list is empty without a law.
        """
        return bottlenecks(self.parametrised, self.limits, self.margin, self.path) if self.feasible else []

    def to_dict(self) -> dict[str, Any]:
        """Return what `towline time --json` prints, ready for JSON; what does not exist is None."""
        return {
            "feasible": self.feasible,
            "status": self.status.value,
            "duration": self.duration,
            "margin": self.margin,
            "violation": self.violation,
            "warnings": list(self.warnings),
            "waypoint_distance": None if self.waypoint_distance is None else self.waypoint_distance.to_dict(),
            "bottlenecks": [each.to_dict() for each in self.bottlenecks],
            "at": self.at,
            "blocked": self.blocked.tolist(),
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
        }

    def save_task(self, file: str | os.PathLike[str], name: str = "timed") -> Path:
        """Save `task`, with this `name`, as a task file (YAML) atomically: `towline plan` and `plan` read it.

        Raises
        ------
        InputError
            If there is no law, or the place cannot be written to.
        """
        path, text = file_path("file", file), to_yaml(self.task(name))
        with whole_file(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
        return path

    def _report(self) -> Report:
        ends = "0 at its start, 1 at its end"
        parts: list[Part] = [f"warning: {sentence}" for sentence in self.warnings]
        if self.feasible:
            facts = [("audit", f"worst violation {quantity(self.violation, 'N', 3)}")]
            if self.waypoint_distance is not None:
                facts.append(("waypoints", self.waypoint_distance.describe()))
            title = f"What is at its limit along the path (s = {ends})"
            parts += [Section("", facts), Section(title, [("", each.describe()) for each in self.bottlenecks])]
        elif self.certificate is None:
            parts.append(f"s is the fraction of the path, {ends}")
        else:
            parts.append(
                f"s = {self.at:.4g} is the worst place of the path (s = {ends}); no time law is feasible there:"
            )
            parts.append(Section("", self.certificate._facts()))
        return Report(self._about, self.status.value, self._summary(), parts)

    def timed(self, path: Curve) -> TimedPath:
        """Return a path of the platform or of a carrier with the time law.

        Raises
        ------
        InputError
            If there is no law.
        """
        if np.isnan(self.sd).any():
            raise InputError(f"timing must be feasible to have a motion, got status {self.status.value!r}")
        required("path", path, PathBase)
        law = {"s": tuple(self.s.tolist()), "speeds": tuple(self.sd.tolist())}
        dwell = self.parametrised.dwell
        if any(dwell.values()):
            law["dwell"] = tuple(dwell.get(s, 0.0) for s in law["s"])
        return TimedPath(kind="timed", frame=path.frame, along=path, until=self.parametrised.until(path), **law)
