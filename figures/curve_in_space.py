"""Draw curves in space."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from . import style


def curve_in_space(ways: Mapping[str, np.ndarray]) -> style.Figure:
    """Draw curves (n, 3) [m] with their names and equal scales; a dot marks the start of each."""
    canvas = style.figure(height=3.3)
    ax = style.axes_in_space(canvas)
    for index, (name, points) in enumerate(ways.items()):
        ax.plot(*points.T, **style.look(index), label=name)
        ax.plot(*points[0], "o", color=style.colour(index), markersize=4)
    style.equal_scales(ax, np.concatenate(list(ways.values())))
    return style.legend_below(canvas, ax)
