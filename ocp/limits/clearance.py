"""Distances between points, cables and obstacles, as expressions that a nonlinear program can differentiate.

Points are (3, 1), CasADi SX or DM. Distances are the true ones, except within 1e-6 m where things touch. Around the
corners of a box they are rounded, so that a program can pass them. Inside a box or a mesh the nearest face counts.

Which face, edge or end is nearest is decided by comparisons, which have no derivatives. The distance then is a formula
of that one alone, so its derivatives cost no more than for two lines, however many faces there are.
"""

from functools import cache, lru_cache
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from ...models.polyhedron import Polyhedron
from ...models.shapes import Block, Capsule, ConvexMesh, Shape, Sphere

Point: TypeAlias = Any  # (3, 1), SX or DM
_FLAT = 1e-12  # share of a segment's squared length: less of it along the axes that count is a segment beside the box
_TINY_GAP = 1e-20  # [m^2], keeps the root's derivative finite where things touch
_NO_LENGTH = 1e-20  # [m^2], of a cable without length
_PARALLEL = 1e-12  # squared sine of the angle of two lines below which any point of them is as near as the others
_ROUNDING = 1e-12  # of the size of a body
_FINE = 2.0**-40  # of a segment
_CUTS = 6  # each a cutting plane and a bisection: of the place where a cable is deepest
_TINY = 1e-12  # [m^2], keeps the root's derivative finite where things touch
_SHORT = 1e-18  # [m^2], of a segment that is a point


class _Line(NamedTuple):
    """A height above a face along a segment: at its start, and its change to the end [m]."""

    start: Any
    slope: Any


def within_segment(share: Any) -> Any:
    """Return the share of a segment that is nearest to this one, from 0 to 1."""
    return ca.fmin(ca.fmax(share, 0.0), 1.0)


@cache
def segment_outside_box() -> ca.Function:
    """Return the function of a box's corners and a segment's ends, (3,) each: the distance [m], negative inside."""
    low, high, p, p_end = (ca.SX.sym(name, 3) for name in ("low", "high", "p", "p_end"))
    beyond = _beyond_at_nearest(low, high, p, p_end)
    squared = ca.sumsqr(beyond)
    outside = ca.if_else(squared > _TINY, ca.sqrt(squared + _TINY), _depth(low, high, p, p_end))
    return ca.Function("segment_outside_box", [low, high, p, p_end], [outside], {"cse": True})


def _beyond_at_nearest(low: Point, high: Point, p: Point, p_end: Point) -> Point:
    """Return how far the point of a segment that is nearest to a box is beyond it along each axis, (3, 1) [m].

    The squared distance along the segment is convex, and its slope is piecewise linear with a kink where the segment
    crosses the plane of a face. Between the last kink at which it falls and the first at which it rises the same faces
    count, so that the place where it is least is a quotient.
    """
    along = p_end - p
    fixed = along == 0
    kinks = [(face - p) / ca.if_else(fixed, 1.0, along) for face in (low, high)]
    shares = [0.0, 1.0, *(within_segment(kink[i]) for kink in kinks for i in range(3))]
    before, after = ca.SX(0.0), ca.SX(1.0)
    for share in shares:
        at = p + share * along
        slope = ca.dot(along, ca.fmax(at - high, 0.0) - ca.fmax(low - at, 0.0))
        before = ca.if_else(slope <= 0, ca.fmax(before, share), before)
        after = ca.if_else(slope >= 0, ca.fmin(after, share), after)
    middle = (before + after) / 2
    at = p + middle * along
    over, under = at > high, at < low
    from_faces = over * (p - high) + under * (p - low)
    counting = ca.dot(along**2, over + under)
    bent = counting > _FLAT * ca.sumsqr(along)
    nearest = within_segment(-ca.dot(along, from_faces) / ca.if_else(bent, counting, 1.0))
    # Along a segment beside the box all places are as near: a rounded number has no derivative.
    share = ca.if_else(bent, nearest, ca.floor(middle / _FINE) * _FINE)
    return from_faces + share * (over + under) * along


def _depth(low: Point, high: Point, p: Point, p_end: Point) -> Any:
    """Return the least over a segment of its largest height above a face [m]; negative where it is in the box.

    Along each axis the segment leaves one face and comes nearer to the other. Of three falling and three rising lines
    the highest is lowest where that pair of them meets which meets highest.
    """
    along = p_end - p
    forward = ca.if_else(along >= 0, 1.0, -1.0)
    before, half, slope = forward * (p - (low + high) / 2), (high - low) / 2, forward * along
    falling = [_Line(-(before + half)[i], -slope[i]) for i in range(3)]
    rising = [_Line((before - half)[i], slope[i]) for i in range(3)]
    meetings = [ca.vertcat(*(_meeting(fall, rise) for rise in rising)) for fall in falling]
    deepest = ca.mmax(ca.vertcat(*meetings))
    left = _first([ca.mmax(row) >= deepest for row in meetings])
    of_left = [sum(chosen * row[j] for chosen, row in zip(left, meetings, strict=True)) for j in range(3)]
    right = _first([value >= deepest for value in of_left])
    return _meeting(_weighted(left, falling), _weighted(right, rising))


def _meeting(falling: _Line, rising: _Line) -> Any:
    """Return the least of the larger of two heights, value and slope at the start, over a segment [m]."""
    change = rising.slope - falling.slope
    share = within_segment((falling.start - rising.start) / ca.if_else(change > 0, change, 1.0))
    return ca.fmax(*(line.start + share * line.slope for line in (falling, rising)))


def _first(holds: list[Any]) -> list[Any]:
    """Return 1 for the first that holds, 0 for all others."""
    chosen, none = [], 1.0
    for here in holds:
        chosen.append(none * here)
        none = none * ca.logic_not(here)
    return chosen


def _weighted(chosen: list[Any], lines: list[_Line]) -> _Line:
    return _Line(*(sum(one * line[k] for one, line in zip(chosen, lines, strict=True)) for k in range(2)))


@lru_cache(maxsize=128)
def _outside_mesh(place: ConvexMesh, ends: int) -> ca.Function:
    """Return the function of a point or of both ends of a segment: its operations are written once for all cables."""
    points = [ca.SX.sym(f"p{i}", 3) for i in range(ends)]
    outside = _point_outside(place.body, *points) if ends == 1 else _cable_outside(place.body, *points)
    return ca.Function("outside_mesh", points, [outside], {"cse": True})


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
    return ca.sqrt(_squared(p, p_end, nearest[:3].T, nearest[3:].T) + _TINY_GAP)


def _squared(p: Any, p_end: Any, starts: Any, edges: Any) -> Any:
    """Return the squared distances of a segment from edges, whose starts and directions are rows (k, 3), (k, 1) [m^2].

    Source: Ericson, Real-Time Collision Detection, 5.1.9.
    """
    along = p_end - p
    between = ca.repmat(p.T, starts.shape[0], 1) - starts
    a, e = ca.fmax(ca.sumsqr(along), _NO_LENGTH), ca.sum2(edges**2)
    b, c, f = ca.mtimes(edges, along), ca.mtimes(between, along), ca.sum2(edges * between)
    beside = a * e - b * b
    cross = beside > _PARALLEL * a * e
    s = ca.if_else(cross, within_segment((b * f - c * e) / ca.if_else(cross, beside, 1.0)), 0.0)
    t = (b * s + f) / e
    s = ca.if_else(t < 0, within_segment(-c / a), ca.if_else(t > 1, within_segment((b - c) / a), s))
    gap = between + ca.mtimes(s, along.T) - ca.repmat(within_segment(t), 1, 3) * edges
    return ca.sum2(gap**2)


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


def point_outside(place: Shape, p: Point) -> Any:
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
        return _outside_mesh(place, 1)(p) - place.rounding
    raise TypeError(f"{type(place).__name__} is not an obstacle")


def cable_outside(place: Shape, p: Point, p_end: Point) -> Any:
    """Return the distance of the segment from p to p_end from an obstacle [m], negative inside."""
    if isinstance(place, Sphere):
        return _from_segment(ca.DM(place.centre), p, p_end) - place.radius
    if isinstance(place, Capsule):
        return between_cables(p, p_end, ca.DM(place.start), ca.DM(place.end)) - place.radius
    if isinstance(place, Block):
        ends = (_before_turn(place, p), _before_turn(place, p_end))
        return segment_outside_box()(ca.DM(place.min), ca.DM(place.max), *ends)
    if isinstance(place, ConvexMesh):
        return _outside_mesh(place, 2)(p, p_end) - place.rounding
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
