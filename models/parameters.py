"""Names of the parameters of cables, such as `cables[2].anchor.x`.

    cables[i].anchor.x  .y  .z            of the anchor in the frame of its carrier [m]
    cables[i].attachment.x  .y  .z        of the attachment in the platform frame [m]
    cables[i].pulley.radius               of the sheave [m]
    cables[i].encoder.offset  .scale  .build_up   from the reading of the winch to the length [m, -, 1/m]

Cables count from 0, as in error messages about robot files.
"""

import re
from typing import NamedTuple

from ..base.inputs import InputError, shown
from .cable import Cable

FORMS = (
    "cables[i].anchor.x, cables[i].attachment.x (or .y, .z), cables[i].pulley.radius or "
    "cables[i].encoder.offset (or .scale, .build_up)"
)
ENCODER = ("offset", "scale", "build_up")
_NAME = re.compile(
    r"cables\[(0|[1-9][0-9]{0,5})\]\.(?:(anchor|attachment)\.([xyz])|pulley\.radius|encoder\.(offset|scale|build_up))"
)


class Parameter(NamedTuple):
    """A number of one cable: of its anchor, attachment or encoder, (3,), or the radius of its pulley."""

    cable: int
    part: str  # anchor, attachment, encoder or radius
    axis: int  # 0 of a radius


def locate(name: object, cables: tuple[Cable, ...] | None = None) -> Parameter:
    """Return which number a name stands for.

    Raises `ValueError` if it is not such a name or, if `cables` are given, they have no such number: "must be ...,
    got ...".
    """
    match = _NAME.fullmatch(name) if isinstance(name, str) else None
    if match is None:
        raise ValueError(f"must be like {FORMS}, got {shown(name)}")
    cable, part, axis = int(match[1]), match[2] or ("encoder" if match[4] else "radius"), "xyz".index(match[3] or "x")
    if match[4]:
        axis = ENCODER.index(match[4])
    if cables is not None and cable >= len(cables):
        raise ValueError(f"must be of a cable from 0 to {len(cables) - 1}, got {shown(name)}")
    if cables is not None and part == "radius" and cables[cable].pulley is None:
        raise ValueError(f"must be of a cable with a pulley, got {shown(name)}")
    if cables is not None and part == "encoder" and cables[cable].encoder is None:
        raise ValueError(f"must be of a cable with an encoder, got {shown(name)}")
    return Parameter(cable, part, axis)


def located(field: str, name: object, cables: tuple[Cable, ...]) -> Parameter:
    """Return which number of the cables a name stands for, or raise InputError that names the field."""
    try:
        return locate(name, cables)
    except ValueError as error:
        raise InputError(f"{field} {error}") from None
