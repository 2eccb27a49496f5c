"""The default `drive` of a robot, and the lengths of cables of fixed length."""

from collections.abc import Iterable

import numpy as np

from .cable import Cable
from .carriers import Carrier, Drive


def usual_drive(carriers: Iterable[Carrier], cables: Iterable[Cable]) -> Drive:
    """Return the drive of a robot whose file has none, from its cables and the carriers that hold these.

    Cables keep their lengths if all hang from carriers that move them about, such as quadrotors, and none has a winch,
    or an encoder or a pulley, which belong to one. All others have winches.
    """
    towed = all(carrier.tows for carrier in carriers)
    winches = any(part is not None for cable in cables for part in (cable.winch, cable.encoder, cable.pulley))
    return "fixed-length" if towed and not winches else "both"


def lengths_to_keep(cables: tuple[Cable, ...], at_home: np.ndarray) -> tuple[Cable, ...]:
    """Return the cables of a robot with fixed lengths; one without a length has its distance at home, (m,) [m].

    Raises `ValueError` if a cable without a length runs over a pulley.
    """
    for index, cable in enumerate(cables):
        if cable.length is None and cable.pulley is not None:
            raise ValueError(
                f"cables[{index}].length must be a number > 0 [m] if drive is fixed-length and the cable has a pulley, "
                "got none"
            )
    return tuple(
        cable if cable.length is not None else cable.model_copy(update={"length": float(length)})
        for cable, length in zip(cables, at_home, strict=True)
    )
