"""`RoundedCorners`: straight lines through points with rounded corners, by the length of the curve.

A corner is a Bezier curve of degree 5 whose first and last three control points lie on the two lines, so that the
curvature rises from zero and returns to it. Its size follows from how far it may miss the corner.
"""

from math import comb, pi
from typing import NamedTuple

import numpy as np

STRAIGHT = 1e-9  # [rad]: a smaller turn is none
TURNS_BACK = 0.95 * pi  # [rad]: at a sharper corner the motion stops
CELLS = 16  # of a corner, in each of which the curvature is bounded
NEAR_END = 0.17  # place of the second control point, as a share of the way from the end of a corner to its tip
# The third one, by the turn [rad]: with it the peak of the curvature is the least for a given miss, within 1 %.
TURNS, NEAR_TIP = (0.0, pi / 4, pi / 2, 3 * pi / 4, pi), (0.78, 0.71, 0.61, 0.43, 0.2)
LOOKS, BETWEEN = 8, 1.002  # in each of them, between which the curvature may be so many times as large
BLOCK = 20_000  # places of corners that are computed together: more would take memory, not less time
MOST = 0.5  # of the shorter line at a corner
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


class Places(NamedTuple):
    """Places of a curve, with derivatives by its length."""

    position: np.ndarray  # (n, 3) [m]
    tangent: np.ndarray  # (n, 3), of length one
    bend: np.ndarray  # (n, 3) [1/m], the second derivative


class RoundedCorners:
    """Lines through points with rounded corners.

    - `points`: (n, 3) [m]; neighbours differ.
    - `tolerance`: by how much the curve may miss a corner [m].
    - `stops`: points at which the motion stops anyway, (n,): their corners stay sharp.
    - `lengths`, `curvature`: of each corner, (n - 2,): the length up to the ends of its cells, (CELLS + 1,) [m], and
      the largest curvature in them, (CELLS,) [1/m].
    """

    def __init__(self, points: np.ndarray, tolerance: float, stops: np.ndarray):
        lines = np.diff(points, axis=0)
        long = np.linalg.norm(lines, axis=1)
        self._points, self._along = points, lines / long[:, None]
        before, after = self._along[:-1], self._along[1:]
        turn = 2 * np.arctan2(np.linalg.norm(after - before, axis=1), np.linalg.norm(after + before, axis=1))
        self.sharp = stops | np.r_[True, turn > TURNS_BACK, True]  # points at which a motion must stop, (n,)
        rounded = (turn > STRAIGHT) & ~self.sharp[1:-1]
        tip = np.interp(turn, TURNS, NEAR_TIP)
        # B(1/2) misses the tip by this much for each metre that is cut off the lines.
        missed = 2 * np.sin(turn / 2) * (1 + 5 * (1 - NEAR_END) + 10 * (1 - tip)) / 32
        room = MOST * np.minimum(long[:-1], long[1:])
        cut = np.where(rounded, np.minimum(tolerance / np.where(rounded, missed, 1.0), room), 0.0)
        offsets = -np.stack([np.ones_like(tip), np.full_like(tip, 1 - NEAR_END), 1 - tip], axis=1) * cut[:, None]
        control = np.concatenate([offsets[:, :, None] * before[:, None], -offsets[:, ::-1, None] * after[:, None]], 1)
        self._control = [points[1:-1, None] + control]  # also of the derivatives, (n - 2, 6 - order, 3)
        for degree in (5, 4):
            self._control.append(degree * np.diff(self._control[-1], axis=1))
        self._ends = np.linspace(0.0, 1.0, CELLS + 1)
        inner = (self._ends[:-1, None] + (1 + _NODES) / 2 / CELLS).ravel()
        speed, _ = self._sizes(inner)
        self.lengths = np.pad(
            np.cumsum(speed.reshape(-1, CELLS, len(_NODES)) @ _WEIGHTS / 2 / CELLS, axis=1), ((0, 0), (1, 0))
        )
        speed, crossed = self._sizes(np.linspace(0.0, 1.0, CELLS * LOOKS + 1))
        curvature = np.divide(crossed, speed**3, out=np.zeros_like(speed), where=speed > 0)
        cells = np.arange(CELLS)[:, None] * LOOKS + np.arange(LOOKS + 1)  # with both ends
        self.curvature = BETWEEN * curvature[:, cells].max(axis=2)
        straight = long - np.append(0.0, cut) - np.append(cut, 0.0)
        pieces = np.zeros(2 * len(long) - 1)
        pieces[::2], pieces[1::2] = np.maximum(straight, 0.0), self.lengths[:, -1]
        # lengths at which the pieces begin and end, (2 n - 2,) [m]: line, corner, line, ... , line.
        self.edges = np.append(0.0, np.cumsum(pieces))
        # lengths at the points, in the middle of their corners, (n,) [m]
        self.tips = np.concatenate([[0.0], (self.edges[1:-1:2] + self.edges[2:-1:2]) / 2, self.edges[-1:]])
        self._starts = points[:-1] + np.append(0.0, cut)[:, None] * self._along

    def at(self, length: np.ndarray) -> Places:
        """Return the places at lengths from 0 to the last edge, (n,) [m]."""
        blocks = [self._at(some) for some in np.array_split(length, len(length) // BLOCK + 1)]
        return Places(*map(np.concatenate, zip(*blocks, strict=True)))

    def _at(self, length: np.ndarray) -> Places:
        piece = np.clip(np.searchsorted(self.edges, length, side="right") - 1, 0, len(self.edges) - 2)
        line, since = piece // 2, length - self.edges[piece]
        tangent, bend = self._along[line].copy(), np.zeros((len(length), 3))
        position = self._starts[line] + since[:, None] * tangent
        turning = np.flatnonzero((piece % 2 == 1) & (self.edges[piece + 1] > self.edges[piece]))
        corner = line[turning]
        share = self._share(corner, since[turning])
        position[turning], first, second = (self._bezier(corner, share, order) for order in range(3))
        speed = np.linalg.norm(first, axis=1, keepdims=True)
        tangent[turning] = first / speed
        across = second - tangent[turning] * np.sum(second * tangent[turning], axis=1, keepdims=True)
        bend[turning] = across / speed**2
        return Places(position, tangent, bend)

    def _sizes(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the speed of all corners at parameters (k,), and the area of velocity and acceleration, (n - 2, k)."""
        count, sizes = len(self._control[0]), []
        for some in np.array_split(np.arange(count), count * len(share) // BLOCK + 1):
            at = np.repeat(some, len(share)), np.tile(share, len(some))
            first, second = self._bezier(*at, 1), self._bezier(*at, 2)
            sizes.append(np.linalg.norm([first, np.cross(first, second)], axis=2))
        speed, crossed = np.concatenate(sizes, axis=1).reshape(2, count, len(share))
        return speed, crossed

    def _share(self, corner: np.ndarray, since: np.ndarray) -> np.ndarray:
        """Return the parameter of corners at lengths from their beginnings, (n,), by Newton's method."""
        known = self.lengths[corner]  # (n, CELLS + 1)
        cell = np.clip((known <= since[:, None]).sum(axis=1) - 1, 0, CELLS - 1)
        rows, start = np.arange(len(cell)), self._ends[cell]
        before, after = known[rows, cell], known[rows, cell + 1]
        share = start + (since - before) / (after - before) / CELLS
        for _ in range(3):
            half = (share - start) / 2
            inner = start[:, None] + half[:, None] * (1 + _NODES)  # (n, 5)
            first = self._bezier(np.repeat(corner, len(_NODES)), inner.ravel(), 1)
            covered = before + half * (np.linalg.norm(first, axis=1).reshape(inner.shape) @ _WEIGHTS)
            speed = np.linalg.norm(self._bezier(corner, share, 1), axis=1)
            share = share - (covered - since) / speed
        return share

    def _bezier(self, corner: np.ndarray, share: np.ndarray, order: int) -> np.ndarray:
        """Return corners at a parameter from 0 to 1, (n,), or their derivative of an order by it, (n, 3)."""
        degree = 5 - order
        weights = [comb(degree, k) * share**k * (1 - share) ** (degree - k) for k in range(degree + 1)]
        return np.einsum("kn,nkj->nj", np.array(weights), self._control[order][corner])
