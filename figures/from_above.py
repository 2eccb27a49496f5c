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
    style.legend_below(canvas, *canvas.axes)
    return canvas
