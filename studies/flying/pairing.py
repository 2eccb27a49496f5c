"""Which point of the ring a cable joins to which point of the platform: the printed pairing has no inverse of J."""

from __future__ import annotations

import numpy as np

from ...figures.drawing import Drawing
from ...figures.from_above import from_above
from ...models import load
from ...models.diagnosis import diagnose
from ..accounts.account import Chapter
from ..accounts.claim import Verdict, stated

ROWS = 6  # of J, whose inverse step 7 of section V takes


def chapter() -> Chapter:
    """The rank of J by the printed pairing, and by the crossed one that the other chapters use."""
    robot = load("wang-flying")
    printed, crossed = diagnose(load("wang-flying-printed")), diagnose(robot)
    values = ", ".join(f"{value:.3g}" for value in crossed.singular_values)
    claim = stated(
        "pairing",
        "Eqs. 2, 3, 38, section V step 7",
        "Cable i joins A_i to B_i, both 60 degrees apart from one to the next, and T = J^-1 (...) : J has rank 6.",
        float(ROWS),
        float(printed.rank_level),
        holds=printed.rank_level == ROWS,
        otherwise=Verdict.IMPOSSIBLE,
        agrees="J has full rank at level poses.",
        differs=f"The rank at every level pose tried is the computed one, because {printed.reason}. Crossed pairs of "
        f"the same points (A1-B2, A2-B1, ...) have rank {crossed.rank}, singular values {values} (moments over "
        f"{robot.length:.3g} m): all else is computed with these.",
        figure="pairing",
    )
    pairs = {
        f"as printed: rank {printed.rank}": _points("wang-flying-printed"),
        f"crossed: rank {crossed.rank}": _points("wang-flying"),
    }
    return Chapter([claim], {"pairing": Drawing("The cables seen from above, numbered", from_above(pairs))})


def _points(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Anchors and attachments, (6, 3) each; cable i has the number of its anchor."""
    robot = load(name)
    return robot.anchors, robot.attachments
