"""Write names beside the ends of curves, so that they are distinct without colours and need no legend."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import style

GAP = 0.065  # of a panel's height, between the names of curves at its edge
HIGHEST = 0.97  # of a panel's height, for the same: above is their heading
MOST_NAMES = 5  # of a curve: more would leave it no room
LINE = {"arrowstyle": "-", "color": "#999999", "linewidth": 0.5, "shrinkA": 0, "shrinkB": 0}
BESIDE: dict[str, Any] = {"xycoords": "axes fraction", "va": "center", "arrowprops": LINE, "annotation_clip": False}
SAME = 1e-3  # of the panel's height: curves that are nowhere farther apart share a name


def together(values: np.ndarray, names: list[str], height: float) -> tuple[np.ndarray, list[str]]:
    """Return the curves (n, k) that differ somewhere, and the names of each: "1, 6", or "1, 2, 3 + 5"."""
    groups: list[list[int]] = []
    for index in range(values.shape[1]):
        for group in groups:
            apart = np.abs(values[:, index] - values[:, group[0]])
            if np.isfinite(apart).any() and np.nanmax(apart) < SAME * height:
                group.append(index)
                break
        else:
            groups.append([index])
    texts = []
    for group in groups:
        shown = group if len(group) <= MOST_NAMES else group[: MOST_NAMES - 2]
        more = f" + {len(group) - len(shown)}" if len(group) > len(shown) else ""
        texts.append(", ".join(names[index] for index in shown) + more)
    return values[:, [group[0] for group in groups]], texts


def name_at_the_end(ax: style.Axes, values: np.ndarray, names: list[str], cables: bool = True) -> None:
    """Write the names of curves beside their ends, whose last values are (k,).

    If they are numbers of `cables`, the highest has the word "cable" or "cables" before it.
    """
    low, high = ax.get_ylim()
    places = (np.clip(values, low, high) - low) / (high - low)
    order = np.argsort(places)
    gap = min(GAP, HIGHEST / max(len(order) - 1, 1))
    for cable, place in zip(order, _spread(places[order], gap), strict=True):
        about = ("cables " if "," in names[cable] else "cable ") if cables and cable == order[-1] else ""
        text, size = f"{about}{names[cable]}", style.NOTE * gap / GAP
        ax.annotate(text, (1.0, places[cable]), (1.05, place), fontsize=size, **BESIDE)


def _spread(places: np.ndarray, gap: float = GAP) -> np.ndarray:
    """Return increasing places with distances of at least `gap`, moved as much up as down."""
    gaps = gap * np.arange(len(places))
    up = np.maximum.accumulate(places - gaps) + gaps
    down = np.minimum.accumulate((places - gaps)[::-1])[::-1] + gaps
    apart = (up + down) / 2
    apart += max(0.0, -apart[0])  # all of them, so that none leaves the panel below
    return np.minimum(apart, HIGHEST - gaps[::-1])
