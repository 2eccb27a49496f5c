"""`Stations`: the waypoints of a path, which it may round."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np


class Stations(NamedTuple):
    """The waypoints of a path, in order."""

    names: tuple[str, ...] = ()  # as in the path's file: `points[2]`
    times: np.ndarray = np.zeros(0)  # when the path passes each, or arrives to dwell, (n,) [s]; nan if unknown
    poses: np.ndarray = np.zeros((0, 6))  # in the frame of the path [m, rad]

    @classmethod
    def joined(cls, parts: Iterable[tuple[str, float, Stations]]) -> Stations:
        """Return the waypoints of a sequence of paths, from the key and the start [s] of each."""
        kept = [(key, start, its) for key, start, its in parts if its.names]
        return cls(
            tuple(f"{key}.{name}" for key, _, its in kept for name in its.names),
            np.concatenate([np.zeros(0), *(start + its.times for _, start, its in kept)]),
            np.concatenate([np.zeros((0, 6)), *(its.poses for _, _, its in kept)]),
        )

    @property
    def windows(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the times of the station before each and of the one after it, (n,) each [s]; infinite if unknown."""
        edges = np.concatenate([[-np.inf], self.times, [np.inf]])
        low, high = edges[:-2], edges[2:]
        return np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)

    def since(self, start: float) -> Stations:
        """Return the waypoints from the time `start` [s] on, with times that count from it."""
        later = self.times >= start
        names = tuple(name for name, kept in zip(self.names, later, strict=True) if kept)
        return Stations(names, self.times[later] - start, self.poses[later])
