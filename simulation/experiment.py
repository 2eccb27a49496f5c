"""`Experiment`: the settings of all runs, for one robot and one reference."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.display import record
from ..control import Reference
from ..control.noise import Noise
from .events.event import Event
from .events.faults import Cut
from .mismatch import Mismatch

Wind = Callable[[np.ndarray, int], np.ndarray]  # the wind at times (K,) [s] for a seed, (K, 3) [m/s]


class Experiment(NamedTuple):
    """Settings shared by all runs: controller period, references, wind, noise and events, see `Conditions`."""

    period: float  # as in `Conditions`
    substeps: int  # as in `Conditions`
    references: Sequence[Reference]  # reference of each period
    wind: Wind | None  # velocity of the air in {G}; None without air
    disturbance: np.ndarray  # as in `Conditions`
    noise: Noise  # as in `Conditions`
    events: tuple[Event, ...]  # events in order of time
    keep_out: Sequence[Sequence[np.ndarray]]  # outlines of the keep-out regions of the reference, see `Trajectory`
    doubt: str = ""  # row of the report that says that the reference is a plan with a broken limit, see `Trajectory`
    mismatch: Mismatch = Mismatch()  # as in `Conditions`
    windings: int = 1  # parts of a period, see `plant.steps.windings_in`

    __repr__ = record

    def cut(self, cables: int, periods: np.ndarray) -> np.ndarray:
        """Return which cables are cut when periods begin, (n, cables); `periods`, (n,), are their numbers."""
        result = np.zeros((len(periods), cables), dtype=bool)
        for event in self.events:
            if isinstance(event, Cut):
                result[periods * self.period >= event.at - 1e-9 * self.period, event.cable - 1] = True
        return result

    def to_dict(self) -> dict[str, Any]:
        """Return all settings except the references, ready for JSON."""
        return {
            "period": self.period,
            "substeps": self.substeps,
            "disturbance": self.disturbance.tolist(),
            "noise": self.noise.model_dump(exclude_defaults=True),
            "mismatch": self.mismatch.model_dump(exclude_defaults=True),
            "events": [event.model_dump(mode="json") for event in self.events],
        }
