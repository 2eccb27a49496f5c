"""`Drawing`: a figure with its caption; `Drawn`: the base of results that are saved as figures."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from . import style


class Drawing(NamedTuple):
    """A figure with its caption."""

    caption: str
    figure: style.Figure


class Drawn:
    """The base of results with figures: `plot` saves those that `figures` draws."""

    __slots__ = ()

    def figures(self) -> dict[str, style.Figure]:
        """Draw what `plot` saves, by the names of the files without suffix."""
        raise NotImplementedError

    def plot(self, folder: str | os.PathLike[str], format: str = "png") -> list[Path]:
        """Save the figures in `folder`, as wide as a journal's column (88 mm), and return their paths.

        A figure without content is left out.

        Args:
            format: png, pdf or svg.

        Raises `InputError` if the format is another, or a file cannot be written.
        """
        return style.save_all(self.figures, folder, format)

    def _drawings(self) -> list[Drawing]:
        """Draw the figures of a report's page, with their names as captions."""
        return [Drawing(name.replace("_", " ").capitalize(), figure) for name, figure in self.figures().items()]
