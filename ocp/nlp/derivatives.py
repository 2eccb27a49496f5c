"""Put together the derivatives of a program from those of one node and one interval: `derivatives`.

CasADi differentiates a mapped function along one direction after the other, each time all of it. Written out for one
node, where all entries share their operations, a Hessian costs a fifth to a tenth. The common subexpressions that are
left, 2 to 15 %, are not looked for: that takes longer than it saves in a hundred iterations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ..limits import Limit
from ..limits.limits import MANY_OPERATIONS, Limits
from ..tasks.scheme import Scheme
from .held import eased
from .near import is_local
from .rows import Row, Tightening

Constraints: TypeAlias = tuple[list[ca.SX], list[Row]]  # values, and their names and bounds


@dataclass(frozen=True, eq=False)
class Differentiable(Displayed):
    """A function of a node or an interval, whose derivatives are made once for all programs that have it."""

    function: ca.Function  # its first inputs are unknowns, the others numbers or parameters; its one output is a column
    unknowns: int  # entries of the first inputs

    def _expressions(self) -> tuple[list[ca.SX], ca.SX, ca.SX]:
        """Return symbols for its inputs, those that are unknown as one column, and the values."""
        function = self.function
        inputs = [ca.SX.sym(f"i{k}", function.sparsity_in(k)) for k in range(function.n_in())]
        unknown = ca.vertcat(*inputs)[: self.unknowns]
        return inputs, unknown, function(*inputs)

    @cached_property
    def slopes(self) -> tuple[ca.Function, np.ndarray, np.ndarray]:
        """Return the function of the nonzero derivatives by the unknowns, and their rows and columns."""
        inputs, unknown, values = self._expressions()
        jacobian = ca.jacobian(values, unknown)
        return ca.Function("slopes", inputs, [jacobian.nz[:]]), *_triplet(jacobian)

    @cached_property
    def curvature(self) -> tuple[ca.Function, np.ndarray, np.ndarray]:
        """Return the function of the second derivatives of the values times multipliers, the last input.

        It has those above the diagonal that are not zero; rows and columns follow.
        """
        inputs, unknown, values = self._expressions()
        multiplier = ca.SX.sym("multiplier", values.numel())
        hessian = ca.triu(ca.hessian(ca.dot(multiplier, values), unknown)[0])
        return ca.Function("curvature", [*inputs, multiplier], [hessian.nz[:]]), *_triplet(hessian)


def _triplet(matrix: ca.SX) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of the nonzeros of a matrix."""
    rows, columns = matrix.sparsity().get_triplet()
    return np.array(rows, dtype=int), np.array(columns, dtype=int)


class Mapped(NamedTuple):
    """A function of some unknowns that is evaluated for k sets of them."""

    differentiable: Differentiable
    inputs: list[Any]  # (., k) each
    places: np.ndarray  # (u, k), the place of each entry of the first inputs among all unknowns

    @property
    def values(self) -> ca.MX:
        """Return the values, (r, k)."""
        return self.differentiable.function.map(self.places.shape[1])(*self.inputs)

    def slopes(self, width: int) -> ca.MX:
        """Return the derivatives of all values with respect to all unknowns, (r k, width)."""
        function, rows, columns = self.differentiable.slopes
        count, height = self.places.shape[1], self.differentiable.function.numel_out(0)
        entries = _Entries(
            ca.vec(function.map(count)(*self.inputs)),
            (rows[:, None] + height * np.arange(count)).ravel(order="F"),
            self.places[columns].ravel(order="F"),
        )
        return _matrix([entries], height * count, width)

    def curvature(self, multipliers: ca.MX) -> _Entries:
        """Return the second derivatives of the values times `multipliers` (r, k), those above the diagonal."""
        function, rows, columns = self.differentiable.curvature
        first, second = self.places[rows], self.places[columns]
        return _Entries(
            ca.vec(function.map(self.places.shape[1])(*self.inputs, multipliers)),
            np.minimum(first, second).ravel(order="F"),
            np.maximum(first, second).ravel(order="F"),
        )


class Block(NamedTuple):
    """Rows of the same kind, one column per stage."""

    values: ca.MX  # (r, k)
    rows: list[Row]  # names and bounds, r
    stages: np.ndarray  # (k,)
    mapped: Mapped | None = None  # what the values are computed by, where it is a function of places among the unknowns
    slopes: ca.MX | None = None  # the derivatives of values that are linear, (r k, unknowns)

    @classmethod
    def of(cls, mapped: Mapped, rows: list[Row], stages: np.ndarray) -> Block:
        """Return the rows of a function of places among the unknowns."""
        return cls(mapped.values, rows, stages, mapped)

    def bounds(self, nodes: np.ndarray, tightening: Mapping[Limit, Tightening]) -> np.ndarray:
        """Return the bounds of the rows, one stage after the other, (r k, 2): tightened where the task permits it.

        `nodes` are where the stages begin, as shares of the duration. A row of a stage may be about all of it.
        """
        first, last = nodes[self.stages], nodes[np.minimum(self.stages + 1, len(nodes) - 1)]
        bounds = np.tile(np.array([(row.low, row.high) for row in self.rows]), (len(self.stages), 1, 1))
        for limit, tighter in tightening.items():
            its = [i for i, row in enumerate(self.rows) if row.limit is limit]
            if its:
                inwards = np.array([tighter.of(self.rows[i]) for i in its]) * [1.0, -1.0]
                bounds[:, its] += eased(tighter.held, first, last)[:, None, None] * inwards
        return bounds.reshape(-1, 2)


class _Entries(NamedTuple):
    """Entries of a sparse matrix, in which entries at the same place add up."""

    values: ca.MX
    rows: np.ndarray
    columns: np.ndarray


def derivatives(
    x: ca.MX, p: ca.MX, costs: Sequence[tuple[Mapped, np.ndarray]], blocks: Sequence[Block]
) -> dict[str, ca.Function]:
    """Return the derivatives of a program as the options of `casadi.nlpsol` that take them.

    Args:
        x, p: Unknowns and parameters.
        costs: What the objective sums, with the weight of each set.
        blocks: The rows, in their order.
    """
    multipliers, of_objective = ca.MX.sym("lam_g", sum(block.values.numel() for block in blocks)), ca.MX.sym("lam_f")
    curved = [cost.curvature(of_objective * ca.DM(weights).T) for cost, weights in costs]
    others, slopes, at = [], [], 0
    for block in blocks:
        count = block.values.numel()
        its = multipliers[at : at + count]
        at += count
        if block.mapped is not None:
            slopes.append(block.mapped.slopes(x.numel()))
            curved.append(block.mapped.curvature(ca.reshape(its, block.values.shape)))
        elif block.slopes is not None:
            slopes.append(block.slopes)
        else:
            values = ca.vec(block.values)
            slopes.append(ca.jacobian(values, x))
            others.append(ca.triu(ca.hessian(ca.dot(its, values), x)[0]))
    hessian = sum(others, _matrix(curved, x.numel(), x.numel()))
    nothing = ca.MX(at, 1)  # in place of the values, which IPOPT takes from another function
    return {
        "jac_g": ca.Function("nlp_jac_g", [x, p], [nothing, ca.vertcat(*slopes)], ["x", "p"], ["g", "jac_g_x"]),
        "hess_lag": ca.Function(
            "nlp_hess_l", [x, p, of_objective, multipliers], [hessian], ["x", "p", "lam_f", "lam_g"], ["hess_gamma_x_x"]
        ),
    }


def _matrix(entries: Sequence[_Entries], height: int, width: int) -> ca.MX:
    rows, columns = (np.concatenate([getattr(each, part) for each in entries]) for part in ("rows", "columns"))
    places, first, which = np.unique(columns * height + rows, return_index=True, return_inverse=True)
    values = ca.vertcat(*(each.values for each in entries))
    if len(places) == len(rows):
        values = values[first.tolist()]
    else:
        values = (
            ca.DM(ca.Sparsity.triplet(len(places), len(rows), which.tolist(), list(range(len(rows)))), 1.0) @ values
        )
    starts = np.searchsorted(places, height * np.arange(width + 1))
    return ca.MX(ca.Sparsity(height, width, starts.tolist(), (places % height).tolist()), values)


class Columns:
    """The columns of a program.

    - `unknowns`: unknowns of all points, (width, points), one point after the other.
    - `scheme`: the scheme, which selects points and groups them into intervals.
    - `references`: the reference motions at all points, (18 (1 + c), points), as numbers or parameters.
    - `carried`: loads and columns of the ground, (., nodes).
    - `intervals`: `Grid.intervals`, (2, steps), as numbers or parameters.
    - `duration`: duration of the references [s].
    """

    def __init__(
        self,
        unknowns: ca.MX,
        scheme: Scheme,
        references: ca.DM | ca.MX,
        carried: np.ndarray,
        intervals: ca.DM | ca.MX,
        duration: float,
    ):
        size, where = scheme.size, np.arange(unknowns.numel()).reshape(-1, unknowns.shape[0]).T
        lasting = ca.repmat(ca.DM(duration), 1, unknowns.shape[1])
        self._of_nodes = {"x": unknowns, "p": references, "carried": ca.DM(carried), "duration": lasting}
        self._of_intervals = {
            "x": _groups(unknowns, size),
            "x_end": unknowns[:, size::size],
            "p": _groups(references, size),
            "p_end": references[:, size::size],
            "grid": intervals,
            "duration": lasting[:, size::size],
        }
        self._at_nodes = where
        self._between = np.vstack([where[:, :-1].T.reshape(-1, len(where) * size).T, where[:, size::size]])

    def at_nodes(self, function: Differentiable, chosen: np.ndarray | None = None) -> Mapped:
        """Return a function of nodes at those `chosen` among them; default: at all."""
        return _mapped(function, self._of_nodes, self._at_nodes, chosen)

    def between(self, function: Differentiable, chosen: np.ndarray | None = None) -> Mapped:
        """Return a function of intervals for those `chosen`; default: for all."""
        return _mapped(function, self._of_intervals, self._between, chosen)


def _mapped(function: Differentiable, columns: dict[str, Any], places: np.ndarray, chosen: Any) -> Mapped:
    inputs = [columns[name] for name in function.function.name_in()]
    if chosen is not None:
        inputs = [each[:, chosen.tolist()] for each in inputs]
        places = places[:, chosen]
    return Mapped(function, inputs, places)


def _groups(values: ca.MX | ca.DM, size: int) -> ca.MX | ca.DM:
    """Return the columns of each interval but its end's, one below the other."""
    return ca.reshape(values[:, :-1], values.shape[0] * size, -1)


class Part(NamedTuple):
    """A node or an interval."""

    cost: Differentiable  # A function of its own, since IPOPT evaluates objective and constraints one after the other
    function: Differentiable  # the values of its rows
    rows: list[Row]  # names and bounds of these
    # Index of each local limit, what returns the function of some of its values, and its rows.
    local: list[tuple[int, Callable[[tuple[int, ...]], Differentiable], list[Row]]]


def part_of(
    name: str,
    unknowns: dict[str, ca.SX],
    parameters: dict[str, ca.SX],
    cost: ca.SX,
    constraints: list[Constraints],
    limits: Limits,
    of_limits: Iterable[tuple[int, Constraints]],
) -> Part:
    """Return the functions of a part whose symbols have the names that `Columns` has.

    `of_limits` are the constraints of `limits`, each with the index of its limit.
    """
    local: list[tuple[int, Callable[[tuple[int, ...]], Differentiable], list[Row]]] = []
    for index, (values, rows) in of_limits:
        if is_local(limits.all[index]):
            function_of_some = partial(_function_of_some, unknowns, parameters, ca.vertcat(*values))
            local.append((index, cache(function_of_some), rows))
        else:
            constraints.append((values, rows))
    values, rows = ([*chain(*parts)] for parts in zip(*constraints, strict=True))
    function = function_of(name, unknowns, parameters, ca.vertcat(*values))
    return Part(function_of(f"{name}_cost", unknowns, parameters, cost), function, rows, local)


def _function_of_some(
    unknowns: dict[str, ca.SX], parameters: dict[str, ca.SX], values: ca.SX, picked: tuple[int, ...]
) -> Differentiable:
    its = values[list(picked)]
    small = ca.n_nodes(its) < MANY_OPERATIONS  # common subexpressions of bodies with many faces take longest to find
    return function_of("near", unknowns, parameters, its, small)


def function_of(
    name: str, unknowns: dict[str, ca.SX], parameters: dict[str, ca.SX], value: ca.SX, small: bool = True
) -> Differentiable:
    """Return the function of all unknowns and of those parameters on which its value depends.

    Common subexpressions of a `small` one are evaluated once.

    CasADi would differentiate with respect to the parameters too and throw the result away: a Hessian took 6 times as
    long.
    """
    inputs = unknowns | {key: each for key, each in parameters.items() if ca.depends_on(value, each)}
    options = {"cse": small, "is_diff_in": [key in unknowns for key in inputs]}
    function = ca.Function(name, [*inputs.values()], [value], [*inputs], ["value"], options)
    return Differentiable(function, sum(each.numel() for each in unknowns.values()))
