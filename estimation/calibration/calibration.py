"""`Calibration`: a calibrated robot, with its file, figures and report."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...base.display import Fact
from ...base.errors import InputError
from ...figures import calibration as pictures
from ...figures.drawing import Drawn
from ...figures.report import Report, Reported
from .parameters import WORDS
from .report import facts, headline, report
from .result import CalibrationData

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The parameters of a cable that are lengths, by the end of their names.
KINDS = {word: word.replace(".", " ") for word in WORDS if word != "scale"}


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
        times = self.measurements.times
        wrong = np.zeros(self.residuals.shape, dtype=bool)
        for one in self._solved.outliers:
            wrong[one.sample, [one.cable, *one.others]] = True
        drawn = {"residuals": pictures.residuals(self.residuals_before, self.residuals, times, wrong)}
        names = [parameter.name for parameter in self.parameters]
        known = set(self.identifiable)
        each = [[f"cables[{cable}].anchor.{axis}" for axis in "xyz"] for cable in range(self.robot.m)]
        if all(name in known for cable in each for name in cable):
            at = np.array([[names.index(name) for name in cable] for cable in each])  # (m, 3)
            covariances = self.covariance[at[:, :, None], at[:, None, :]]
            drawn["anchors"] = pictures.anchors(self.file.anchors, self.robot.anchors, covariances)
        sigmas: dict[str, np.ndarray] = {}
        for parameter in self.parameters:
            cable, _, end = parameter.name.removeprefix("cables[").partition("].")
            if end in KINDS:
                sigmas.setdefault(KINDS[end], np.full(self.robot.m, np.nan))[int(cable)] = parameter.sigma
        if sigmas:
            drawn["observability"] = pictures.observability(sigmas)
        return drawn

    def _report(self) -> Report:
        return report(self, self._drawings)
