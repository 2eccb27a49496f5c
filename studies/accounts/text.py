"""An account as Markdown: the report, and the errata from the same claims."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .claim import Claim, Verdict, told

if TYPE_CHECKING:
    from .account import Account

FIGURES = "figures"  # the folder beside the report
READ = (
    "The paper was read as text recognised from its pages: a single symbol that is wrong may be that reading's, not "
    "the authors'."
)


def report(account: Account) -> str:
    """Chapter by chapter: a table of its claims, and its figures."""
    from ... import __version__

    lines = [f"# {account.paper.source}", "", f"{account.summary()}. Computed in {account.seconds:.0f} s."]
    for title, chapter in account.chapters.items():
        heads = ("claim", "where", "the paper says", "printed", "computed", "verdict", "why")
        rows = [
            (
                claim.id,
                claim.place,
                claim.says,
                told(claim.printed, claim.unit),
                told(claim.computed, claim.unit),
                f"**{claim.verdict}**",
                claim.why,
            )
            for claim in chapter.claims
        ]
        lines += ["", f"## {title}", "", *_table(heads, rows)]
        for name, drawing in chapter.drawings.items():
            shows = [claim.id for claim in chapter.claims if claim.figure == name]
            caption = f"{drawing.caption} ({', '.join(shows)})" if shows else drawing.caption
            lines += ["", f"![{drawing.caption}]({FIGURES}/{name}.png)", "", f"*{caption}*"]
    lines += [f"\n## {title}: not computed\n\n{why}" for title, why in account.broken.items()]
    return "\n".join([*lines, "", f"towline {__version__}", ""])


def errata(account: Account) -> str:
    """The claims that were not reproduced, by verdict, with why."""
    lines = [
        f"# Errata of {account.paper.source}",
        "",
        f"Computed, not argued: each line is a claim of the report. {READ}",
    ]
    titles = {
        Verdict.DIFFERS: "What is printed and what holds",
        Verdict.IMPOSSIBLE: "What cannot be",
        Verdict.NOT_DETERMINED: "What the paper does not print",
    }
    for verdict, title in titles.items():
        rows = [_row(claim) for claim in account.errata if claim.verdict is verdict]
        if rows:
            lines += [
                "",
                f"## {title}",
                "",
                *_table(("claim", "where", "the paper says", "printed", "computed", "why"), rows),
            ]
    return "\n".join([*lines, ""])


def _row(claim: Claim) -> tuple[str, ...]:
    printed, computed = told(claim.printed, claim.unit), told(claim.computed, claim.unit)
    return claim.id, claim.place, claim.says, printed, computed, claim.why


def _table(heads: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """A table; what would end a cell is escaped."""
    safe = [tuple(cell.replace("|", "\\|").replace("\n", " ") for cell in row) for row in (heads, *rows)]
    first, *others = ("| " + " | ".join(row) + " |" for row in safe)
    return [first, "|" + " --- |" * len(heads), *others]
