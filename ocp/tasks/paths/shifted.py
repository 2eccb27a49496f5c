"""`shifted`: a path, moved in its frame without turning it."""

from typing import Any, TypeVar

import numpy as np

from .base import PathBase

POINT, POINTS, PATHS = ("start", "end", "pose", "centre"), ("points", "poses"), ("path", "along")
AnyKind = TypeVar("AnyKind", bound=PathBase)


def shifted(path: AnyKind, by: np.ndarray) -> AnyKind:
    """Return the path moved by (3,) [m] along the axes of its frame."""
    return path.__class__.model_validate(_moved(path.model_dump(), by))


def _moved(fields: dict[str, Any], by: np.ndarray) -> dict[str, Any]:
    """Return the fields of a path with all its positions moved, those of paths inside it too."""
    moved = dict(fields)
    for name, value in fields.items():
        if name in POINT and isinstance(value, list | tuple):  # the start of a path that returns is a time
            moved[name] = _point(value, by)
        elif name in POINTS:
            moved[name] = [_point(point, by) for point in value]
        elif name in PATHS:
            moved[name] = _moved(value, by)
        elif name == "parts":
            moved[name] = [part | {"path": _moved(part["path"], by)} for part in value]
    return moved


def _point(point: list[float] | tuple[float, ...], by: np.ndarray) -> list[float]:
    return [*(np.array(point[:3]) + by).tolist(), *point[3:]]
