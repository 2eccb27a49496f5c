"""Draw a replay: residuals over a recording, window by window, and with what explains them fitted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import style

LABELS = {
    "position": ("position [mm]", 1e3),
    "rotation": ("rotation [mrad]", 1e3),
    "tensions": ("tension [N]", 1.0),
    "lengths": ("length [mm]", 1e3),
}
VECTORS = ("position", "rotation")


def replay(
    times: np.ndarray,
    residuals: Mapping[str, np.ndarray],
    explained: Mapping[str, np.ndarray],
    noise: Mapping[str, float],
    title: str,
    by: str = "",
) -> style.Figure:
    """Draw the size of each kind of residual over time, and its noise.

    - `times`: times of the samples of each window, (W, S) [s].
    - `residuals`, `explained`: measured minus simulated by kind, (W, S, k), with the model and with the parameter that
      explains most, which is called `by`.
    - `noise`: standard deviation of each kind.
    - `title`: result in one line.
    """
    canvas = style.figure(height=0.9 + 1.1 * len(residuals))
    panels = style.panels_below(canvas, "time [s]", [LABELS[name][0] for name in residuals])
    for ax, (name, part) in zip(panels, residuals.items(), strict=False):
        scale = LABELS[name][1]
        curves = [(part, 0, "model"), *([(explained[name], 1, f"with {by} fitted")] if explained else [])]
        for values, index, label in curves:
            for k, (at, window) in enumerate(zip(times, values, strict=True)):
                look: dict[str, Any] = style.look(index) | {"linewidth": 0.9}
                ax.plot(at, scale * _size(name, window), **look, label=label if k == 0 else None)
        usual = np.sqrt(np.isfinite(part).any(axis=(0, 1)).sum()) if name in VECTORS else 1.0
        ax.axhline(scale * usual * noise[name], color="#444444", linewidth=0.8, linestyle=":", label="noise, rms")
        ax.set_ylim(bottom=0.0)
    style.heading(panels[0], title)
    return style.legend_below(canvas, panels[0])


def _size(name: str, values: np.ndarray) -> np.ndarray:
    """Return the length of vectors (S, 3), or the root mean square over the cables (S, m).

    Coordinates that do not move are nan and are left out; samples without any number stay nan.
    """
    squares, known = np.nan_to_num(np.square(values)).sum(axis=-1), np.isfinite(values).any(axis=-1)
    return np.sqrt(np.where(known, squares / (1 if name in VECTORS else values.shape[-1]), np.nan))
