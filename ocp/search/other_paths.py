"""What path near a task's own is feasible: a nearer end, a smaller or shifted path, other yaws, a wider tube."""

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np

from ...base.text import quantity, quantity_row
from ...solvers.margin import margins
from ..audits.audit import Audit
from ..audits.tensions import scaled
from ..global_path.at_rest import AtRest
from ..result import Relaxed
from ..tasks.lay_out import with_task
from ..tasks.paths import CirclePath, FeedPath, LinePath, WaypointPath
from ..tasks.paths.base import PathBase
from ..tasks.scenario import ATTITUDE, POSITION, Scenario
from .largest_share import RESERVES, Change, Variation, along
from .refinement import planned, rounded, solved
from .search import Search

STEP = 1.3  # ratio of successive shifts
SHIFTS = STEP ** np.arange(-36, 3)  # in parts of the robot's size
HALVINGS = 5
LEAST = 0.05  # of a path: with less, other changes are better advice
MOST_NAMED = 5  # points of a smaller path that its advice gives
PLACES = 31  # of a path, at which a shifted one is compared
YAWS = np.deg2rad(np.arange(-180, 180, 5))  # that are tried
WIDER = 0.05  # of the distance of a given state from its path, at which almost nothing is left to choose
MOST_TILTED = 0.5  # [rad], of a tilt that is offered
SPARE = 1.01  # times the largest tilt at the nodes
POINT, POINTS, PATHS = ("start", "end", "pose", "centre"), ("points", "poses"), ("path", "along")
AnyKind = TypeVar("AnyKind", bound=PathBase)


def shortest_shifts(scenario: Scenario, size: float, holds: Callable[[np.ndarray], np.ndarray]) -> Iterator[np.ndarray]:
    """Yield the shortest shift (3,) [m] along each axis and direction that `holds`, the shortest of all first.

    `size` is the robot's size [m]; `holds` is given shifts (k, 3), and returns which of them are long enough, (k,).
    """
    ways = np.kron(np.eye(3)[[axis for axis in POSITION if scenario.robot.dof_mask[axis]]], [[1], [-1]])
    for far in SHIFTS * size:
        if not len(ways):
            return
        far_enough = holds(far * ways)
        found, ways = ways[far_enough][::-1], ways[~far_enough]
        low, high = np.full((2, len(found), 1), [[[far / STEP]], [[far]]])
        for _ in range(HALVINGS if len(found) else 0):
            middle = (low + high) / 2
            enough = holds(middle * found)[:, None]
            low, high = np.where(enough, low, middle), np.where(enough, middle, high)
        yield from (high * found)[np.argsort(high[:, 0], kind="stable")]


def nearer_end(scenario: Scenario) -> Change | None:
    """Return the change of the end of a straight line to one nearer to its start."""
    path = scenario.task.path
    if not isinstance(path, LinePath):
        return None
    start, way = np.array(path.start), np.array(path.end) - np.array(path.start)
    whole, turns = float(np.linalg.norm(way[:3])), not way[:3].any()

    def to(share: float) -> Variation:
        end = start + share * way
        printed = np.array([rounded(to, up=back) for to, back in zip(end[:3], way[:3] < 0, strict=True)])
        # No coordinate goes beyond the start, so that those that are equal at both ends stay.
        end[:3] = np.where(way[:3] < 0, np.minimum(printed, start[:3]), np.maximum(printed, start[:3]))
        varied = along(scenario, path.model_copy(update={"end": tuple(end.tolist())}))
        attitude = f"to roll, pitch, yaw ({quantity_row(np.rad2deg(end[3:]) + 0.0)}) degrees" * bool(way[3:].any())
        if turns:
            return varied, 100 * share, f"of it, {attitude}"
        place = f"of {quantity(whole, 'm')}, to ({quantity_row(end[:3] + 0.0)}) m"
        return varied, float(np.linalg.norm(end[:3] - start[:3])), ", ".join(filter(None, [place, attitude]))

    name, unit = ("part of the rotation", "%") if turns else ("length of the line", "m")
    return Change(name, unit, to, least=LEAST)


def smaller_circle(scenario: Scenario) -> Change | None:
    """Return the change of a circle to a smaller one at the same angular velocity."""
    path = scenario.task.path
    if not isinstance(path, CirclePath) or any(carrier.moves for carrier in scenario.robot.carriers):
        return None  # carriers that move with the platform may make all of it feasible

    def with_radius(share: float) -> Variation:
        smaller = path.model_copy(update={"radius": share * path.radius})
        return along(scenario, smaller), share * path.radius, f"instead of {quantity(path.radius, 'm')}"

    return Change("path.radius", "m", with_radius)


def near_home(scenario: Scenario) -> Change | None:
    """Return the change of a path to one of the same form, shrunk towards the platform's home.

    Its attitudes come nearer to the home attitude in proportion. It helps where neither end can be reached.
    """
    path, home = scenario.task.path, scenario.robot.home
    if not isinstance(path, LinePath | WaypointPath | CirclePath | FeedPath) or scenario.relative:
        return None

    def about_home(share: float) -> Variation:
        smaller = shrunk(path, home, share)
        points = [(f"{name} ", getattr(smaller, name)) for name in POINT if hasattr(smaller, name)]
        points += [("", point) for point in getattr(smaller, "points", ())]
        named = ", ".join(f"{name}({quantity_row(point[:3], digits=6)})" for name, point in points[:MOST_NAMED])
        named += ", ..." * (len(points) > MOST_NAMED)
        return along(scenario, smaller), 100 * share, f"of it, shrunk towards home: {named} m"

    return Change("size of the path", "%", about_home, least=LEAST)


def shortest_shift(scenario: Scenario, balance: bool = True) -> np.ndarray | None:
    """Return the shortest shift (3,) [m] of the whole path along an axis of {G} to where all limits are kept at rest.

    Shifts are compared at some positions of the path; without `balance` it does not matter whether there are tensions.
    None where no shift is necessary, or where other positions of the carriers are better advice.
    """
    task, robot = scenario.task, scenario.robot
    movable = any(carrier.free_coordinates(robot.drive) for carrier in robot.carriers)
    if movable or scenario.relative or task.phases is not None or task.initial is not None:
        return None
    platform, carriers = scenario.motion(np.linspace(0.0, scenario.duration, PLACES), None)
    size = float(np.linalg.norm(np.ptp(robot.home_anchors, axis=0)))
    kept, worst = AtRest(scenario, size, balance=balance), 0

    def slack(by: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the slack of each shift (k, 3) at some places of the path, (k, places)."""
        poses = np.tile(platform.pose[places], (len(by), 1, 1))
        poses[..., :3] += by[:, None]
        return kept(poses.reshape(-1, 6), np.tile(carriers.pose[places], (len(by), 1, 1))).slack.reshape(len(by), -1)

    def holds(by: np.ndarray) -> np.ndarray:
        nonlocal worst
        enough = slack(by, np.array([worst]))[:, 0] >= 0  # most shifts fail where the one before did
        if enough.any():
            everywhere = slack(by[enough], np.arange(PLACES))
            worst = int(everywhere[everywhere.min(axis=1).argmin()].argmin())
            enough[enough] = (everywhere >= 0).all(axis=1)
        return enough

    return None if holds(np.zeros((1, 3)))[0] else next(shortest_shifts(scenario, size, holds), None)


def shifted_path(scenario: Scenario, shortest: np.ndarray | None) -> Change | None:
    """Return the change of the place of the whole path, by a little more than the shortest shift that is necessary."""
    if shortest is None:
        return None
    axis, way = int(np.abs(shortest).argmax()), np.sign(shortest)
    farthest = float(np.abs(shortest[axis])) / RESERVES[-1]

    def by(share: float) -> Variation:
        shift = rounded((1 - share) * farthest, up=True) * way
        return along(scenario, shifted(scenario.task.path, shift)), float(shift[axis]), f"along {'xyz'[axis]}"

    return Change("shift of the path", "m", by, up=bool(way[axis] > 0), requested=0.0)


def other_yaws(scenario: Scenario) -> Change | None:
    """Return the change of the yaws at the points of the path at which no tensions hold the platform at rest.

    Each lies between the given yaw and the one with the largest capacity margin there, as near to the given one as
    tensions at rest permit, or by one factor less.
    """
    path, robot = scenario.task.path, scenario.robot
    if not isinstance(path, LinePath | WaypointPath) or scenario.relative or not robot.dof_mask[5]:
        return None
    line = isinstance(path, LinePath)
    points = np.array([path.start, path.end] if line else path.points)
    names = ["path.start", "path.end"] if line else [f"path.points[{i}]" for i in range(len(points))]
    wrong = np.flatnonzero(_margins_at_yaws(scenario, points, points[:, 5:])[:, 0] < 0)
    given, held = points[wrong, 5], _margins_at_yaws(scenario, points[wrong], np.tile(YAWS, (len(wrong), 1)))
    if not len(wrong) or held.max(axis=1).min() < 0:
        return None
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
        return along(scenario, path_with_yaws), float(yaws[0]), detail

    return Change(f"yaw at {names[wrong[0]]}", "rad", with_yaws, up=bool(back[0] > 0), requested=float(given[0]))


def as_wide_as_states(search: Search, scenario: Scenario, audit: Audit) -> list[Relaxed]:
    """Return the radius of the tube that reaches the given state farthest outside it."""
    tube = scenario.task.tube
    off = max((excess.value for excess in audit.excess if excess.limit == "tube.position"), default=0.0)
    if off <= tube.radius:
        return []
    radius = rounded((1 + WIDER) * off, up=True)
    plan = planned(search, _with_tube(scenario, position=radius), "audit, wider tube")
    return [] if plan is None else [Relaxed("tube.position", "m", tube.radius, radius, plan)]


def tilting_platform(search: Search, scenario: Scenario) -> list[Relaxed]:
    """Return the tube in which the platform must be allowed to tilt, so that few cables can hold it on its path.

    Cables fewer than the degrees of freedom balance the weight in few attitudes, which change from place to place.
    """
    task, robot = scenario.task, scenario.robot
    angles = [axis for axis in ATTITUDE if robot.dof_mask[axis]]
    if task.tube.turn or task.phases is not None or not angles or robot.m >= robot.dof_mask.sum():
        return []
    free = _with_tube(scenario, attitude=MOST_TILTED)
    outcome = solved(search, free, None)
    if outcome is None:
        return []
    turns = [column for column, (owner, axis) in enumerate(free.owners()) if owner is None and axis in angles]
    tilt = min(rounded(SPARE * float(np.abs(outcome.deviation.q[:, turns]).max()), up=True), MOST_TILTED)
    if not tilt:
        return []
    tilting = _with_tube(scenario, attitude=tilt)
    plan = planned(search, tilting, "audit, tilting platform", outcome.deviation)
    return [] if plan is None else [Relaxed("tube.attitude", "rad", task.tube.turn, tilt, plan, "about each axis")]


def _with_tube(scenario: Scenario, **changes: float) -> Scenario:
    return with_task(scenario, tube=scenario.task.tube.model_copy(update=changes))


def _margins_at_yaws(scenario: Scenario, points: np.ndarray, yaws: np.ndarray) -> np.ndarray:
    """Return the capacity margins at rest at points (n, 6) with yaws (n, k), carriers as at the start, (n, k) [N]."""
    poses = np.repeat(points, yaws.shape[1], axis=0)
    poses[:, 5] = yaws.ravel()
    still, axes = np.zeros_like(poses), np.flatnonzero(scenario.robot.dof_mask)
    carriers = np.vstack([carrier.pose for carrier in scenario.references(np.zeros(1))[1]])
    A = scaled(scenario, scenario.dynamics.wrench_matrix(poses, carriers))[:, axes]
    w = scaled(scenario, scenario.dynamics.required_wrench(poses, still, still, wind=scenario.wind))[:, axes]
    return margins(A, w, *scenario.bounds()).reshape(yaws.shape)


def shifted(path: AnyKind, by: np.ndarray) -> AnyKind:
    """Return the path moved by (3,) [m] along the axes of its frame, without turning it."""
    return path.__class__.model_validate(_moved(path.model_dump(), lambda point: [*(point[:3] + by), *point[3:]]))


def shrunk(path: AnyKind, towards: np.ndarray, share: float) -> AnyKind:
    """Return the path whose poses, and the radius of a circle, have this share of their distances from a pose (6,)."""

    def nearer(point: np.ndarray) -> list[float]:
        there = towards[: len(point)]
        return list(there + share * (point - there))

    fields = _moved(path.model_dump(), nearer)
    return path.__class__.model_validate(fields | ({"radius": share * fields["radius"]} if "radius" in fields else {}))


def _moved(fields: dict[str, Any], move: Callable[[np.ndarray], list[float]]) -> dict[str, Any]:
    """Return the fields of a path with all its positions or poses moved, those of paths inside it too."""
    moved = dict(fields)
    for name, value in fields.items():
        if name in POINT and isinstance(value, list | tuple):  # the start of a path that returns is a time
            moved[name] = move(np.array(value))
        elif name in POINTS:
            moved[name] = [move(np.array(point)) for point in value]
        elif name in PATHS:
            moved[name] = _moved(value, move)
        elif name == "parts":
            moved[name] = [part | {"path": _moved(part["path"], move)} for part in value]
    return moved
