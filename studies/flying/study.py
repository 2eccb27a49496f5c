"""Paper F recomputed, claim by claim: `towline reproduce flying`."""

from importlib import import_module

from ..accounts.account import Paper

PAPER = Paper(
    "flying", "Q. Wang, H. Chen, Y. Su, L. Qiao: Coupling dynamics analysis of the flying cable driven parallel robot"
)
MODULES = {
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
CHAPTERS = {title: import_module(f".{name}", __package__).chapter for title, name in MODULES.items()}
