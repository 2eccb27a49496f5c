"""Prove a task infeasible from values that the planner cannot change, before any program is solved: `infeasible_ends`.

Where the platform starts and ends, and along a path that it must follow, some coordinates have no freedom. Whether a
limit that depends on these alone is kept does not depend on the planner. Nor does whether tensions exist, where the
task fixes all of platform and carriers, or whether all cables together can carry the weight. A distance from an
obstacle changes by at most the distance that points of the platform can move inside the tube.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, Self

import casadi as ca
import numpy as np

from ...base.text import quantity
from ...solvers import Certificate
from ..audits.audit import Audit
from ..audits.by_phase import distribution
from ..audits.checks import LENGTH_TOLERANCE
from ..audits.excess import Excess
from ..limits import Limit, Rate
from ..tasks.ends import AT_REST, fixed_values
from ..tasks.paths import Motion
from ..tasks.scenario import ATTITUDE, Scenario
from .blocked_tube import blocked_tube
from .no_attitude import CERTAIN, no_attitude, out_of_reach
from .no_cycle import no_cycle
from .too_fast import too_fast
from .too_heavy import OF_DURATION, too_heavy, too_weak_carriers

PLACES = 41  # along the path
GIVEN, NEAR, FREE = range(3)  # of a value: no freedom, freedom inside the tube, chosen by the planner


class InfeasibleEnds(NamedTuple):
    """The proof that no motion keeps a task's limits."""

    excess: list[Excess]  # each limit that is exceeded whatever the planner chooses, where it is exceeded by most
    # That of an end at which no tensions exist; None if both ends have tensions or are not fixed.
    certificate: Certificate | None

    def describe(self) -> str:
        """Return one line for a person."""
        lines = [str(excess) for excess in self.excess[:1]]
        if self.certificate is not None:
            lines.append(f"no tensions at t = {self.certificate.time:.3f} s")
        return "; ".join(lines)

    def of(self, audit: Audit) -> Audit:
        """Return an audit that shows what is proven, and no more."""
        return replace(audit, excess=self.excess, certificate=self.certificate)


def infeasible_ends(scenario: Scenario) -> InfeasibleEnds | None:
    """Return the proof that a task is impossible, if its ends or a path that it must follow show it; else None."""
    task = _Known.of(scenario)
    proven = _exceeded(task) + _stretched(task)
    known = {(excess.limit, excess.about) for excess in proven}
    given = task.given
    hurried = [*_hurried(task)]
    hurried += too_weak_carriers(scenario, task.times[given], task.platform.at(given), task.carriers.at(given))
    durations = [excess for excess in hurried if excess.limit == OF_DURATION]
    proven += [max(durations, key=lambda excess: excess.bound)] if durations else []
    known |= {(excess.limit, excess.about) for excess in durations}
    proven += [excess for excess in hurried if (excess.limit, excess.about) not in known]
    proven += too_heavy(scenario, task.resting())
    certificate = _without_tensions(task) or _beyond_reach(task)
    if not proven and certificate is None:
        proven += _at_no_attitude(task) or no_cycle(scenario)
        proven += blocked_tube(scenario, task.platform.pose[:2], lambda k, point: task.reach(k, point[None]))
    return InfeasibleEnds(proven, certificate) if proven or certificate is not None else None


class _Known(NamedTuple):
    """The motion of a task at its start, its end and places between, in this order, and the freedom of its values."""

    scenario: Scenario
    times: np.ndarray  # (n,) [s]
    freedom: list[np.ndarray]  # at start, end and between: of each value of platform and carriers, (1 + c, 3, 6)
    platform: Motion  # in {G}, where it is given
    carriers: Motion  # likewise

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Return what is known of the motion of a task."""
        times = np.concatenate([[0.0, scenario.duration], np.linspace(0.0, scenario.duration, PLACES)[1:-1]])
        platform, carriers = scenario.motion(times, None)
        owners = scenario.owners()
        for fixed in fixed_values(scenario):
            owner, coordinate = owners[fixed.column]
            where = (coordinate,) if owner is None else (owner, coordinate)
            if owner is not None or not scenario.relative:
                (platform if owner is None else carriers)[fixed.order][(abs(fixed.end), *where)] += fixed.value
        return cls(scenario, times, [_freedom(scenario, end) for end in (0, -1, None)], platform, carriers)

    @property
    def which(self) -> np.ndarray:
        """Return which entry of `freedom` each time has, (n,)."""
        return np.minimum(np.arange(len(self.times)), 2)

    @property
    def given(self) -> np.ndarray:
        """Return at which times the whole motion of the platform is given, (n,)."""
        return ~np.array([each[0].any() for each in self.freedom])[self.which]

    def reach(self, which: int, points: np.ndarray | None = None) -> float:
        """Return how far points of the platform (k, 3) can be from where the reference has them [m]; default: any."""
        robot, tube, freedom = self.scenario.robot, self.scenario.task.tube, self.freedom[which]
        if points is None:
            points = np.vstack([robot.attachments, robot.platform.com, self.scenario.body_corners])
        turns = tube.turn * (freedom[0, 0, list(ATTITUDE)] == NEAR).sum()
        moves = tube.radius if (freedom[0, 0, :3] == NEAR).any() else 0.0
        return float(moves + turns * np.linalg.norm(points, axis=1).max())

    def resting(self, count: int = 6) -> np.ndarray:
        """Return which of platform and carriers have no speed in the first coordinates at both ends, (2, 1 + c)."""
        speeds = np.concatenate([self.platform.velocity[:2, None], self.carriers.velocity[:2]], axis=1)[:, :, :count]
        given = np.stack([self.freedom[end][:, 1, :count] == GIVEN for end in (0, 1)])
        return np.all(given & (np.abs(speeds) < AT_REST), axis=2)


def _freedom(scenario: Scenario, end: int | None) -> np.ndarray:
    """Return the freedom of each value of the platform, then of each carrier, (1 + c, 3, 6), at an end or between."""
    freedom = np.full((1 + len(scenario.robot.carriers), 3, 6), GIVEN)
    if scenario.duration_range is not None:
        platform, carriers = scenario.references(np.array([0.0, scenario.duration]))
        for body, reference in enumerate((platform, *carriers)):
            for order in (1, 2):
                moves = reference[order][end].any() if end is not None else reference[order].any() or body == 0
                freedom[body, order] = FREE if moves else GIVEN
    for owner, coordinate in scenario.owners():
        freedom[0 if owner is None else 1 + owner, :, coordinate] = FREE
        if owner is None:
            freedom[0, 0, coordinate] = NEAR
    owners = scenario.owners()
    for fixed in fixed_values(scenario):
        owner, coordinate = owners[fixed.column]
        if fixed.end == end:
            freedom[0 if owner is None else 1 + owner, fixed.order, coordinate] = GIVEN
    undone = any(owners[fixed.column][0] is None and fixed.value for fixed in fixed_values(scenario))
    if scenario.relative and undone:  # rest in the frame of the carrier, on a path that moves there
        freedom[0, 1:] = FREE
    if scenario.relative:  # in {G} each value of the platform depends on all of the carrier's, and on its own
        for order in range(3):
            freedom[0, order] = FREE if freedom[1:, : order + 1].any() else freedom[0, : order + 1].max()
    return freedom


def _exceeded(task: _Known) -> list[Excess]:
    """Return the limits that are exceeded whatever the planner chooses, each where it is exceeded by most."""
    scenario, times, limits, exceeded = task.scenario, task.times, task.scenario.limits, []
    values = limits.along(task.platform, task.carriers, None, scenario.off_path(times, task.platform, task.carriers))
    worst: dict[int, tuple[float, Excess]] = {}
    for which, rows in enumerate((slice(0, 1), slice(1, 2), slice(2, None))):
        chosen, near = _dependent(scenario, task.freedom[which])
        reach = task.reach(which)
        for k, (limit, place) in enumerate(zip(limits, limits.places, strict=True)):
            if limit.soft is not None or isinstance(limit, Rate) or not (found := values[k][rows]).size:
                continue
            found = np.where(scenario.in_force(limit, times[rows])[:, None], found, np.nan)
            excess = _excess(limit, times[rows], found, chosen[place], near[place], reach)
            if excess is not None and (k not in worst or excess[0] > worst[k][0]):
                worst[k] = excess
    for _, excess in sorted(worst.values(), key=lambda pair: -pair[0]):
        if not any(excess.limit == other.limit and excess.about == other.about for other in exceeded):
            exceeded.append(excess)
    return exceeded


def _at_no_attitude(task: _Known) -> list[Excess]:
    """Return the limit that the platform exceeds at an end whatever attitude the planner chooses there."""
    scenario, platform, carriers = task.scenario, task.platform, task.carriers
    if scenario.relative:
        return []
    for end, freedom in enumerate(task.freedom[:2]):
        angles = [i for i in ATTITUDE if freedom[0, 0, i] == NEAR]
        if angles and (freedom[0, 0, :3] == GIVEN).all():
            usable = ~_dependent(scenario, freedom)[0]
            pose, places = platform.pose[end], carriers.pose[end]
            moves = np.abs([platform.velocity[end], platform.acceleration[end]]).max() > AT_REST
            rests = not moves and (freedom[0, 1:] == GIVEN).all() and (freedom[1:, 0] == GIVEN).all()
            if proven := no_attitude(scenario, float(task.times[end]), angles, pose, places, usable, bool(rests)):
                return proven
    return []


def _stretched(task: _Known) -> list[Excess]:
    """Return the worst cable that cannot keep the length that its drive fixes, wherever in its reach its carrier is."""
    scenario, robot = task.scenario, task.scenario.robot
    if robot.fixed_lengths is None:
        return []
    fixed, lengths = robot.fixed_lengths, scenario.dynamics.cable_lengths(task.platform.pose, task.carriers.pose)
    nearest = _nearest_lengths(scenario, task.platform.pose, task.carriers.pose)
    off, given = np.empty_like(lengths), np.empty(lengths.shape, bool)
    for which, rows in enumerate((slice(0, 1), slice(1, 2), slice(2, None))):
        free = task.freedom[which][:, 0].max(axis=1)
        given[rows] = (free[1:] == GIVEN)[robot.carrier_of_cable]
        off[rows] = np.where(given[rows], np.abs(lengths[rows] - fixed), nearest[rows] - fixed)
        off[rows] -= task.reach(which) if free[0] < FREE else np.inf
    row, cable = np.unravel_index(off.argmax(), off.shape)
    if off[row, cable] <= LENGTH_TOLERANCE:
        return []
    length, why = lengths[row, cable], "the drive fixed-length keeps it constant"
    if not given[row, cable]:
        length, why = nearest[row, cable], f"{why}; here its carrier is as near as its reach permits"
    facts = (float(task.times[row]), float(length), float(fixed[cable]), "m", "exactly", why)
    return [Excess("cable_length", f"cable {cable + 1}", *facts)]


def _nearest_lengths(scenario: Scenario, platform: np.ndarray, carriers: np.ndarray) -> np.ndarray:
    """Return the smallest lengths of cables, wherever in its reach box a carrier is, (n, m) [m]; -inf without one."""
    robot, attachments = scenario.robot, scenario.dynamics.points(platform, carriers)[1]
    nearest = np.full(attachments.shape[:2], -np.inf)
    for cable, owner in enumerate(robot.carrier_of_cable):
        box, at = scenario.reach(owner), attachments[:, cable]
        if box is not None:
            apart = np.maximum(np.maximum(np.subtract(box.min, at), np.subtract(at, box.max)), 0.0)
            nearest[:, cable] = np.linalg.norm(apart, axis=1) - np.linalg.norm(robot.anchors[cable])
    return nearest


def _hurried(task: _Known) -> Iterator[Excess]:
    """Yield the limits of speeds and accelerations that are exceeded because the duration is too short."""
    scenario, robot, order = task.scenario, task.scenario.robot, np.argsort(task.times)
    which = task.which[order]
    poses = np.concatenate([task.platform.pose[None], task.carriers.pose.swapaxes(0, 1)])[:, order]
    spread, centres = np.zeros((len(poses), 3)), np.zeros((2, 3))
    for kind, its in enumerate(task.freedom):
        spread[:, kind] = np.where((its[:, 0] == FREE).any(axis=1), np.inf, 0.0)
        for k, point in enumerate((np.zeros(3), np.array(robot.platform.com))):
            centres[k, kind] = spread[0, kind] + task.reach(kind, point[None])
        spread[0, kind] += task.reach(kind)
    if scenario.duration_range is not None:
        spread[0, 2], centres[:, 2] = np.inf, np.inf  # the planner may choose when the platform is where on its path
    if robot.fixed_lengths is not None:  # no carrier is farther from its attachments than its cables are long
        far = robot.fixed_lengths + np.linalg.norm(robot.anchors, axis=1) + LENGTH_TOLERANCE
        attachments = scenario.dynamics.points(task.platform.pose, task.carriers.pose)[1][order]
        for index in np.flatnonzero(np.isinf(spread[1:]).any(axis=1)):
            own = np.flatnonzero(robot.carrier_of_cable == index)
            cable = own[far[own].argmin()]
            poses[1 + index, :, :3], spread[1 + index] = attachments[:, cable], spread[0] + far[cable]
    resting = [np.all(task.resting(count), axis=0) for count in (3, 6)]
    return too_fast(scenario, task.times[order], poses, spread[:, which], *resting, centres=centres[:, which])


def _dependent(scenario: Scenario, freedom: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which values of all limits depend on what the planner chooses, and which on the tube's freedom alone."""
    function = scenario.limits.function
    count = function.numel_out(0)
    on_platform = freedom[0, 0] != GIVEN
    of_input = [*freedom.reshape(len(freedom), -1), np.full(scenario.robot.m, FREE), np.where(on_platform, FREE, GIVEN)]
    chosen, near = np.zeros(count, bool), np.zeros(count, bool)
    for i, kinds in enumerate(of_input):
        depends = ca.DM(function.jac_sparsity(0, i), 1.0).full() > 0
        chosen |= depends[:, kinds == FREE].any(axis=1)
        near |= depends[:, kinds == NEAR].any(axis=1)
    return chosen, near


def _excess(
    limit: Limit, times: np.ndarray, values: np.ndarray, chosen: np.ndarray, near: np.ndarray, reach: float
) -> tuple[float, Excess] | None:
    """Return by what part of its scale a limit is exceeded at some of `times`, and the excess itself."""
    over = limit.over(times, values)
    if over.shape[1] != values.shape[1]:  # one value of all components
        chosen, near = (np.array([each.any()]) for each in (chosen, near))
    room = np.where(chosen, np.inf, np.where(near, limit.per_metre * reach + CERTAIN, 0.0))
    beyond = np.maximum(limit.low - over, over - limit.high) - room
    beyond = np.where(np.isnan(beyond), -np.inf, beyond)
    if beyond.max() <= limit.tolerance:
        return None
    row, which = np.unravel_index(beyond.argmax(), beyond.shape)
    changes = f"inside the tube this changes by at most {quantity(room[which], limit.unit, digits=3)}"
    excess = Excess.of(limit, int(which), times[row], over[row, which], changes if near[which] else "")
    return float(beyond[row, which]) / limit.scale, excess


def _beyond_reach(task: _Known) -> Certificate | None:
    """Return the certificate of the worst given pose at which carriers cannot hold the platform from their boxes."""
    given = task.given & ~task.scenario.phases.resting(task.times)
    free = np.array([each[1:, 0].any(axis=1) for each in task.freedom])[task.which[given]]
    return out_of_reach(task.scenario, task.times[given], task.platform.at(given), task.carriers.at(given), free)


def _without_tensions(task: _Known) -> Certificate | None:
    """Return the certificate of the worst end at which the task gives all poses and no feasible tensions exist.

    None if feasible tensions exist at both ends, or may exist.
    """
    scenario, times, platform, carriers = task.scenario, task.times, task.platform, task.carriers
    worst: Certificate | None = None
    for row, freedom in enumerate(task.freedom[:2]):
        if freedom[0].any() or freedom[1:, 0].any():
            continue
        one = slice(row, row + 1)
        A = scenario.dynamics.wrench_matrix(platform.pose[one], carriers.pose[one])
        distribute = distribution(scenario, times[one], A)
        moving, bases = platform.at(one), carriers.at(one)
        for wind, extreme in scenario.cases_at(platform.pose[row], platform.velocity[row]):
            result = distribute(scenario.required_wrench(times[one], moving, bases, wind, extreme), None)
            found = result.certificate
            if found is None or max(float(result.violation[0]), result.beyond) <= distribute.tolerance:
                continue
            if worst is None or found.shortfall > worst.shortfall:
                at = None if scenario.wind_set is None else wind
                time = float(times[row])
                worst = replace(found, time=time, wind=at, load=scenario.load_of(time, extreme))
    return worst
