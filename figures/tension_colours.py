"""Choose the colour of a tension between its limits: one scale for figures, films and viewer.

A cable fails at both of its limits, and t_max is often a hundred times t_min: a linear scale would show one colour for
all tensions near t_min. The scale is therefore logarithmic, with a hundredth of t_max added so that t_min = 0 has a
place too:

    place(t) = log((t + e) / (t_min + e)) / log((t_max + e) / (t_min + e)),   e = t_max / 100
"""

from __future__ import annotations

import numpy as np

from ..base.text import quantity
from . import style

FINEST = 0.01  # of t_max
PALEST = 0.12  # of the colour map: paler lines cannot be seen on white
NO_TENSION = "#999999"
APART = 0.11  # of the scale: labels that are closer overlap
LETTER = 0.012  # of the scale: half the width of a letter of a label


def place(tensions: np.ndarray, t_min: np.ndarray, t_max: np.ndarray) -> np.ndarray:
    """Return the place of tensions (..., m) [N] between their limits (m,): 0 at t_min, 1 at t_max; nan stays."""
    step = FINEST * t_max
    span = np.log((t_max + step) / (t_min + step))
    above = np.log((np.clip(tensions, t_min, t_max) + step) / (t_min + step))
    # Equal limits: whatever the tension is, it is at both.
    return np.where(np.isnan(tensions), np.nan, np.divide(above, span, out=np.ones_like(above), where=span > 0))


def shades(places: np.ndarray) -> np.ndarray:
    """Return the RGB of places between the limits, bytes (..., 3): pale near t_min, dark near t_max, grey for nan."""
    from matplotlib import colormaps
    from matplotlib.colors import to_rgba

    known = np.nan_to_num(places)
    rgba = np.asarray(colormaps["viridis_r"](PALEST + (1 - PALEST) * known))
    rgba = np.where(np.isnan(places)[..., None], to_rgba(NO_TENSION), rgba)
    return np.round(255 * rgba[..., :3]).astype(np.uint8)


def scale() -> style.ScalarMappable:
    """Return the colours of places from 0 to 1, for a colour bar."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    return ScalarMappable(Normalize(0.0, 1.0), ListedColormap(shades(np.linspace(0.0, 1.0, 256)) / 255.0))


def mark(bar: style.Colorbar, t_min: np.ndarray, t_max: np.ndarray, size: float) -> None:
    """Label a colour bar of `scale` with the limits (m,) [N], and tensions between them if all cables have the same.

    `size` is the height of the letters [points].
    """
    places = {0.0: "t_min", 1.0: "t_max"}
    if np.ptp(t_min) == 0 and np.ptp(t_max) == 0:
        places = {0.0: quantity(float(t_min[0]), digits=3), 1.0: quantity(float(t_max[0]), digits=3)}
        exponents = range(int(np.floor(np.log10(FINEST * t_max[0]))), int(np.ceil(np.log10(t_max[0]))) + 1)
        for tension in (step * 10.0**exponent for exponent in exponents for step in (1, 2, 5)):
            at = float(place(np.array([tension]), t_min[:1], t_max[:1])[0])
            text = quantity(tension, digits=3)
            near = (abs(at - other) < max(APART, LETTER * (len(text) + len(name))) for other, name in places.items())
            if t_min[0] < tension < t_max[0] and not any(near):
                places[at] = text
    bar.set_ticks(list(places), labels=list(places.values()))
    bar.ax.tick_params(labelsize=size)


def rgb(colour: str) -> tuple[int, int, int]:
    """Return the bytes of a colour such as "#0072B2"."""
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
