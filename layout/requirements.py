"""`Requirements`: what a design may change, and what it must be able to do."""

import os
from itertools import product
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from ..base.inputs import file_path
from ..models import Robot
from ..models.parsing import read_yaml, validate
from ..models.part import (
    Box,
    NonNegative,
    Part,
    Pose,
    Positive,
    PositiveRange,
    Range,
    Rows,
    Title,
    Vector3,
    Whole,
    optional,
)
from ..ocp.tasks.task import Task
from ..ocp.tasks.task_limits import AnyKeepOut

Wrench = Pose  # six finite numbers
NO_WRENCH: Wrench = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
Axis = Literal["x", "y", "z"]
Count = Annotated[Whole, Field(ge=1, le=100)]
CableNumber = Annotated[Whole, Field(ge=1)]
MOST_PAIRED = 8  # cables: 40 320 pairings
MOST_ROWS = 20_000  # poses times wrenches of all requirements, of each of which the search computes a margin
POINTS = ("anchor", "attachment")


class Free(Part):
    """Numbers of some cables that a design chooses: points in a box, or tension limits in a range."""

    part: Literal["anchor", "attachment", "t_min", "t_max"] = Field(description="kind of the numbers")
    cables: tuple[CableNumber, ...] | None = optional("cables, counted from 1; default: all", min_length=1)
    box: Box | None = optional(
        "for anchor and attachment: box of allowed points in the frame of carrier or platform [m]; equal "
        "bounds make it a face, a line or a point"
    )
    range: Range | None = optional("for t_min and t_max: smallest and largest value [N]")
    equal: bool = optional("true: the cables have one point or value in common", False)
    pairing: bool = optional(
        "true: for attachment, instead of a box: the cables exchange their attachments, and every pairing "
        "is compared; nothing else is free, and there are at most 8 cables",
        False,
    )
    copy_of: tuple[CableNumber, ...] | None = optional(
        "instead of box or range: one cable for each of `cables`, whose point or value is copied", min_length=1
    )
    mirrored: Axis | None = optional("with copy_of: the coordinate of the points whose sign is reversed; default: none")

    @model_validator(mode="after")
    def _where(self) -> Self:
        points = self.part in POINTS
        if self.pairing:
            if self.part != "attachment":
                raise ValueError(f"pairing must be left out for {self.part}: the attachments are exchanged")
            for name in ("box", "range", "copy_of", "mirrored", "equal"):
                if getattr(self, name):
                    raise ValueError(f"{name} must be left out with pairing")
            return self._with_different_cables()
        wanted, other = ("box", "range") if points else ("range", "box")
        if getattr(self, other) is not None:
            raise ValueError(f"{other} must be left out for {self.part}, which has a {wanted}")
        if (self.copy_of is None) == (getattr(self, wanted) is None):
            got = "neither" if self.copy_of is None else "both"
            raise ValueError(f"{wanted} or copy_of must be given for {self.part}, and not both, got {got}")
        if self.range is not None and self.range.min < 0.0:
            raise ValueError(f"range must not have negative tensions, got {self.range.min:g}")
        if self.mirrored is not None and (self.copy_of is None or not points):
            raise ValueError("mirrored must be left out without copy_of, and for tensions")
        if self.copy_of is not None and self.equal:
            raise ValueError("equal must be left out with copy_of")
        if self.copy_of is not None and (self.cables is None or len(self.cables) != len(self.copy_of)):
            count = "all" if self.cables is None else len(self.cables)
            raise ValueError(f"copy_of must name as many cables as `cables`, {count}, got {len(self.copy_of)}")
        return self._with_different_cables()

    def _with_different_cables(self) -> Self:
        for name, cables in (("cables", self.cables), ("copy_of", self.copy_of)):
            if cables is not None and len(set(cables)) < len(cables):
                raise ValueError(f"{name} must name each cable once, got {list(cables)}")
        return self


class Requirement(Part):
    """Poses at which the cables must balance wrenches; every combination of the lists is required."""

    box: Box | None = optional("box of positions of the platform in {G} [m]")
    grid: tuple[Count, Count, Count] = optional("with a box: numbers of positions along x, y and z", (7, 7, 5))
    attitudes: Rows[Vector3] = optional(
        "with a box: roll, pitch, yaw of the platform [rad]; default: level", ((0.0, 0.0, 0.0),)
    )
    poses: Rows[Pose] | None = optional("instead of a box: poses of the platform [m, rad]")
    wrenches: Rows[Wrench] = optional(
        "wrenches (fx, fy, fz, mx, my, mz) on the platform in addition to its weight, about its CoM "
        "[N, N m]; default: none",
        (NO_WRENCH,),
    )
    accelerations: Rows[Wrench] = optional(
        "accelerations of the platform: second derivatives of its pose [m/s^2, rad/s^2]; default: rest", (NO_WRENCH,)
    )
    winds: Rows[Vector3] | None = optional("velocities of the air in {G} [m/s]; default: no aerodynamic forces")

    @model_validator(mode="after")
    def _where(self) -> Self:
        if (self.box is None) == (self.poses is None):
            got = "neither" if self.box is None else "both"
            raise ValueError(f"box or poses must be given, and not both, got {got}")
        return self

    def places(self, grid: tuple[int, ...] | None = None) -> np.ndarray:
        """Return the poses, (N, 6) [m, rad]: the list, or a grid in the box (default: its own)."""
        if self.box is None:
            return np.array(self.poses)
        axes = [
            np.linspace(low, high, count) if count > 1 and low < high else np.array([(low + high) / 2])
            for low, high, count in zip(self.box.min, self.box.max, grid or self.grid, strict=True)
        ]
        return np.array([(*position, *attitude) for attitude in self.attitudes for position in product(*axes)])

    def sampled(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Return random poses in the box with its attitudes, (count, 6), or all poses of a list.

        A third of the values of each coordinate are at its bounds, where the worst poses often are.
        """
        if self.box is None:
            return np.array(self.poses)
        poses = np.empty((count, 6))
        low, high = np.array(self.box.min), np.array(self.box.max)
        beyond = (high - low) / 4
        poses[:, :3] = np.clip(rng.uniform(low - beyond, high + beyond, (count, 3)), low, high)
        poses[:, 3:] = np.array(self.attitudes)[rng.integers(len(self.attitudes), size=count)]
        return poses

    @property
    def demands(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray | None]]:
        """Return every combination of wrench, acceleration and wind."""
        winds = [None] if self.winds is None else [np.array(wind) for wind in self.winds]
        return [(np.array(w), np.array(a), wind) for w, a, wind in product(self.wrenches, self.accelerations, winds)]

    @property
    def size(self) -> int:
        """Return the number of pairs of pose and wrench."""
        poses = len(self.attitudes) * int(np.prod(self.grid)) if self.poses is None else len(self.poses)
        return poses * len(self.wrenches) * len(self.accelerations) * len(self.winds or (0,))


class Prices(Part):
    """Prices of cables and winches, in any currency."""

    cable: NonNegative = optional(
        "price of a metre of cable; the length of a cable is its largest one at the required positions", 0.0
    )
    t_max: NonNegative = optional("price of a newton of the t_max of one cable", 0.0)

    def cost(self, robot: Robot, cable: float) -> float:
        """Return what the winches of a robot and a length of cable [m] cost."""
        return self.t_max * float(robot.t_max.sum()) + self.cable * cable


class Requirements(Part):
    """Requirements of a design: what is free, poses and wrenches. A requirement file is YAML with these keys."""

    name: Title = optional("name of the requirements, for reports and file names", "design")
    free: Annotated[tuple[Free, ...], Field(min_length=1, max_length=200)] = Field(
        description="numbers of the robot that the design chooses; all others keep the values of its file"
    )
    require: Annotated[tuple[Requirement, ...], Field(min_length=1, max_length=200)] = Field(
        description="poses and the wrenches to balance there"
    )
    tasks: Annotated[tuple[Task, ...], Field(max_length=20)] = optional(
        "tasks, with the keys of task files, for each of which the resulting robot must have a feasible "
        "plan; default: none",
        (),
    )
    margin: Positive = optional(
        "smallest accepted capacity margin, with moments divided by the `length` of the robot's file; default: 1 N, "
        "or 10 % of the robot's weight if that is less [N]",
        1.0,
    )
    clearance: NonNegative = optional("smallest distance between two cables [m]; 0: no limit", 0.0)
    keep_out: Annotated[tuple[AnyKeepOut, ...], Field(max_length=20)] = optional(
        "regions, with the keys of task files, from which the cables keep the distance `cables` at the "
        "required positions; default: none",
        (),
    )
    cable_platform_clearance: Positive | None = optional(
        "smallest distance of cables from the platform's body [m]; default: no limit"
    )
    cable_floor_clearance: NonNegative | None = optional(
        "smallest height of cables above the robot's floor [m]; default: no limit"
    )
    natural_frequency: Positive | None = optional(
        "smallest accepted natural frequency of the platform on elastic cables, with the tensions of least "
        "norm that balance each required wrench [Hz]; default: no limit"
    )
    cable_length: PositiveRange | None = optional(
        "shortest and longest length that the winches can give a cable, at the required positions [m]; "
        "default: no limit"
    )
    maximise: Literal["margin", "natural_frequency", "volume"] = optional(
        "objective: the smallest capacity margin; or, with at least the margin `margin`, the lowest "
        "natural frequency, or the volume of the required boxes, which grow about their centres",
        "margin",
    )
    minimise: Literal["t_max", "cost"] | None = optional(
        "objective instead, with at least the margin `margin`: the mean t_max of the cables, which must be "
        "free, or the cost of cables and winches"
    )
    prices: Prices | None = optional("for minimise: cost, the prices of cables and winches")
    start: Literal["robot", "random"] = optional(
        "first layout: the robot's own, moved into the boxes, or a random one", "robot"
    )
    time_limit: Positive = optional("time of the search [s]; the last audit is finished first", 10.0)
    seed: Annotated[Whole, Field(ge=0, le=2**32 - 1)] = optional("seed of the random numbers", 0)

    @model_validator(mode="after")
    def _not_too_many(self) -> Self:
        if len(self.free) > 1 and any(each.pairing for each in self.free):
            raise ValueError(f"free must have no item besides a pairing, got {len(self.free) - 1} more")
        self._check_objective()
        for number, place in enumerate(self.keep_out):
            for name in ("platform", "carriers"):
                value = getattr(place, name)
                if value != type(place).model_fields[name].default:
                    raise ValueError(f"keep_out[{number}].{name} must be left out: a design places cables, got {value}")
        size = sum(each.size for each in self.require)
        if size > MOST_ROWS:
            raise ValueError(f"require must have at most {MOST_ROWS} pairs of pose and wrench, got {size}")
        return self

    def _check_objective(self) -> None:
        """Raise ValueError if something is missing for the objective, or contradicts it."""
        winches = any(each.part == "t_max" for each in self.free)
        if self.minimise == "t_max" and not winches:
            raise ValueError("free must have an item with part t_max for minimise: t_max, got none")
        if (self.minimise == "cost") != (self.prices is not None):
            wanted = "given for" if self.prices is None else "left out without"
            raise ValueError(f"prices must be {wanted} minimise: cost")
        if self.prices is not None and not (self.prices.cable > 0.0 or (winches and self.prices.t_max > 0.0)):
            raise ValueError("prices must have one above 0 of something that is free: cable, or t_max if it is free")
        if self.maximise != "margin" and self.minimise is not None:
            raise ValueError(f"maximise must be left out with minimise, got {self.maximise!r}")
        for name, usual in (("maximise", "margin"), ("minimise", None)):
            if getattr(self, name) != usual and any(each.pairing for each in self.free):
                wanted = "margin" if usual else "left out"
                raise ValueError(f"{name} must be {wanted} with a pairing, got {getattr(self, name)!r}")
        boxes = [each.box for each in self.require if each.box is not None]
        if self.maximise == "volume" and not any(box.min != box.max for box in boxes):
            raise ValueError("require must have a box with an extent for maximise: volume, got none")


def read_requirements(requirements: Requirements | dict[str, Any] | str | os.PathLike[str]) -> Requirements:
    """Return `Requirements` from requirements, a mapping or a YAML file.

    Raises `InputError` if they are invalid; the message names the field, the accepted values and the value.
    """
    if isinstance(requirements, Requirements):
        return requirements
    if isinstance(requirements, dict):
        return validate(requirements, Requirements, "requirements")
    accepted = "Requirements, a mapping or the path of a YAML file"
    return read_yaml(file_path("requirements", requirements, accepted), Requirements)
