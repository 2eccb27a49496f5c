"""`Claim`: one statement of a paper beside the result of computing it.

A verdict follows from numbers, never from opinion: `compared` compares numbers with the printed ones, `stated` records
whether a statement holds, `undetermined` records what the paper does not print, `repaired` what is possible in place of
an impossible statement. Each verdict comes with one sentence of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeAlias

import numpy as np

from ...base.text import quantity, quantity_row

__all__ = ["Claim", "Value", "Verdict", "compared", "repaired", "stated", "undetermined", "value_text"]

Value: TypeAlias = float | tuple[float, ...] | str | None
DIGITS = 5  # of values in reports: one more than papers print


class Verdict(StrEnum):
    """The verdict on a claim; its values are plain strings."""

    REPRODUCED = "reproduced"
    """The computed result is the printed one."""

    DIFFERS = "differs"
    """The computed result is another, or the paper contradicts itself."""

    IMPOSSIBLE = "impossible"
    """No choice of what the paper does not state gives the printed result."""

    NOT_DETERMINED = "not determined"
    """The paper does not print what is needed to decide."""

    REPAIRED = "repaired"
    """No statement of the paper: something else, possible in the place of what the paper states and is impossible."""


@dataclass(frozen=True)
class Claim:
    """One claim of a paper and its verdict.

    Attributes
    ----------
    id
        Unique in its account: letters, digits, dots and hyphens.
    place
        Where in the paper: an equation, a table, a figure, a section.
    statement
        The statement of the paper, in a sentence.
    printed, computed
        Numbers in `unit`, or text. `printed` is what the paper gives: a number that it prints, or the one that follows
        from what it prints; None where it gives none.
    verdict, why
        The verdict, and the reason in one sentence.
    unit
        Unit of printed and computed; default: no unit.
    figure
        Name of the figure that shows it, if there is one.
    """

    id: str
    place: str
    statement: str
    printed: Value
    computed: Value
    verdict: Verdict
    why: str
    unit: str = ""
    figure: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return all fields for JSON."""
        return {
            "id": self.id,
            "place": self.place,
            "statement": self.statement,
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
    statement: str,
    printed: float | tuple[float, ...],
    computed: float | tuple[float, ...],
    *,
    within: float,
    agrees: str,
    differs: str,
    unit: str = "",
    figure: str | None = None,
) -> Claim:
    """Compare computed numbers with printed ones: reproduced if they differ by `within` at most.

    Parameters
    ----------
    within
        The allowed difference in `unit`: the precision of the printed digits, or of the lines of a figure.
    agrees, differs
        The reason for either verdict.
    """
    apart = np.abs(np.asarray(computed, dtype=float) - np.asarray(printed, dtype=float))
    same = bool((apart <= within).all())
    verdict, why = (Verdict.REPRODUCED, agrees) if same else (Verdict.DIFFERS, differs)
    return Claim(id, place, statement, printed, computed, verdict, why, unit, figure)


def stated(
    id: str,
    place: str,
    statement: str,
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
    """Return a claim that is reproduced if the statement holds, else `otherwise`; other arguments as in `compared`."""
    verdict, why = (Verdict.REPRODUCED, agrees) if holds else (otherwise, differs)
    return Claim(id, place, statement, printed, computed, verdict, why, unit, figure)


def undetermined(
    id: str,
    place: str,
    statement: str,
    printed: Value,
    computed: Value,
    *,
    missing: str,
    unit: str = "",
    figure: str | None = None,
) -> Claim:
    """Return a claim that the paper does not decide; `missing` states what it does not print and what was assumed."""
    return Claim(id, place, statement, printed, computed, Verdict.NOT_DETERMINED, missing, unit, figure)


def repaired(
    id: str,
    place: str,
    statement: str,
    computed: Value,
    *,
    holds: bool,
    works: str,
    fails: str,
    unit: str = "",
    figure: str | None = None,
) -> Claim:
    """Return something else than the paper has, in the place of what is impossible there; not determined if it fails.

    Parameters
    ----------
    works, fails
        The reason for either verdict.
    """
    verdict, why = (Verdict.REPAIRED, works) if holds else (Verdict.NOT_DETERMINED, fails)
    return Claim(id, place, statement, None, computed, verdict, why, unit, figure)


def value_text(value: Value, unit: str = "") -> str:
    """Return a value as text with its unit; None is a dash."""
    if value is None:
        return "–"
    if isinstance(value, str):
        text = value
    elif isinstance(value, tuple):
        text = f"({quantity_row(value, digits=DIGITS)})"
    else:
        text = quantity(value, digits=DIGITS)
    return f"{text} {unit}" if unit else text
