"""Distances between points, cables and obstacles, as expressions that a nonlinear program can differentiate.

Points are (3, 1), CasADi SX or DM. Distances are the true ones, but for a hair (1e-6 m) where things touch; those from
boxes are measured along the axes, which is never more than the true distance.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from .task_limits import Block, Capsule, KeepOut, Sphere

__all__ = ["between_cables", "between_points", "cable_outside", "point_outside"]

Point: TypeAlias = Any  # (3, 1), SX or DM

_TINY = 1e-12  # [m^2], keeps the root's derivative finite where things touch
_STILL = 1e-9  # [m], of a cable along an axis: what changes less counts as this much


def between_points(p: Point, q: Point) -> Any:
    """|p - q| [m]."""
    return ca.sqrt(ca.sumsqr(p - q) + _TINY)


def between_cables(p: Point, p_end: Point, q: Point, q_end: Point) -> Any:
    """Distance of the segments p to p_end and q to q_end [m] (Ericson, Real-Time Collision Detection, 5.1.9)."""
    along, across, between = p_end - p, q_end - q, p - q
    a, e, f = ca.sumsqr(along), ca.sumsqr(across), ca.dot(across, between)
    b, c = ca.dot(along, across), ca.dot(along, between)
    # On parallel lines every s will do; what is added to the denominator picks one.
    s = _within((b * f - c * e) / (a * e - b * b + 1e-9 * a * e))
    t = (b * s + f) / e
    s = ca.if_else(t < 0, _within(-c / a), ca.if_else(t > 1, _within((b - c) / a), s))
    return between_points(p + s * along, q + _within(t) * across)


def point_outside(place: KeepOut, p: Point) -> Any:
    """How far p is outside an obstacle [m], negative inside."""
    if isinstance(place, Sphere):
        return between_points(p, ca.DM(place.centre)) - place.radius
    if isinstance(place, Capsule):
        return _from_segment(p, ca.DM(place.start), ca.DM(place.end)) - place.radius
    if isinstance(place, Block):
        low, high = np.array(place.min), np.array(place.max)
        beyond = ca.fabs(p - ca.DM((low + high) / 2)) - ca.DM((high - low) / 2)
        return ca.mmax(beyond) if isinstance(beyond, ca.DM) else _largest([beyond[i] for i in range(3)])
    raise TypeError(f"{type(place).__name__} is no obstacle")


def cable_outside(place: KeepOut, p: Point, p_end: Point) -> Any:
    """How far the segment from p to p_end is outside an obstacle [m], negative inside."""
    if isinstance(place, Sphere):
        return _from_segment(ca.DM(place.centre), p, p_end) - place.radius
    if isinstance(place, Capsule):
        return between_cables(p, p_end, ca.DM(place.start), ca.DM(place.end)) - place.radius
    if isinstance(place, Block):
        shares = [0.0, 1.0, *_corners(place, p, p_end)]
        return -_largest([-point_outside(place, p + share * (p_end - p)) for share in shares])
    raise TypeError(f"{type(place).__name__} is no obstacle")


def _corners(place: Block, p: Point, p_end: Point) -> list[Any]:
    """Where on a segment the distance from a box may be least.

    It is the largest of the six distances from the faces, each linear along the segment: convex with corners, where two
    of them are equal.
    """
    low, high = ca.DM(place.min), ca.DM(place.max)
    faces = [(sign * (p - bound)[i], sign * (p_end - p)[i]) for sign, bound in ((-1, low), (1, high)) for i in range(3)]
    shares = []
    for (value, slope), (other, other_slope) in combinations(faces, 2):
        change = other_slope - slope
        shares.append(_within((value - other) / ca.if_else(ca.fabs(change) < _STILL, _STILL, change)))
    return shares


def _from_segment(p: Point, start: Point, end: Point) -> Any:
    along = end - start
    share = _within(ca.dot(p - start, along) / (ca.sumsqr(along) + _TINY))
    return between_points(p, start + share * along)


def _within(share: Any) -> Any:
    return ca.fmin(ca.fmax(share, 0.0), 1.0)


def _largest(values: list[Any]) -> Any:
    largest = values[0]
    for value in values[1:]:
        largest = ca.fmax(largest, value)
    return largest
