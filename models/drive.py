"""What moves a robot whose file does not state its `drive`: winches or carriers, and which lengths cables keep."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .carriers import Drive

if TYPE_CHECKING:
    from .robot import Cable, Robot

__all__ = ["lengths_to_keep", "usual_drive"]


def usual_drive(robot: Robot) -> Drive:
    """Return the drive of a robot whose file has none.

    Cables keep their lengths if all hang from carriers that move them about, such as quadrotors, and none has a winch,
    or an encoder or a pulley, which belong to one. All others have winches.
    """
    towed = all(robot.carriers[index].tows for index in robot.carrier_of_cable)
    winches = any(part is not None for cable in robot.cables for part in (cable.winch, cable.encoder, cable.pulley))
    return "fixed-length" if towed and not winches else "both"


def lengths_to_keep(robot: Robot, at_home: np.ndarray) -> tuple[Cable, ...]:
    """Return the cables of a robot with fixed lengths; one without a length has its distance at home, (m,) [m].

    Raises
    ------
    ValueError
        If a cable without a length runs over a pulley.
    """
    for index, cable in enumerate(robot.cables):
        if cable.length is None and cable.pulley is not None:
            raise ValueError(
                f"cables[{index}].length must be a number > 0 [m] if drive is fixed-length and the cable has a pulley, "
                "got none"
            )
    return tuple(
        cable if cable.length is not None else cable.model_copy(update={"length": float(length)})
        for cable, length in zip(robot.cables, at_home, strict=True)
    )
