"""Recheck what a day of work adds to a plan: bodies of platforms, a steady feed, slow zones, cycles without a stop."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise, product
from typing import Any

import numpy as np
from scipy.optimize import nnls

from towline.models import Robot

from .saved_motion import SavedMotion, rotation

__all__ = ["body_distances", "work"]

SIGNS = np.array(list(product((0, 1), repeat=3)))
FINER = 10  # looks for each saved instant
RISE = 10.0  # [1/s], of the bound of a speed outside of a zone
CLOSE = 2e-6  # of speeds and places
BENT = 0.01  # of an acceleration: what a curvature may be more between the planner's looks


def body_distances(body: Mapping[str, Any], place: Mapping[str, Any], motion: SavedMotion) -> Callable[..., np.ndarray]:
    """Return the function of times (n,) to the distances (n, 1) of the platform's body from a place [m].

    The nearest point of the hull of all differences of corners follows from nonnegative least squares (Lawson and
    Hanson): of shares s of the columns (p, 1) that miss (0, 1) by least, p s / sum(s) is the point nearest to zero.
    """
    (its, radius), (theirs, more) = _corners(body), _corners(place)
    centre, far = its.mean(axis=0), float(np.linalg.norm(its - its.mean(axis=0), axis=1).max())
    middle, away = theirs.mean(axis=0), float(np.linalg.norm(theirs - theirs.mean(axis=0), axis=1).max())

    def distances(times: np.ndarray) -> np.ndarray:
        moved = motion.on_platform(times, np.vstack([its, centre]))
        rough = np.linalg.norm(moved[:, -1] - middle, axis=1) - far - away  # not more than the distance
        values, scale = rough.copy(), far + away
        for i in np.flatnonzero(rough < max(rough.min() + scale, scale)):
            p = (moved[i, :-1, None] - theirs).reshape(-1, 3) / scale
            shares, _ = nnls(np.vstack([p.T, np.ones(len(p))]), np.array([0.0, 0.0, 0.0, 1.0]))
            values[i] = scale * np.linalg.norm(shares @ p) / shares.sum()
        return (values - radius - more)[:, None]

    return distances


def _corners(shape: Mapping[str, Any]) -> tuple[np.ndarray, float]:
    """Return points (k, 3) and a radius: a shape is all that is within the radius of their hull."""
    if shape["kind"] == "sphere":
        return np.array([shape["centre"]]), shape["radius"]
    if shape["kind"] == "capsule":
        return np.array([shape["start"], shape["end"]]), shape["radius"]
    low, high = np.array(shape["min"]), np.array(shape["max"])
    turned = np.eye(3) if shape.get("attitude") is None else rotation(np.array(shape["attitude"]))
    return (low + high) / 2 + (SIGNS - 0.5) * (high - low) @ turned.T, 0.0


def work(motion: SavedMotion, robot: Robot, task: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with speeds along the path and in zones, and with the ends of a cycle."""
    fine = motion.looks(FINER)
    pose, velocity, _ = motion.platform(fine)
    speed = np.linalg.norm(velocity[:, :3], axis=1)
    for zone in (task.get("limits") or {}).get("zone_speed") or ():
        off = np.linalg.norm(pose[:, :3] - np.array(zone["centre"]), axis=1) - zone["radius"]
        share = speed / (zone["speed"] + RISE * np.maximum(off, 0.0)) - 1
        if share.max() > CLOSE * max(1 / zone["speed"], 1.0):
            yield f"{zone['name']}: too fast by {share.max():.3g} of its bound at t = {fine[share.argmax()]:.6f} s"
    path, tube = task.get("path") or {}, task.get("tube") or {}
    if path.get("kind") == "feed" and path.get("feed"):
        # Its acceleration jumps, so that nothing is interpolated.
        yield from _fed(path, float(tube.get("position") or 0.0), *motion.platform(motion.times))
    if tube.get("ends") == "periodic":
        bodies = (motion.platform, motion.carriers) if _also_periodic(task) else (motion.platform,)
        for body in bodies:
            first, last = (list(body(motion.times[[end]])) for end in (0, -1))
            for a, b, name in zip(first, last, ("pose", "velocity", "acceleration"), strict=True):
                if np.abs(a - b).max() > CLOSE * max(np.abs(a).max(), 1.0):
                    yield f"the cycle jumps: {name} differs by {np.abs(a - b).max():.3g} from end to start"
    if tube.get("waypoints") == "exact":
        for point in path["points"]:
            # What is passed at speed v between two looks is missed by at most half of the way.
            near = np.linalg.norm(pose[:, :3] - np.array(point)[:3], axis=1)
            if near.min() > 0.6 * speed[near.argmin()] * (motion.times[1] - motion.times[0]) + CLOSE:
                yield f"a point is missed by {near.min():.3g} m"
    if path.get("kind") == "line" and tube.get("position", 0.0) != "free" and not task.get("initial"):
        yield from _inside(path, float(tube.get("position") or 0.0), pose)


def _also_periodic(task: Mapping[str, Any]) -> bool:
    base = task.get("base") or {}
    return base.get("kind") == "free" and base.get("ends") == "periodic"


def _fed(
    path: Mapping[str, Any], radius: float, pose: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray
) -> Iterator[str]:
    """Yield whether a path at a feed leaves its lines by more than the tolerance, or is faster than it may be."""
    points = np.array([point[:3] for point in path["points"]])
    off = np.full(len(pose), np.inf)
    for a, b in pairwise(points):
        off = np.minimum(off, _from_line(pose[:, :3], a, b))
    if off.max() > path.get("tolerance", 1e-3) + radius + CLOSE:
        yield f"the lines are missed by {off.max():.6g} m"
    if radius == 0.0:
        fastest = np.linalg.norm(velocity[:, :3], axis=1).max()
        if fastest > (1 + CLOSE) * path["feed"]:
            yield f"faster than the feed: {fastest:.6g} m/s"
        most = np.linalg.norm(acceleration[:, :3], axis=1).max()
        if most > (1 + BENT) * path["acceleration"]:
            yield f"the acceleration is {most:.6g} m/s^2"


def _inside(path: Mapping[str, Any], radius: float, pose: np.ndarray) -> Iterator[str]:
    """Yield whether a motion is farther from its line than the tube permits."""
    off = _from_line(pose[:, :3], np.array(path["start"])[:3], np.array(path["end"])[:3])
    if off.max() > radius + CLOSE:
        yield f"the tube is left by {off.max() - radius:.3g} m"


def _from_line(places: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the distances of places (n, 3) from the line between a and b, (n,) [m]."""
    share = np.clip((places - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(places - a - share[:, None] * (b - a), axis=1)
