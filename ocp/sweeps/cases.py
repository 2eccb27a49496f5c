"""`Cases`: the robot and the task of each plan of a sweep, for all combinations of the varied values."""

from math import prod
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...models import Robot
from ...models.parsing import validate
from ..tasks.lay_out import lay_out
from ..tasks.task import Task
from .axis import Axis


class Cases:
    """The combinations of values of `axes`, numbered from 0 with the last axis fastest.

    `robot` and `task` are those without variation, `shape` has the number of values of each axis.
    """

    def __init__(self, robot: Robot, task: Task, axes: tuple[Axis, ...]):
        self.robot, self.task, self.axes = robot, task, axes
        self.shape = tuple(len(axis.values) for axis in axes)
        self._data = task.model_dump(exclude_unset=True)
        for key, own in (("limits", task.limits.own), ("objective", task.objective.own)):
            if own:
                self._data.setdefault(key, {})["own"] = own
        self._robots: dict[tuple[int, ...], Robot] = {}

    def __len__(self) -> int:
        """Return the number of combinations."""
        return prod(self.shape)

    def places(self, number: int) -> list[tuple[Axis, int]]:
        """Return each axis with the index of its value in a combination."""
        indices = np.unravel_index(number, self.shape)
        return [(axis, int(index)) for axis, index in zip(self.axes, indices, strict=True)]

    def described(self, number: int) -> str:
        """Return the values of a combination as text: "margin = 5, duration = 4"."""
        return ", ".join(f"{axis.field.key} = {axis.texts[index]}" for axis, index in self.places(number))

    def case(self, number: int) -> tuple[Robot, Task]:
        """Return robot and task of a combination, validated like a robot and task file.

        Raises `InputError` if the values are not valid.
        """
        data, of_robot = self._data, list[tuple[Axis, int]]()
        for axis, index in self.places(number):
            if axis.field.of_robot:
                of_robot.append((axis, index))
            else:
                data = axis.field.set(data, axis.values[index])
        return self._robot(of_robot), validate(data, Task, f"task {self.task.name!r}")

    def _robot(self, varied: list[tuple[Axis, int]]) -> Robot:
        if not varied:
            return self.robot
        place = tuple(index for _, index in varied)
        if place not in self._robots:
            data: Any = self.robot.model_dump(exclude_unset=True)
            for axis, index in varied:
                data = axis.field.set(data, axis.values[index])
            self._robots[place] = validate(data, Robot, f"robot {self.robot.name!r}")
        return self._robots[place]

    def check(self) -> None:
        """Check every combination: whether the values are valid and the task fits the robot.

        Raises `InputError` for the first one that is wrong, with its values.
        """
        for number in range(len(self)):
            try:
                lay_out(*self.case(number))
            except InputError as error:
                raise InputError(f"{error} (with {self.described(number)})") from None

    def units(self) -> tuple[str, ...]:
        """Return the unit of each varied field; empty without a unit."""
        robot, task = self.case(0)
        return tuple(axis.field.unit(robot if axis.field.of_robot else task) for axis in self.axes)
