"""`long_turns`: lines whose angles change by more than half a turn, although the other way to the end is shorter."""

from math import pi, remainder

import numpy as np

from ...base.text import quantity
from ..tasks.paths import LinePath, PathBase, SequencePath

LEAST = 1e-3  # [rad], by which a turn must be less than a whole one, which is meant
OTHER_WAY = "the other way to the same attitude"


def long_turns(path: PathBase) -> list[str]:
    """Return a sentence for each angle of a line, also of a part of a sequence, that turns the longer way."""
    if isinstance(path, SequencePath):
        return [sentence for piece in path.parts for sentence in long_turns(piece.path)]
    if not isinstance(path, LinePath):
        return []
    found = []
    for name, start, end in zip(("roll", "pitch", "yaw"), path.start[3:], path.end[3:], strict=True):
        short = remainder(end - start, 2 * pi)
        if pi < abs(end - start) < 2 * pi - LEAST:
            turns, least = (quantity(np.rad2deg(abs(turn)), "degrees", 4) for turn in (end - start, short))
            other = f"{OTHER_WAY}, to a {name} of {quantity(start + short, 'rad', digits=6)}, is {least}"
            found.append(f"the line turns by {turns} in {name}; {other}")
    return found
