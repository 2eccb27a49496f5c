"""An account as one HTML file that contains its figures and loads nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...figures import page as html
from ...figures import style
from .claim import Claim, value_text
from .text import READ

if TYPE_CHECKING:
    from .account import Account, Chapter


def page(account: Account) -> str:
    """Return the page: an overview, then chapter by chapter each claim with its figure."""
    summary = f"{account.summary()}. Computed in {account.seconds:.0f} s."
    word, colour = ("complete", style.colour(0)) if account.complete else ("incomplete", style.colour(1))
    parts = [_overview(account)]
    for title, chapter in account.chapters.items():
        parts += [html.heading(title), *_chapter(chapter)]
    parts += [html.heading(f"{title}: not computed") + html.paragraph(why) for title, why in account.broken.items()]
    parts.append(_errata(account))
    return html.page(account.paper.source, word, summary, colour, parts)


def _overview(account: Account) -> str:
    rows = [
        (claim.id, value_text(claim.printed, claim.unit), value_text(claim.computed, claim.unit), claim.verdict.value)
        for claim in account.claims
    ]
    return html.columns("All claims", ("claim", "printed", "computed", "verdict"), rows)


def _errata(account: Account) -> str:
    rows = [(claim.id, claim.place, claim.verdict.value, claim.why) for claim in account.errata]
    return html.columns("Errata", ("claim", "where", "verdict", "why"), rows) + html.paragraph(READ)


def _chapter(chapter: Chapter) -> list[str]:
    """Return claims, each figure after the first claim that it belongs to, then the figures that belong to no claim."""
    parts, waiting = [], dict(chapter.drawings)
    for claim in chapter.claims:
        parts.append(_claim(claim))
        if claim.figure in waiting:
            parts.append(html.picture(waiting.pop(claim.figure)))
    return [*parts, *(html.picture(drawing) for drawing in waiting.values())]


def _claim(claim: Claim) -> str:
    rows = [
        (claim.place, claim.statement),
        ("Printed", value_text(claim.printed, claim.unit)),
        ("Computed", value_text(claim.computed, claim.unit)),
        (claim.verdict.value.capitalize(), claim.why),
    ]
    return html.facts(claim.id, rows, level=3)
