"""A task laid out for one robot: reference motions at any time, and which coordinates are free to deviate from them.

Every motion is a reference plus a deviation: the platform follows its path inside a tube, a free carrier moves about
its home. The deviations are the unknowns of the planner, piecewise polynomials of the time (`scheme`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...base.display import Displayed
from ...models import Dynamics, Robot, points
from ...models.part import Box, PositiveRange, Vector3
from ...models.shapes import skeleton
from ..costs.cost import Cost
from ..costs.terms import (
    CarrierAcceleration,
    CarrierOffset,
    Costs,
    Formation,
    Jerk,
    Margin,
    PathDeviation,
    Tension,
    TensionRate,
    Time,
)
from ..limits.limit import Hull, Limit
from ..limits.limits import Limits
from .deviation import Deviation
from .paths import AnyPath, Motion, RestPath, TimedPath, WaypointPath
from .phase import LaidPhase, Phases
from .scheme import LINEAR, SCHEMES, Scheme
from .task import FreeBase, Task
from .wind_set import WindBox, WindDisc, WindSet, as_wind, possible_winds_at

POSITION, ATTITUDE = range(3), range(3, 6)
AUDIT_RATE = 1000.0  # [1/s]: the audit looks at every millisecond
LEAST_AUDIT_RATE = 100.0  # [1/s], of motions for which `AUDIT_RATE` would take more than `MANY_SAMPLES`
MANY_SAMPLES = 200_000
LEAST_INTERVALS = 200  # of the audit: short motions are audited between their ends too
START_BAND = 1e-4  # of the force scale: how far planned tensions may start from the measured ones
MOST_SAMPLES = 1_000_000  # of the audit
FEW = 20  # intervals of the saved trajectory of a motion that is shorter than two of its samples


def least_audit_rate(task: Task) -> float:
    """Return how many instants per second an audit looks at, at least [1/s]: phases may be short.

    If instants are far apart, the audit adds others between them (`audits.peaks`).
    """
    return AUDIT_RATE if task.phases else LEAST_AUDIT_RATE


@dataclass(frozen=True)
class Scenario(Displayed):
    """A robot and its task, with the quantities that follow from both."""

    robot: Robot
    task: Task
    path: AnyPath  # of the platform: the task's, or the same geometry with a time law that the planner chose
    dynamics: Dynamics
    relative: bool  # whether the platform's path is given in the frame of the robot's only carrier
    platform_free: list[int]  # coordinates of the platform that may leave the path
    carrier_free: list[tuple[int, int]]  # (carrier, coordinate) pairs that the planner chooses
    limits: Limits
    carrier_paths: dict[int, AnyPath] = field(repr=False)
    duration: float  # [s]; of a task that leaves it free: where the planner starts, then what it chose
    phases: Phases = field(default_factory=Phases, repr=False)  # of the task, if it has some
    passing: bool = False  # whether each leg of the path has its own duration (`search.passing_times`)
    tightened: np.ndarray | float = 0.0  # by how much the tension limits are, for the uncertain robots, (m,) [N]

    @cached_property
    def costs(self) -> Costs:
        """Return the costs of the task."""
        return cost_list(self.robot, self.task)

    @cached_property
    def body_corners(self) -> np.ndarray:
        """Return the corners of the bodies of platform and loads in the platform's frame, (k, 3) [m]."""
        loads = [phase.load.body for phase in self.task.phases or () if phase.load is not None]
        parts = [skeleton(body).corners for body in (self.robot.platform.body, *loads) if body is not None]
        return np.concatenate([np.zeros((0, 3)), *parts])

    def moving_points(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        """Return the points of platform (n, 6) and carriers (n, c, 6) between which all others are, (n, k, 3) [m]."""
        corners = points.placed(platform, np.vstack([self.robot.platform.com, self.body_corners]))
        return np.concatenate([*self.dynamics.points(platform, carriers), corners, carriers[..., :3]], axis=1)

    def in_force(self, limit: Limit, times: np.ndarray) -> np.ndarray:
        """Return at which of `times` a limit holds, (n,): in its phases, their boundaries included."""
        if limit.phases is None:
            return np.ones(len(times), bool)
        within = [self.phases.within(self.phases.all[index], times) for index in limit.phases]
        return np.any(within, axis=0)

    @property
    def scheme(self) -> Scheme:
        """Return the scheme of the acceleration between the nodes."""
        return SCHEMES[self.task.scheme or LINEAR.name]

    @property
    def duration_range(self) -> PositiveRange | None:
        """Return the range from which the planner chooses the duration; None if it is given."""
        return self.task.duration if isinstance(self.task.duration, PositiveRange) else None

    @property
    def stretches(self) -> bool:
        """Return whether another duration only changes the time along all paths."""
        return all(path.stretches for path in (self.path, *self.carrier_paths.values()))

    @property
    def wind(self) -> Vector3 | None:
        """Return the wind of the planned tensions in {G} [m/s], of several the middle, or None without air."""
        wind = self.task.wind
        return wind.middle if isinstance(wind, WindBox | WindDisc) else wind

    @property
    def wind_set(self) -> WindSet | None:
        """Return the winds in which tensions must exist; None if the task has one wind or none."""
        return self.task.wind if isinstance(self.task.wind, WindBox | WindDisc) else None

    def cases_at(self, pose: np.ndarray, velocity: np.ndarray) -> list[tuple[Vector3 | None, int | None]]:
        """Return the winds and the extreme loads with which tensions must exist at a motion (6,) in {G}.

        Of several winds, these are the worst. A wind of None means no air, a load of None the given load.
        """
        if self.wind_set is None:
            return [(self.wind, load) for load in (None, *range(self.phases.extremes))]
        winds = possible_winds_at(self.wind_set, self.robot, pose[None], velocity[None])
        return [(as_wind(values[0]), None) for values in winds]

    @property
    def decisive(self) -> int:
        """Return how many winds, or extreme loads, decide whether tensions exist with all."""
        aero, winds = self.robot.platform.aero, self.wind_set
        return self.phases.extremes if aero is None or winds is None else winds.count(aero)

    def lasting(self, seconds: float) -> Scenario:
        """Return the scenario with another duration [s]."""
        return replace(self, duration=seconds)

    def held(self, seconds: float) -> Scenario:
        """Return the scenario of the task whose duration is given [s]."""
        return replace(self, task=self.task.model_copy(update={"duration": seconds}), duration=seconds)

    def along(self, path: AnyPath, seconds: float) -> Scenario:
        """Return the scenario with another path of the platform, in the same frame, and its duration [s]."""
        return replace(self, path=path, duration=seconds)

    @property
    def count(self) -> int:
        """Return the number n of free coordinates."""
        return len(self.platform_free) + len(self.carrier_free)

    @property
    def is_fixed(self) -> bool:
        """Return whether the task leaves nothing to choose but tensions."""
        return self.count == 0 and self.duration_range is None

    @property
    def longest(self) -> float:
        """Return the longest duration that is tried where a longer one may help [s]; longer audits take minutes."""
        given = self.duration if self.duration_range is None else self.duration_range.max
        return max(MOST_SAMPLES / max(AUDIT_RATE, self.task.output_rate), given)

    @property
    def output_samples(self) -> int:
        """Return how many intervals the saved trajectory has: `FEW` where its rate would leave both ends alone."""
        samples = round(self.duration * self.task.output_rate)
        return samples if samples > 1 else FEW

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the tension limits less the task's margin if that is hard, and tightened, (m,) each [N]."""
        inside = self.hard_margin + self.tightened
        return self.robot.t_min + inside, self.robot.t_max - inside

    def bounds_in(self, phase: LaidPhase | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the tension limits in a phase, less the margin: of cables that may be slack the lower one is 0."""
        low, high = self.bounds()
        return (np.zeros_like(low), high) if phase is not None and phase.slack else (low, high)

    def bounds_at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the tension limits at `times` less the margin, (n, m) each [N]: of both phases at a boundary."""
        low, high = self.bounds()
        return self._where_taut(times, low), np.tile(high, (len(times), 1))

    @property
    def start_tensions(self) -> np.ndarray | None:
        """Return the tensions with which the motion starts, (m,) [N], inside their limits; None if they are free."""
        initial = self.task.initial
        if initial is None or initial.tensions is None:
            return None
        low, high = self.bounds_at(np.zeros(1))
        return np.clip(initial.tensions, low[0], high[0])

    def t_min_at(self, times: np.ndarray) -> np.ndarray:
        """Return the smallest tensions at `times`, (n, m) [N]: zero where cables may be slack."""
        return self._where_taut(times, self.robot.t_min)

    def _where_taut(self, times: np.ndarray, low: np.ndarray) -> np.ndarray:
        """Return a lower limit (m,) at `times`, (n, m), and zero where all phases permit slack cables."""
        slack = np.ones(len(times), bool) if self.phases.all else np.zeros(len(times), bool)
        for phase in self.phases.all:
            slack &= phase.slack | ~self.phases.within(phase, times)
        return np.where(slack[:, None], 0.0, low)

    def required_wrench(
        self,
        times: np.ndarray,
        platform: Motion,
        carriers: Motion | None = None,
        wind: Vector3 | np.ndarray | None = None,
        extreme: int | None = None,
    ) -> np.ndarray:
        """Return the wrench that platform and load need at `times` for a motion in {G}, (n, 6) [N, N m].

        The load is the given one, or an `extreme` one.
        """
        w = self.dynamics.required_wrench(*platform, *(carriers or ()), wind=wind)
        loads = self.phases.loads_at(times, extreme) if self.phases.carry else None
        return w if loads is None else w + self.dynamics.carried_wrench(*platform, loads)

    def load_of(self, time: float, extreme: int | None) -> tuple[float, float, float, float] | None:
        """Return mass [kg] and CoM [m] of an extreme load at a time, for a certificate; None for the given one."""
        if extreme is None:
            return None
        mass, x, y, z = self.phases.loads_at(np.array([time]), extreme)[0, :4].tolist()
        return mass, x, y, z

    @property
    def hard_margin(self) -> float:
        """Return how far every tension must stay inside its limits [N]; a soft margin is among `limits`."""
        return 0.0 if "margin" in self.task.limits.soft else self.task.margin

    def references(self, times: np.ndarray) -> tuple[Motion, list[Motion]]:
        """Return the platform's path, in its own frame, and the carriers' reference motions in {G}."""
        platform = self.path.at(times, self.duration)
        carriers = []
        for index, home in enumerate(self.robot.carrier_home):
            path = self.carrier_paths.get(index)
            if path is None:
                path = RestPath(kind="rest", pose=tuple(home))
            carriers.append(path.at(times, self.duration))
        return platform, carriers

    def motion(self, times: np.ndarray, deviation: Deviation | None) -> tuple[Motion, Motion]:
        """Return the motion of platform, (n, 6) each, and carriers, (n, c, 6) each, in {G} with their deviations."""
        platform, carriers = self.references(times)
        if deviation is not None:
            values = deviation.evaluate(times)[:3]
            platform = platform.plus(value @ self.spread(None).T for value in values)
            carriers = [c.plus(value @ self.spread(i).T for value in values) for i, c in enumerate(carriers)]
        return in_world(self.dynamics, self.relative, platform, carriers)

    def pose_on_path(self, motion: Motion, carriers: Motion) -> np.ndarray:
        """Return the poses of the platform at `motion` in {G} in the frame of its path, (n, 6) [m, rad]."""
        return _pose_in(carriers.pose[:, 0], motion.pose) if self.relative else motion.pose

    def off_path(self, times: np.ndarray, motion: Motion, carriers: Motion) -> np.ndarray:
        """Return the offset of the platform at `motion` in {G} from its path, (n, 6) [m, rad], in the path's axes."""
        return points.shortest_way(self.pose_on_path(motion, carriers) - self.path.at(times, self.duration).pose)

    def passes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return when the platform has to pass inner points of its path [s], and their offsets from it.

        They are (k,) and (k, 6) [m, rad]; none unless `tube.waypoints` is exact.
        """
        if self.task.tube.waypoints != "exact" or not isinstance(self.path, WaypointPath | TimedPath):
            return np.zeros(0), np.zeros((0, 6))
        _, times, poses = self.path.stations(self.duration)
        times, poses = times[1:-1].clip(0.0, self.duration), poses[1:-1]
        return times, points.shortest_way(poses - self.path.at(times, self.duration).pose)

    def spread(self, body: int | None) -> np.ndarray:
        """Return the matrix (6, count) from free coordinates to the six of the platform (None) or of a carrier."""
        matrix = np.zeros((6, self.count))
        for column, (owner, coordinate) in enumerate(self.owners()):
            if owner == body:
                matrix[coordinate, column] = 1.0
        return matrix

    def free_of(self, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
        """Return the free coordinates among values of the platform (..., 6) and of carriers (..., c, 6), (..., n)."""
        whole = np.concatenate([platform[..., None, :], carriers], axis=-2)
        return whole[
            ..., [0 if owner is None else 1 + owner for owner, _ in self.owners()], [i for _, i in self.owners()]
        ]

    @cached_property
    def loose(self) -> list[int]:
        """Return the carriers that keep their distance from the platform rather than a position."""
        free = {owner for owner, coordinate in self.carrier_free if coordinate in POSITION}
        return [i for i in sorted(free) if not self.robot.carriers[i].confined]

    def reach(self, carrier: int) -> Box | None:
        """Return the box in {G} that a carrier never leaves [m]; None without one, or if that limit is soft."""
        return None if "carrier_reach" in self.task.limits.soft else self.robot.carriers[carrier].motion_limits.reach

    def moves(self, hull: Hull) -> bool:
        """Return whether the planner chooses a coordinate that a convex limit is about."""
        return any((hull.carrier, coordinate) in self.owners() for coordinate in hull.coordinates)

    def owners(self) -> list[tuple[int | None, int]]:
        """Return the owner of each free coordinate: (None for the platform or the carrier's index, coordinate)."""
        return [*((None, coordinate) for coordinate in self.platform_free), *self.carrier_free]


def in_world(dynamics: Dynamics, relative: bool, platform: Motion, carriers: list[Motion]) -> tuple[Motion, Motion]:
    """Return motions in {G} of a platform, given in the frame of the only carrier if `relative`, and of all carriers.

    The carriers' is (n, c, 6). Derivatives by another parameter than the time are turned in the same way, by the
    chain rule.
    """
    if relative:
        pose, velocity, acceleration = dynamics.relative.motion_in_world(*platform, *carriers[0])
        pose[:, 3:] = np.unwrap(pose[:, 3:], axis=0)
        platform = Motion(pose, velocity, acceleration)
    return platform, Motion(*(np.stack(parts, axis=1) for parts in zip(*carriers, strict=True)))


def _pose_in(frame: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return poses (n, 6) given in {G} relative to frames at poses (n, 6)."""
    R = points.rotations(frame[:, 3:])
    turned = points.angles(R.swapaxes(1, 2) @ points.rotations(pose[:, 3:]))
    return np.hstack([points.in_frame(frame, pose[:, :3]), turned])


def cost_list(robot: Robot, task: Task) -> Costs:
    """Return the costs of `task`."""
    objective = task.objective
    costs: list[Cost] = [
        Tension(objective.tension or robot.force_scale),
        CarrierOffset(objective.carrier_offset),
        CarrierAcceleration(objective.carrier_acceleration),
        Jerk(objective.jerk),
    ]
    turn = 0.0 if task.tube.attitude == "free" else task.tube.turn
    deviation = objective.deviation or 0.1 * max(task.tube.radius, robot.length * turn)  # of the tube
    if 0 < deviation < np.inf:
        costs.append(PathDeviation(deviation))
    formation = objective.formation or _usual_formation(robot, task)
    for kind, amount in (
        (Formation, formation),
        (TensionRate, objective.tension_rate),
        (Time, objective.time),
        (Margin, objective.margin),
    ):
        if amount is not None:
            costs.append(kind(amount))
    return Costs(robot, (*costs, *objective.own))


def _usual_formation(robot: Robot, task: Task) -> float | None:
    """Return the mean length of the cables at home [m] if several carriers are free without `around`, or None."""
    base = task.base
    if not isinstance(base, FreeBase) or base.around or sum(carrier.moves for carrier in robot.carriers) < 2:
        return None
    return float(np.linalg.norm(robot.home_anchors - robot.home_attachments, axis=1).mean())
