"""Transcription schemes: which polynomial of time the acceleration is between two nodes, and where A t = w is required.

Inverse dynamics makes the differential equation a chain of integrators, which every scheme integrates exactly: position
and speed at the nodes are no approximation. Schemes differ in two choices only:

    linear     acceleration linear; balance at the nodes
    hermite    acceleration quadratic; balance at the nodes and in the middle (Hermite-Simpson)
    spline     acceleration a cubic B-spline, twice continuously differentiable; balance at the nodes

With all of them the acceleration is continuous.

A robot with enough cables has tensions between those points too, wherever its limits permit; one with few cables has
them only as exactly as the polynomial follows a motion that is possible. There the order counts: the error of two
balances per interval with a quadratic is far smaller than that of one balance with a line.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ...base.display import Displayed
from . import bernstein
from .bernstein import Values

Motion = tuple[np.ndarray, np.ndarray, np.ndarray]

SchemeName = Literal["linear", "hermite", "spline"]


@dataclass(frozen=True)
class Scheme(Displayed):
    """A transcription scheme.

    An interval has a point at its start, one at each share in `inner`, and one at its end, which is the next
    interval's start. Every point has q, v and a.
    """

    name: SchemeName
    degree: int  # degree of the acceleration
    inner: tuple[float, ...]  # further points inside an interval, as shares of it
    weights: tuple[float, ...]  # weights of the quadrature over an interval, at its points from start to end
    smooth: bool = False  # whether jerk and snap, the next two derivatives, are unknowns at the nodes as well

    @property
    def size(self) -> int:
        """Return how many points each interval adds."""
        return 1 + len(self.inner)

    @property
    def derivatives(self) -> int:
        """Return how many of q, v, a, jerk, snap are unknowns."""
        return 5 if self.smooth else 3

    def shares(self, steps: int) -> np.ndarray:
        """Return the points of all intervals as shares of the duration, (steps * size + 1,)."""
        starts = np.arange(steps)[:, None] + np.array([0.0, *self.inner])
        return np.append(starts.ravel(), steps) / steps

    def quadrature(self, lengths: np.ndarray) -> np.ndarray:
        """Return the weights of the integral over intervals of these `lengths` (n,) at all points, (n * size + 1,).

        Those of a smooth scheme are of the spline itself, whose snap is equal in the first two nodes and in the last
        two: if the cost had other weights than the motion, motion at the ends would cost too little.
        """
        if self.smooth:
            from scipy.interpolate import make_interp_spline  # loads for longer than a plan of another scheme takes

            nodes = np.append(0.0, np.cumsum(lengths))
            equal = [(3, np.zeros(len(nodes)))]
            return make_interp_spline(nodes, np.eye(len(nodes)), bc_type=(equal, equal)).integrate(0.0, nodes[-1])
        weights = np.zeros(len(lengths) * self.size + 1)
        for k, length in enumerate(lengths):
            weights[k * self.size : (k + 1) * self.size + 1] += np.array(self.weights) * length
        return weights

    @cached_property
    def _to_points(self) -> np.ndarray:
        """Return the matrix from values at the points to the Bernstein points of their polynomial."""
        inverse = np.linalg.inv(bernstein.basis(self.degree, (0.0, *self.inner, 1.0)))
        return np.where(np.abs(inverse) < 1e-12, 0.0, inverse)

    @property
    def inner_points(self) -> tuple[int, ...]:
        """Return the Bernstein points of the acceleration that are no value at a point: limits apply there too."""
        is_value = [(row != 0).sum() == 1 for row in self._to_points] if not self.smooth else [True, False, False, True]
        return tuple(i for i, known in enumerate(is_value) if not known)

    def acceleration(self, h: Values, a: Sequence[Values], jerk: tuple[Values, Values] | None = None) -> list[Values]:
        """Return the Bernstein points of the acceleration over an interval, `degree` + 1.

        - `h`: length of the interval [s].
        - `a`: accelerations at its points, start and end included.
        - `jerk`: at start and end, for a smooth scheme; default: the line between the ends.
        """
        if self.smooth:
            start, end = a
            rise = (end - start) / 3 if jerk is None else None
            first, last = (rise, rise) if jerk is None else (h / 3 * jerk[0], h / 3 * jerk[1])
            return [start, start + first, end - last, end]
        return [sum(float(w) * value for w, value in zip(row, a, strict=True) if w != 0) for row in self._to_points]

    def evaluate(
        self, nodes: np.ndarray, values: Motion, jerk: np.ndarray | None, times: np.ndarray
    ) -> list[np.ndarray]:
        """Return position, velocity, acceleration and jerk at `times` (k,), (k, n) each.

        `values` are (q, v, a) at the points `nodes` of all intervals, (points, n) each; `jerk` is (points, n) or None.
        """
        size = self.size
        starts = nodes[::size]
        q, v = (part[:-1:size] for part in values[:2])
        h = np.diff(starts)[:, None]
        a = [values[2][i:-1:size] for i in range(size)] + [values[2][size::size]]
        acceleration = self.acceleration(h, a, None if jerk is None else (jerk[:-1], jerk[1:]))
        speed = bernstein.integral(h, v, acceleration)
        position = bernstein.integral(h, q, speed)
        change = bernstein.derivative(h, acceleration)
        index = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(starts) - 2)
        shares = (times - starts[index]) / h[index, 0]
        motion = []
        for points in (position, speed, acceleration, change):
            weights = bernstein.basis(len(points) - 1, shares)
            motion.append(np.sum([weights[:, i : i + 1] * point[index] for i, point in enumerate(points)], axis=0))
        return motion


SCHEMES: dict[str, Scheme] = {
    scheme.name: scheme
    for scheme in (
        Scheme("linear", 1, (), (0.5, 0.5)),
        Scheme("hermite", 2, (0.5,), (1 / 6, 2 / 3, 1 / 6)),
        Scheme("spline", 3, (), (0.5, 0.5), smooth=True),
    )
}
LINEAR = SCHEMES["linear"]
