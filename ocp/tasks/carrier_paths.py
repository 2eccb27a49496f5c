"""`by_index`: the paths that a task gives to carriers, checked, by the index of the carrier."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeVar

from ...errors import InputError
from ...models import Robot

__all__ = ["by_index"]


class _Framed(Protocol):
    @property
    def frame(self) -> str: ...


Framed = TypeVar("Framed", bound=_Framed)


def by_index(robot: Robot, paths: Mapping[str, Framed], field: str) -> dict[int, Framed]:
    """Return paths given by the names of carriers by the index of their carrier; a message names `field`.

    Raises
    ------
    InputError
        If a name is unknown or that of a carrier that never moves, or if a path is not given in {G}.
    """
    names = [carrier.name for carrier in robot.carriers]
    paths_by_index = {}
    for name, path in paths.items():
        if name not in names:
            raise InputError(f"{field} must name carriers of the robot ({', '.join(names)}), got {name!r}")
        carrier = robot.carriers[names.index(name)]
        if not carrier.moves:
            raise InputError(f"{field} must name carriers that move, got {name!r}, which is of kind {carrier.kind}")
        if path.frame != "world":
            raise InputError(f"{field}.{name}.frame must be world, got {path.frame!r}")
        paths_by_index[names.index(name)] = path
    return paths_by_index
