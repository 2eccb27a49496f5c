"""Paper C recomputed, claim by claim: `towline reproduce ctmrts`."""

from __future__ import annotations

from . import towing_equations, towing_modes, towing_ranges, towing_tensions
from .account import Account, Paper, Progress, gather

PAPER = Paper(
    "ctmrts",
    "Y. Wang, Z. Zhao, J. Li, G. Ji: Analysis of workspace of cable-typing close-coupling multi-robot collaboratively "
    "towing system",
)
CHAPTERS = {
    "The model, Eqs. 1 to 13": towing_equations.chapter,
    "Tensions, Eqs. 11, 16, 17": towing_tensions.chapter,
    "Workspaces, figures 2 to 6": towing_ranges.chapter,
    "Three ways to drive, three to six robots": towing_modes.chapter,
}


def account(progress: Progress | None = None) -> Account:
    """Recompute the paper."""
    return gather(PAPER, CHAPTERS, progress)
