"""Another path of the same form: moved in its frame (`shifted`), or shrunk towards a pose (`shrunk`)."""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from .base import PathBase

POINT, POINTS, PATHS = ("start", "end", "pose", "centre"), ("points", "poses"), ("path", "along")
AnyKind = TypeVar("AnyKind", bound=PathBase)


def shifted(path: AnyKind, by: np.ndarray) -> AnyKind:
    """Return the path moved by (3,) [m] along the axes of its frame, without turning it."""
    return path.__class__.model_validate(_moved(path.model_dump(), lambda point: [*(point[:3] + by), *point[3:]]))


def shrunk(path: AnyKind, towards: np.ndarray, share: float) -> AnyKind:
    """Return the path whose poses, and the radius of a circle, have this share of their distances from a pose (6,)."""

    def nearer(point: np.ndarray) -> list[float]:
        there = towards[: len(point)]
        return list(there + share * (point - there))

    fields = _moved(path.model_dump(), nearer)
    return path.__class__.model_validate(fields | ({"radius": share * fields["radius"]} if "radius" in fields else {}))


def _moved(fields: dict[str, Any], move: Callable[[np.ndarray], list[float]]) -> dict[str, Any]:
    """Return the fields of a path with all its positions or poses moved, those of paths inside it too."""
    moved = dict(fields)
    for name, value in fields.items():
        if name in POINT and isinstance(value, list | tuple):  # the start of a path that returns is a time
            moved[name] = move(np.array(value))
        elif name in POINTS:
            moved[name] = [move(np.array(point)) for point in value]
        elif name in PATHS:
            moved[name] = _moved(value, move)
        elif name == "parts":
            moved[name] = [part | {"path": _moved(part["path"], move)} for part in value]
    return moved
