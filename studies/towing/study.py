"""Paper C recomputed, claim by claim: `towline reproduce ctmrts`."""

from ..accounts.account import Paper
from . import equations, flights, loop, modes, ranges, tensions

PAPER = Paper(
    "ctmrts",
    "Y. Wang, Z. Zhao, J. Li, G. Ji: Analysis of workspace of cable-typing close-coupling multi-robot collaboratively "
    "towing system",
)
CHAPTERS = {
    "The model, Eqs. 1 to 13": equations.chapter,
    "Tensions, Eqs. 11, 16, 17": tensions.chapter,
    "The loop, Eqs. 14, 15, steps (a) to (f)": loop.chapter,
    "Workspaces, figures 2 to 6": ranges.chapter,
    "Three drives, three to six robots": modes.chapter,
    "The load towed": flights.chapter,
}
