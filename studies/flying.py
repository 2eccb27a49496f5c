"""Paper F recomputed, claim by claim: `towline reproduce flying`."""

from __future__ import annotations

from . import (
    flying_balance,
    flying_cable,
    flying_disturbance,
    flying_helix,
    flying_pairing,
    flying_parameters,
    flying_procedure,
    flying_radius,
    flying_repair,
    flying_rotations,
    flying_vibration,
    flying_wind,
)
from .account import Account, Paper, Progress, gather

PAPER = Paper(
    "flying",
    "Q. Wang, H. Chen, Y. Su, L. Qiao: Coupling dynamics analysis of the flying cable driven parallel robot",
)
CHAPTERS = {
    "Table 1": flying_parameters.chapter,
    "Which cable goes where": flying_pairing.chapter,
    "Rotations (section II, IV)": flying_rotations.chapter,
    "A vibrating cable (section III)": flying_cable.chapter,
    "Forces and moments (section IV)": flying_balance.chapter,
    "The procedure (section V)": flying_procedure.chapter,
    "Wind (section VI)": flying_wind.chapter,
    "A straight flight (section VI.A)": flying_helix.chapter,
    "A circle of 1 m, and its repair (section VI.B)": flying_repair.chapter,
    "The largest circle (section VI.B)": flying_radius.chapter,
    "A vibrating platform (section VI.B)": flying_vibration.chapter,
    "A moving quadrotor (section VI.C)": flying_disturbance.chapter,
}


def account(progress: Progress | None = None) -> Account:
    """Recompute the paper."""
    return gather(PAPER, CHAPTERS, progress)
