"""Paper F's references to its own equations and figures, and frames and letters that do not fit its definitions.

Eq. 2 is printed twice, and the text refers to equations by their place among all that are displayed. Sections VI.A and
VI.B refer to figures by numbers that are one less than those of the captions, except once.
"""

import numpy as np

from ...models import load
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .element import ELEMENTS
from .motion import RADIUS, circle

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
    return Chapter(
        [
            claim("section-V-references").compared(by_order(IN_STEPS), printed=IN_STEPS, **last),
            claim("section-II-IV-references").compared(by_order(OUTSIDE), printed=OUTSIDE),
            claim("section-VI-references").compared(captions, printed=shown),
            _frames(),
            _angle(),
            claim("eq-23-cables").compared(load("wang-flying-printed").m, printed=ELEMENTS + 1, elements=ELEMENTS),
        ]
    )


def by_order(references: tuple[int, ...]) -> list[int]:
    """Return the numbers of the equations at these places among all displayed ones, the second Eq. 2 included."""
    return [TAGS[place - 1] for place in references]


def _frames() -> Claim:
    """Transform the platform's circle into its own frame."""
    motion = circle(RADIUS)
    in_own = motion.pose[:, :3] - motion.pose[:, :3]  # O_B from O_B; the level platform's axes are those of {A}
    return claim("frames").compared(np.linalg.norm(in_own, axis=1).max(), printed=RADIUS)


def _angle() -> Claim:
    """Compute how far B_2 moves with alpha_A, by the printed b_i and by b_i with alpha_B."""
    r_B = np.hypot(*load("wang-flying-printed").attachments[0, :2])

    def moved(of_b: float) -> float:
        alpha_B = np.radians(60)
        before, after = (r_B * np.array([np.cos(angle), np.sin(angle)]) for angle in (alpha_B, alpha_B + of_b))
        return float(np.linalg.norm(after - before) / TURN)

    return claim("eq-3-alpha").compared(moved(0.0), printed=moved(TURN))
