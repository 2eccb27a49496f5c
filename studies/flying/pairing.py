"""The pairing of anchors and attachments: with the printed one J has no inverse."""

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
    """Check the rank of J of the printed pairing, and of the crossed pairing that the other chapters use."""
    robot = load("wang-flying")
    printed, crossed = diagnose(load("wang-flying-printed")), diagnose(robot)
    values = ", ".join(f"{value:.3g}" for value in crossed.singular_values)
    claim = stated(
        "pairing",
        "Eqs. 2, 3, 38, section V step 7",
        "Cable i joins A_i to B_i, neighbours are separated by 60 degrees, and T = J^-1 (...) (rank of J).",
        float(ROWS),
        float(printed.rank_level),
        holds=printed.rank_level == ROWS,
        otherwise=Verdict.IMPOSSIBLE,
        agrees="J has full rank at level poses.",
        differs=f"At every level pose that was tried J has the computed rank, because {printed.reason}. Crossed pairs "
        "of "
        f"the same points (A1-B2, A2-B1, ...) have rank {crossed.rank} and singular values {values} (moments over "
        f"{robot.length:.3g} m); all other chapters use them.",
        figure="pairing",
    )
    pairs = {
        f"as printed: rank {printed.rank}": _points("wang-flying-printed"),
        f"crossed: rank {crossed.rank}": _points("wang-flying"),
    }
    return Chapter([claim], {"pairing": Drawing("The numbered cables from above", from_above(pairs))})


def _points(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return anchors and attachments, (6, 3) each; cable i has the number of its anchor."""
    robot = load(name)
    return robot.anchors, robot.attachments
