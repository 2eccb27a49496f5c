"""`Claim`: one thing that a paper says, beside what comes out when it is computed.

A verdict follows from numbers, never from opinion: `compared` holds numbers against the printed ones, `stated` asks
whether what is said holds, `undetermined` says what the paper does not print. Each is told in one sentence, and what is
written for one verdict never stands beside another.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeAlias

import numpy as np

__all__ = ["Claim", "Value", "Verdict", "compared", "stated", "told", "undetermined"]

Value: TypeAlias = float | tuple[float, ...] | str | None


class Verdict(StrEnum):
    """What became of a claim; its values are plain strings."""

    REPRODUCED = "reproduced"
    """What is computed is what is printed."""

    DIFFERS = "differs"
    """Something else comes out, or what is printed contradicts itself."""

    IMPOSSIBLE = "impossible"
    """No choice of what the paper leaves open gives what is printed."""

    NOT_DETERMINED = "not determined"
    """The paper does not print what would decide it."""


@dataclass(frozen=True)
class Claim:
    """One row of an account.

    Attributes
    ----------
    id
        Unique in its account: letters, digits, dots and hyphens.
    place
        Where in the paper: an equation, a table, a figure, a section.
    says
        What the paper says there, in a sentence.
    printed, computed
        Numbers in `unit`, or text; printed is None where the paper draws or says it without a number.
    verdict, why
        The verdict, and why, in one sentence.
    unit
        Of printed and computed; empty: none.
    figure
        Name of the figure that shows it, if one does.
    """

    id: str
    place: str
    says: str
    printed: Value
    computed: Value
    verdict: Verdict
    why: str
    unit: str = ""
    figure: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """All of it, ready for JSON."""
        return {
            "id": self.id,
            "place": self.place,
            "says": self.says,
            "printed": self.printed,
            "computed": self.computed,
            "unit": self.unit,
            "verdict": self.verdict.value,
            "why": self.why,
            "figure": self.figure,
        }


def compared(
    id: str,
    place: str,
    says: str,
    printed: float | tuple[float, ...],
    computed: float | tuple[float, ...],
    *,
    within: float,
    agrees: str,
    differs: str,
    unit: str = "",
    figure: str | None = None,
) -> Claim:
    """Hold computed numbers against printed ones: reproduced if none is farther off than `within`.

    Parameters
    ----------
    within
        The difference that is allowed, in `unit`: that of the digits that are printed, or of a figure's lines.
    agrees, differs
        The sentence for either verdict.
    """
    apart = np.abs(np.asarray(computed, dtype=float) - np.asarray(printed, dtype=float))
    same = bool((apart <= within).all())
    verdict, why = (Verdict.REPRODUCED, agrees) if same else (Verdict.DIFFERS, differs)
    return Claim(id, place, says, printed, computed, verdict, why, unit, figure)


def stated(
    id: str,
    place: str,
    says: str,
    printed: Value,
    computed: Value,
    *,
    holds: bool,
    agrees: str,
    differs: str,
    otherwise: Verdict = Verdict.DIFFERS,
    unit: str = "",
    figure: str | None = None,
) -> Claim:
    """Ask whether what is said holds: reproduced if so, else `otherwise`; `agrees` and `differs` as in `compared`."""
    verdict, why = (Verdict.REPRODUCED, agrees) if holds else (otherwise, differs)
    return Claim(id, place, says, printed, computed, verdict, why, unit, figure)


def undetermined(
    id: str,
    place: str,
    says: str,
    printed: Value,
    computed: Value,
    *,
    missing: str,
    unit: str = "",
    figure: str | None = None,
) -> Claim:
    """What the paper leaves open; `missing` says what it does not print, and what was assumed for `computed`."""
    return Claim(id, place, says, printed, computed, Verdict.NOT_DETERMINED, missing, unit, figure)


def told(value: Value, unit: str = "") -> str:
    """A value in words, with its unit; that of None is a dash."""
    if value is None:
        return "–"
    if isinstance(value, str):
        text = value
    elif isinstance(value, tuple):
        text = "(" + ", ".join(f"{each:.5g}" for each in value) + ")"
    else:
        text = f"{value:.5g}"
    return f"{text} {unit}" if unit else text
