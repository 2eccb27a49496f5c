"""What else would make a motion feasible: a nearer end, another place, feed or yaw, less wind or mass, other cables."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...base.text import quantity
from ...models import Robot
from ...solvers.margins import margins
from ..audits.audit import Audit
from ..audits.excess import TENSIONS
from ..audits.tensions import scaled
from ..global_path.at_rest import AtRest
from ..plan import Plan
from ..proofs.durations import durations
from ..proofs.infeasible_ends import InfeasibleEnds, infeasible_ends
from ..result import Relaxed
from ..tasks.deviation import Deviation
from ..tasks.ends import fixed_values
from ..tasks.lay_out import lay_out
from ..tasks.paths import AnyPath, CirclePath, FeedPath, LinePath, WaypointPath
from ..tasks.paths.shifted import shifted
from ..tasks.phase import Load
from ..tasks.scenario import POSITION, Scenario
from ..tasks.status import MotionStatus
from ..tasks.task import Tube
from ..tasks.wind_set import WindBox, WindDisc
from .given_states import near_given_states
from .largest_share import HALVINGS, RESERVES, Variation, largest_share
from .longer_phases import longer_phases
from .relaxations import LONGER, longer_durations, near_motion, other_duration, rounded, slower
from .search import Search
from .tilting import tilting_platform

PLACES = 31  # of a path, at which a shifted one is compared
SHIFT_STEP = 1.3  # of a shift to the next one that is tried
SHIFTS = SHIFT_STEP ** np.arange(-36, 0)  # that are tried, in parts of the distance between the farthest anchors
YAWS = np.deg2rad(np.arange(-180, 180, 5))  # that are tried
STRONGEST = 100.0  # times t_max: a motion that needs more is not one that stronger cables make feasible


def near_chosen_motion(
    search: Search, scenario: Scenario, deviation: Deviation | None, audit: Audit, proven: InfeasibleEnds | None = None
) -> list[Relaxed]:
    """Return what would make a motion feasible that the planner chooses; `audit` is that of the closest one.

    If no duration and no limit of the task does, it is what the platform could do exactly on its path. If the task is
    `proven` infeasible, a longer duration is only tried if that is not, and for flying carriers, whose programs take
    long, only if tensions exist at both ends.
    """
    slower_helps = True
    if proven is not None and scenario.stretches:
        flying = any(carrier.efforts for carrier in scenario.robot.carriers)
        shortest, longest = longer_durations(scenario)
        slower_helps = shortest < longest and not (flying and proven.certificate is not None)
    longer = longer_phases(search, scenario, audit) if slower_helps else []
    found = near_motion(search, scenario, deviation, audit, slower_helps) or near_given_states(search, scenario, audit)
    if found:
        return longer + found
    if scenario.carrier_free:  # only what is proven of it tells how near an end must be
        proof = infeasible_ends(scenario)
        return [] if proof is None or proof.certificate is None else _nearer_end(search, scenario)
    if np.abs([fixed.value for fixed in fixed_values(scenario)]).max(initial=0.0) > 0:
        return []  # no motion is exactly on the path
    along = search.audit_motion(scenario, None, "audit of the path")
    exact = lay_out(scenario.robot, scenario.task.model_copy(update={"tube": Tube()}))
    found = other_duration(search, scenario, durations(exact), along) if slower_helps else []
    return longer + (found or stronger_or_nearer(search, scenario, along))


def stronger_or_nearer(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return feasible variations of what a task does not name: where its path is, the platform's mass, t_max, t_min.

    `audit` is that of the motion exactly on the path. Each variation is one change; if speeds or accelerations are
    exceeded too, it may also need a longer duration, which is not tried in phases. The list is empty if the motion
    exceeds other limits, or for boxes of winds and uncertain robots.
    """
    task = scenario.task
    if isinstance(task.wind, WindBox | WindDisc) or task.robust is not None:
        return []
    if scenario.carrier_free:  # all others would solve many programs
        return _lighter_load(search, scenario)
    others = [excess for excess in audit.excess if excess.limit != TENSIONS]
    if others and task.phases is not None:
        return []
    factors = [slower(excess) for excess in others]
    found = slower_path(search, scenario, audit)
    if min(factors, default=2.0) <= 1.0 or (others and not scenario.stretches):
        blocked = any(excess.limit == "keep_out" for excess in others)  # ideas name other ends and ways round
        return found + ([] if blocked else _shifted_path(search, scenario, audit) or _nearer_end(search, scenario))
    seconds = rounded(LONGER * max(factors, default=1.0) * scenario.duration, up=True)
    for make in (
        tilting_platform,
        _nearer_end,
        _smaller_circle,
        _other_yaws,
        _less_wind,
        _lighter_load,
        _surer_load,
        _lighter_platform,
        _stronger_cables,
        _slacker_cables,
    ):
        its = make(search, scenario)
        if not its and others and seconds <= scenario.longest:
            longer = lay_out(scenario.robot, task.model_copy(update={"duration": seconds}))
            with_it = f", with a duration of {quantity(seconds, 's')}"
            its = [replace(each, detail=each.detail + with_it) for each in make(search, longer)]
        found += its
    return found + _shifted_path(search, scenario, audit)


def _nearer_end(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the farthest end of a straight line, as far from its start, up to which it is feasible."""
    path = scenario.task.path
    if not isinstance(path, LinePath):
        return []
    start, way = np.array(path.start), np.array(path.end) - np.array(path.start)
    whole, turns = float(np.linalg.norm(way[:3])), not way[:3].any()

    def to(share: float) -> Variation:
        end = start + share * way
        nearer = path.model_copy(update={"end": tuple(end.tolist())})
        place = ", ".join(f"{value:.4g}" for value in (np.rad2deg(end[3:]) if turns else end[:3]))
        varied = _along(scenario, nearer)
        if turns:
            return varied, 100 * share, f"of it, to roll, pitch, yaw ({place}) degrees"
        return varied, share * whole, f"of {quantity(whole, 'm')}, to ({place})"

    return (
        largest_share(search, to, "part of the rotation", "%")
        if turns
        else largest_share(search, to, "length of the line", "m")
    )


def _smaller_circle(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the largest radius of a circle, at its angular velocity, with which it is feasible."""
    path = scenario.task.path
    if not isinstance(path, CirclePath) or any(carrier.moves for carrier in scenario.robot.carriers):
        return []  # carriers that move with the platform may make all of it feasible

    def with_radius(share: float) -> Variation:
        smaller = path.model_copy(update={"radius": share * path.radius})
        return _along(scenario, smaller), share * path.radius, f"instead of {quantity(path.radius, 'm')}"

    return largest_share(search, with_radius, "path.radius", "m")


def slower_path(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the largest feed or angular velocity of a path that has its own, at which it is feasible.

    `audit` is that of the motion exactly on the path.
    """
    path, factors = scenario.task.path, [slower(excess) for excess in audit.excess if excess.limit != TENSIONS]
    if not isinstance(path, FeedPath | CirclePath) or min(factors, default=2.0) <= 1.0:
        return []
    fed = isinstance(path, FeedPath)
    fastest = path.rate if isinstance(path, CirclePath) else path.feed or max(path.feeds or (0.0,))
    others = ", the others by the same factor" if fed and path.feed is None else ""

    least = scenario.duration / scenario.longest  # else it would last too long to be audited

    def at(share: float) -> Variation:
        share = max(share, least)
        data = path.model_dump()  # a copy of the path would keep its law
        for name, power in (("rate", 1), ("drift", 1), ("feed", 1), ("feeds", 1), ("acceleration", 2)):
            if data.get(name) is not None:
                data[name] = (share**power * np.array(data[name])).tolist()
        push = f"{others}, with an acceleration of {quantity(data['acceleration'], 'm/s^2')}" if fed else ""
        return _along(scenario, type(path).model_validate(data)), share * fastest, push.removeprefix(", ")

    name, unit = ("path.feed", "m/s") if fed else ("path.rate", "rad/s")
    return largest_share(search, at, name, unit, up=fastest < 0, most=1.0 / max(factors, default=1.0))


def _shifted_path(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the smallest shift of the whole path along an axis of {G} with which it is feasible.

    Shifts are compared at rest, at some positions of the path; the audit decides. The list is empty where other
    positions of the carriers are better advice.
    """
    task, path, robot = scenario.task, scenario.task.path, scenario.robot
    movable = any(carrier.free_coordinates(robot.drive) for carrier in robot.carriers)
    if movable or scenario.relative or task.phases is not None or task.initial is not None:
        return []
    times = np.linspace(0.0, scenario.duration, PLACES)
    platform, carriers = scenario.motion(times, None)
    size = float(np.linalg.norm(np.ptp(robot.home_anchors, axis=0)))
    kept = AtRest(scenario, size)

    def holds(by: np.ndarray) -> bool:
        poses = platform.pose.copy()
        poses[:, :3] += by
        return bool((kept(poses, carriers.pose).slack >= 0).all())

    if holds(np.zeros(3)):
        return []
    shortest = np.full(3, np.inf)
    for way in (sign * np.eye(3)[axis] for axis in POSITION if robot.dof_mask[axis] for sign in (1, -1)):
        far = next((far for far in SHIFTS * size if far < np.abs(shortest).max() and holds(far * way)), None)
        if far is None:
            continue
        low, high = far / SHIFT_STEP, far
        for _ in range(HALVINGS // 2):
            middle = (low + high) / 2
            low, high = (low, middle) if holds(middle * way) else (middle, high)
        if high < np.abs(shortest).max():
            shortest = high * way
    if np.isinf(shortest).any():
        return []
    axis = int(np.abs(shortest).argmax())
    for reserve in RESERVES:
        by = rounded(float(np.abs(shortest[axis])) / reserve, up=True) * np.sign(shortest)
        moved = _along(scenario, shifted(path, by))
        audit = search.audit_motion(moved, None, "audit, shifted path")
        if audit.passed:
            plan = Plan(moved, MotionStatus.FEASIBLE, None, audit, 0.0, 0.0)
            return [Relaxed("shift of the path", "m", 0.0, float(by[axis]), plan, f"along {'xyz'[axis]}")]
    return []


def _other_yaws(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return feasible yaws for the points of the path at which no tensions hold the platform at rest.

    Each lies between the given yaw and the one with the largest capacity margin there, as near to the given one as
    tensions at rest permit, or by one factor less.
    """
    path, robot = scenario.task.path, scenario.robot
    if not isinstance(path, LinePath | WaypointPath) or scenario.relative or not robot.dof_mask[5]:
        return []
    line = isinstance(path, LinePath)
    points = np.array([path.start, path.end] if line else path.points)
    names = ["path.start", "path.end"] if line else [f"path.points[{i}]" for i in range(len(points))]
    wrong = np.flatnonzero(_margins_at_yaws(scenario, points, points[:, 5:])[:, 0] < 0)
    given, held = points[wrong, 5], _margins_at_yaws(scenario, points[wrong], np.tile(YAWS, (len(wrong), 1)))
    if not len(wrong) or held.max(axis=1).min() < 0:
        return []
    back = np.angle(np.exp(1j * (YAWS[held.argmax(axis=1)] - given)))
    shares = np.linspace(0.0, 1.0, len(YAWS))
    between = given[:, None] + back[:, None] * (1 - shares)
    nearest = shares[np.argmax(_margins_at_yaws(scenario, points[wrong], between) < 0, axis=1) - 1]

    def with_yaws(share: float) -> Variation:
        turned, yaws = points.copy(), given + (1 - share * nearest) * back
        turned[wrong, 5] = yaws
        rows = tuple(map(tuple, turned.tolist()))
        path_with_yaws = path.model_copy(update={"start": rows[0], "end": rows[-1]} if line else {"points": rows})
        others = [f"{quantity(yaw, 'rad')} at {names[i]}" for i, yaw in zip(wrong[1:], yaws[1:], strict=True)]
        detail = ", ".join([f"instead of {quantity(given[0], 'rad')}", *others])
        return _along(scenario, path_with_yaws), float(yaws[0]), detail

    found = largest_share(search, with_yaws, f"yaw at {names[wrong[0]]}", "rad", up=bool(back[0] > 0))
    return [replace(each, requested=float(given[0])) for each in found]


def _margins_at_yaws(scenario: Scenario, points: np.ndarray, yaws: np.ndarray) -> np.ndarray:
    """Return the capacity margins at rest at points (n, 6) with yaws (n, k), carriers as at the start, (n, k) [N]."""
    poses = np.repeat(points, yaws.shape[1], axis=0)
    poses[:, 5] = yaws.ravel()
    still, axes = np.zeros_like(poses), np.flatnonzero(scenario.robot.dof_mask)
    carriers = np.vstack([carrier.pose for carrier in scenario.references(np.zeros(1))[1]])
    A = scaled(scenario, scenario.dynamics.wrench_matrix(poses, carriers))[:, axes]
    w = scaled(scenario, scenario.dynamics.required_wrench(poses, still, still, wind=scenario.wind))[:, axes]
    return margins(A, w, *scenario.bounds()).reshape(yaws.shape)


def _along(scenario: Scenario, path: AnyPath) -> Scenario:
    """Return the scenario along another path. Where a given state is that of an end of the path, it moves with it."""
    times, changes = np.array([0.0, scenario.duration]), dict[str, object](path=path)
    motion = scenario.along(path, scenario.duration).motion(times, None)[0]
    for row, key in enumerate(("initial", "final")):
        state, moved = getattr(scenario.task, key), dict[str, tuple[float, ...]]()
        for name, values in zip(("pose", "velocity", "acceleration"), motion, strict=True):
            given = None if state is None else getattr(state, name)
            if given is not None:
                fixed = ~np.isin(np.arange(6), scenario.platform_free)
                moved[name] = tuple(np.where(fixed, values[row], given).tolist())
        if state is not None:
            changes[key] = state.model_copy(update=moved)
    return lay_out(scenario.robot, scenario.task.model_copy(update=changes))


def _less_wind(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the strongest wind from the same direction that is feasible."""
    wind = scenario.task.wind
    if wind is None or isinstance(wind, WindBox | WindDisc) or not any(wind):
        return []
    velocity = np.array(wind)
    speed = float(np.linalg.norm(velocity))

    def with_wind(share: float) -> Variation:
        task = scenario.task.model_copy(update={"wind": tuple((share * velocity).tolist())})
        return lay_out(scenario.robot, task), share * speed, f"instead of {quantity(speed, 'm/s')}"

    return largest_share(search, with_wind, "wind", "m/s")


def _lighter_load(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the heaviest loads of phases that are feasible, by one factor, with moments of inertia in proportion."""
    phases = scenario.task.phases or ()
    masses = [0.0 if phase.load is None else phase.load.mass for phase in phases]
    mass = max(masses, default=0.0)
    if mass == 0.0:
        return []
    others = "in each phase" if len({*masses, 0.0}) == 2 else "the others by the same factor"
    every = f", {others}" if sum(each > 0 for each in masses) > 1 else ""

    def with_loads(share: float) -> Variation:
        def lighter(load: Load) -> Load:
            inertia = tuple(share * value for value in load.inertia)
            return load.model_copy(update={"mass": share * load.mass, "inertia": inertia})

        return _carrying(scenario, lighter), share * mass, f"instead of {quantity(mass, 'kg')}{every}"

    return largest_share(search, with_loads, f"phases[{masses.index(mass)}].load.mass", "kg")


def _surer_load(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the largest tolerances of the loads with which it is feasible, all in proportion to the task's."""
    if not scenario.phases.extremes:
        return []

    def with_loads(share: float) -> Variation:
        def surer(load: Load) -> Load:
            x, y, z = (share * tolerance for tolerance in load.com_tolerance)
            return load.model_copy(update={"mass_tolerance": share * load.mass_tolerance, "com_tolerance": (x, y, z)})

        return _carrying(scenario, surer), 100 * share, "of the task's"

    return largest_share(search, with_loads, "mass_tolerance and com_tolerance of the loads", "%")


def _carrying(scenario: Scenario, change: Callable[[Load], Load]) -> Scenario:
    """Return the scenario with other loads, laid out."""
    carried = tuple(
        phase if phase.load is None else phase.model_copy(update={"load": change(phase.load)})
        for phase in scenario.task.phases or ()
    )
    return lay_out(scenario.robot, scenario.task.model_copy(update={"phases": carried}))


def _lighter_platform(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the heaviest platform that is feasible, with the moments of inertia that go with its mass."""
    data, mass = scenario.robot.model_dump(), scenario.robot.platform.mass

    def with_mass(share: float) -> Variation:
        platform = data["platform"] | {"mass": share * mass}
        if platform["inertia"] is not None:
            platform["inertia"] = [share * value for value in platform["inertia"]]
        lighter = Robot.model_validate(data | {"platform": platform})
        return lay_out(lighter, scenario.task), share * mass, f"instead of {quantity(mass, 'kg')}"

    return largest_share(search, with_mass, "platform.mass", "kg")


def _stronger_cables(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the smallest factor of all t_max that is feasible, as the largest t_max."""
    data, t_max = scenario.robot.model_dump(), scenario.robot.t_max
    largest, others = float(t_max.max()), "" if np.ptp(t_max) == 0 else ", the others by the same factor"

    def with_limits(share: float) -> Variation:
        factor = 1 + (STRONGEST - 1) * (1 - share) ** 4  # fine steps near one
        cables = [cable | {"t_max": factor * cable["t_max"]} for cable in data["cables"]]
        stronger = Robot.model_validate(data | {"cables": cables})
        return lay_out(stronger, scenario.task), factor * largest, f"instead of {quantity(largest, 'N')}{others}"

    return largest_share(search, with_limits, "cables.t_max", "N", up=True)


def _slacker_cables(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the largest factor of all t_min that is feasible, as the largest t_min."""
    data, t_min = scenario.robot.model_dump(), scenario.robot.t_min
    largest, others = float(t_min.max()), "" if np.ptp(t_min) == 0 else ", the others by the same factor"
    if largest == 0.0:
        return []

    def with_limits(share: float) -> Variation:
        cables = [cable | {"t_min": share * cable["t_min"]} for cable in data["cables"]]
        slacker = Robot.model_validate(data | {"cables": cables})
        return lay_out(slacker, scenario.task), share * largest, f"instead of {quantity(largest, 'N')}{others}"

    return largest_share(search, with_limits, "cables.t_min", "N")
