"""Paper F's references to its own equations and figures, and frames and letters that do not fit its definitions.

Eq. 2 is printed twice, and the text refers to equations by their place among all that are displayed. Sections VI.A and
VI.B refer to figures by numbers that are one less than those of the captions, except once.
"""

import numpy as np

from ...models import load
from ..accounts.claim import Chapter
from .claims import claim
from .element import ELEMENTS
from .plans import RADIUS, circle

TAGS = (1, 2, 2, *range(3, 39))  # numbers of the displayed equations, in order: 2 is printed twice
IN_STEPS = (6, 11, 12, 23, 24, 39)  # equations by which steps 2 to 7 of section V compute
# References in sections II to IV, in order.
OUTSIDE = (6, 6, 6, 14, 15, 24, 25, 27, 28, 29, 31, 32, 33, 30, 34, 27, 35, 38)
FIGURES = {
    "trajectories of platform and quadrotor": (6, 5),
    "lengths and tensions in compound motion": (7, 6),
    "expected and superimposed trajectories": (8, 7),
    "length of cable 1": (9, 8),
    "force of cable 1": (10, 9),
    "ratio of cable 1": (11, 10),
}
"""Figures by what sections VI.A and VI.B describe: the number of its caption, and the number in the text."""
TURN = 1e-6  # of alpha_A, for a difference [rad]


def chapter() -> Chapter:
    """Look references up, and form what frames and letters state."""
    captions, shown = zip(*FIGURES.values(), strict=True)
    last = {"tags": len(TAGS), "last": TAGS[-1], "in_steps": IN_STEPS[-1]}
    robot, places = load("wang-flying-printed"), circle(RADIUS).pose[:, :3]
    in_own = places - places  # O_B from O_B; the level platform's axes are those of {A}
    # How far B_2 moves with alpha_A, by b_i with alpha_B and by the printed b_i.
    r_B, alpha_B = np.hypot(*robot.attachments[0, :2]), np.radians(60)
    B_2 = [r_B * np.array([np.cos(angle), np.sin(angle)]) for angle in (alpha_B, alpha_B + 0.0, alpha_B + TURN)]
    own, by_printed = (float(np.linalg.norm(place - B_2[0]) / TURN) for place in B_2[1:])
    return Chapter(
        [
            claim("section-V-references").compared(by_order(IN_STEPS), printed=IN_STEPS, **last),
            claim("section-II-IV-references").compared(by_order(OUTSIDE), printed=OUTSIDE),
            claim("section-VI-references").compared(captions, printed=shown),
            claim("frames").compared(np.linalg.norm(in_own, axis=1).max(), printed=RADIUS),
            claim("eq-3-alpha").compared(own, printed=by_printed),
            claim("eq-23-cables").compared(robot.m, printed=ELEMENTS + 1, elements=ELEMENTS),
        ]
    )


def by_order(references: tuple[int, ...]) -> list[int]:
    """Return the numbers of the equations at these places among all displayed ones, the second Eq. 2 included."""
    return [TAGS[place - 1] for place in references]
