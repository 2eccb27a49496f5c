"""`corrected`, `correction_of`: a log and its robot without the probable input errors of the log."""

from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...models.cable import Encoder
from ...models.files import as_robot
from ...models.robot import Robot
from ..logs.measurements import Measurements
from .interpretations import FACTORS
from .parameters import Parameters
from .plausibility import mistake

MOST_MISTAKES = 3


class Correction(NamedTuple):
    """A log and its robot without the probable input errors of the log.

    Attributes:
        robot: The robot. Its encoders convert readings in another unit or with another sign, so it fits the log as it
            is.
        measurements: Measurements without the other errors.
        texts: The errors, in one line each.
        counted: True if readings count something whose size is known only roughly, so their scales should be estimated.
    """

    robot: Robot
    measurements: Measurements
    texts: list[str]
    counted: bool


def corrected(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """Return measurements without their probable input errors, and a line about each error.

    Raises:
        InputError: If the measurements have another number of cables, or several errors are equally probable.
    """
    found = correction_of(robot, measurements)
    first, last = (Parameters(one, ()).table(Parameters(one, ()).first)[:, 7] for one in (as_robot(robot), found.robot))
    lengths = found.measurements.lengths * (last / first)
    return (found.measurements.changed(lengths=lengths) if found.texts else measurements), found.texts


def correction_of(robot: Robot, measurements: Measurements) -> Correction:
    """Return a log and its robot without the probable input errors of the log; raise InputError as `corrected`."""
    robot, texts, counted = as_robot(robot), list[str](), False
    for _ in range(MOST_MISTAKES):
        found = mistake(robot, measurements)
        if found is None:
            break
        if found.corrected is None:
            raise InputError(f"measurements must have one probable error that is known, got: {found.text}")
        texts.append(found.text)
        sizes = np.broadcast_to(found.factors, robot.m)
        counted |= not set(np.abs(sizes).tolist()) <= {1.0, *FACTORS}
        measurements = found.corrected.changed(lengths=found.corrected.lengths / sizes)
        robot = _scaled(robot, sizes)
    return Correction(robot, measurements, texts, counted)


def _scaled(robot: Robot, factors: np.ndarray) -> Robot:
    """Return the robot with encoders whose readings are smaller by factors (m,)."""
    if (factors == 1).all():
        return robot
    cables = []
    for cable, factor in zip(robot.cables, factors.tolist(), strict=True):
        known = cable.encoder or Encoder()
        change = {"scale": factor * known.scale, "build_up": factor**2 * known.build_up}
        cables.append(cable.model_copy(update={"encoder": known.model_copy(update=change)}))
    return robot.model_copy(update={"cables": tuple(cables)})
