"""`PlanData`: the numbers of a planned motion and its audit, which reports and figures use; see `Plan`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.display import Displayed, tensions_over_time
from ..solvers import Certificate
from ..statics.robust import RobotShare, share_of_robots
from .audits.audit import Audit
from .audits.by_phase import worst_certificate
from .audits.waypoint_distance import WaypointDistance, waypoint_distance
from .tasks.deviation import Deviation
from .tasks.scenario import Scenario
from .tasks.task import MotionStatus
from .warnings.positions import Instants, between_points, into_each_other, into_places, leaves_its_points, outside_frame
from .warnings.values import fixed_cables, long_turns, short_cables, slipped_units, weak_formation

if TYPE_CHECKING:
    from ..statics.stop_result import Stop
    from .audits.robust_margin import RobustMargin
    from .timing.fastest_law import FastestLaw

DRAWN_AT = 200  # times at which drawn robots are checked
MOST_WARNED = 100_000  # times that are looked at for warnings, or less than twice as many
MOST_SPANS = 8


class PlannerStep(NamedTuple):
    """One step of the planner."""

    name: str  # what was computed: "ends and path", "timing", "nonlinear program, 100 steps"
    message: str  # its result, as text with units; empty if it has no result worth a line
    seconds: float  # wall time [s]


class Offers(NamedTuple):
    """The relaxations of a plan, and whether the search for them stopped before all were tried."""

    found: Sequence[Relaxed] = ()
    cut_short: bool = False


class PhaseSummary(NamedTuple):
    """A phase of a motion."""

    name: str
    start: float  # [s]
    end: float
    load: float  # the mass that the platform carries [kg]
    # smallest and largest audited tension [N]; None if none exist at some time, or none were evaluated
    tension_min: float | None
    tension_max: float | None
    # the largest sum of the forces of the ground [N]; None for a phase without ground, or without tensions
    reaction_max: float | None


@dataclass(frozen=True)
class PlanData(Displayed):
    """A planned motion and its audit, without figures, files and reports.

    Attributes:
        scenario: The robot and the task.
        status: See `MotionStatus`.
        deviation: Planned free coordinates and tensions at the nodes; None if the task fixes the motion.
        audit: The dense evaluation that decides whether the plan is feasible.
        build_s, solve_s: Wall time to build and to solve the nonlinear programs [s], over all attempts; 0 if none was
            solved.
        reason: If the status is `not-found`: the reason why the search ended.
        iterations, message: Iterations and message of the last run of the solver.
        iterates: Rows of (iteration, objective, infeasibility) of all runs of the solver, in order; each run starts at
            0.
        stages: The stages of the planner, in order, with their messages and times.
        objective: Final value of the task's objective in the program; None if no program has it.
        robust: Tension spread due to geometric uncertainty; None unless the task requires it.
        stop: The longest stop on the path from an instant of the plan; None unless the task has `stop_within`.
        offers: Computes `relaxations`.
        law: Result of `time_along`: the fastest time law along the path with its active limits, or the point where none
            exists; None for other plans.
    """

    scenario: Scenario
    status: MotionStatus
    deviation: Deviation | None
    audit: Audit
    build_s: float
    solve_s: float
    reason: str = ""
    iterations: int = 0
    message: str = ""
    iterates: tuple[tuple[int, float, float], ...] = ()
    stages: tuple[PlannerStep, ...] = ()
    objective: float | None = None
    robust: RobustMargin | None = None
    stop: Stop | None = None
    offers: Callable[[], Offers] = field(default=Offers, repr=False, compare=False)
    law: FastestLaw | None = field(default=None, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return the state for a pickle, with computed relaxations."""
        return {**self.__dict__, "offers": partial(Offers, *self._offered)}

    def _picture(self) -> str:
        robot, audit = self.scenario.robot, self.audit
        return tensions_over_time(audit.times, audit.tensions, robot.t_min, robot.t_max)

    @property
    def feasible(self) -> bool:
        """Return whether the audit confirms every limit of task and robot."""
        return self.status is MotionStatus.FEASIBLE

    @property
    def duration(self) -> float:
        """Return the duration of the motion [s]; if no time law exists, the motion only shows the path."""
        return self.scenario.duration

    @property
    def tension_min(self) -> float | None:
        """Return the smallest audited tension [N]; None if no tensions exist at some time."""
        return float(self.audit.tensions.min()) if np.isfinite(self.audit.tensions).all() else None

    @property
    def tension_max(self) -> float | None:
        """Return the largest audited tension [N]; None if no tensions exist at some time."""
        return float(self.audit.tensions.max()) if np.isfinite(self.audit.tensions).all() else None

    @property
    def margin(self) -> float | None:
        """Return the smallest distance of any tension from its limits [N]; None if no tensions exist at some time."""
        tensions, t_min = self.audit.tensions, self.scenario.t_min_at(self.audit.times)
        inside = np.minimum(tensions - t_min, self.scenario.robot.t_max - tensions)
        return float(inside.min()) if np.isfinite(inside).all() else None

    @property
    def tracking_error_max(self) -> float:
        """Return the largest distance of the platform from its path [m]."""
        return float(self.audit.tracking_error.max())

    @cached_property
    def waypoint_distance(self) -> WaypointDistance | None:
        """Return the waypoint that the motion passes at the largest distance; None for a path without waypoints.

        It is measured on the motion. Straight legs round their points by up to `blend`, and in a tube the distance may
        be larger.
        """
        scenario, audit = self.scenario, self.audit

        def pose_at(times: np.ndarray) -> np.ndarray:
            return scenario.pose_on_path(*scenario.motion(times, self.deviation))

        stations = scenario.path.stations(scenario.duration)
        if not stations.names:  # of a spline with the fastest time law, when it passes them is not known
            stations = scenario.task.path.stations(scenario.duration)
            stations = stations._replace(times=np.full(len(stations.names), np.nan))
        if scenario.task.phases is not None:  # whose paths are the parts of a sequence
            names = tuple(name.replace("parts", "phases", 1) for name in stations.names)
            stations = stations._replace(names=names)
        poses = scenario.pose_on_path(audit.motion, audit.carriers)
        return waypoint_distance(stations, audit.times, poses, pose_at)

    @property
    def certificate(self) -> Certificate | None:
        """Return the certificate with the largest shortfall, with its time and wind; None for a feasible plan.

        It is also None if tensions exist throughout and only other limits are exceeded (`audit.excess`). The direction
        is in {G}; `wind` is set for a task with a box of winds.
        """
        return None if self.feasible else self.audit.certificate

    @cached_property
    def _offered(self) -> Offers:
        return self.offers()

    @property
    def relaxations(self) -> tuple[Relaxed, ...]:
        """Return feasible variations of an infeasible task; may be empty.

        Relaxations with the same plan apply only together. They are computed on first use, which can take longer than
        the plan: programs with a limited number of iterations are solved for them, in the time that remains of
        `time_limit`.
        """
        return tuple(self._offered.found)

    @property
    def cut_short(self) -> bool:
        """Return whether the search for relaxations stopped before all were tried, at its number of iterations."""
        return self._offered.cut_short

    @property
    def relaxed(self) -> Relaxed | None:
        """Return the first of the relaxations; None if there is none."""
        return next(iter(self.relaxations), None)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Return possible problems that no limit covers, one sentence each: read them before a robot moves.

        A motion with warnings can be feasible: no limit of the task or the robot forbids them.
        """
        audit, scenario = self.audit, self.scenario
        some = slice(None, None, max(len(audit.times) // MOST_WARNED, 1))
        seen = Instants(scenario.dynamics, audit.times[some], audit.motion.pose[some], audit.carriers.pose[some])
        limited = partial(audit.limiting, some)
        inside = into_places(seen, scenario.limits, limited) + between_points(seen, scenario.limits, limited)
        others = (*outside_frame(seen), *short_cables(seen), *fixed_cables(seen, audit.tensions[some]))
        others += tuple(into_each_other(seen))
        if scenario.task.base.kind == "free":
            others = (*others, *weak_formation(seen, scenario.task.objective.formation))
        units = slipped_units(scenario.robot, scenario.task)
        path = scenario.task.path
        return (*units, *long_turns(path), *leaves_its_points(path), *inside, *others)

    @cached_property
    def infeasible_spans(self) -> tuple[Certificate, ...]:
        """Return a certificate of the worst instant of each span without tensions, in order of time.

        The certificate's `span` holds the first and the last audited instant of the span [s], its `time` the worst one.
        If there are more than `MOST_SPANS` spans, the worst are returned.
        """
        audit = self.audit
        short = np.concatenate([[False], audit.violation > audit.tolerance, [False]])
        edges = np.flatnonzero(short[1:] != short[:-1]).reshape(-1, 2)  # first row, and the one after the last
        edges = sorted(edges.tolist(), key=lambda edge: -audit.violation[slice(*edge)].max())[:MOST_SPANS]
        certificates = []
        for first, after in sorted(edges):
            row = first + int(audit.violation[first:after].argmax())
            time, platform = float(audit.times[row]), audit.motion.at(row)
            certificate = worst_certificate(self.scenario, time, platform, audit.carriers.pose[row])
            if certificate is not None:
                span = (float(audit.times[first]), float(audit.times[after - 1]))
                certificates.append(replace(certificate, time=time, span=span))
        return tuple(certificates)

    @cached_property
    def phases(self) -> tuple[PhaseSummary, ...]:
        """Return name, times, load, tensions and ground reaction of each phase; empty for a task without phases."""
        result, audit, phases = [], self.audit, self.scenario.phases
        for index, phase in enumerate(phases.all):
            tensions = audit.tensions[rows := phases.index_at(audit.times) == index]
            there = bool(tensions.size and np.isfinite(tensions).all())  # shown instants may step over a short phase
            extremes = (float(tensions.min()), float(tensions.max())) if there else (None, None)
            reaction = None
            if phase.rests and there and audit.supports is not None:
                reaction = float(audit.supports[rows].sum(axis=1).max())
            result.append(PhaseSummary(phase.name, phase.start, phase.end, float(phase.load[0]), *extremes, reaction))
        return tuple(result)

    def share_of_robots(self, count: int = 200, seed: int = 0) -> RobotShare:
        """Sample robots from the uncertainty, and check whether each has tensions inside its limits along the motion.

        Poses and required wrenches are from the plan, at some 200 times. Nothing is linearised: each robot has its
        own wrench matrices, and the exact solver decides.

        Args:
            count: Number of robots.
            seed: Seed of the random numbers.

        Raises `InputError` if an argument is wrong, or the robot has no uncertainty.
        """
        audit, scenario = self.audit, self.scenario
        rows = np.unique(np.linspace(0, len(audit.times) - 1, DRAWN_AT).round().astype(int))
        motion, carriers = audit.motion.at(rows), audit.carriers.at(rows)
        w = scenario.required_wrench(audit.times[rows], motion, carriers, scenario.wind)
        return share_of_robots(scenario.robot, motion.pose, w, carriers.pose, count, seed)

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `towline plan --json`, ready for JSON; missing numbers are None."""
        return {
            "feasible": self.feasible,
            "status": self.status.value,
            "reason": self.reason,
            "duration": self.duration,
            "tension_min": self.tension_min,
            "tension_max": self.tension_max,
            "margin": self.margin,
            "tracking_error_max": self.tracking_error_max,
            "warnings": list(self.warnings),
            "waypoint_distance": None if self.waypoint_distance is None else self.waypoint_distance.to_dict(),
            "build_s": self.build_s,
            "solve_s": self.solve_s,
            "iterations": self.iterations,
            "solver_message": self.message,
            "audit": self.audit.to_dict(),
            "robust": None if self.robust is None else self.robust.to_dict(),
            "stop": None if self.stop is None else self.stop.to_dict(),
            "certificate": None if self.certificate is None else self.certificate.to_dict(),
            "infeasible_spans": [certificate.to_dict() for certificate in self.infeasible_spans],
            "relaxations": [relaxed.to_dict() for relaxed in self.relaxations],
            "relaxations_cut_short": self.cut_short,
            "phases": [phase._asdict() for phase in self.phases],
            "stages": [stage._asdict() for stage in self.stages],
            **({} if self.law is None else self.law.to_dict()),
            **({} if self.law is None or self.law.exists else {"duration": None}),
        }


@dataclass(frozen=True)
class Relaxed(Displayed):
    """A feasible variation of the requested task, and its plan.

    Attributes:
        name, unit: Field of the task that differs, or a description, and its unit.
        requested, possible: Value in the task, and the closest value with a known feasible plan.
        plan: The plan of the varied task.
        detail: What is said of it behind the value, such as the end of a shorter line; may be empty.
    """

    name: str
    unit: str
    requested: float
    possible: float
    plan: Any  # a `Plan`, which is above this file
    detail: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return {"name", "unit", "requested", "possible", "detail"} for JSON."""
        return {name: getattr(self, name) for name in ("name", "unit", "requested", "possible", "detail")}
