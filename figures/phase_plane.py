"""Draw a time law in its phase plane: speed along a path over the path, coloured by the active limit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from . import style


def phase_plane(s: np.ndarray, sd: np.ndarray, active: Sequence[tuple[float, float, str]]) -> style.Figure:
    """Draw ds/dt over s, (n,) each.

    - `s`, `sd`: fraction of the path, increasing from 0 to 1, and its rate [1/s], whose square is linear between grid
      points.
    - `active`: stretches of the path with their active limit: start, end and name.
    """
    canvas = style.figure(height=2.2 + 0.17 * len({name for *_, name in active}))
    ax = style.axes(canvas, "fraction s of the path [-]", "ds/dt [1/s]")
    fine = np.unique(np.concatenate([s, np.linspace(0.0, 1.0, 500)]))
    speed = np.sqrt(np.maximum(np.interp(fine, s, sd**2), 0.0))
    ax.plot(fine, speed, color="#bbbbbb", linewidth=0.8)
    looks: dict[str, int] = {}
    for start, end, name in active:
        there = np.unique([start, *fine[(start < fine) & (fine < end)], end])
        label = None if name in looks else name
        look = style.look(looks.setdefault(name, len(looks)))
        ax.plot(there, np.sqrt(np.maximum(np.interp(there, fine, speed**2), 0.0)), **look, label=label)
    ax.set_ylim(bottom=0.0)
    ax.margins(x=0.01)
    return style.legend_below(canvas, ax)
