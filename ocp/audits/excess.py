"""A limit that a motion does not keep: what is passed, by what, when, and by how much."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

__all__ = ["Excess"]


@dataclass(frozen=True)
class Excess:
    """One limit at the instant where it is passed by most. Its text is the sentence that a report has.

    Attributes
    ----------
    limit
        The physical name: that of the task's or robot's field.
    about
        "cable 3", "quad1", "platform".
    time
        [s]; None if it is about no instant.
    value, bound
        What there is and what is accepted, in `unit`; a value of nan: there is none.
    unit
        Of both.
    accepted
        On which side of the bound the value ought to be.
    why
        What else a person ought to know; empty: nothing.
    """

    limit: str
    about: str
    time: float | None
    value: float
    bound: float
    unit: str
    accepted: Literal["at most", "at least", "exactly"] = "at most"
    why: str = ""

    def __str__(self) -> str:
        at = "" if self.time is None else f" at t = {self.time:.3f} s"
        side = "" if self.accepted == "exactly" else f"{self.accepted} "
        told = f"{self.limit}: {self.about}{at}: {self.value:.6g} {self.unit}"
        return f"{told}, accepted: {side}{self.bound:.6g} {self.unit}" + (f" ({self.why})" if self.why else "")

    def to_dict(self) -> dict[str, Any]:
        """Ready for JSON, with the sentence as "text"; numbers that do not exist are None."""
        return {
            "limit": self.limit,
            "about": self.about,
            "time": self.time,
            "value": self.value if np.isfinite(self.value) else None,
            "bound": self.bound,
            "unit": self.unit,
            "accepted": self.accepted,
            "why": self.why,
            "text": str(self),
        }
