"""Robot files: the library that ships with towline, and any YAML file of the same form."""

import difflib
import os
from functools import cache
from pathlib import Path
from typing import TypeAlias

from ..base.inputs import InputError, file_path, shown
from .library import FOLDER, available
from .parsing import read_yaml
from .robot import Robot

AnyRobot: TypeAlias = Robot | str | os.PathLike[str]
"""A robot, the name of one in the library, or the path of a robot file."""


def load(name: str | os.PathLike[str]) -> Robot:
    """Load a robot of the library by its `name`, one of `available()`, or any YAML file by its path.

    Raises:
        InputError: If there is no such robot or file, or the file is not a valid robot: one line with file, field and
            value.
    """
    path = file_path("robot", name, "a name of the library or the path of a YAML file")
    text = os.fspath(name)
    if text in available():
        return _of_library(text)
    if path.suffix in (".yaml", ".yml") or _exists(path):
        return read_yaml(path, Robot)
    close = difflib.get_close_matches(text, available(), n=1)
    if close:
        hint = f"did you mean {close[0]!r}? `towline robots` lists all"
        raise InputError(f"no robot {shown(text)} in the library; {hint}")
    raise InputError(f"no robot or file {shown(text)}; `towline robots` lists the library")


def as_robot(robot: object) -> Robot:
    """Return a robot as it is, or load it by its name or path.

    Raises `InputError` if it is neither, or `load` refuses it.
    """
    if isinstance(robot, Robot):
        return robot
    if isinstance(robot, str | os.PathLike):
        return load(robot)
    raise InputError(f"robot must be a Robot, a name of the library or the path of a robot file, got {shown(robot)}")


@cache  # a robot cannot be changed, and reading one takes 5 to 15 ms
def _of_library(name: str) -> Robot:
    return read_yaml(FOLDER / f"{name}.yaml", Robot)


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # too long for a file name, or with a NUL in it: no file has that name
        return False
