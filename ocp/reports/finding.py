"""What a planner found, as data: the motion, what the audit says of it, and the verdict. `Plan` adds its faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..audits.audit import Audit
from ..audits.missing import Missing, missing
from ..status import MotionStatus
from ..tasks.scenario import Deviation, Scenario
from .stage import Stage

__all__ = ["Finding", "Relaxed"]


@dataclass(frozen=True)
class Finding:
    """A planned motion and what its audit saw.

    Attributes
    ----------
    scenario
        The robot and the task, laid out.
    status
        See `MotionStatus`.
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
    stages
        The steps of the planner's ladder, in order: what each said, and how long it took.
    relaxed
        If not feasible: what would have been, if the planner knows.
    """

    scenario: Scenario
    status: MotionStatus
    deviation: Deviation | None
    audit: Audit
    build_s: float
    solve_s: float
    iterations: int = 0
    message: str = ""
    iterates: tuple[tuple[int, float, float], ...] = ()
    stages: tuple[Stage, ...] = ()
    relaxed: Relaxed | None = None

    @property
    def feasible(self) -> bool:
        """Whether the audit saw every tension inside its limits, and all else that the task and the robot limit too."""
        return self.status is MotionStatus.FEASIBLE

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

        The keys of `solvers.Certificate.to_dict`, `time` [s], and `wind` [m/s] of a task with a box of winds; the
        direction is in {G}.
        """
        if self.feasible or self.audit.certificate is None:
            return None
        at: dict[str, Any] = {"time": self.audit.certificate_time}
        if self.audit.certificate_wind is not None:
            at["wind"] = list(self.audit.certificate_wind)
        return at | self.audit.certificate.to_dict()

    @cached_property
    def missing(self) -> tuple[Missing, ...]:
        """The spans in which no tensions inside their limits give the wrench that is needed; see `missing`."""
        return missing(self.scenario, self.audit)

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
            "missing": [each.to_dict() for each in self.missing],
            "relaxed": None if self.relaxed is None else self.relaxed.to_dict(),
            "stages": [stage._asdict() for stage in self.stages],
        }


@dataclass(frozen=True)
class Relaxed:
    """A task near the one that was asked, and its plan.

    Attributes
    ----------
    name, unit
        The field of the task that differs, and its unit.
    asked, possible
        Its value in the task, and the nearest one that was found to do.
    plan
        The plan of that.
    """

    name: str
    unit: str
    asked: float
    possible: float
    plan: Finding

    def to_dict(self) -> dict[str, Any]:
        """{"name", "unit", "asked", "possible"} for JSON."""
        return {"name": self.name, "unit": self.unit, "asked": self.asked, "possible": self.possible}
