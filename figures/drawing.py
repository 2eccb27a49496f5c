"""`Drawing`: a figure and what stands below it."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Drawing(NamedTuple):
    """A figure and what stands below it."""

    caption: str
    figure: Figure
