"""`Limit`: values that stay between bounds along a whole motion, and the forms that program, audit and figure use.

A limit is one formula, `values`, of the state at one instant (`State`). The program imposes it at its nodes and, if the
limit has a `Hull`, at the Bernstein points of each interval, so that it also holds between the nodes. The audit and the
figures evaluate the same formula on a dense grid. Subclasses for vectors (`Magnitude`), angles (`Angle`) and rates of
change (`Rate`) derive differentiable rows and readable values from the formula.
"""

from abc import ABC, abstractmethod
from copy import copy
from typing import NamedTuple, Self

import casadi as ca
import numpy as np
from typing_extensions import override

from .state import State

# Share of the scale that the audit accepts beyond a bound. For angles it is 1e-6 rad: programs bound the cosine, which
# resolves a small angle to no better than this.
TOLERANCE = 1e-6
EQUATION_TOLERANCE = 1e-3  # of the scale: equations hold at the nodes, and between them nearly
RATE_TOLERANCE = 1e-3  # of the scale: the audited tensions are the planned ones but for the wrench's rest
LEAST_COSINE = 1e-4  # less of a cosine is no scale: of angles below a hundredth of a radian
ROUNDING = 1e-3  # of a bound: a norm is rounded by so much at zero, where it has a corner


class Hull(NamedTuple):
    """The only part of a motion on which a convex limit depends.

    The values have to be a linear expression of it (for a `Magnitude` the vector; for an `Angle` the cosine, up to
    90 degrees), so that the convex hull of the Bernstein points bounds them over an interval. While such a limit is
    hard, the program imposes it only if the planner is free to choose one of the coordinates.

    Attributes:
        carrier: Index of the carrier; None for the platform's offset from its path.
        order: 0: the pose, 1: the velocity, 2: the acceleration.
        coordinates: Coordinates on which the values depend: 0 to 5 for x, y, z, roll, pitch, yaw.
        at_ends: True if the program limits the points at the ends of an interval; False if bounds of its unknowns
            already do.
    """

    carrier: int | None
    order: int
    coordinates: tuple[int, ...]
    at_ends: bool = True


class Rows(NamedTuple):
    """Rows of a program: values (k, 1), and the bounds of each."""

    values: ca.SX
    low: float
    high: float


class Limit(ABC):
    """A limit: `values` stay from `low` to `high` along the whole motion. Subclass it for a limit of your own.

    Attributes:
        name: Name in tasks, audits, reports and figures.
        unit: Unit of values and bounds.
        labels: Subject of each value, (k,): "cable 3", "quad1".
        low, high: Bounds of each value; infinite: no bound.
        scale: Typical size in this unit: programs divide by it, and the audit's tolerance is proportional to it.
        soft: Excess that adds 1 to the objective, or None if the limit is hard. A task's `limits.soft` sets it by name.
        hull: The part of the motion on which a convex limit depends, so that it holds between the nodes too; else None.
        shown: True if figures and reports show it.
        per_metre: Largest change of a value while each point of the platform moves by at most one metre and all else is
            fixed; infinite if unknown, 1 for a distance. With it the planner proves that an obstacle blocks the way.
        thickness: For a distance from a keep-out region, its thickness [m]. A motion may jump over a thin region
            between two nodes, so the program also constrains the distance between them. Infinite for other limits.
        only_between: Whether `on_the_way` has values at places between the two instants, not at these.
        phases: Indices of the phases of the task in which it holds; None for all times.
    """

    name: str = "limit"
    unit: str = ""
    labels: tuple[str, ...] = ("platform",)
    low: float = -np.inf
    high: float = np.inf
    scale: float = 1.0
    soft: float | None = None
    hull: Hull | None = None
    shown: bool = True
    per_metre: float = np.inf
    thickness: float = np.inf
    only_between: bool = False
    phases: frozenset[int] | None = None

    @abstractmethod
    def values(self, state: State) -> ca.SX:
        """Return the values at one instant, (k, 1), as an expression of its symbols."""

    def on_the_way(self, first: State, second: State) -> ca.SX | None:
        """Return the smallest values while all points move straight from one instant to another, (k, 1).

        The program limits these values where a step may jump over a region. By default there are none, and it limits
        the values at its nodes; both where these are `only_between` the instants.
        """
        return None

    def rows(self, values: ca.SX, shrink: float = 0.0) -> Rows:
        """Return the limit as rows of a program, in units of `scale`, from its values (k, 1).

        If the limit `tightens`, its bounds move inwards by the part `shrink` of `scale`. The values do not change.
        """
        reserve = shrink * self.scale if self.tightens else 0.0
        return Rows(values / self.scale, (self.low + reserve) / self.scale, (self.high - reserve) / self.scale)

    def over(self, times: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return the limited values at `times` (n,) [s], (n, k), from the values at these times."""
        return values

    def share_beyond(self, value: float) -> float:
        """Return how far a value is beyond the bounds, in units of `scale`."""
        return max(self.low - value, value - self.high, 0.0) / self.scale

    def about(self, index: int) -> str:
        """Return the subject of value `index`, for messages."""
        return self.labels[index]

    def is_about(self, about: str) -> bool:
        """Return whether one of its values has this subject."""
        return any(self.about(index) == about for index in range(len(self.labels)))

    @property
    def title(self) -> str:
        """Return the name of its curves in a figure."""
        return self.name

    @property
    def tolerance(self) -> float:
        """Return the audit's tolerance beyond the bounds, in the unit of the values."""
        return self.scale * (EQUATION_TOLERANCE if self.is_equation and self.hull is None else TOLERANCE)

    @property
    def is_equation(self) -> bool:
        """Return whether it is an equation, which holds at the nodes, and between them only approximately."""
        return self.low == self.high

    @property
    def is_convex(self) -> bool:
        """Return whether the program imposes it on Bernstein points rather than on values at the nodes."""
        return self.hull is not None and self.soft is None

    @property
    def tightens(self) -> bool:
        """Return whether a program can tighten the bounds; False for equations and for convex limits of poses."""
        return not (self.is_equation or (self.is_convex and self.order == 0))

    @property
    def order(self) -> int:
        """Return the derivative of the pose that a convex limit bounds."""
        return 0 if self.hull is None else self.hull.order

    @property
    def slack_weight(self) -> float:
        """Return the excess, in units of `soft`, to which a slack variable of 1 in the program corresponds."""
        return 0.0 if self.soft is None else self.scale / self.soft

    def softened(self, amount: float | None) -> Self:
        """Return the limit as a soft one, with the excess that adds 1 to the objective; None leaves it unchanged."""
        if amount is None:
            return self
        soft = copy(self)
        soft.soft = amount
        return soft

    def during(self, phases: frozenset[int] | None) -> Self:
        """Return the limit as one that holds in some phases of the task, or, for None, at all times."""
        some = copy(self)
        some.phases = phases
        return some


class Magnitude(Limit):
    """A limit of the length of a vector: `values` are its components, `high` bounds their root sum square.

    A norm has a corner at zero, where a motion rests. At the nodes of a program the root is therefore taken of the sum
    plus a small square, which is added to the square of the bound as well. On Bernstein points the square is limited,
    which has no corner.
    """

    def __init__(self, most: float):
        self.high = self.scale = most

    @override
    def rows(self, values: ca.SX, shrink: float = 0.0) -> Rows:
        if self.is_convex:
            most = 1.0 - shrink if self.tightens else 1.0
            return Rows(ca.sumsqr(values) / self.high**2, -np.inf, most**2)
        rounding = ROUNDING * self.high
        size = ca.sqrt(ca.sumsqr(values) + rounding**2)
        return Rows(size / self.scale, 0.0, float(np.hypot(self.high - shrink * self.scale, rounding)) / self.scale)

    @override
    def over(self, times: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.linalg.norm(values, axis=1, keepdims=True)


class Angle(Limit):
    """A limit of an angle [rad]: `values` is its cosine, which has a derivative at zero too; `high` is the angle."""

    unit = "rad"

    def __init__(self, most: float):
        self.high = most

    @property
    @override
    def tightens(self) -> bool:
        return not self.is_convex

    @property
    def _least(self) -> float:
        return float(np.cos(self.high))

    @property
    def _change(self) -> float:
        """Return the change of the cosine up to the bound."""
        return max(1.0 - self._least, LEAST_COSINE)

    @override
    def rows(self, values: ca.SX, shrink: float = 0.0) -> Rows:
        if self.is_convex:
            return Rows(values, self._least, np.inf)
        return Rows(values / self._change, (self._least + shrink * self._change) / self._change, np.inf)

    @override
    def over(self, times: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.arccos(np.clip(values, -1, 1))

    @override
    def share_beyond(self, value: float) -> float:
        return max(self._least - float(np.cos(value)), 0.0) / self._change

    @property
    @override
    def slack_weight(self) -> float:
        if self.soft is None:
            return 0.0
        slope = float(np.sqrt(1 - self._least**2))  # what the cosine changes by as the angle does
        return self._change / (self.soft * slope)


class Rate(Limit):
    """A limit of the rates of change of `values`: the program uses their differences from point to point."""

    @override
    def over(self, times: np.ndarray, values: np.ndarray) -> np.ndarray:
        rates = np.diff(values, axis=0) / np.diff(times)[:, None]
        return np.vstack([rates, rates[-1:]])

    @property
    @override
    def tolerance(self) -> float:
        return RATE_TOLERANCE * self.scale
