"""Distance of a segment from a box along the axes, as an expression that a nonlinear program can differentiate.

Which faces count is decided by comparisons, which have no derivatives. The distance then is a formula of those alone:
a program differentiates some twenty products, however many pairs of faces there are.
"""

from functools import cache
from typing import Any, TypeAlias

import casadi as ca

Point: TypeAlias = Any  # (3, 1), SX or DM
_Line: TypeAlias = tuple[Any, Any]  # height above a face at the start of a segment, and its change to the end [m]
_TINY = 1e-12  # [m^2], keeps the root's derivative finite where things touch
_FINE = 2.0**-40  # of a segment
_FLAT = 1e-12  # share of a segment's squared length: less of it along the axes that count is a segment beside the box


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
    falling = [(-(before + half)[i], -slope[i]) for i in range(3)]
    rising = [((before - half)[i], slope[i]) for i in range(3)]
    meetings = [ca.vertcat(*(_meeting(fall, rise) for rise in rising)) for fall in falling]
    deepest = ca.mmax(ca.vertcat(*meetings))
    left = _first([ca.mmax(row) >= deepest for row in meetings])
    of_left = [sum(chosen * row[j] for chosen, row in zip(left, meetings, strict=True)) for j in range(3)]
    right = _first([value >= deepest for value in of_left])
    return _meeting(_weighted(left, falling), _weighted(right, rising))


def _meeting(falling: _Line, rising: _Line) -> Any:
    """Return the least of the larger of two heights, value and slope at the start, over a segment [m]."""
    (fall, down), (rise, up) = falling, rising
    change = up - down
    share = within_segment((fall - rise) / ca.if_else(change > 0, change, 1.0))
    return ca.fmax(fall + share * down, rise + share * up)


def _first(holds: list[Any]) -> list[Any]:
    """Return 1 for the first that holds, 0 for all others."""
    chosen, none = [], 1.0
    for here in holds:
        chosen.append(none * here)
        none = none * ca.logic_not(here)
    return chosen


def _weighted(chosen: list[Any], lines: list[_Line]) -> _Line:
    value, slope = (sum(one * line[k] for one, line in zip(chosen, lines, strict=True)) for k in range(2))
    return value, slope
