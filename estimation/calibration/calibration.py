"""`Calibration`: a calibrated robot, with its file, figures and report."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ...base.display import Fact
from ...base.errors import InputError
from ...figures.drawing import Drawn
from ...figures.report import Report, Reported
from .report import facts, headline, report
from .result import CalibrationData

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Calibration(CalibrationData, Drawn, Reported):
    """The result of `calibrate`: `CalibrationData`, which can also be saved, drawn and reported."""

    def _headline(self) -> str:
        return headline(self)

    def _facts(self) -> Iterable[Fact]:
        return facts(self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Save the robot as a robot file (YAML) atomically, and return the path.

        A result that should not be used (`refused`) is not saved. `robot.save` saves it nevertheless.

        Args:
            path: Path of the file; an existing file is overwritten.

        Raises:
            InputError: If the result is refused, or the file cannot be written.
        """
        if self.refused is not None:
            raise InputError(f"calibration must be usable to be saved, got one that is refused: {self.refused}")
        from ...models.parsing import save_yaml

        return save_yaml(self.robot, path, "path")

    def figures(self) -> dict[str, Figure]:
        """Draw residuals before and after, anchors with error ellipsoids, and standard deviations, by name.

        Anchors are drawn if all of them are observable.
        """
        from .drawings import drawings

        return drawings(self)

    def _report(self) -> Report:
        return report(self, self._drawings)
