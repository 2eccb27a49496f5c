"""The papers that `towline reproduce` recomputes, by name."""

from collections.abc import Callable
from functools import partial

from .accounts.account import Account, Progress, gather
from .flying import study as flying
from .towing import study as towing

PAPERS: dict[str, Callable[[Progress | None], Account]] = {
    study.PAPER.name: partial(gather, study.PAPER, study.CHAPTERS) for study in (flying, towing)
}
