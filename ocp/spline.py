"""Motions of piecewise linear acceleration: the exact integrator that the transcription uses.

Over an interval of h seconds from (q, v, a) at its start to a' at its end,

    v' = v + h/2 (a + a'),    q' = q + h v + h^2/6 (2 a + a'),

so q is a cubic spline and its acceleration, and with it the tension, is continuous. A cubic lies inside the convex
hull of its Bernstein points: a convex limit that holds at those holds at every time between the nodes.

All functions take NumPy arrays and CasADi expressions.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

Values: TypeAlias = Any  # np.ndarray or a CasADi expression


def defects(
    h: Values, start: tuple[Values, Values, Values], end: tuple[Values, Values, Values]
) -> tuple[Values, Values]:
    """How far (q', v') at the end is from what integration gives; zero on a motion."""
    q, v, a = start
    q_end, v_end, a_end = end
    return q_end - (q + h * v + h**2 / 6 * (2 * a + a_end)), v_end - (v + h / 2 * (a + a_end))


def position_points(h: Values, q: Values, v: Values, q_end: Values, v_end: Values) -> list[Values]:
    """The two inner Bernstein points of the cubic q; the outer two are q and q'."""
    return [q + h / 3 * v, q_end - h / 3 * v_end]


def speed_point(h: Values, v: Values, a: Values) -> Values:
    """The inner Bernstein point of the quadratic v; the outer two are v and v'."""
    return v + h / 2 * a


def evaluate(
    nodes: np.ndarray, q: np.ndarray, v: np.ndarray, a: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration at `times`, (n, c) each, of the spline with values (k, c) at `nodes` (k,)."""
    index = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, len(nodes) - 2)
    h = (nodes[index + 1] - nodes[index])[:, None]
    s = times[:, None] - nodes[index][:, None]
    start, slope = a[index], (a[index + 1] - a[index]) / h
    return (
        q[index] + s * v[index] + s**2 / 2 * start + s**3 / 6 * slope,
        v[index] + s * start + s**2 / 2 * slope,
        start + s * slope,
    )
