"""`Excess`: a limit that a motion exceeds: which, by what, when, and by how much."""

from dataclasses import asdict, dataclass
from typing import Any, Literal, Self

import numpy as np

from ...base.display import Displayed
from ...base.text import quantity
from ..limits import Limit
from ..limits.places import WITHIN

TENSIONS = "tensions"  # the limit of an audit that finds no tensions for the wrench


@dataclass(frozen=True)
class Excess(Displayed):
    """One limit at the instant where it is exceeded by most. As text it is a sentence of a report."""

    limit: str  # name of the limit in the task or the robot's file
    about: str  # "cable 3", "quad1", "platform"
    time: float | None  # instant [s]; None if the limit does not refer to one
    # the value and its bound, in `unit`; nan if there is no value
    value: float
    bound: float
    unit: str  # unit of value and bound
    accepted: Literal["at most", "at least", "exactly"] = "at most"  # side of the bound on which the value must be
    why: str = ""  # explanation; may be empty
    what: str = ""  # what the value is, if it is not the limited quantity: "distance from its path"
    # The value with which the program would keep the limit, if it is another: a distance has no least value, but a
    # thin region is nowhere deep. It is the bound where a tighter one at the nodes would not help.
    between: float | None = None

    @classmethod
    def of(cls, limit: Limit, which: int, time: float, value: float, why: str = "") -> Self:
        """Return the excess of one value of a limit, `which`, over the bound that it is beyond.

        If both bounds have one size, as for a speed, it is the size of the value that must be at most the bound.
        """
        side, bound = ("at least", limit.low) if value < limit.low else ("at most", limit.high)
        if limit.is_equation:
            side = "exactly"
        elif limit.low == -limit.high:
            side, bound, value = "at most", limit.high, abs(value)
        return cls(limit.name, limit.about(which), float(time), float(value), bound, limit.unit, side, why)

    def __str__(self) -> str:
        """Return "carrier_speed of quad1 must be at most 2 m/s but is 2.5 m/s at t = 1.250 s", for example."""
        at = "" if self.time is None else f" at t = {self.time:.3f} s"
        why = f" ({self.why})" if self.why else ""
        body, _, region = self.about.partition(" outside ")
        if self.limit == "keep_out" and region and not np.isnan(self.value):
            required = f" (required distance: {quantity(self.bound, self.unit)})" if self.bound > 0 else ""
            side, off = ("inside", -self.value) if self.value < 0 else ("from", self.value)
            depth = quantity(off, self.unit)
            return f"{_named(body)} is {depth} {side} the keep-out region {region!r}{at}{required}{why}"
        body, _, room = self.about.partition(WITHIN)
        if room and self.value < 0:
            side = "below" if room == "the floor" else "beyond"
            return f"{_named(body)} is {quantity(-self.value, self.unit)} {side} {room}{at}{why}"
        if self.limit == TENSIONS:
            return f"with tensions inside their limits the wrench is off by {quantity(self.value, self.unit)}{at}{why}"
        side = "" if self.accepted == "exactly" else f"{self.accepted} "
        value, bound = (quantity(number, self.unit) for number in (self.value, self.bound))
        for digits in (6, 9, 12):
            if value == bound:
                value, bound = (quantity(number, self.unit, digits=digits) for number in (self.value, self.bound))
        value = "undefined" if np.isnan(self.value) else value
        owner = "" if self.about == "platform" and self.limit.startswith("platform_") else f" of {_named(self.about)}"
        what = f": {self.what}" if self.what else ""
        return f"{self.limit}{owner}{what} must be {side}{bound} but is {value}{at}{why}"

    def to_dict(self) -> dict[str, Any]:
        """Return the fields for JSON, with the sentence as "text"; numbers that do not exist are None."""
        facts = asdict(self) | {"value": self.value if np.isfinite(self.value) else None, "text": str(self)}
        return {name: fact for name, fact in facts.items() if name != "between"}


def _named(body: str) -> str:
    """Return the subject of a limit as in a sentence: "cable 3", but "the platform"."""
    return f"the {body}" if body == "platform" else body
