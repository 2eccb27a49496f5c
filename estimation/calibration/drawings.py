"""The figures of a calibration, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...figures import calibration as pictures
from .parameters import WORDS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .result import CalibrationData

# The parameters of a cable that are lengths, by the end of their names.
KINDS = {word: word.replace(".", " ") for word in WORDS if word != "scale"}


def drawings(result: CalibrationData) -> dict[str, Figure]:
    """Draw residuals before and after, anchors with error ellipsoids, and the standard deviation of each parameter.

    Ellipsoids are drawn if all anchors are observable.
    """
    times = result.measurements.times
    wrong = np.zeros(result.residuals.shape, dtype=bool)
    for one in result._solved.outliers:
        wrong[one.sample, [one.cable, *one.others]] = True
    drawn = {"residuals": pictures.residuals(result.residuals_before, result.residuals, times, wrong)}
    robot, file = result.robot, result.file
    names = [parameter.name for parameter in result.parameters]
    known = set(result.identifiable)
    each = [[f"cables[{cable}].anchor.{axis}" for axis in "xyz"] for cable in range(robot.m)]
    if all(name in known for cable in each for name in cable):
        at = np.array([[names.index(name) for name in cable] for cable in each])  # (m, 3)
        covariances = result.covariance[at[:, :, None], at[:, None, :]]
        drawn["anchors"] = pictures.anchors(file.anchors, robot.anchors, covariances)
    sigmas: dict[str, np.ndarray] = {}
    for parameter in result.parameters:
        cable, _, end = parameter.name.removeprefix("cables[").partition("].")
        if end in KINDS:
            sigmas.setdefault(KINDS[end], np.full(robot.m, np.nan))[int(cable)] = parameter.sigma
    if sigmas:
        drawn["observability"] = pictures.observability(sigmas)
    return drawn
