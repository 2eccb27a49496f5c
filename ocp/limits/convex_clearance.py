"""Distances of points and cables from convex polyhedra, as expressions that a nonlinear program can differentiate.

Which face, edge or end is nearest is decided by comparisons, which have no derivatives. The distance then is a formula
of that one alone, so its derivatives cost no more than for two lines, however many faces there are.
"""

from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from ...models.part import Pose, Vector3
from ...models.polyhedron import Polyhedron
from ...models.shapes import ConvexMesh
from .box_clearance import within_segment

Point: TypeAlias = Any  # (3, 1), SX or DM

_TINY = 1e-20  # [m^2], keeps the root's derivative finite where things touch
_SHORT = 1e-20  # [m^2], of a cable without length
_PARALLEL = 1e-12  # squared sine of the angle of two lines below which any point of them is as near as the others
_ROUNDING = 1e-12  # of the size of a body
_FINE = 2.0**-40  # of a segment
_CUTS = 6  # each a cutting plane and a bisection: of the place where a cable is deepest


def point_outside_mesh(place: ConvexMesh, p: Point) -> Any:
    """Return the distance of p from a convex mesh [m], negative inside."""
    return _functions(place.vertices, place.scale, place.pose).of_point(p)


def cable_outside_mesh(place: ConvexMesh, p: Point, p_end: Point) -> Any:
    """Return the distance of the segment from p to p_end from a convex mesh [m], negative inside."""
    return _functions(place.vertices, place.scale, place.pose).of_cable(p, p_end)


class _Functions(NamedTuple):
    of_point: ca.Function
    of_cable: ca.Function


@lru_cache(maxsize=64)
def _functions(vertices: tuple[Vector3, ...], scale: float, pose: Pose) -> _Functions:
    """Return the functions of a point and of a segment's ends: their operations are written once for all cables."""
    body = ConvexMesh(kind="mesh", vertices=vertices, scale=scale, pose=pose).body
    p, p_end = ca.SX.sym("p", 3), ca.SX.sym("p_end", 3)
    options = {"cse": True}
    return _Functions(
        ca.Function("point_outside_mesh", [p], [_point_outside(body, p)], options),
        ca.Function("cable_outside_mesh", [p, p_end], [_cable_outside(body, p, p_end)], options),
    )


def _chosen(rows: np.ndarray, where: Any) -> Any:
    """Return the first row (k, 1) of an array (n, k) where a condition (n, 1) holds."""
    numbers = ca.DM(np.arange(len(rows)))
    first = ca.mmin(ca.if_else(where, numbers, len(rows)))
    return ca.mtimes(ca.DM(rows.T), numbers == first)


def _planes(body: Polyhedron) -> np.ndarray:
    """Return normal and offset of each face, (f, 4)."""
    return np.column_stack([body.normals, body.offsets])


def _heights(body: Polyhedron, p: Any) -> Any:
    """Return how far p is beyond each face, (f, 1) [m]."""
    return ca.mtimes(ca.DM(body.normals), p) - ca.DM(body.offsets)


class _Above(NamedTuple):
    """The face that a point is farthest above, as a formula, and whether the point of it below is on the body."""

    height: Any
    on_face: Any


def _above(body: Polyhedron, p: Any) -> _Above:
    heights = _heights(body, p)
    plane = _chosen(_planes(body), heights == ca.mmax(heights))
    height = ca.dot(plane[:3], p) - plane[3]
    below = ca.mmax(_heights(body, p - height * plane[:3]))
    return _Above(height, below <= _ROUNDING * body.size)


def _point_outside(body: Polyhedron, p: Any) -> Any:
    """Return the distance of a point: from the face below it, else from the nearest edge."""
    above = _above(body, p)
    return ca.if_else(ca.logic_or(above.height <= 0, above.on_face), above.height, _from_edges(body, p, p))


def _cable_outside(body: Polyhedron, p: Any, p_end: Any) -> Any:
    """Return the distance of a segment: from the face below one of its ends, else from the nearest edge."""
    inside, outside = _deepest(body, p, p_end), _from_edges(body, p, p_end)
    for end in (_above(body, p), _above(body, p_end)):
        nearer = ca.logic_and(end.on_face, ca.logic_and(end.height > 0, end.height < outside))
        outside = ca.if_else(nearer, end.height, outside)
    return ca.if_else(inside > 0, outside, inside)


def _deepest(body: Polyhedron, p: Any, p_end: Any) -> Any:
    """Return the least over a segment of its largest height above a face [m]; not positive where it meets the body.

    That height is convex and piecewise linear along the segment: cutting planes and bisections in turn enclose the
    place where it is least, between a face from which it falls and one from which it rises.
    """
    at, along = _heights(body, p), ca.mtimes(ca.DM(body.normals), p_end - p)

    def highest(share: Any, falling: bool) -> tuple[_Line, Any]:
        """Return the line that is highest at a place, of equal ones the one that falls or rises most, and which."""
        values = at + share * along
        value = ca.mmax(values)
        if falling:
            slope = ca.mmin(ca.if_else(values == value, along, np.inf))
        else:
            slope = ca.mmax(ca.if_else(values == value, along, -np.inf))
        return _Line(value - share * slope, slope), ca.logic_and(values == value, along == slope)

    low, high = ca.SX(0.0), ca.SX(1.0)
    left, right = highest(low, True)[0], highest(high, False)[0]
    for turn in range(2 * _CUTS):
        share = (low + high) / 2 if turn % 2 else _crossing(low, high, left, right)
        here, _ = highest(share, True)
        falls = here.slope < 0
        low, high = ca.if_else(falls, share, low), ca.if_else(falls, high, share)
        left = _Line(*(ca.if_else(falls, new, old) for new, old in zip(here, left, strict=True)))
        right = _Line(*(ca.if_else(falls, old, new) for new, old in zip(here, right, strict=True)))
    lines = []
    for share, falling in ((low, True), (high, False)):
        plane = _chosen(_planes(body), highest(share, falling)[1])
        lines.append(_Line(ca.dot(plane[:3], p) - plane[3], ca.dot(plane[:3], p_end - p)))
    # All points of a segment along a face are as deep within a span: a rounded number has no derivative.
    left, right = lines
    share = _crossing(0.0, 1.0, left, right, ca.floor(high / _FINE) * _FINE)
    return ca.fmax(*(line.start + share * line.slope for line in lines))


class _Line(NamedTuple):
    """A height along a segment: at its start, and its change to the end [m]."""

    start: Any
    slope: Any


def _crossing(low: Any, high: Any, left: _Line, right: _Line, flat: Any = None) -> Any:
    """Return where a line that falls on the left meets one that rises on the right; else the lower end, or `flat`."""
    rise = right.slope - left.slope
    crossing = (left.start - right.start) / ca.if_else(rise > 0, rise, 1.0)
    inner = ca.fmin(ca.fmax(crossing, low), high)
    return ca.if_else(left.slope >= 0, low, ca.if_else(right.slope <= 0, high if flat is None else flat, inner))


def _from_edges(body: Polyhedron, p: Any, p_end: Any) -> Any:
    """Return the distance of a segment from the nearest edge [m]."""
    starts, edges = body.edges[:, 0], body.edges[:, 1] - body.edges[:, 0]
    squares = _squared(p, p_end, ca.DM(starts), ca.DM(edges))
    nearest = _chosen(np.hstack([starts, edges]), squares == ca.mmin(squares))
    return ca.sqrt(_squared(p, p_end, nearest[:3].T, nearest[3:].T) + _TINY)


def _squared(p: Any, p_end: Any, starts: Any, edges: Any) -> Any:
    """Return the squared distances of a segment from edges, whose starts and directions are rows (k, 3), (k, 1) [m^2].

    Source: Ericson, Real-Time Collision Detection, 5.1.9.
    """
    along = p_end - p
    between = ca.repmat(p.T, starts.shape[0], 1) - starts
    a, e = ca.fmax(ca.sumsqr(along), _SHORT), ca.sum2(edges**2)
    b, c, f = ca.mtimes(edges, along), ca.mtimes(between, along), ca.sum2(edges * between)
    beside = a * e - b * b
    cross = beside > _PARALLEL * a * e
    s = ca.if_else(cross, within_segment((b * f - c * e) / ca.if_else(cross, beside, 1.0)), 0.0)
    t = (b * s + f) / e
    s = ca.if_else(t < 0, within_segment(-c / a), ca.if_else(t > 1, within_segment((b - c) / a), s))
    gap = between + ca.mtimes(s, along.T) - ca.repmat(within_segment(t), 1, 3) * edges
    return ca.sum2(gap**2)
