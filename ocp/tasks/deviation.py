"""`Deviation`: how a motion leaves its references, at the points of a transcription and between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...base.display import Displayed
from .scheme import LINEAR, Scheme


@dataclass(frozen=True)
class Deviation(Displayed):
    """Values of the free coordinates at the points of a transcription, and by its scheme at all times between.

    The inner points of a scheme are among the nodes.
    """

    nodes: np.ndarray  # (k,) [s]
    q: np.ndarray  # (k, n)
    v: np.ndarray  # (k, n)
    a: np.ndarray  # (k, n)
    tensions: np.ndarray  # (k, m) [N]
    scheme: Scheme = LINEAR
    jerk: np.ndarray | None = None  # (k, n), where the scheme is smooth

    def evaluate(self, times: np.ndarray) -> list[np.ndarray]:
        """Return q, v, a and jerk at `times` (k,), (k, n) each."""
        return self.scheme.evaluate(self.nodes, (self.q, self.v, self.a), self.jerk, times)

    def at(self, nodes: np.ndarray) -> Deviation:
        """Return the same motion at other nodes as an initial guess: tensions are interpolated."""
        q, v, a, jerk = self.evaluate(nodes)
        return Deviation(nodes, q, v, a, self.tensions_at(nodes), jerk=jerk)

    def tensions_at(self, times: np.ndarray) -> np.ndarray:
        """Return the tensions at `times` (k,), linear between the nodes, (k, m) [N]."""
        return np.stack([np.interp(times, self.nodes, column) for column in self.tensions.T], axis=1)

    def stretched(self, factor: float) -> Deviation:
        """Return the same path in `factor` times the time."""
        jerk = None if self.jerk is None else self.jerk / factor**3
        return replace(self, nodes=self.nodes * factor, v=self.v / factor, a=self.a / factor**2, jerk=jerk)
