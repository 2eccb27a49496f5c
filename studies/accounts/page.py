"""An account as one HTML file that contains its figures and loads nothing."""

from collections import Counter

from ...figures import page as html
from ...figures import style
from .account import Account, Chapter
from .claim import Claim, Verdict, value_text
from .errata import BY_THE_PAPER, MEANING, READ

NOT_REPRODUCED = "What was not reproduced"


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
