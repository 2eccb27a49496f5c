"""`carrier_paths`: the paths that a task gives to carriers, checked, by the index of the carrier."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, TypeVar

from ...errors import InputError
from ...models import Robot
from .path import AnyPath, RestPath
from .task import GivenBase, HoldBase, Task

__all__ = ["by_index", "carrier_paths"]


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


def carrier_paths(robot: Robot, task: Task) -> dict[int, AnyPath]:
    """Return the carriers' reference paths by the index of the carrier; the others stay at home.

    Raises
    ------
    InputError
        As `by_index` does.
    """
    base = task.base
    if isinstance(base, HoldBase):
        paths: dict[str, AnyPath] = {name: RestPath(kind="rest", pose=pose) for name, pose in base.poses.items()}
        field = "poses"
    elif isinstance(base, GivenBase):
        paths, field = base.paths, "paths"
    else:
        paths, field = base.around, "around"
    return by_index(robot, paths, f"task {task.name!r}: base.{field}")
