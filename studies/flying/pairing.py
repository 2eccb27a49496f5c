"""The pairing of anchors and attachments: with the printed one J has no inverse.

While the platform is level, at any position and yaw, the six lines A_i B_i have Plücker coordinates that are affine in
cos a_i and sin a_i, a_i = 60 degrees (i - 1): their only products of second order are r_A r_B sin(yaw) times
cos^2 a_i + sin^2 a_i, a constant. Six points of three functions, 1, cos a_i and sin a_i, span three dimensions at most.
"""

from collections.abc import Mapping

import numpy as np

from ...figures import style
from ...figures.drawing import Drawing
from ...models import load
from ...models.diagnosis import diagnose
from ..accounts.claim import Chapter, Verdict
from .claims import claim

ROWS = 6  # of J, whose inverse step 7 of section V takes
LEVEL = 200  # positions and yaws at which the coordinates are formed


def chapter() -> Chapter:
    """Check the rank of J of the printed pairing, and of the crossed pairing that the other chapters use."""
    robot = load("wang-flying")
    printed, crossed = diagnose(load("wang-flying-printed")), diagnose(robot)
    values = ", ".join(f"{value:.3g}" for value in crossed.singular_values)
    rank = claim("pairing").stated(
        printed.rank_level,
        printed.rank_level == ROWS,
        printed=ROWS,
        otherwise=Verdict.IMPOSSIBLE,
        affine=off_affine(),
        reason=printed.reason,
        rank=crossed.rank,
        values=values,
        length=robot.length,
    )
    robots = {f"as printed: rank {printed.rank}": load("wang-flying-printed"), f"crossed: rank {crossed.rank}": robot}
    pairs = {title: (each.anchors, each.attachments) for title, each in robots.items()}
    return Chapter([rank], {"pairing": Drawing("The numbered cables from above", from_above(pairs))})


def off_affine() -> float:
    """Return how far the lines' coordinates are from affine ones at random level poses, over the largest."""
    rng, robot = np.random.default_rng(0), load("wang-flying-printed")
    anchors, attachments = robot.anchors, robot.attachments
    angles = np.radians(60) * np.arange(6)
    basis = np.column_stack([np.ones(6), np.cos(angles), np.sin(angles)])
    rest = np.eye(6) - basis @ np.linalg.pinv(basis)
    places, yaws = rng.uniform(-2, 2, (LEVEL, 1, 3)), rng.uniform(-np.pi, np.pi, (LEVEL, 1))
    across = attachments[:, 0] * np.sin(yaws) + attachments[:, 1] * np.cos(yaws)
    along = attachments[:, 0] * np.cos(yaws) - attachments[:, 1] * np.sin(yaws)
    ends = places + np.stack([along, across, np.tile(attachments[:, 2], (LEVEL, 1))], axis=-1)
    lines = np.concatenate([anchors - ends, np.cross(ends, anchors - ends)], axis=-1)
    return float(np.abs(rest @ lines).max() / np.abs(lines).max())


def from_above(pairings: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> "style.Figure":
    """Draw (anchors, attachments), (m, 3) each [m], of several pairings side by side, under their titles."""
    canvas = style.figure(height=0.9 + 3.0 / len(pairings))
    for place, (title, (anchors, attachments)) in enumerate(pairings.items(), 1):
        share = canvas.axes[0] if canvas.axes else None
        ax = style.axes(canvas, "x [m]", "y [m]" if place == 1 else "", (1, len(pairings), place), share)
        ax.tick_params(labelleft=place == 1)
        for anchor, attachment in zip(anchors, attachments, strict=True):
            ax.plot(*np.stack([anchor, attachment])[:, :2].T, color="#999999", linewidth=1.0)
        ends = ((anchors, "s", 1, "anchors A", 1.12), (attachments, "o", 0, "attachments B", 0.75))
        for points, mark, index, label, away in ends:
            shade = style.colour(index)
            ax.plot(*points[:, :2].T, mark, color=shade, markersize=3, label=label)
            for number, point in enumerate(points, 1):
                look = {"fontsize": style.NOTE, "ha": "center", "va": "center", "color": shade}
                ax.annotate(f"{number}", away * point[:2], **look)
        ax.set_aspect("equal")
        ax.margins(0.12)
        style.heading(ax, title, 1 / len(pairings))
    return style.legend_below(canvas, *canvas.axes)
