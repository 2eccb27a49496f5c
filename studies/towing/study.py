"""Paper C recomputed, claim by claim: `towline reproduce ctmrts`."""

from importlib import import_module

from ..accounts.account import Paper

PAPER = Paper(
    "ctmrts",
    "Y. Wang, Z. Zhao, J. Li, G. Ji: Analysis of workspace of cable-typing close-coupling multi-robot collaboratively "
    "towing system",
)
MODULES = {
    "The model, Eqs. 1 to 13": "equations",
    "Tensions, Eqs. 11, 16, 17": "tensions",
    "The loop, Eqs. 14, 15, steps (a) to (f)": "loop",
    "Workspaces, figures 2 to 6": "ranges",
    "Three drives, three to six robots": "modes",
    "The load towed": "flights",
}
CHAPTERS = {title: import_module(f".{name}", __package__).chapter for title, name in MODULES.items()}
