"""An account as files: an HTML page that loads nothing, errata in Markdown, claims as data, and figures."""

import json
import re
from collections import Counter
from pathlib import Path

from ...base.writing import whole_file
from ...figures import page as html, style
from .claim import Account, Chapter, Claim, Verdict, value_text

NOT_REPRODUCED = "What was not reproduced"
BY_THE_PAPER = "By the paper"  # head of what it prints, or of what follows from that
MEANING = "“By the paper” marks what the paper prints, or what follows from it."
COMPARED = re.compile(r"(?P<statement>.*\S) \((?P<quantity>.*)\)\.", re.DOTALL)  # what the numbers of a claim are
READ = (
    "The paper was read as text recognised from its pages (OCR): a single wrong symbol may be an error of the "
    "recognition, not of the authors."
)


def write(account: Account, folder: Path, form: str = "png") -> list[Path]:
    """Write report (HTML), errata (Markdown), claims (JSON) and figures into `folder`; return their paths.

    Each file is written atomically. Raises `InputError` if the folder cannot be written to.
    """
    name = account.paper.name
    texts = {
        f"{name}.html": page(account),
        f"{name}-errata.md": errata(account),
        f"{name}.json": json.dumps(account.to_dict(), indent=2, allow_nan=False) + "\n",
    }
    files = [folder / file for file in texts]
    for file, content in zip(files, texts.values(), strict=True):
        with whole_file(file) as temporary:
            temporary.write_text(content, encoding="utf-8")
    for chapter in account.chapters.values():
        for figure, drawing in chapter.drawings.items():
            files.append(style.save(drawing.figure, folder / "figures" / f"{figure}.{form}"))
    return files


def page(account: Account) -> str:
    """Return the page: contents, counts, what was not reproduced, then the claims and figures of each chapter."""
    summary = f"{account.summary()}. Computed in {account.seconds:.0f} s."
    word, colour = ("complete", style.colour(0)) if account.complete else ("incomplete", style.colour(1))
    chapters = [(title, f"chapter-{number}") for number, title in enumerate(account.chapters, 1)]
    links = [html.link(NOT_REPRODUCED, "errata"), *(html.link(*chapter) for chapter in chapters)]
    counts = [Counter(claim.verdict for claim in chapter.claims) for chapter in account.chapters.values()]
    rows = [
        (html.link(*link), *(str(count[verdict] or "–") for verdict in Verdict))
        for link, count in zip(chapters, counts, strict=True)
    ]
    heads = ("chapter", *(verdict.value for verdict in Verdict))
    # What was not reproduced: where, what the paper states, and why; each row links to its claim.
    errata = [
        (html.link(claim.place, _anchor(claim)), claim.statement, claim.verdict.value, claim.why)
        for claim in account.errata
    ]
    table = html.columns(NOT_REPRODUCED, ("where", "the paper states", "verdict", "why"), errata)
    parts = [html.contents(links), html.columns("Summary", heads, rows)]
    parts += ['<div id="errata">', table, html.paragraph(f"{MEANING} {READ}"), "</div>"]
    for (title, anchor), chapter in zip(chapters, account.chapters.values(), strict=True):
        parts += [html.heading(title, anchor=anchor), *_chapter(chapter)]
    parts += [html.heading(f"{title}: not computed") + html.paragraph(why) for title, why in account.broken.items()]
    return html.page(account.paper.source, word, summary, colour, parts)


def _chapter(chapter: Chapter) -> list[str]:
    """Return the claims, folded, then the figures side by side, with the claims that each belongs to."""
    drawings = []
    for name, drawing in chapter.drawings.items():
        places = dict.fromkeys(claim.place for claim in chapter.claims if claim.figure == name)
        caption = f"{drawing.caption} ({', '.join(places)})" if places else drawing.caption
        drawings.append(drawing._replace(caption=caption))
    parts = [_claim(claim) for claim in chapter.claims]
    return [*parts, *([html.side_by_side(map(html.picture, drawings))] if drawings else [])]


def _claim(claim: Claim) -> str:
    rows = [
        (BY_THE_PAPER, value_text(claim.printed, claim.unit)),
        ("Computed", value_text(claim.computed, claim.unit)),
        (claim.verdict.value.capitalize(), claim.why),
        ("Name", claim.id),
    ]
    title = f"{claim.place}: {claim.statement} – {claim.verdict.value}"
    return html.fold(title, html.facts("", rows, _anchor(claim)))


def _anchor(claim: Claim) -> str:
    return f"claim-{claim.id}"


def errata(account: Account) -> str:
    """Return the claims that were not reproduced, by verdict, with their reasons."""
    lines = [
        f"# Errata of {account.paper.source}",
        "",
        "Each entry gives a claim of the paper, the values that were compared, and why the claim is not reproduced. "
        f"{MEANING} {READ} In formulas, ddX is the second time derivative of X, and dX is the first or, in entries on "
        "small changes, a small change of X.",
    ]
    titles = {
        Verdict.DIFFERS: "Printed results that differ, and what is correct",
        Verdict.IMPOSSIBLE: "Impossible",
        Verdict.NOT_DETERMINED: "Not determined by what the paper prints",
        Verdict.REPAIRED: "What is possible instead",
    }
    for verdict, title in titles.items():
        entries = [_entry(claim) for claim in account.errata if claim.verdict is verdict]
        lines += ["", f"## {title}", *entries] if entries else []
    return "\n".join([*lines, ""])


def numbers_text(claim: Claim) -> str:
    """Return what the paper gives and what was computed, in a sentence each."""
    numbers = ((BY_THE_PAPER, claim.printed), ("Computed", claim.computed))
    return " ".join(f"{head}: {value_text(value, claim.unit)}." for head, value in numbers if value is not None)


def _entry(claim: Claim) -> str:
    """Return the place and the name of a claim with what it states, the two numbers, and why: one paragraph each."""
    found = COMPARED.fullmatch(claim.statement)
    statement, quantity = (f"{found['statement']}.", found["quantity"]) if found else (claim.statement, "")
    about = f"*Compared: {quantity}.* " if quantity else ""
    parts = [f"- **{claim.place}** (`{claim.id}`): {statement}", f"{about}{numbers_text(claim)}".strip(), claim.why]
    safe = [part.replace("<", "&lt;").replace("\n", " ") for part in parts]
    return "\n" + "\n\n    ".join(safe)
