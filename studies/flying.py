"""Paper F recomputed, claim by claim: `towline reproduce flying`."""

from __future__ import annotations

from . import flying_pairing, flying_parameters, flying_radius
from .account import Account, Paper, Progress, gather

PAPER = Paper(
    "flying",
    "Q. Wang, H. Chen, Y. Su, L. Qiao: Coupling dynamics analysis of the flying cable driven parallel robot",
)
CHAPTERS = {
    "Table 1": flying_parameters.chapter,
    "Which cable goes where": flying_pairing.chapter,
    "The largest circle": flying_radius.chapter,
}


def account(progress: Progress | None = None) -> Account:
    """Recompute the paper."""
    return gather(PAPER, CHAPTERS, progress)
