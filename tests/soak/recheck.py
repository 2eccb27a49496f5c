"""Recheck a saved plan by code that shares nothing with the planner: own geometry and dynamics in NumPy.

Distances are sampled where they are small, each time twenty times as densely, down to a step of 0.1 us; all else at
twenty times the saved rate.
Tensions are looked for at instants that are not saved, by SciPy's bounded least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from ruamel.yaml import YAML

from towline.models import Robot

from .recheck_work import body_distances, work
from .saved_motion import SavedMotion, rotation

__all__ = ["cable_distance", "least_along", "point_distance", "rechecked"]

TOUCHING = 2e-6  # [m]: the planner's 1e-6, and the same again by which its distances are rounded
SHARE = 2e-6  # of a bound, for the same reason
FINER = 20
LEVELS = 3
MOST_SPANS = 3000  # of each level: those with the smallest distances
LOOKS = 100  # instants at which tensions are looked for
# Weights of forces across a thrust beside the wrench: they choose among the tensions that balance it. Two cables of one
# quadrotor that are nearly parallel balance it within its tolerance with many tensions, and those that fit it best pull
# the beam apart: with a weight of 1e-3 they missed the thrust by 0.05 N where others missed both by 0.003 N. Where
# tolerances are a millionth of that, the larger weight misses the wrench.
BESIDE = 0.1, 1e-3
GOLDEN = (np.sqrt(5) - 1) / 2
NARROWED = 45  # times by the golden section: to 4e-10 of a cable

Points = Callable[[np.ndarray], np.ndarray]  # times (n,) -> values (n, k)


def rechecked(dataset: Any, tolerance: float) -> list[str]:
    """Return what is wrong with a feasible plan; nothing if all is right.

    Args:
        dataset: The plan's trajectory, with at least 1000 instants a second.
        tolerance: Of the wrench [N].
    """
    yaml = YAML(typ="safe")
    robot = Robot.model_validate(yaml.load(dataset.attrs["robot"]))
    task = yaml.load(dataset.attrs["task"])
    motion = SavedMotion(robot, dataset)
    wrong = list(_consistent(dataset))
    limits = task.get("limits") or {}
    for place in limits.get("keep_out") or ():
        wrong += _near(motion, place)
    wrong += _apart(motion, limits)
    wrong += _bounded(motion, robot, task, limits)
    wrong += _ends(motion, task)
    wrong += work(motion, robot, task)
    if not task.get("phases") and not isinstance(task.get("wind"), dict):
        wrong += _tensions(motion, robot, task, dataset, tolerance)
    return wrong


def point_distance(place: Mapping[str, Any], p: np.ndarray) -> np.ndarray:
    """Return the distances of points (..., 3) from a ball, a capsule or a box, (...) [m], negative inside."""
    if place["kind"] == "sphere":
        return np.linalg.norm(p - np.array(place["centre"]), axis=-1) - place["radius"]
    if place["kind"] == "capsule":
        start, along = np.array(place["start"]), np.array(place["end"]) - np.array(place["start"])
        share = np.clip((p - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        return np.linalg.norm(p - start - share[..., None] * along, axis=-1) - place["radius"]
    low, high = np.array(place["min"]), np.array(place["max"])
    turned = np.eye(3) if place.get("attitude") is None else rotation(np.array(place["attitude"]))
    beyond = np.abs((p - (low + high) / 2) @ turned) - (high - low) / 2
    return np.where((beyond <= 0).all(-1), beyond.max(-1), np.linalg.norm(beyond.clip(0), axis=-1))


def cable_distance(place: Mapping[str, Any], p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the distances of the lines from p to q (..., 3) from a place: along each line its distance is convex."""
    return least_along(lambda at: point_distance(place, at), p, q)


def least_along(distance: Callable[[np.ndarray], np.ndarray], p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the smallest of a convex function on each line from p to q (..., 3), by the golden section, (...)."""
    low, high = np.zeros(p.shape[:-1]), np.ones(p.shape[:-1])
    best = np.minimum(distance(p), distance(q))
    for _ in range(NARROWED):
        first, second = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        at_first, at_second = (distance(p + share[..., None] * (q - p)) for share in (first, second))
        best = np.minimum(best, np.minimum(at_first, at_second))
        left = at_first <= at_second
        low, high = np.where(left, low, first), np.where(left, second, high)
    return best


def _consistent(dataset: Any) -> Iterator[str]:
    """Yield whether saved positions and velocities are not those of one motion, by the trapezoid rule."""
    h = np.diff(dataset["time"].values)
    for body in ("", "carrier_"):
        x, v = (dataset[f"{body}{name}"].values for name in ("pose", "velocity"))
        a = dataset[f"{body}acceleration"].values
        wide = (-1, *[1] * (x.ndim - 1))
        for value, rate in ((x, v), (v, a)):
            size = max(np.abs(rate).max(), 1.0)
            off = np.diff(value, axis=0) - h.reshape(wide) * (rate[1:] + rate[:-1]) / 2
            if np.abs(off).max() > 1.1 * size * h.max():  # an acceleration may jump
                yield f"the saved {body}motion is not that of its derivatives"


def _near(motion: SavedMotion, place: Mapping[str, Any]) -> list[str]:
    """Return what comes too near to a place."""
    riding, wrong = place.get("frame") == "platform", []
    robot, name = motion.robot, place.get("name", "obstacle")

    def own(times: np.ndarray, points: np.ndarray) -> np.ndarray:
        if not riding:
            return points
        pose = next(motion.platform(times))
        return (points - pose[:, None, :3]) @ rotation(pose[:, 3:])

    def of_points(times: np.ndarray) -> np.ndarray:
        return point_distance(place, motion.on_platform(times, np.vstack([robot.attachments, robot.platform.com])))

    def of_carriers(times: np.ndarray) -> np.ndarray:
        return point_distance(place, own(times, next(motion.carriers(times))[:, moving, :3]))

    def of_cables(times: np.ndarray) -> np.ndarray:
        return cable_distance(place, *(own(times, ends) for ends in motion.cables(times)))

    moving = [i for i, carrier in enumerate(robot.carriers) if carrier.moves]
    body = robot.platform.body
    of_platform = of_points if body is None else body_distances(body.model_dump(), place, motion)
    kinds = [("platform", of_platform)] * (not riding) + [("carriers", of_carriers)] * bool(moving)
    for about, distances in (*kinds, ("cables", of_cables)):
        least = place.get(about, "radius" if about == "carriers" else 0.0)
        if place["kind"] != "mesh" and least is not None:
            least = robot.carrier_radius[moving] if least == "radius" else least
            wrong += _kept(motion, distances, least, f"{about} from {name}")
    return wrong


def _apart(motion: SavedMotion, limits: Mapping[str, Any]) -> list[str]:
    """Return which carriers and cables come too near to each other."""
    robot, wrong = motion.robot, []
    if (least := limits.get("carrier_separation")) is not None:
        i, j = np.triu_indices(len(robot.carriers), 1)

        def of_carriers(times: np.ndarray) -> np.ndarray:
            at = next(motion.carriers(times))[..., :3]
            return np.linalg.norm(at[:, i] - at[:, j], axis=-1)

        least = robot.carrier_radius[i] + robot.carrier_radius[j] if least == "radius" else least
        wrong += _kept(motion, of_carriers, least, "carriers from each other")
    if (least := limits.get("cable_clearance")) is not None:
        of, ends, at = robot.carrier_of_cable, robot.attachments, robot.anchors
        pairs = [(i, j) for i in range(robot.m) for j in range(i) if not np.array_equal(ends[i], ends[j])]
        pairs = [(i, j) for i, j in pairs if of[i] != of[j] or not np.array_equal(at[i], at[j])]
        first, second = (np.array(side, dtype=int) for side in zip(*pairs, strict=True))

        def of_cables(times: np.ndarray) -> np.ndarray:
            p, q = motion.cables(times)
            start, along = p[:, second], q[:, second] - p[:, second]

            def from_second(points: np.ndarray) -> np.ndarray:
                share = (np.einsum("nki,nki->nk", points - start, along) / (along**2).sum(-1)).clip(0.0, 1.0)
                return np.linalg.norm(points - start - share[..., None] * along, axis=-1)

            return least_along(from_second, p[:, first], q[:, first])

        wrong += _kept(motion, of_cables, least, "cables from each other")
    return wrong


def _kept(motion: SavedMotion, distances: Points, least: float | np.ndarray, about: str) -> list[str]:
    """Return the text of distances (n, k) of which one is below its least, one or (k,) [m], sampled where near it."""
    start, end = motion.times[:-1], motion.times[1:]
    values = distances(motion.times) - least
    closest, when = values.min(), motion.times[values.min(axis=1).argmin()]
    before, after = values[:-1], values[1:]
    for _ in range(LEVELS):
        # How fast a distance changes from one instant to the next is how fast it may change in between, but for some.
        change = 2 * np.maximum(np.abs(after - before), 1e-3 * (end - start)[:, None])
        bound = (np.minimum(before, after) - change).min(axis=1)
        chosen = np.argsort(bound)[:MOST_SPANS]
        chosen = chosen[bound[chosen] < 0]
        if not chosen.size:
            break
        times = np.linspace(start[chosen], end[chosen], FINER + 1)  # (FINER + 1, k)
        values = (distances(times.ravel()) - least).reshape(*times.shape, -1)
        if values.min() < closest:
            closest, when = values.min(), times[np.unravel_index(values.argmin(), values.shape)[:2]]
        start, end = times[:-1].ravel(), times[1:].ravel()
        before, after = (part.reshape(-1, values.shape[-1]) for part in (values[:-1], values[1:]))
    if closest < -TOUCHING:
        return [f"{about}: too near by {-closest:.3g} m at t = {when:.6f} s"]
    return []


def _bounded(motion: SavedMotion, robot: Robot, task: Mapping[str, Any], limits: Mapping[str, Any]) -> list[str]:
    """Return speeds, accelerations, lengths and places that are beyond their bounds."""
    fine = motion.looks(FINER)
    pose, velocity, acceleration = motion.platform(fine)
    wrong = []

    def check(name: str, values: np.ndarray, low: Any, high: Any, scale: float) -> None:
        beyond = np.maximum(low - values, values - high)
        if beyond.max() > SHARE * scale:
            row = int(np.unravel_index(beyond.argmax(), beyond.shape)[0])
            wrong.append(f"{name}: beyond its bound by {beyond.max():.3g} at t = {fine[row]:.6f} s")

    if (most := limits.get("platform_speed")) is not None:
        check("platform_speed", np.linalg.norm(velocity[:, :3], axis=1), -np.inf, most, most)
    if (most := limits.get("platform_acceleration")) is not None:
        check("platform_acceleration", np.linalg.norm(acceleration[:, :3], axis=1), -np.inf, most, most)
    if (box := limits.get("platform_box")) is not None:
        check("platform_box", pose[:, :3], np.array(box["min"]), np.array(box["max"]), 1.0)
    if (span := limits.get("cable_length")) is not None and not robot.pulley_radii.any():
        lengths = np.linalg.norm(np.subtract(*motion.cables(fine)), axis=-1)
        check("cable_length", lengths, span["min"], span["max"], span["max"])
    if (most := limits.get("cable_speed")) is not None and not robot.pulley_radii.any():
        step = 1e-6
        later, sooner = (np.linalg.norm(np.subtract(*motion.cables(fine + k)), axis=-1) for k in (step, -step))
        check("cable_speed", np.abs(later - sooner) / (2 * step), -np.inf, most, most + 1e-3)
    free = (task.get("base") or {}).get("kind") == "free"
    carried = [*motion.carriers(fine)] if free else []
    for i, carrier in enumerate(robot.carriers):
        own = carrier.motion_limits
        if not carrier.moves or not free:
            continue
        for name, most, k in (("speed", own.speed, 1), ("acceleration", own.acceleration, 2)):
            if most is not None:
                check(f"{carrier.name} {name}", np.linalg.norm(carried[k][:, i, :3], axis=1), -np.inf, most, most)
        if own.tilt is not None:
            upright = rotation(carried[0][:, i, 3:])[:, 2, 2]
            check(f"{carrier.name} tilt", np.arccos(np.clip(upright, -1, 1)), -np.inf, own.tilt, 1.0)
        if own.reach is not None:
            check(f"{carrier.name} reach", carried[0][:, i, :3], np.array(own.reach.min), np.array(own.reach.max), 1.0)
    return wrong


def _ends(motion: SavedMotion, task: Mapping[str, Any]) -> list[str]:
    """Return whether a line does not start and end where it must."""
    path, given = task.get("path") or {}, task.get("initial")
    if path.get("kind") != "line" or (path.get("frame") or "world") != "world":
        return []
    rests = (task.get("tube") or {}).get("ends") in (None, "rest")
    ends = [(0, given["pose"] if given else path["start"]), (-1, path["end"])]
    pose = next(motion.platform(motion.times[[0, -1]]))
    far = [float(np.abs(pose[end, :3] - np.array(at)[:3]).max()) for end, at in ends]
    return ["an end of the line is missed"] if rests and not task.get("final") and max(far) > 1e-6 else []


def _wrenches(motion: SavedMotion, robot: Robot, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return directions of the cables (n, m, 3), wrench matrices and required wrenches by Newton and Euler."""
    pose, velocity, acceleration = motion.platform(times)
    R, com = rotation(pose[:, 3:]), np.array(robot.platform.com)
    ends, anchors = motion.cables(times)
    along = anchors - ends
    u = along / np.linalg.norm(along, axis=-1, keepdims=True)
    arms = (robot.attachments - com) @ R.swapaxes(1, 2)
    A = np.concatenate([u, np.cross(arms, u)], axis=-1).swapaxes(1, 2)
    spin, turning = _spin(pose[:, 3:], velocity[:, 3:], acceleration[:, 3:])
    lever = np.einsum("nij,j->ni", R, com)
    of_com = acceleration[:, :3] + np.cross(turning, lever) + np.cross(spin, np.cross(spin, lever))
    inertia = R @ robot.inertia @ R.swapaxes(1, 2)
    moment = np.einsum("nij,nj->ni", inertia, turning) + np.cross(spin, np.einsum("nij,nj->ni", inertia, spin))
    force = robot.platform.mass * (of_com - np.array(robot.gravity))
    return u, A, np.hstack([force, moment])


def _spin(angles: np.ndarray, rates: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return angular velocity and acceleration in {G} of roll, pitch, yaw and their derivatives, (n, 3) each."""
    yaw, pitch = angles[:, 2], angles[:, 1]
    zero, one = np.zeros_like(yaw), np.ones_like(yaw)
    z = np.stack([zero, zero, one], axis=1)
    y = np.stack([-np.sin(yaw), np.cos(yaw), zero], axis=1)
    x = np.stack([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)], axis=1)
    of_yaw = rates[:, 2:] * z
    of_pitch = of_yaw + rates[:, 1:2] * y
    spin = of_pitch + rates[:, :1] * x
    turning = second[:, 2:] * z + second[:, 1:2] * y + second[:, :1] * x
    turning += rates[:, 1:2] * np.cross(of_yaw, y) + rates[:, :1] * np.cross(of_pitch, x)
    return spin, turning


def _tensions(motion: SavedMotion, robot: Robot, task: Mapping[str, Any], dataset: Any, tolerance: float) -> list[str]:
    """Return whether saved tensions are none, or none exist between the saved instants."""
    from scipy.optimize import lsq_linear

    if robot.pulley_radii.any() or (robot.platform.aero is not None and task.get("wind") is not None):
        return []
    margin = 0.0 if "margin" in ((task.get("limits") or {}).get("soft") or {}) else float(task.get("margin") or 0.0)
    low, high = robot.t_min + margin, robot.t_max - margin
    tensions, times = dataset["tensions"].values, motion.times
    wrong = []
    if not ((tensions >= low - 1e-6) & (tensions <= high + 1e-6)).all():
        wrong.append("a saved tension is beyond its limits")
    scale = np.repeat([1.0, 1.0 / robot.length], 3) * robot.dof_mask
    allowed = 1.01 * tolerance + 2e-6 + 1e-10 * robot.force_scale

    def missing(at: np.ndarray, t: np.ndarray) -> np.ndarray:
        _, A, w = _wrenches(motion, robot, at)
        return np.linalg.norm(((A @ t[..., None])[..., 0] - w) * scale, axis=1)

    if missing(times, tensions).max() > allowed:
        wrong.append(f"the saved tensions miss the wrench by {missing(times, tensions).max():.3g} N")
    wrong += _efforts(motion, robot, times, tensions)
    rng = np.random.default_rng(0)
    room = np.minimum(tensions - low, high - tensions).min(axis=1)
    rows = np.unique(np.concatenate([np.argsort(room[:-1])[: LOOKS // 2], rng.integers(0, len(times) - 1, LOOKS // 2)]))
    rows = rows[motion.smooth[rows]]
    at = times[rows] + rng.uniform(0.2, 0.8, len(rows)) * (times[rows + 1] - times[rows])
    u, A, w = _wrenches(motion, robot, at)
    across, needed = _across(motion, robot, at, u)
    spare = np.where(low < high, low, low - 1e-12), np.where(low < high, high, high + 1e-12)
    found = np.zeros((len(at), robot.m))
    for weight in BESIDE:
        rows = np.concatenate([scale[:, None] * A, weight * across], axis=1)
        values = np.concatenate([scale * w, weight * needed], axis=1)
        found = np.array([lsq_linear(a, b, spare, "bvls", tol=1e-14).x for a, b in zip(rows, values, strict=True)])
        if missing(at, found).max() <= allowed:
            break
    if missing(at, found).max() > allowed:
        when = at[missing(at, found).argmax()]
        wrong.append(f"no tensions within {missing(at, found).max():.3g} N of the wrench at t = {when:.6f} s")
    return wrong + (_efforts(motion, robot, at, found) if robot.m <= len(robot.platform.dof) else [])


def _across(motion: SavedMotion, robot: Robot, times: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (n, 2 k, m) of tensions, and the forces (n, 2 k) that they must be, across the thrust of quadrotors.

    Where cables pull a beam apart, the wrench alone leaves open by how much.
    """
    pose, _, acceleration = motion.carriers(times)
    rows, needed = [np.zeros((len(times), 0, robot.m))], [np.zeros((len(times), 0))]
    for i, carrier in enumerate(robot.carriers):
        if carrier.body is not None:
            turned = rotation(pose[:, i, 3:])[..., :2]
            pull = np.einsum("nij,nki->njk", turned, u) * (robot.carrier_of_cable == i)
            rows.append(pull)
            force = carrier.body.mass * (np.array(robot.gravity) - acceleration[:, i, :3])
            needed.append(np.einsum("nij,ni->nj", turned, force))
    return np.concatenate(rows, axis=1), np.concatenate(needed, axis=1)


def _efforts(motion: SavedMotion, robot: Robot, times: np.ndarray, tensions: np.ndarray) -> list[str]:
    """Return whether a quadrotor needs another thrust than it has, or a force across it."""
    u, _, _ = _wrenches(motion, robot, times)
    pose, _, acceleration = motion.carriers(times)
    wrong = []
    for i, carrier in enumerate(robot.carriers):
        if carrier.body is None:
            continue
        thrust = next(actuator for actuator in carrier.actuators if actuator.name == "thrust")
        held = robot.carrier_of_cable == i
        pull = -(tensions[:, held, None] * u[:, held]).sum(axis=1)
        force = carrier.body.mass * (acceleration[:, i, :3] - np.array(robot.gravity)) - pull
        force = np.einsum("nij,ni->nj", rotation(pose[:, i, 3:]), force)
        beyond = np.maximum(thrust.low - force[:, 2], force[:, 2] - thrust.high).max()
        if beyond > SHARE * thrust.high:
            wrong.append(f"{carrier.name}: thrust beyond its bounds by {beyond:.3g} N")
        across = np.abs(force[:, :2]).max(axis=1)
        if across.max() > 1.02e-3 * robot.force_scale:
            when = times[across.argmax()]
            wrong.append(f"{carrier.name}: a force of {across.max():.4g} N across its thrust at t = {when:.6f} s")
    return wrong
