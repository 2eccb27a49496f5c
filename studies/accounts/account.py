"""`Account`: a paper recomputed, claim by claim, with a figure beside each claim that has one.

A study is a mapping from the titles of its chapters to functions, each of which computes one `Chapter`; `gather` runs
them one after the other. A chapter whose solver breaks does not stop the others: it is reported, and the account is not
complete.
"""

import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from ...base.errors import SolverError
from .claim import Chapter, Claim, Verdict

Progress: TypeAlias = Callable[[str, int, int], None]  # what is being computed, chapters done, all of them


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
