"""An account as Markdown: the report, and the errata from the same claims."""

import re
from collections.abc import Sequence

from .account import Account
from .claim import Claim, Verdict, value_text

FIGURES = "figures"  # the folder beside the report
BY_THE_PAPER = "by the paper"  # head of what it prints, or of what follows from that
MEANING = "“By the paper” is a number that it prints, or the one that follows from what it prints."
COMPARED = re.compile(r"(?P<statement>.*\S) \((?P<quantity>.*)\)\.", re.DOTALL)  # what the numbers of a claim are
READ = (
    "The paper was read as text recognised from its pages (OCR): a single wrong symbol may be an error of the "
    "recognition, not of the authors."
)


def report(account: Account, form: str = "png") -> str:
    """Return the report: for each chapter a table of its claims, and its figures, files of the format `form`."""
    from ...base.version import __version__

    lines = [f"# {account.paper.source}", "", f"{account.summary()}. Computed in {account.seconds:.0f} s."]
    for title, chapter in account.chapters.items():
        heads = ("claim", "where", "the paper states", BY_THE_PAPER, "computed", "verdict", "why")
        rows = [
            (
                *(claim.id, claim.place, claim.statement),
                *(value_text(value, claim.unit) for value in (claim.printed, claim.computed)),
                *(f"**{claim.verdict}**", claim.why),
            )
            for claim in chapter.claims
        ]
        lines += ["", f"## {title}", "", *_table(heads, rows)]
        for name, drawing in chapter.drawings.items():
            shows = [claim.id for claim in chapter.claims if claim.figure == name]
            caption = f"{drawing.caption} ({', '.join(shows)})" if shows else drawing.caption
            lines += ["", f"![{drawing.caption}]({FIGURES}/{name}.{form})", "", f"*{caption}*"]
    lines += [f"\n## {title}: not computed\n\n{why}" for title, why in account.broken.items()]
    return "\n".join([*lines, "", f"towline {__version__}", ""])


def errata(account: Account) -> str:
    """Return the claims that were not reproduced, by verdict, with their reasons."""
    lines = [
        f"# Errata of {account.paper.source}",
        "",
        "Each entry is a claim of the paper, the reason why it is not reproduced, and the numbers that were compared. "
        f"{MEANING} {READ}",
    ]
    titles = {
        Verdict.DIFFERS: "What is printed, and what holds",
        Verdict.IMPOSSIBLE: "Impossible",
        Verdict.NOT_DETERMINED: "Not printed in the paper",
        Verdict.REPAIRED: "What is possible instead",
    }
    for verdict, title in titles.items():
        entries = [_entry(claim) for claim in account.errata if claim.verdict is verdict]
        lines += ["", f"## {title}", *entries] if entries else []
    return "\n".join([*lines, ""])


def _entry(claim: Claim) -> str:
    """Return the place and the name of a claim with what it states, the two numbers, and why: one paragraph each."""
    found = COMPARED.fullmatch(claim.statement)
    statement, quantity = (f"{found['statement']}.", found["quantity"]) if found else (claim.statement, "")
    numbers = [
        f"{head}: {value_text(value, claim.unit)}."
        for head, value in ((BY_THE_PAPER.capitalize(), claim.printed), ("Computed", claim.computed))
        if value is not None
    ]
    about = [f"*Compared: {quantity}.*"] if quantity else []
    parts = [f"- **{claim.place}** (`{claim.id}`): {statement}", " ".join([*about, *numbers]), claim.why]
    safe = [part.replace("<", "&lt;").replace("\n", " ") for part in parts]
    return "\n" + "\n\n    ".join(safe)


def _table(heads: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Return a table; characters that would end a cell are escaped."""
    safe = [tuple(cell.replace("|", "\\|").replace("\n", " ") for cell in row) for row in (heads, *rows)]
    first, *others = ("| " + " | ".join(row) + " |" for row in safe)
    return [first, "|" + " --- |" * len(heads), *others]
