"""Paper F recomputed, claim by claim: `towline reproduce flying`."""

from ..accounts.account import Paper
from . import (
    balance,
    cable,
    disturbance,
    element,
    flights,
    helix,
    pairing,
    parameters,
    procedure,
    radius,
    references,
    repair,
    rotations,
    shaken,
    structure,
    vibration,
    wind,
)

PAPER = Paper(
    "flying", "Q. Wang, H. Chen, Y. Su, L. Qiao: Coupling dynamics analysis of the flying cable driven parallel robot"
)
CHAPTERS = {
    "Table 1": parameters.chapter,
    "The robot (section II)": structure.chapter,
    "The pairing of the cables": pairing.chapter,
    "Rotations (section II, IV)": rotations.chapter,
    "A vibrating cable (section III)": cable.chapter,
    "An element of a cable (section III)": element.chapter,
    "Forces and moments (section IV)": balance.chapter,
    "References, frames and letters": references.chapter,
    "The procedure (section V)": procedure.chapter,
    "Wind (section VI)": wind.chapter,
    "A straight flight (section VI.A)": helix.chapter,
    "A circle of radius 1 m, and what makes it possible (section VI.B)": repair.chapter,
    "The largest circle (section VI.B)": radius.chapter,
    "A vibrating platform (section VI.B)": vibration.chapter,
    "A vibration in the elastic plant (sections III, V)": shaken.chapter,
    "A moving quadrotor (figures 12 to 15)": disturbance.chapter,
    "Motions flown in the wind (section VI)": flights.chapter,
}
