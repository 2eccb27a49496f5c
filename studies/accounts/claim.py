"""`Claim`: one statement of a paper beside the result of computing it; `Account`: a paper recomputed, claim by claim.

A verdict follows from numbers, never from opinion: a `Statement` becomes a claim by what is computed. `compared`
compares numbers with the printed ones, `stated` records whether a statement holds, `undetermined` records what the
paper does not print, `repaired` what is possible in place of an impossible statement. Each verdict has one sentence of
its own.

A study is a mapping from the titles of its chapters to functions, each of which computes one `Chapter`; `gather` runs
them one after the other. If a solver breaks in a chapter, it is reported, and the account is not complete.
"""

import re
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from ruamel.yaml import YAML

from ...base.errors import SolverError
from ...base.text import quantity, quantity_row
from ...figures.drawing import Drawing

Value: TypeAlias = float | tuple[float, ...] | str | None
FIELD = re.compile(r"\{(?P<name>[a-z]\w*)(:(?P<format>[^}]*))?\}")  # {G} is a frame
DIGITS = 5  # of values in reports: one more than papers print
Progress: TypeAlias = Callable[[str, int, int], None]  # what is being computed, chapters done, all of them


class Verdict(StrEnum):
    """The verdict on a claim; its values are plain strings."""

    REPRODUCED = "reproduced"
    """The computed result is the printed one."""

    DIFFERS = "differs"
    """The computed result differs, or the paper contradicts itself."""

    IMPOSSIBLE = "impossible"
    """No choice of the quantities that the paper does not specify gives the printed result."""

    NOT_DETERMINED = "not determined"
    """The paper does not print what is needed to decide."""

    REPAIRED = "repaired"
    """Not in the paper: a feasible alternative to an impossible claim."""


@dataclass(frozen=True)
class Claim:
    """One claim of a paper and its verdict.

    `printed` is what the paper gives: a number that it prints, or the one that follows from what it prints; None where
    it gives none. Numbers are in `unit`.
    """

    id: str  # unique in its account: letters, digits, dots and hyphens
    place: str  # in the paper: an equation, a table, a figure, a section
    statement: str  # of the paper, in a sentence
    printed: Value
    computed: Value
    verdict: Verdict
    why: str  # in one sentence
    unit: str = ""  # of printed and computed
    figure: str | None = None  # name of the one that shows it

    def to_dict(self) -> dict[str, Any]:
        """Return all fields for JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Chapter:
    """Claims that belong together, and figures by name."""

    claims: list[Claim]
    drawings: dict[str, Drawing] = field(default_factory=dict)


@dataclass(frozen=True)
class Statement:
    """A statement of a paper, and the sentences of the verdicts on it, as `claims.yaml` of a study has them.

    All texts may have fields such as `{least:.1f}`, whose names begin with a small letter; whoever computes the claim
    gives their values. Computed and printed numbers are kept as a float or a tuple of floats, whatever they come in.
    """

    id: str
    place: str
    statement: str
    printed: ArrayLike | None = None
    within: float = 0.0  # allowed difference in `unit`: the precision of the printed digits, or of a figure's lines
    unit: str = ""
    figure: str | None = None
    agrees: str = ""  # the reason for the verdict reproduced
    differs: str = ""  # and for another
    missing: str = ""  # what the paper does not print, and what was assumed
    works: str = ""  # the reason why something possible stands in the place of what is impossible
    fails: str = ""  # and why not

    def compared(
        self, computed: ArrayLike, printed: ArrayLike | None = None, within: float | None = None, **fields: Any
    ) -> Claim:
        """Compare computed numbers with printed ones: reproduced if they differ by `within` at most."""
        numbers = np.asarray(computed, dtype=float)
        expected = np.broadcast_to(np.asarray(self.printed if printed is None else printed, dtype=float), numbers.shape)
        same = (np.abs(numbers - expected) <= (self.within if within is None else within)).all()
        return self.stated(numbers, bool(same), expected, **fields)

    def stated(
        self,
        computed: ArrayLike,
        holds: bool | np.bool_,
        printed: ArrayLike | None = None,
        otherwise: Verdict = Verdict.DIFFERS,
        **fields: Any,
    ) -> Claim:
        """Return a claim that is reproduced if the statement holds, else `otherwise`."""
        verdict, why = (Verdict.REPRODUCED, self.agrees) if holds else (otherwise, self.differs)
        return self._claim(computed, printed, verdict, why, fields)

    def undetermined(self, computed: ArrayLike, printed: ArrayLike | None = None, **fields: Any) -> Claim:
        """Return a claim that the paper does not decide."""
        return self._claim(computed, printed, Verdict.NOT_DETERMINED, self.missing, fields)

    def repaired(self, computed: ArrayLike, holds: bool | np.bool_, **fields: Any) -> Claim:
        """Return something else than the paper has, in the place of what is impossible; not determined if it fails."""
        verdict, why = (Verdict.REPAIRED, self.works) if holds else (Verdict.NOT_DETERMINED, self.fails)
        return self._claim(computed, None, verdict, why, fields)

    def _claim(
        self, computed: ArrayLike, printed: ArrayLike | None, verdict: Verdict, why: str, fields: Mapping[str, Any]
    ) -> Claim:
        def filled(field: re.Match[str]) -> str:
            return format(fields[field["name"]], field["format"] or "")

        texts = (self.id, self.place, self.statement, why, self.unit, self.figure or "")
        id, place, statement, why, unit, figure = (FIELD.sub(filled, text) for text in texts)
        expected = self.printed if printed is None else printed
        return Claim(id, place, statement, _value(expected), _value(computed), verdict, why, unit, figure or None)


def _value(given: ArrayLike | None) -> Value:
    if given is None or isinstance(given, str):
        return given
    numbers: float | list[float] = np.asarray(given, dtype=float).tolist()
    return tuple(numbers) if isinstance(numbers, list) else numbers


@cache
def statements(file: Path) -> dict[str, Statement]:
    """Return the statements of a YAML file by their names in it, which are their ids unless these have fields."""
    entries = YAML(typ="safe", pure=True).load(file.read_text(encoding="utf-8"))
    return {name: Statement(**{"id": name, **entry}) for name, entry in entries.items()}


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


class Paper(NamedTuple):
    """A paper: the name of its study, and its source."""

    name: str
    source: str


@dataclass(frozen=True)
class Account:
    """The claims of a paper, each with its verdict."""

    paper: Paper
    chapters: dict[str, Chapter]  # by title, in order
    broken: dict[str, str]  # reasons by title, of chapters that could not be computed
    seconds: float  # wall time of the whole run

    @property
    def claims(self) -> list[Claim]:
        """Return the claims of all chapters, in order."""
        return [claim for chapter in self.chapters.values() for claim in chapter.claims]

    @property
    def errata(self) -> list[Claim]:
        """Return the claims that were not reproduced, and what is possible instead."""
        return [claim for claim in self.claims if claim.verdict is not Verdict.REPRODUCED]

    @property
    def complete(self) -> bool:
        """Return whether every chapter was computed, so that every claim has a verdict."""
        return bool(self.claims) and not self.broken

    def summary(self) -> str:
        """Return how many claims of the paper have which verdict, in one line, and how many repairs there are."""
        counts = Counter(claim.verdict for claim in self.claims)
        repairs = counts.pop(Verdict.REPAIRED, 0)
        parts = [f"{counts[verdict]} {verdict.value}" for verdict in Verdict if counts[verdict]]
        beside = [f"{repairs} repaired, which are not in the paper"] if repairs else []
        missing = [f"not computed: {', '.join(self.broken)}"] if self.broken else []
        return "; ".join([f"{counts.total()} claims: {', '.join(parts)}", *beside, *missing])

    def to_dict(self) -> dict[str, Any]:
        """Return {"paper", "complete", "broken", "seconds", "claims"} for JSON."""
        return {
            "paper": self.paper.name,
            "complete": self.complete,
            "broken": self.broken,
            "seconds": self.seconds,
            "claims": [claim.to_dict() for claim in self.claims],
        }


def gather(paper: Paper, chapters: Mapping[str, Callable[[], Chapter]], progress: Progress | None = None) -> Account:
    """Compute the chapters, by title, of a paper in order; `progress` is called before each one and once at the end."""
    computed: dict[str, Chapter] = {}
    broken: dict[str, str] = {}
    start = time.perf_counter()
    for done, (title, compute) in enumerate(chapters.items()):
        if progress is not None:
            progress(title, done, len(chapters))
        try:
            computed[title] = compute()
        except SolverError as error:
            broken[title] = str(error)
    if progress is not None:
        progress("done", len(chapters), len(chapters))
    return Account(paper, computed, broken, time.perf_counter() - start)
