"""Paper F's references to its own equations and figures, and frames and letters that do not fit its definitions.

Eq. 2 is printed twice, and the text refers to equations by their place among all that are displayed. Sections VI.A and
VI.B refer to figures by numbers that are one less than those of the captions, except once.
"""

from __future__ import annotations

import numpy as np

from ...models import load
from ..accounts.account import Chapter
from ..accounts.claim import Claim, compared
from .element import ELEMENTS
from .motion import RADIUS, circle

TAGS = (1, 2, 2, *range(3, 39))  # numbers of the displayed equations, in order: 2 is printed twice
IN_STEPS = (6, 11, 12, 23, 24, 39)  # equations by which steps 2 to 7 of section V compute
OUTSIDE = (
    6,
    6,
    6,
    14,
    15,
    24,
    25,
    27,
    28,
    29,
    31,
    32,
    33,
    30,
    34,
    27,
    35,
    38,
)  # references in sections II to IV, in order
CAPTIONS = {
    "trajectories of platform and quadrotor": 6,
    "lengths and tensions in compound motion": 7,
    "expected and superimposed trajectories": 8,
    "length of cable 1": 9,
    "force of cable 1": 10,
    "ratio of cable 1": 11,
}
SHOWN = {
    "trajectories of platform and quadrotor": 5,
    "lengths and tensions in compound motion": 6,
    "expected and superimposed trajectories": 7,
    "length of cable 1": 8,
    "force of cable 1": 9,
    "ratio of cable 1": 10,
}
"""Figures by what sections VI.A and VI.B describe: the number of its caption, and the number in the text."""
TURN = 1e-6  # of alpha_A, for a difference [rad]


def chapter() -> Chapter:
    """Look references up, and form what frames and letters state."""
    return Chapter([_in_steps(), _outside(), _figures(), _frames(), _angle(), _cables()])


def _in_steps() -> Claim:
    return compared(
        "section-V-references",
        "section V, steps 2, 4, 5, 6 and 7",
        "l_i, dB, dT_C, dT_K, dT and T are computed by the equations with these numbers.",
        tuple(float(number) for number in IN_STEPS),
        by_order(IN_STEPS),
        within=0.0,
        agrees="These are the numbers of the equations.",
        differs="They are the places of the equations in the text, whose numbers are one less, as Eq. 2 is printed "
        f"twice: the {len(TAGS)} equations end with Eq. {TAGS[-1]}, so there is no Eq. {IN_STEPS[-1]}.",
    )


def _outside() -> Claim:
    return compared(
        "section-II-IV-references",
        "sections II, III and IV",
        "The text refers to equations with these numbers, from the length of a cable to the last grouping.",
        tuple(float(number) for number in OUTSIDE),
        by_order(OUTSIDE),
        within=0.0,
        agrees="These are the numbers of the equations.",
        differs='They are places in the text too, and the numbers are one less: "from (6)" the length does not depend '
        'on the quadrotor\'s position (Eq. 5), "(28), (29), (31), (32) and (33) into (30)" gives Eq. 33.',
    )


def by_order(references: tuple[int, ...]) -> tuple[float, ...]:
    """Return the numbers of the equations at these places among all displayed ones, the second Eq. 2 included."""
    return tuple(float(TAGS[place - 1]) for place in references)


def _figures() -> Claim:
    return compared(
        "section-VI-references",
        "VI.A, VI.B",
        "The text refers to figures with these numbers for the helix, for lengths and tensions, and for trajectories, "
        "length, force and ratio of cable 1.",
        tuple(float(number) for number in SHOWN.values()),
        tuple(float(CAPTIONS[what]) for what in SHOWN),
        within=0.0,
        agrees="These are the numbers of the captions.",
        differs="By their captions these figures have the computed numbers, which the claims of this account use.",
    )


def _frames() -> Claim:
    """Transform the platform's circle into its own frame."""
    motion = circle(RADIUS)
    in_own = motion.pose[:, :3] - motion.pose[:, :3]  # O_B from O_B; the level platform's axes are those of {A}
    return compared(
        "frames",
        "IV.B, VI.A, VI.B",
        "The platform moves on a circle in {B}, where X_b is its position (radius of the path of its centre in {B}).",
        RADIUS,
        float(np.linalg.norm(in_own, axis=1).max()),
        within=1e-9,
        agrees="The centre moves in {B}.",
        differs="{B} is fixed to the platform, whose centre does not move in it: {A} is meant, in which the circle's "
        "centre is given. In the same way X_a, the position of the quadrotor, is in {G} and not in its own frame {A}.",
        unit="m",
    )


def _angle() -> Claim:
    """Compute how far B_2 moves with alpha_A, by the printed b_i and by b_i with alpha_B."""
    r_B = float(np.hypot(*load("wang-flying-printed").attachments[0, :2]))

    def moved(of_b: float) -> float:
        alpha_B = np.radians(60)
        before, after = (r_B * np.array([np.cos(angle), np.sin(angle)]) for angle in (alpha_B, alpha_B + of_b))
        return float(np.linalg.norm(after - before) / TURN)

    return compared(
        "eq-3-alpha",
        "Eq. 3",
        "b_i has the angle alpha_A (shift of B_2 as the angle between the anchors changes, per radian).",
        moved(TURN),
        moved(0.0),
        within=1e-9,
        agrees="The attachments do not depend on it.",
        differs="alpha_B, the angle between the attachments, is meant. Both are 60 degrees, so no number changes.",
        unit="m",
    )


def _cables() -> Claim:
    return compared(
        "eq-23-cables",
        "text below Eq. 23",
        f"The number of the cable is i = 1, 2, ..., n + 1, where n is the number of elements (last i, n = {ELEMENTS}).",
        float(ELEMENTS + 1),
        float(load("wang-flying-printed").m),
        within=0.0,
        agrees="There are as many cables.",
        differs="There are six cables, however many elements each has; n + 1 is the number of its nodes.",
    )
