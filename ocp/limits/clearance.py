"""Distances between points, cables and obstacles, as expressions that a nonlinear program can differentiate.

Points are (3, 1), CasADi SX or DM. Distances are the true ones, except within 1e-6 m where things touch. Around the
corners of a box they are rounded, so that a program can pass them. Inside a box or a mesh the nearest face counts.
"""

from typing import Any, TypeAlias

import casadi as ca

from ...models.shapes import Block, Capsule, ConvexMesh, Shape, Sphere
from .box_clearance import segment_outside_box, within_segment
from .convex_clearance import cable_outside_mesh, point_outside_mesh

Point: TypeAlias = Any  # (3, 1), SX or DM
Place: TypeAlias = Shape

_TINY = 1e-12  # [m^2], keeps the root's derivative finite where things touch
_SHORT = 1e-18  # [m^2], of a segment that is a point


def between_points(p: Point, q: Point) -> Any:
    """Return |p - q| [m]."""
    return ca.sqrt(ca.sumsqr(p - q) + _TINY)


def between_cables(p: Point, p_end: Point, q: Point, q_end: Point) -> Any:
    """Return the distance of the segments p to p_end and q to q_end [m].

    Source: Ericson, Real-Time Collision Detection, 5.1.9.
    """
    along, across, between = p_end - p, q_end - q, p - q
    f, b, c = ca.dot(across, between), ca.dot(along, across), ca.dot(along, between)
    # On a segment without length, such as the way of a platform at rest, any point will do.
    points = [ca.sumsqr(each) < _SHORT for each in (along, across)]
    a, e = (ca.if_else(point, 1.0, ca.sumsqr(each)) for point, each in zip(points, (along, across), strict=True))
    # On parallel lines every s will do; what is added to the denominator picks one.
    s = within_segment((b * f - c * e) / (a * e - b * b + 1e-9 * a * e))
    t = (b * s + f) / e
    s = ca.if_else(t < 0, within_segment(-c / a), ca.if_else(t > 1, within_segment((b - c) / a), s))
    s, t = (ca.if_else(point, 0.5, share) for point, share in zip(points, (s, t), strict=True))
    return between_points(p + s * along, q + within_segment(t) * across)


def point_outside(place: Place, p: Point) -> Any:
    """Return the distance of p from an obstacle [m], negative inside."""
    if isinstance(place, Sphere):
        return between_points(p, ca.DM(place.centre)) - place.radius
    if isinstance(place, Capsule):
        return _from_segment(p, ca.DM(place.start), ca.DM(place.end)) - place.radius
    if isinstance(place, Block):
        low, high = ca.DM(place.min), ca.DM(place.max)
        beyond = ca.fabs(_before_turn(place, p) - (low + high) / 2) - (high - low) / 2  # the faces along each axis
        most = ca.mmax(beyond)
        return ca.if_else(most <= 0, most, ca.sqrt(ca.sumsqr(ca.fmax(beyond, 0.0)) + _TINY))
    if isinstance(place, ConvexMesh):
        return point_outside_mesh(place, p) - place.rounding
    raise TypeError(f"{type(place).__name__} is not an obstacle")


def cable_outside(place: Place, p: Point, p_end: Point) -> Any:
    """Return the distance of the segment from p to p_end from an obstacle [m], negative inside."""
    if isinstance(place, Sphere):
        return _from_segment(ca.DM(place.centre), p, p_end) - place.radius
    if isinstance(place, Capsule):
        return between_cables(p, p_end, ca.DM(place.start), ca.DM(place.end)) - place.radius
    if isinstance(place, Block):
        ends = (_before_turn(place, p), _before_turn(place, p_end))
        return segment_outside_box()(ca.DM(place.min), ca.DM(place.max), *ends)
    if isinstance(place, ConvexMesh):
        return cable_outside_mesh(place, p, p_end) - place.rounding
    raise TypeError(f"{type(place).__name__} is not an obstacle")


def _before_turn(place: Block, p: Point) -> Point:
    """Return the point that a turned box turns to p."""
    if place.attitude is None:
        return p
    centre = ca.DM(place.centre)
    return centre + ca.mtimes(ca.DM(place.axes.T), p - centre)


def _from_segment(p: Point, start: Point, end: Point) -> Any:
    along = end - start
    share = within_segment(ca.dot(p - start, along) / (ca.sumsqr(along) + _TINY))
    return between_points(p, start + share * along)
