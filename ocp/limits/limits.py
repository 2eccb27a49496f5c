"""`Limits`: all limits of a task for one robot, and the one function that evaluates them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from ...errors import InputError
from ...models import Robot
from .limit import Limit
from .state import Body, State

__all__ = ["Limits"]


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits in the order of their values; iterating gives them one by one."""

    robot: Robot
    all: tuple[Limit, ...]

    def __iter__(self) -> Iterator[Limit]:
        return iter(self.all)

    def __reduce__(self) -> tuple[type[Limits], tuple[Robot, tuple[Limit, ...]]]:
        """Pickle what was given: the functions are built again."""
        return Limits, (self.robot, self.all)

    @cached_property
    def _state(self) -> State:
        # Pieces of one symbol are no symbols: derivatives are taken with respect to these.
        platform, *carriers = (
            Body(ca.SX.sym("x", 6), ca.SX.sym("v", 6), ca.SX.sym("a", 6)) for _ in range(1 + len(self.robot.carriers))
        )
        return State(self.robot, platform, tuple(carriers), ca.SX.sym("t", self.robot.m), ca.SX.sym("off_path", 6))

    @cached_property
    def _values(self) -> list[ca.SX]:
        """Return the values of each limit, as expressions of the state."""
        values = []
        for limit in self:
            its = ca.SX(limit.values(self._state))
            count = limit.over(np.arange(2.0), np.zeros((2, its.numel()))).shape[1]
            if len(limit.labels) != count:
                raise InputError(
                    f"limit {limit.name!r} must have a label for each of its {count} values, got {limit.labels}"
                )
            values.append(its)
        return values

    @cached_property
    def function(self) -> ca.Function:
        """Return the function of all values, one below the other.

        Its inputs are the motion of the platform in {G} (18: pose, velocity, acceleration), those of all carriers (18
        each), the tensions [N] (m) and the platform's offset from its path (6).
        """
        state = self._state
        bodies = [state.platform, *state.carriers]
        parts = [part for body in bodies for part in body]
        inner = ca.Function("limits_of_parts", [*parts, state.tensions, state.off_path], [ca.vertcat(*self._values)])
        whole = [ca.SX.sym(f"body{i}", 18) for i in range(len(bodies))]
        given = [part for body in whole for part in ca.vertsplit(body, 6)]
        values = inner(*given, state.tensions, state.off_path)
        return ca.Function("limits", [*whole, state.tensions, state.off_path], [values])

    @cached_property
    def places(self) -> list[slice]:
        """Return where among all values those of each limit are."""
        ends = np.cumsum([0, *(its.numel() for its in self._values)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def of_tensions(self) -> frozenset[str]:
        """Return the names of the limits that depend on the tensions, of which a motion may have others."""
        depend = (ca.depends_on(its, self._state.tensions) for its in self._values)
        return frozenset(limit.name for limit, does in zip(self, depend, strict=True) if does)

    def hull(self, limit: Limit) -> ca.Function:
        """Return the function of the values of a convex limit from what its hull is about, (6, 1).

        Raises
        ------
        InputError
            If the values depend on more than that.
        """
        state, hull = self._state, limit.hull
        if hull is None:
            raise TypeError(f"limit {limit.name!r} has no hull")
        part = state.off_path if hull.carrier is None else state.carriers[hull.carrier][hull.order]
        values = self._values[self.all.index(limit)]
        if not all(ca.depends_on(symbol, part) for symbol in ca.symvar(values)):
            raise InputError(f"limit {limit.name!r} must depend only on what its hull names, got {hull}")
        return ca.Function("hull", [part], [values])

    def over(
        self, times: np.ndarray, bodies: list[np.ndarray], tensions: np.ndarray, off_path: np.ndarray
    ) -> list[np.ndarray]:
        """Return what each limit bounds along a motion, one array (n, k) a limit, in its unit.

        Parameters
        ----------
        times
            (n,) [s].
        bodies
            Motions of platform and carriers in {G}, (n, 18) each.
        tensions
            (n, m) [N]; where they are nan, so are the values that depend on them.
        off_path
            Offset of the platform from its path, (n, 6) [m, rad].
        """
        if not self.all:
            return []
        arguments = (*(body.T for body in bodies), tensions.T, off_path.T)
        values = self.function.map(len(times))(*arguments).full().T
        return [limit.over(times, values[:, place]) for limit, place in zip(self, self.places, strict=True)]
