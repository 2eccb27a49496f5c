"""Interference: cables stay clear of each other, of the platform's body and of obstacles.

Cables are the straight segments from anchor to attachment. Sources: Ericson, Real-Time Collision Detection, 5.1.9
(distance of segments) and 5.3.3 (segments that enter a box).
"""

from itertools import combinations
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ...models import Robot
from ...models.part import Box, NonNegative, Positive, optional
from ...models.points import anchors, attachments, in_frame
from ...models.polyhedron import Polyhedron
from ...models.shapes import Block, Capsule, ConvexMesh, Sphere, skeleton
from ..condition import Condition, Places

_ROUNDING = 1e-12  # of the size of a mesh


Obstacle = Annotated[Sphere | Capsule | Block | ConvexMesh, Field(discriminator="kind")]


class Interference(Condition):
    """Cables keep a distance from each other and from obstacles, and do not enter the platform's body.

    Pairs of cables that share an anchor or an attachment at home are not checked.
    """

    kind: Literal["interference"] = "interference"
    between_cables: Positive | None = optional("minimum distance between two cables [m]; default: not checked")
    platform: Box | None = optional(
        "the platform's body in its own frame, which no cable may enter [m]; default: not checked"
    )
    obstacles: tuple[Obstacle, ...] = optional("spheres, capsules, boxes and convex meshes in {G}", ())
    clearance: NonNegative = optional("minimum distance between cables and obstacles [m]", 0.0)

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if self.between_cables is None and self.platform is None and not self.obstacles:
            raise ValueError("between_cables, platform or obstacles must be given, got none of them")
        return self

    def evaluate(self, robot: Robot, places: Places) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):  # of places that are far too far away
            return self._free(robot, places)

    def _free(self, robot: Robot, places: Places) -> np.ndarray:
        starts, ends = anchors(robot, places.carriers), attachments(robot, places.pose)
        free = np.ones(len(places), dtype=bool)
        if self.between_cables is not None:
            free &= least_distance(robot, starts, ends) >= self.between_cables
        if self.platform is not None:
            low, high = np.array(self.platform.min), np.array(self.platform.max)
            for cable in range(robot.m):
                free &= ~_enters(low, high, robot.attachments[cable], in_frame(places.pose, starts[:, cable]))
        for obstacle in self.obstacles:
            for cable in range(robot.m):
                distance = outside(obstacle, starts[:, cable], ends[:, cable])
                # Inside a box the distance is zero, which is interference without any clearance too.
                free &= (distance > 0.0) & (distance >= self.clearance)
        return free


def segment_distance(p: np.ndarray, p_end: np.ndarray, q: np.ndarray, q_end: np.ndarray) -> np.ndarray:
    """Return the distance of the segments p to p_end and q to q_end, (..., 3) each, (...) [m]."""
    gap, _, _ = nearest_points(p, p_end, q, q_end)
    return np.sqrt(_dot(gap, gap))


def nearest_points(
    p: np.ndarray, p_end: np.ndarray, q: np.ndarray, q_end: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the shortest vector from segment q to segment p, (..., 3) [m], and its ends as fractions of p and q."""
    along, across, between = p_end - p, q_end - q, p - q
    a, e, f = _dot(along, along), _dot(across, across), _dot(across, between)
    b, c = _dot(along, across), _dot(along, between)
    tiny = np.finfo(float).tiny
    beside = a * e - b * b
    crossing = beside > 1e-14 * a * e
    # On parallel lines every s serves, so 0 does.
    s = np.where(crossing, np.clip((b * f - c * e) / np.where(crossing, beside, 1.0), 0.0, 1.0), 0.0)
    t = np.clip((b * s + f) / np.maximum(e, tiny), 0.0, 1.0)
    s = np.clip((b * t - c) / np.maximum(a, tiny), 0.0, 1.0)
    return between + s[..., None] * along - t[..., None] * across, s, t


def least_distance(robot: Robot, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the smallest distance of two cables without a common end at home, (n,) [m]; inf if there are none.

    The cables run from `starts` to `ends`, (n, m, 3) each.
    """
    distances = np.array(list(cable_distances(robot, starts, ends).values())).reshape(-1, len(starts))
    return distances.min(axis=0, initial=np.inf)


def cable_distances(robot: Robot, starts: np.ndarray, ends: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    """Return the distances (n,) [m] of the cables of each pair without a common end at home, counted from 0."""
    homes = robot.home_anchors, robot.home_attachments
    return {
        (i, j): segment_distance(starts[:, i], ends[:, i], starts[:, j], ends[:, j])
        for i, j in combinations(range(robot.m), 2)
        if all(np.linalg.norm(points[i] - points[j]) > 1e-9 for points in homes)
    }


def outside(obstacle: Obstacle, p: np.ndarray, p_end: np.ndarray) -> np.ndarray:
    """Return the distance of the segments p to p_end (n, 3) from an obstacle, (n,) [m]; at most 0 where they meet."""
    nearest, its = np.full(len(p), np.inf), skeleton(obstacle)
    for part in its.parts:  # of a body with faces the nearest place is on an edge, or on a face below an end
        start, end = (np.broadcast_to(part[k], p.shape) for k in (0, -1))
        nearest = np.minimum(nearest, segment_distance(p, p_end, start, end))
    if isinstance(obstacle, Block | ConvexMesh):
        nearest = _with_faces(obstacle.body, p, p_end, nearest)
    return nearest - its.radius


def _with_faces(body: Polyhedron, p: np.ndarray, p_end: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return the distance of segments from a convex body, (n,), from that of its edges: zero where they meet it."""
    for end in (p, p_end):
        heights = body.beyond(end)
        height = heights.max(axis=1)
        below = end - height[:, None] * body.normals[heights.argmax(axis=1)]
        on_face = body.beyond(below).max(axis=1) <= _ROUNDING * body.size
        nearest = np.where(on_face, np.minimum(nearest, height), nearest)
    return np.where(_meets(body.beyond(p), body.beyond(p_end)), 0.0, nearest)


def _meets(at: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Return whether segments pass a place behind all planes, from how far both ends are beyond each, (n, f) [m]."""
    along = to - at
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = -at / along
    entry = np.where(along < 0, crossing, np.where((along == 0) & (at > 0), np.inf, 0.0)).max(axis=1)
    leave = np.where(along > 0, crossing, 1.0).min(axis=1)
    return np.maximum(entry, 0.0) <= np.minimum(leave, 1.0)


def _enters(low: np.ndarray, high: np.ndarray, attachment: np.ndarray, anchor: np.ndarray) -> np.ndarray:
    """Return whether the segments from an attachment (3,) to anchors (n, 3), in the platform frame, enter its box.

    Touching the surface is allowed: attachments lie on it.
    """
    slack = 1e-9 * max(float(np.abs(high - low).max()), 1e-9)
    at, to = (np.concatenate([low - end, end - high], axis=-1) + slack for end in (attachment, anchor))
    return _meets(at, to)


def _dot(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.einsum("...i,...i->...", x, y)
