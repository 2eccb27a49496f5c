"""`Limits`: all limits of a task for one robot, and the one function that evaluates them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError
from ...models import Robot
from ...models.batch import BLOCK, in_blocks
from .distance import Distance, Pair
from .limit import Limit
from .state import Body, State

# To find common subexpressions among so many takes longer than a plan's evaluations gain by them, a tenth.
MANY_OPERATIONS = 5000
Motion: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]  # pose, velocity, acceleration


class Separating(NamedTuple):
    """The distances of a limit, and planes between its bodies, for `BLOCK` instants.

    `plane` returns the distance of a pair from its points, and the derivative by a shift of the first body: the
    direction of a plane between the bodies, (4,).
    """

    moving: int  # how many points the first body of each pair has
    pairs: int  # how many there are
    points: ca.Function  # of the motions of platform and carriers, (18,) each: points of all pairs, one after the other
    plane: ca.Function


def motions(platform: Motion, carriers: Motion) -> list[np.ndarray]:
    """Return the motions (n, 18) of platform and each carrier: pose, velocity, acceleration side by side."""
    bodies = [platform, *zip(*(np.moveaxis(part, 1, 0) for part in carriers), strict=True)]
    return [np.hstack(body) for body in bodies]


def of_motions(name: str, bodies: Sequence[Body], others: Sequence[ca.SX], values: Sequence[ca.SX]) -> ca.Function:
    """Return the function of values from the whole motions of bodies, (18,) each, and others of their symbols.

    Inputs of bodies that never move have no effect.
    """
    symbols = [body if body.moves else Body.symbols() for body in bodies]
    inputs = [part for body in symbols for part in body] + [*others]
    small = ca.n_nodes(ca.veccat(*values)) < MANY_OPERATIONS
    parts = ca.Function("of_parts", inputs, [*values], {"cse": small})
    whole = [ca.SX.sym(f"body{i}", 18) for i in range(len(bodies))]
    given = [part for body in whole for part in ca.vertsplit(body, 6)]
    return ca.Function(name, [*whole, *others], parts.call([*given, *others]))


@dataclass(frozen=True, eq=False)
class Limits(Displayed):
    """Limits in the order of their values; iterating gives them one by one."""

    robot: Robot
    all: tuple[Limit, ...]
    _ways: dict[Limit, ca.Function | None] = field(default_factory=dict, init=False, repr=False)
    _separating: dict[Limit, Separating] = field(default_factory=dict, init=False, repr=False)
    _blocks: dict[tuple[Limit, ...], ca.Function] = field(default_factory=dict, init=False, repr=False)

    def __iter__(self) -> Iterator[Limit]:
        return iter(self.all)

    def __reduce__(self) -> tuple[type[Limits], tuple[Robot, tuple[Limit, ...]]]:
        """Pickle what was given: the functions are built again."""
        return Limits, (self.robot, self.all)

    @cached_property
    def _state(self) -> State:
        # With symbols for anchors that never move, an audit's accelerations of cables took twice as long.
        carriers = tuple(Body.symbols() if each.moves else Body.at_rest(each.home) for each in self.robot.carriers)
        return State(self.robot, Body.symbols(), carriers, ca.SX.sym("t", self.robot.m), ca.SX.sym("off_path", 6))

    @property
    def _bodies(self) -> list[Body]:
        return [self._state.platform, *self._state.carriers]

    @property
    def _others(self) -> list[ca.SX]:
        return [self._state.tensions, self._state.off_path]

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
        return self.function_of(self.all)

    def function_of(self, limits: Iterable[Limit]) -> ca.Function:
        """Return the function of the values of some limits, with the same inputs."""
        values = [self._values[self.all.index(limit)] for limit in limits]
        return of_motions("limits", self._bodies, self._others, [ca.vertcat(*values)])

    @cached_property
    def places(self) -> list[slice]:
        """Return which of all values belong to each limit."""
        ends = np.cumsum([0, *(its.numel() for its in self._values)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def of_tensions(self) -> frozenset[str]:
        """Return the names of the limits that depend on the tensions, of which a motion may have others."""
        depend = (ca.depends_on(its, self._state.tensions) for its in self._values)
        return frozenset(limit.name for limit, does in zip(self, depend, strict=True) if does)

    def hull(self, limit: Limit) -> ca.Function:
        """Return the function of the values of a convex limit from what its hull is about, (6, 1).

        Raises `InputError` if the values depend on more than that.
        """
        state, hull = self._state, limit.hull
        if hull is None:
            raise TypeError(f"limit {limit.name!r} has no hull")
        part = state.off_path if hull.carrier is None else state.carriers[hull.carrier][hull.order]
        values = self._values[self.all.index(limit)]
        if not all(ca.depends_on(symbol, part) for symbol in ca.symvar(values)):
            raise InputError(f"limit {limit.name!r} must depend only on what its hull names, got {hull}")
        return ca.Function("hull", [part], [values])

    def on_the_way(self, limit: Limit) -> ca.Function | None:
        """Return the function of a limit's values on the straight way from one instant to another; None if not known.

        Its inputs are the motions of platform and carriers (18 each) at the first, then at the second.
        """
        if limit not in self._ways:
            count, other = 1 + len(self.robot.carriers), self._state
            whole = [ca.SX.sym(f"body{i}", 18) for i in range(2 * count)]
            bodies = [Body(*ca.vertsplit(body, 6)) for body in whole]
            first, second = (
                State(self.robot, part[0], tuple(part[1:]), other.tensions, other.off_path)
                for part in (bodies[:count], bodies[count:])
            )
            values = limit.on_the_way(first, second)
            self._ways[limit] = None if values is None else ca.Function("on_the_way", whole, [values])
        return self._ways[limit]

    def separating(self, limit: Distance) -> Separating:
        """Return the functions that bound the distances of a limit over time."""
        if limit not in self._separating:
            pairs = limit.pairs(self._state)
            first, second = (ca.SX.sym("p", 3, part.shape[1]) for part in pairs[0])
            shift = ca.SX.sym("shift", 3)
            apart = limit.apart(Pair(first + ca.repmat(shift, 1, first.shape[1]), second))
            plane = ca.substitute(ca.horzcat(apart, ca.jacobian(apart, shift)), shift, ca.SX.zeros(3))
            points = ca.vec(ca.horzcat(first, second))
            ends = ca.vertcat(*(ca.vec(ca.horzcat(*pair)) for pair in pairs))
            self._separating[limit] = Separating(
                moving=first.shape[1],
                pairs=len(pairs),
                points=of_motions("points", self._bodies, [], [ca.densify(ends)]).map(BLOCK),
                plane=ca.Function("plane", [points], [ca.densify(ca.vec(plane))], {"cse": True}).map(BLOCK),
            )
        return self._separating[limit]

    def along(
        self,
        platform: Motion,
        carriers: Motion,
        tensions: np.ndarray | None = None,
        off_path: np.ndarray | None = None,
        distances: bool = True,
    ) -> list[np.ndarray]:
        """Return the values of each limit along a motion in {G}, (n, k); without `distances` none of these, (n, 0).

        - `platform`, `carriers`: pose, velocity and acceleration, (n, 6) each and (n, c, 6) each.
        - `tensions`: (n, m) [N]; where they are nan, so are the values that depend on them. Default: zeros.
        - `off_path`: offset of the platform from its path, (n, 6) [m, rad]. Default: zeros.
        """
        chosen = tuple(limit for limit in self if distances or not isinstance(limit, Distance))
        found = dict(zip(chosen, self._along(chosen, platform, carriers, tensions, off_path), strict=True))
        return [found[limit] if limit in found else np.zeros((len(platform[0]), 0)) for limit in self]

    def distances(self, limit: Distance, platform: Motion, carriers: Motion) -> np.ndarray:
        """Return the distances of one limit along a motion in {G}, (n, k) [m]."""
        return self._along((limit,), platform, carriers)[0]

    def at_rest(self, platform: np.ndarray, carriers: np.ndarray) -> list[np.ndarray]:
        """Return the values of each limit at poses of platform (n, 6) and carriers (n, c, 6) at rest, (n, k)."""
        moving, bases = ((pose, np.zeros_like(pose), np.zeros_like(pose)) for pose in (platform, carriers))
        return self.along(moving, bases)

    def _along(
        self,
        chosen: tuple[Limit, ...],
        platform: Motion,
        carriers: Motion,
        tensions: np.ndarray | None = None,
        off_path: np.ndarray | None = None,
    ) -> list[np.ndarray]:
        """Return the values of some of the limits, as `along` does."""
        if not chosen:
            return []
        values = [self._values[self.all.index(limit)] for limit in chosen]
        if chosen not in self._blocks:
            self._blocks[chosen] = self.function_of(chosen).map(BLOCK)
        n = len(platform[0])
        arguments = motions(platform, carriers)
        arguments.append(np.zeros((n, self.robot.m)) if tensions is None else tensions)
        arguments.append(np.zeros((n, 6)) if off_path is None else off_path)
        (found,) = in_blocks(self._blocks[chosen], arguments)
        return np.split(found, np.cumsum([its.numel() for its in values])[:-1], axis=1)
