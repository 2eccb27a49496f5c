"""Draw cables from above: which anchor each joins to which attachment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from . import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def from_above(pairings: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> Figure:
    """Draw (anchors, attachments), (m, 3) each [m], of several pairings side by side, under their titles."""
    canvas = style.figure(height=0.9 + 3.0 / len(pairings))
    for place, (title, (anchors, attachments)) in enumerate(pairings.items(), 1):
        share = canvas.axes[0] if canvas.axes else None
        ax = style.axes(canvas, "x [m]", "y [m]" if place == 1 else "", (1, len(pairings), place), share)
        ax.tick_params(labelleft=place == 1)
        for anchor, attachment in zip(anchors, attachments, strict=True):
            ax.plot(*np.stack([anchor, attachment])[:, :2].T, color="#999999", linewidth=1.0)
        ax.plot(*anchors[:, :2].T, "s", color=style.colour(1), markersize=3, label="anchors A")
        ax.plot(*attachments[:, :2].T, "o", color=style.colour(0), markersize=3, label="attachments B")
        for index, (anchor, attachment) in enumerate(zip(anchors, attachments, strict=True), 1):
            ax.annotate(
                f"{index}", 1.12 * anchor[:2], fontsize=style.NOTE, ha="center", va="center", color=style.colour(1)
            )
            ax.annotate(
                f"{index}", 0.75 * attachment[:2], fontsize=style.NOTE, ha="center", va="center", color=style.colour(0)
            )
        ax.set_aspect("equal")
        ax.margins(0.12)
        style.heading(ax, title, 1 / len(pairings))
    style.legend_below(canvas, *canvas.axes)
    return canvas
