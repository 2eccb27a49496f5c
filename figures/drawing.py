"""Define a figure with its caption."""

from __future__ import annotations

from typing import NamedTuple

from . import style


class Drawing(NamedTuple):
    """A figure with its caption."""

    caption: str
    figure: style.Figure
