"""An account as one HTML file with its figures inside, that loads nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...figures import page as html
from ...figures import style
from .claim import Claim, told
from .text import READ

if TYPE_CHECKING:
    from .account import Account, Chapter


def page(account: Account) -> str:
    """The whole page: an overview, then chapter by chapter each claim with its figure."""
    told_so = f"{account.summary()}. Computed in {account.seconds:.0f} s."
    word, colour = ("complete", style.colour(0)) if account.complete else ("incomplete", style.colour(1))
    parts = [_overview(account)]
    for title, chapter in account.chapters.items():
        parts += [html.heading(title), *_chapter(chapter)]
    parts += [html.heading(f"{title}: not computed") + html.paragraph(why) for title, why in account.broken.items()]
    parts.append(_errata(account))
    return html.page(account.paper.source, word, told_so, colour, parts)


def _overview(account: Account) -> str:
    rows = [
        (claim.id, told(claim.printed, claim.unit), told(claim.computed, claim.unit), claim.verdict.value)
        for claim in account.claims
    ]
    return html.columns("All claims", ("claim", "printed", "computed", "verdict"), rows)


def _errata(account: Account) -> str:
    rows = [(claim.id, claim.place, claim.verdict.value, claim.why) for claim in account.errata]
    return html.columns("Errata", ("claim", "where", "verdict", "why"), rows) + html.paragraph(READ)


def _chapter(chapter: Chapter) -> list[str]:
    """Claims, each figure after the first claim that it belongs to, and then those that belong to none."""
    parts, waiting = [], dict(chapter.drawings)
    for claim in chapter.claims:
        parts.append(_claim(claim))
        if claim.figure in waiting:
            parts.append(html.picture(waiting.pop(claim.figure)))
    return [*parts, *(html.picture(drawing) for drawing in waiting.values())]


def _claim(claim: Claim) -> str:
    rows = [
        (claim.place, claim.says),
        ("Printed", told(claim.printed, claim.unit)),
        ("Computed", told(claim.computed, claim.unit)),
        (claim.verdict.value.capitalize(), claim.why),
    ]
    return html.facts(claim.id, rows, level=3)
