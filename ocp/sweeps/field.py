"""`Field`: a field of a task or of its robot, by its dotted key; it can be set, and knows its unit."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ...base.display import Displayed
from ...base.errors import InputError
from ...base.inputs import shown

OF_ROBOT = "robot."  # begins the key of a field of the robot; a task has no field of that name
WHOLE = "robot", "task"  # keys whose values are whole robots or tasks, by name or file
_KEY = re.compile(r"[A-Za-z_][\w-]*(\[\d+\])*(\.[A-Za-z_][\w-]*(\[\d+\])*)*")
_STEP = re.compile(r"[^.\[\]]+")
_UNIT = re.compile(r"\[([^\]]+)\]")  # in the description of a field


@dataclass(frozen=True)
class Field(Displayed):
    """A field of a task, such as `tube.position`, or of the robot, such as `robot.platform.mass`.

    Items of lists have numbers from 0 on, as in `limits.keep_out[0].radius`; without a number all items are meant, as
    in `robot.cables.t_max`. `robot` and `task` are the whole of each.
    """

    key: str

    @classmethod
    def of(cls, key: object) -> Field:
        """Return the field of a key.

        Raises `InputError` if it is no dotted key.
        """
        if not isinstance(key, str) or not _KEY.fullmatch(key):
            accepted = "dotted keys of a task file, such as tube.position"
            raise InputError(f"vary must have {accepted}, got the key {shown(key)}")
        return cls(key)

    @property
    def of_robot(self) -> bool:
        """Return whether it is a field of the robot, and not of the task."""
        return self.key == "robot" or self.key.startswith(OF_ROBOT)

    @property
    def whole(self) -> bool:
        """Return whether its values are whole robots or tasks."""
        return self.key in WHOLE

    @property
    def name(self) -> str:
        """Return its name in tables: the varied `task.margin` is not the `margin` of a plan."""
        return self.key if self.of_robot or self.whole else f"task.{self.key}"

    @property
    def steps(self) -> tuple[str | int, ...]:
        """Return the keys and numbers that lead to it."""
        steps = _STEP.findall(self.key.removeprefix(OF_ROBOT))
        return tuple(int(step) if step.isdecimal() else step for step in steps)

    def holds(self, other: Field) -> bool:
        """Return whether the other field is this one or a part of it; of a whole robot or task fields can vary too."""
        if self.whole or other.whole:
            return self == other
        return other.steps[: len(self.steps)] == self.steps and other.of_robot == self.of_robot

    def set(self, data: Any, value: Any) -> Any:
        """Return data of a task or robot with another value of this field.

        Raises `InputError` if the data have no such place.
        """
        return self._set(data, self.steps, value, ())

    def _set(self, data: Any, left: tuple[str | int, ...], value: Any, done: tuple[str | int, ...]) -> Any:
        if not left:
            return value
        step, rest = left[0], left[1:]
        if isinstance(data, list | tuple):
            if isinstance(step, str):
                return [self._set(item, left, value, done) for item in data]
            if step < len(data):
                changed = self._set(data[step], rest, value, (*done, step))
                return [*data[:step], changed, *data[step + 1 :]]
        if isinstance(step, int):
            items = len(data) if isinstance(data, list | tuple) else 0
            raise InputError(f"vary {self.key}: {_dotted(done)} must have an item {step}, got {items} items")
        if data is not None and not isinstance(data, Mapping):
            raise InputError(f"vary {self.key}: {_dotted(done)} must be a mapping, got {shown(data)}")
        block = data or {}
        return {**block, step: self._set(block.get(step), rest, value, (*done, step))}

    def unit(self, part: Any) -> str:
        """Return the field's unit from its description, in a task or robot; empty if it has none."""
        description, step = "", ""
        for step in () if self.whole else self.steps:
            if isinstance(step, int):
                part = part[step]  # an item has its list's unit
                continue
            if isinstance(part, tuple):
                part = part[0]
            if isinstance(part, dict):
                description, part = "", part[step]
            else:
                description, part = type(part).model_fields[step].description or "", getattr(part, step)
        found = _UNIT.search(description)
        units = found[1].split(", ") if found else [""]
        # Of a pose: lengths, then angles.
        return units[step >= 3] if len(units) == 2 and isinstance(step, int) else ", ".join(units)


def _dotted(steps: tuple[str | int, ...]) -> str:
    return "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).removeprefix(".")
