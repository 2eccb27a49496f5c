"""`Report`: what a result says to people, as text, page or data; `Reported`: the base of results that have one."""

import json
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from ..base.display import Displayed, Fact
from ..base.inputs import file_path
from ..base.text import in_columns
from ..base.writing import whole_file
from .drawing import Drawing

# The colour of each status in `style.colour`; distinct with any kind of colour vision, and the word stands beside it.
COLOURS = {"feasible": 0, "passed": 0, "file confirmed": 0, "infeasible": 1, "failed": 1}
OTHER = 5


class Section(NamedTuple):
    """Facts that belong together; a fact without a name continues the one before it."""

    title: str
    facts: Sequence[Fact]


class Table(NamedTuple):
    """Rows of equal kind under named columns; columns in `numeric` are aligned on the right."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    numeric: Sequence[int] = ()


Part = Section | Table | str  # of a report; the last is a sentence


@dataclass(frozen=True)
class Report(Displayed):
    """A report: one line with the result, then the facts behind it."""

    about: str  # what the result is of, such as robot and task
    status: str  # the result in one word; empty where there is none
    summary: str  # what decided it, in one line
    parts: Sequence[Part]  # sections, tables and sentences, in order
    drawings: Callable[[], Iterable[Drawing]] = tuple  # draws the figures of the page
    folded: Sequence[str] = ()  # titles of the parts that the page folds, below the others
    files: Sequence[tuple[str, Callable[[], str]]] = ()  # title of each file in the page, and what returns its text

    @property
    def headline(self) -> str:
        """Return the result in one line."""
        return f"{self.about}: {f'{self.status.upper()}, ' if self.status else ''}{self.summary}"

    def text(self) -> str:
        """Return the report for a terminal."""
        named = [name for part in self.parts if isinstance(part, Section) for name, _ in part.facts]
        width, lines = max(map(len, named), default=0), [self.headline]
        for part in self.parts:
            if isinstance(part, str):
                lines.append(f"  {part}")
                continue
            lines += [f"  {part.title}"] if part.title else []
            if isinstance(part, Table):
                lines += [f"    {line}" for line in in_columns([part.columns, *part.rows], part.numeric)]
            else:
                wide = width + 2 if any(name for name, _ in part.facts) else 0
                lines += [f"    {name:<{wide}}{fact}" for name, fact in part.facts]
        return "\n".join(lines)

    def html(self) -> str:
        """Return the report as a page with its figures inside, which loads nothing."""
        from . import page, style

        shown, folded = [], []
        for part in self.parts:
            name = part.title if isinstance(part, Section | Table) else ""
            hidden = name in self.folded
            title = "" if hidden else name
            if isinstance(part, str):
                inside = page.paragraph(part)
            elif isinstance(part, Table):
                inside = page.columns(title, part.columns, part.rows)
            elif any(name for name, _ in part.facts):
                inside = page.facts(title if hidden else title or "Result", part.facts)
            else:
                inside = "\n".join([page.heading(title), *(page.paragraph(fact) for _, fact in part.facts)])
            (folded if hidden else shown).append(page.fold(name, inside) if hidden else inside)
        folded += [page.fold(title, page.verbatim(write())) for title, write in self.files]
        parts = page.beside([*shown, *folded], [page.picture(drawing) for drawing in self.drawings()])
        word, colour = self.status or "result", style.colour(COLOURS.get(self.status, OTHER))
        return page.page(self.about, word, self.summary, colour, parts)

    def to_dict(self) -> dict[str, Any]:
        """Return the report as data, ready for JSON."""
        names = ("title", "facts", "columns", "rows")
        parts = [
            part if isinstance(part, str) else {name: getattr(part, name) for name in names if hasattr(part, name)}
            for part in self.parts
        ]
        return {"about": self.about, "status": self.status, "summary": self.summary, "parts": parts}


class Reported(Displayed):
    """The base of results that have a report, whose headline is theirs."""

    __slots__ = ()

    def _report(self) -> Report:
        raise NotImplementedError

    def _headline(self) -> str:
        return self._report().headline

    def report(self) -> str:
        """Return the report as text: the result in the first line, then the facts behind it."""
        return self._report().text()

    def save_report(self, file: str | os.PathLike[str]) -> Path:
        """Write the report atomically, by the file's suffix: as text (.txt), data (.json), or else an HTML page.

        The page contains its figures and loads nothing from the network.
        Raises `InputError` if the file cannot be written.
        """
        path, report = file_path("file", file), self._report()
        with whole_file(path) as temporary:
            if path.suffix == ".txt":
                content = report.text() + "\n"
            elif path.suffix == ".json":
                content = json.dumps(report.to_dict(), indent=2) + "\n"
            else:
                content = report.html()
            temporary.write_text(content, encoding="utf-8")
        return path
