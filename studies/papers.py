"""The papers that `towline reproduce` recomputes, by name: what each is, and the modules of its chapters by title."""

from collections.abc import Callable
from functools import partial
from importlib import import_module

from .accounts.claim import Account, Paper, Progress, gather

FLYING = "Q. Wang, H. Chen, Y. Su, L. Qiao: Coupling dynamics analysis of the flying cable driven parallel robot"
TOWING = (
    "Y. Wang, Z. Zhao, J. Li, G. Ji: Analysis of workspace of cable-typing close-coupling multi-robot collaboratively "
    "towing system"
)
OF_FLYING = {
    "Table 1": "parameters",
    "The robot (section II)": "structure",
    "The pairing of the cables": "pairing",
    "Rotations (section II, IV)": "rotations",
    "A vibrating cable (section III)": "cable",
    "An element of a cable (section III)": "element",
    "Forces and moments (section IV)": "balance",
    "References, frames and letters": "references",
    "The procedure (section V)": "procedure",
    "Wind (section VI)": "wind",
    "A straight flight (section VI.A)": "helix",
    "A circle of radius 1 m, and what makes it possible (section VI.B)": "repair",
    "The largest circle (section VI.B)": "radius",
    "A vibrating platform (section VI.B)": "vibration",
    "A vibration in the elastic plant (sections III, V)": "shaken",
    "A moving quadrotor (figures 12 to 15)": "disturbance",
    "Motions flown in the wind (section VI)": "flights",
}
OF_TOWING = {
    "The model, Eqs. 1 to 13": "equations",
    "Tensions, Eqs. 11, 16, 17": "tensions",
    "The loop, Eqs. 14, 15, steps (a) to (f)": "loop",
    "Workspaces, figures 2 to 6": "ranges",
    "Three drives, three to six robots": "modes",
    "The load towed": "flights",
}


def _study(name: str, source: str, folder: str, modules: dict[str, str]) -> Callable[[Progress | None], Account]:
    chapters = {title: import_module(f".{folder}.{module}", __package__).chapter for title, module in modules.items()}
    return partial(gather, Paper(name, source), chapters)


PAPERS = {
    "flying": _study("flying", FLYING, "flying", OF_FLYING),
    "ctmrts": _study("ctmrts", TOWING, "towing", OF_TOWING),
}
