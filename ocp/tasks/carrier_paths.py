"""Paths of carriers, given by their names: whose they are, and whether they can be followed."""

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
    """The same paths by the index of their carrier; `field` is what a message names.

    Raises
    ------
    InputError
        If a name is unknown or that of a carrier that never moves, or a path is not one in {G}.
    """
    names = [carrier.name for carrier in robot.carriers]
    found = {}
    for name, path in paths.items():
        if name not in names:
            raise InputError(f"{field}: carrier {name!r} is unknown; accepted: {', '.join(names)}")
        if robot.carriers[names.index(name)].kind == "ground":
            raise InputError(f"{field}: carrier {name!r} is of kind ground and never moves")
        if path.frame != "world":
            raise InputError(f"{field}.{name}.frame: {path.frame!r}; accepted: world")
        found[names.index(name)] = path
    return found
