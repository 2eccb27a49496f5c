"""`corrected`, `corrected_log`: measurements, or a log and its robot, without the probable input errors of the log."""

from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...models.cable import Encoder
from ...models.files import as_robot
from ...models.robot import Robot
from ..logs.clocks import realigned
from ..logs.measurements import Measurements
from ..logs.reading import Log
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
        columns: Columns of the log in the order of the cables, (m,).
    """

    robot: Robot
    measurements: Measurements
    texts: list[str]
    counted: bool
    columns: np.ndarray


def corrected(robot: Robot, measurements: Measurements) -> tuple[Measurements, list[str]]:
    """Return measurements without their probable input errors, and a line about each error.

    Raises:
        InputError: If the measurements have another number of cables, or several errors are equally probable.
    """
    found = correction_of(robot, measurements)
    first, last = (Parameters(one, ()).table(Parameters(one, ()).first)[:, 7] for one in (as_robot(robot), found.robot))
    lengths = found.measurements.lengths * (last / first)
    return (found.measurements.changed(lengths=lengths) if found.texts else measurements), found.texts


def corrected_log(robot: Robot, read: Log) -> tuple[Log, Correction]:
    """Return a log without its probable input errors, with notes about them, and the correction.

    A clock that was aligned by cable speeds is aligned again, as errors hide it; raises InputError as `corrected`.
    """
    found, clock = correction_of(robot, read.measurements), None
    notes = [*read.notes, *(f"corrected: {text}" for text in found.texts)]
    if read.clock is not None and found.texts:
        measurements, clock = realigned(found.robot, found.measurements)
        found = found._replace(measurements=measurements)
        notes += [] if clock is None else [f"aligned again after this: {clock}"]
    if found.counted:
        notes.append("what a reading of the winches counts is known only roughly")
    return read._replace(measurements=found.measurements, notes=notes), found


def correction_of(robot: Robot, measurements: Measurements) -> Correction:
    """Return measurements and their robot without probable input errors; raise InputError as `corrected`."""
    robot, texts, counted = as_robot(robot), list[str](), False
    columns = np.arange(robot.m)
    for _ in range(MOST_MISTAKES):
        found = mistake(robot, measurements)
        if found is None:
            break
        if found.corrected is None:
            raise InputError(f"measurements must have one probable error that is known, got: {found.text}")
        texts.append(found.text)
        sizes = np.broadcast_to(found.factors, robot.m)
        columns = columns if found.columns is None else columns[found.columns]
        counted |= not set(np.abs(sizes).tolist()) <= {1.0, *FACTORS}
        measurements = found.corrected.changed(lengths=found.corrected.lengths / sizes)
        robot = _scaled(robot, sizes)
    return Correction(robot, measurements, texts, counted, columns)


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
