"""`Variables`: the free numbers of a robot as one vector inside bounds, and the robots that vectors stand for."""

from dataclasses import dataclass, replace

import numpy as np

from ..base.inputs import InputError, shown
from ..models import Robot
from .requirements import MOST_PAIRED, POINTS, Free, Requirements

_AXES, PARTS = "xyz", ("anchor", "attachment", "t_min", "t_max")
# A flat available wrench set has the margin 0, and a rounding error makes that positive.
LEAST_MARGIN, LEAST_SHARE = 1.0, 0.01  # [N], or of the force scale if that is less


@dataclass(frozen=True)
class Variables:
    """Maps variables y to the layout z = fixed + S y: anchors (3 m), attachments (3 m), t_min (m) and t_max (m)."""

    robot: Robot
    S: np.ndarray  # (8 m, p), 1, -1 or 0
    fixed: np.ndarray  # what does not change, (8 m,)
    low: np.ndarray  # bounds of the variables, (p,)
    high: np.ndarray  # (p,)
    names: tuple[str, ...]  # of the variables, such as "cables[2].anchor.x"
    points: tuple[np.ndarray, ...]  # variables that are one point or one tension limit, and move together

    @property
    def size(self) -> int:
        """Return the number of variables."""
        return self.low.size

    @property
    def limits(self) -> np.ndarray:
        """Return which variables are tension limits, (p,)."""
        return np.abs(self.S[6 * self.robot.m :]).sum(axis=0) > 0.0

    def with_points_held(self, y: np.ndarray) -> "Variables":
        """Return these variables with the points fixed at their values in y, (p,); the tension limits stay free."""
        low, high = (np.where(self.limits, bound, y) for bound in (self.low, self.high))
        return replace(self, low=low, high=high)

    def layout(self, y: np.ndarray) -> np.ndarray:
        """Return the layout, (8 m,)."""
        return self.fixed + self.S @ y

    def of_robot(self) -> np.ndarray:
        """Return the variables of the robot itself, moved inside the bounds, (p,)."""
        first = self.S.argmax(axis=0)  # a row with the value of the variable itself
        return np.clip(_layout_of(self.robot)[first], self.low, self.high)

    def robot_at(self, y: np.ndarray) -> Robot:
        """Return the robot with the numbers of a vector.

        Raises `InputError` if no such robot exists.
        """
        numbers = dict(zip(PARTS, parts(self.layout(y), self.robot.m), strict=True))
        data = self.robot.model_dump()
        cables = [
            cable | {name: values[i].tolist() for name, values in numbers.items()}
            for i, cable in enumerate(data["cables"])
        ]
        return Robot.model_validate({**data, "cables": cables})


def parts(layout: np.ndarray, m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return anchors (m, 3), attachments (m, 3), t_min (m,) and t_max (m,) of a layout."""
    return layout[: 3 * m].reshape(m, 3), layout[3 * m : 6 * m].reshape(m, 3), layout[6 * m : 7 * m], layout[7 * m :]


def by_cable(layout: np.ndarray, m: int) -> np.ndarray:
    """Return the numbers of each cable: anchor, attachment, t_min and t_max, (m, 8)."""
    return np.column_stack(parts(layout, m))


def variables_of(robot: Robot, requirements: Requirements) -> Variables:
    """Return the variables of the free numbers of a robot.

    Raises `InputError` if the requirements do not fit the robot.
    """
    _check(robot, requirements)
    fixed, column_of = _layout_of(robot), {}
    low: list[float] = []
    high: list[float] = []
    names: list[str] = []
    points: list[np.ndarray] = []
    for free in requirements.free:
        if free.copy_of is not None or free.pairing:
            continue
        box = free.box or free.range  # of a point, or of a tension limit
        assert box is not None
        low_high = np.atleast_1d(box.min).tolist(), np.atleast_1d(box.max).tolist()
        for number, cable in enumerate(free.cables or range(1, robot.m + 1)):
            rows = _rows(free.part, cable, robot.m)
            if number == 0 or not free.equal:
                start = len(low)
                low += low_high[0]
                high += low_high[1]
                names += [f"cables[{cable - 1}].{free.part}{suffix}" for suffix in _suffixes(free)]
                points.append(np.arange(start, len(low)))
            column_of |= {row: (column, 1.0) for row, column in zip(rows, points[-1], strict=True)}
    for free in requirements.free:
        for cable, source in zip(free.cables or (), free.copy_of or (), strict=True) if free.copy_of else ():
            signs = [-1.0 if suffix == f".{free.mirrored}" else 1.0 for suffix in _suffixes(free)]
            pairs = zip(_rows(free.part, cable, robot.m), _rows(free.part, source, robot.m), signs, strict=True)
            for row, original, sign in pairs:
                if original in column_of:
                    column_of[row] = (column_of[original][0], sign)
                else:
                    fixed[row] = sign * fixed[original]
    S = np.zeros((fixed.size, len(low)))
    for row, (column, sign) in column_of.items():
        S[row, column], fixed[row] = sign, 0.0
    found = Variables(robot, S, fixed, np.array(low), np.array(high), tuple(names), tuple(points))
    if requirements.maximise == "natural_frequency" or requirements.natural_frequency is not None:
        _check_elastic(robot, parts(found.layout(found.low), robot.m)[2])
    t_min = parts(found.fixed + np.maximum(S, 0) @ found.high, robot.m)[2]
    lowest = parts(found.layout(found.low), robot.m)[3]
    if not (t_min < lowest).all():
        cable = int(np.argmin(lowest - t_min))
        raise InputError(
            f"free must keep t_min of cable {cable + 1} below its t_max, got t_min up to {t_min[cable]:g} N "
            f"and t_max from {lowest[cable]:g} N"
        )
    return found


def _check(robot: Robot, requirements: Requirements) -> None:
    """Raise InputError if requirements do not fit a robot: its size, its cables, or a number that is free twice."""
    least = min(LEAST_MARGIN, LEAST_SHARE * robot.force_scale)
    if requirements.margin < least:
        raise InputError(f"margin must be at least {least:g} N for robot {robot.name!r}, got {requirements.margin:g} N")
    taken: dict[tuple[str, int], int] = {}
    for number, free in enumerate(requirements.free):
        where = f"free[{number}]"
        if free.pairing and (count := len(free.cables or range(robot.m))) > MOST_PAIRED:
            raise InputError(f"{where}.cables must be at most {MOST_PAIRED} for a pairing, got {count}")
        for name in ("cables", "copy_of"):
            for cable in getattr(free, name) or ():
                if cable > robot.m:
                    raise InputError(f"{where}.{name} must be cables of the robot, 1 to {robot.m}, got {shown(cable)}")
        for cable in free.cables or range(1, robot.m + 1):
            if (free.part, cable) in taken:
                first = taken[free.part, cable]
                raise InputError(f"{where} must not free {free.part} of cable {cable}, as free[{first}] does")
            taken[free.part, cable] = number
    for number, free in enumerate(requirements.free):
        for cable in free.copy_of or ():
            source = taken.get((free.part, cable))
            if source is not None and requirements.free[source].copy_of is not None:
                raise InputError(f"free[{number}].copy_of must name cables that are not copies themselves, got {cable}")


def _check_elastic(robot: Robot, lowest: np.ndarray) -> None:
    """Raise InputError if a cable has no stiffness, or may have no tension (m,), and so no stiffness either."""
    for index, cable in enumerate(robot.cables):
        if cable.stiffness is None:
            raise InputError(
                f"cables[{index}].stiffness must be given for natural_frequency, got none in robot {robot.name!r}"
            )
        if not lowest[index] > 0.0:
            raise InputError(
                f"t_min of cable {index + 1} must be above 0 N for natural_frequency, as a cable without tension has "
                f"no stiffness, got {lowest[index]:g} N in robot {robot.name!r}"
            )


def _layout_of(robot: Robot) -> np.ndarray:
    return np.concatenate([robot.anchors.ravel(), robot.attachments.ravel(), robot.t_min, robot.t_max])


def _suffixes(free: Free) -> list[str]:
    return [f".{axis}" for axis in _AXES] if free.part in POINTS else [""]


def _rows(part: str, cable: int, m: int) -> list[int]:
    """Return the rows of a layout that a number of a cable has; cables are counted from 1."""
    if part in POINTS:
        start = 3 * (m * POINTS.index(part) + cable - 1)
        return [start, start + 1, start + 2]
    return [(6 if part == "t_min" else 7) * m + cable - 1]
