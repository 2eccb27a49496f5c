"""Build the nonlinear program of a scenario: inverse dynamics at the points of a scheme, integrated between them.

Unknown at each point k are the free coordinates q_k, their rates v_k and accelerations a_k, and the tensions t_k; the
duration T too where the task leaves it free:

    min   mean over time of the costs, such as sum |quantity / what costs one|^2       (`costs`)
    s.t.  A(q_k) t_k + S n_k = w(q_k, v_k, a_k)                         at every point
          (q, v)_{k+1} = integral of the acceleration's polynomial      (`scheme`, `spline`)
          t_min + margin <= t_k <= t_max - margin
          the same two for tensions of their own in each decisive wind of a box    (`wind_set`)
          n_k >= 0, platform at rest on its path                        on the ground, else n_k = 0 (`tasks.phase`)
          the limits of `limits`                                        at every point
          their slopes lead inside where a fixed end is on one          (`leaving`)
          tube, reach, speed, tilt, acceleration at the Bernstein points: so they hold between points too

What holds at one point is in `node`, what binds an interval's in `interval`; `stages` has both as functions. Tensions
are in units of `Robot.force_scale`, the weight, moments over `Robot.length`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ..limits import Limit
from ..tasks import bernstein
from ..tasks.deviation import Deviation
from ..tasks.ends import carrier_ends, fixed_values, platform_ends
from ..tasks.lay_out_phases import known_tensions
from ..tasks.scenario import ATTITUDE, START_BAND, Scenario
from .derivatives import Block, Columns, Mapped, Part, derivatives
from .grid import Grid, passed
from .held import eased, held_wrench
from .interval import points
from .layout import DURATION, MARGIN, Layout
from .near import Near, has_places, parts
from .rows import MANY, Mesh, Row, Tightening, stretch
from .stages import Stages, reference_motions

LEGS = 0.3, 3.0  # times its duration in the motion before: what one of a leg may be
SAME = 1e-9  # of the duration: rounding of where a leg ends


@dataclass(frozen=True)
class Program(Displayed):
    """A nonlinear program in CasADi's form, its bounds, and how to read its solution."""

    scenario: Scenario
    mesh: Mesh
    layout: Layout
    shares: np.ndarray  # (k,) of the duration, where the points are
    problem: dict[str, ca.MX]  # {"x", "p", "f", "g"} for `casadi.nlpsol`
    lower: np.ndarray  # bounds of x and g
    upper: np.ndarray  # likewise
    lower_g: np.ndarray  # likewise
    upper_g: np.ndarray  # likewise
    near: Near  # where it has the rows of local limits
    costs: list[tuple[Mapped, np.ndarray]]  # what the objective sums, and the weights of their sets
    blocks: list[Block]  # the rows of g, in their order
    local: int  # how many of the first blocks are of local limits
    parameters: np.ndarray  # values of the parameters p of `problem`; only a movable one has some

    def of(self, scenario: Scenario) -> Program:
        """Return the program, which has parameters, of another scenario that differs in its references and ends only.

        The duration may be another one too.
        """
        times = self.shares * scenario.duration
        lower, upper = _simple_bounds(scenario, self.mesh, self.layout, times)
        parameters = _values(reference_motions(scenario, times), scenario.duration / self.mesh.steps)
        return replace(self, scenario=scenario, parameters=parameters, lower=lower, upper=upper)

    def tightened(self, mesh: Mesh) -> Program:
        """Return this program with the bounds of another mesh of as many steps."""
        scenario = self.scenario
        lower, upper = _simple_bounds(scenario, mesh, self.layout, self.shares * scenario.duration)
        lower_g, upper_g = _bounds(scenario, mesh, Grid.of(scenario, mesh.steps), self.blocks)
        return replace(self, mesh=mesh, lower=lower, upper=upper, lower_g=lower_g, upper_g=upper_g)

    @cached_property
    def has_corners(self) -> bool:
        """Return whether a robot keeps true distances from regions; teams come nearer slowly for long, and arrive."""
        return self.local > 0 and has_places(self.scenario) and self.scenario.count <= MANY

    def columns(self, x: np.ndarray) -> np.ndarray:
        """Return the unknowns of each point, one row per point."""
        return x.reshape(-1, self.layout.width)

    def times(self, x: np.ndarray) -> np.ndarray:
        """Return the times of the points of a solution x, (k,) [s]."""
        place, nominal = self.layout.at(DURATION), self.shares * self.scenario.duration
        if place is None:
            return nominal
        factors = self.columns(x)[:, place]
        if self.scenario.passing:
            return np.append(0.0, np.cumsum(np.diff(nominal) * factors[:-1]))
        return nominal * factors[0]

    def read(self, x: np.ndarray) -> Deviation:
        """Return the deviation of a solution x."""
        layout, columns, scheme = self.layout, self.columns(x), self.scenario.scheme
        tensions = columns[:, layout.tensions] * self.scenario.robot.force_scale
        q, v, a = (columns[:, part] for part in (layout.q, layout.v, layout.a))
        jerk = columns[:, layout.jerk] / self._step if scheme.smooth else None
        return Deviation(self.times(x), q, v, a, tensions, scheme, jerk)

    @property
    def _step(self) -> float:
        """Return the length of an interval at the scenario's duration [s]."""
        return self.scenario.duration / self.mesh.steps

    def missing(self, x: np.ndarray) -> float:
        """Return the largest missing wrench at a point of a solution x, in any wind [N]."""
        wrenches = self.columns(x)[:, self.layout.missing].reshape(-1, 6)
        return float(np.linalg.norm(wrenches, axis=1).max(initial=0.0) * self.scenario.robot.force_scale)

    @cached_property
    def derivatives(self) -> dict[str, ca.Function]:
        """Return options of `casadi.nlpsol`: Jacobian and Hessian."""
        return derivatives(self.problem["x"], self.problem["p"], self.costs, self.blocks)

    def suffices(self, motion: Deviation) -> bool:
        """Return whether a motion can exceed no local limit where the program does not have its rows."""
        return self.near.is_everywhere or self.near.suffices(self.scenario, self.shares, motion)

    def strays(self, x: np.ndarray) -> bool:
        """Return whether the motion of unknowns x is deep in a region of which the program does not have the rows."""
        return bool(np.isfinite(x).all()) and self.near.strays(self.scenario, self.shares, self.read(x))

    def violation(self, x: np.ndarray, g: np.ndarray) -> float:
        """Return the largest violation of the bounds by x and its constraints g; infinite if they are not numbers."""
        beyond = [self.lower - x, x - self.upper, self.lower_g - g, g - self.upper_g]
        worst = float(np.concatenate(beyond).max())
        return worst if np.isfinite(worst) else np.inf

    def pack(self, deviation: Deviation) -> np.ndarray:
        """Return the x of a deviation at the points, with zero slacks."""
        layout = self.layout
        columns = np.zeros((len(self.shares), layout.width))
        for part, values in ((layout.q, deviation.q), (layout.v, deviation.v), (layout.a, deviation.a)):
            columns[:, part] = values
        if self.scenario.scheme.smooth:
            a, nodes = deviation.a, deviation.nodes
            jerk = np.gradient(a, nodes, axis=0) if deviation.jerk is None else deviation.jerk
            columns[:, layout.jerk] = self._step * jerk
            columns[:, layout.snap] = self._step**2 * np.gradient(jerk, nodes, axis=0)
        columns[:, layout.tensions] = deviation.tensions / self.scenario.robot.force_scale
        columns[:, layout.wind_tensions] = np.tile(columns[:, layout.tensions], layout.winds)
        columns[:, layout.supports] = self.scenario.phases.resting(deviation.nodes)[:, None] / max(layout.grounds, 1)
        if (place := layout.at(DURATION)) is not None:
            columns[:, place] = deviation.nodes[-1] / self.scenario.duration
        return columns.ravel()


def build(
    scenario: Scenario, mesh: Mesh, near: Near | None = None, movable: bool = False, stages: Stages | None = None
) -> Program:
    """Build the nonlinear program of `scenario` on `mesh`, with local limits where they are `near`; default: all.

    A `movable` one has the references and the length of the intervals as parameters (`Program.of`). Its ends are not
    yet known, so that it has no rows of `leaving`. `stages` belong to the scenario and the mesh; default: new ones.
    """
    steps, scheme, stages = mesh.steps, scenario.scheme, stages or Stages.of(scenario, mesh, movable)
    layout, grid, node, interval = stages.layout, stages.grid, stages.node, stages.interval
    near = near or Near.everywhere(scenario, grid.shares)
    times = grid.shares * scenario.duration
    p, given, intervals = ca.MX.sym("p", 0), ca.DM(stages.references), ca.DM(grid.intervals)
    if movable:
        p, given, intervals = _as_parameters(stages.references.shape, steps)
    x = ca.MX.sym("x", len(times) * layout.width)
    X = ca.reshape(x, layout.width, len(times))
    columns = Columns(X, scheme, given, stages.carried, intervals, scenario.duration)
    costs = [
        (columns.at_nodes(node.cost), grid.weights),
        (columns.between(interval.cost), grid.steps / scenario.duration),
    ]
    objective = ca.MX(0.0)
    for cost, weights in costs:
        objective += ca.dot(cost.values, ca.DM(weights).T)

    local = _near_rows(scenario, near, node, interval, columns)
    blocks = [
        *local,
        Block.of(columns.at_nodes(node.function), node.rows, np.arange(len(times)) // scheme.size),
        Block.of(columns.between(interval.function), interval.rows, np.arange(steps)),
        *_single_rows(scenario, layout, X, grid),
        *(
            Block.of(columns.at_nodes(function, np.array([point])), rows, np.array([point // scheme.size]))
            for function, rows, point in stages.ends
        ),
    ]
    g = ca.vertcat(*(ca.vec(block.values) for block in blocks))
    problem = {"x": x, "p": p, "f": objective, "g": g}
    bounds = *_simple_bounds(scenario, mesh, layout, times), *_bounds(scenario, mesh, grid, blocks)
    values = _values(stages.references, grid.steps[0]) if movable else np.zeros(0)
    return Program(
        scenario, mesh, layout, grid.shares, problem, *bounds, near, costs, blocks, local=len(local), parameters=values
    )


def _as_parameters(shape: tuple[int, int], steps: int) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Return the parameters of a movable program, and what they are: references, and `Grid.intervals`."""
    count = shape[0] * shape[1]
    p = ca.MX.sym("p", count + 1)
    return p, ca.reshape(p[:count], *shape), ca.vertcat(ca.repmat(p[count], 1, steps), ca.DM.zeros(1, steps))


def _values(references: np.ndarray, step: float) -> np.ndarray:
    return np.append(references.ravel(order="F"), step)


def _near_rows(scenario: Scenario, near: Near, node: Part, interval: Part, columns: Columns) -> list[Block]:
    """Return the rows of local limits where they are near, at nodes and between them."""
    blocks, size = [], scenario.scheme.size
    windows: np.ndarray = np.lib.stride_tricks.sliding_window_view(near.chosen, size + 1, axis=1)
    all_of: np.ndarray = np.lib.stride_tricks.sliding_window_view(near.between, size, axis=1)
    inside = windows[:, ::size].max(axis=2) & all_of[:, ::size].all(axis=2)
    at_nodes, between = (node, columns.at_nodes, near.chosen, size), (interval, columns.between, inside, 1)
    its_parts = parts(scenario.limits)
    for part, mapped_at, near_to, points_of_stage in (at_nodes, between):
        for index, function, rows in part.local:
            together: dict[bytes, list[int]] = {}  # values that are near at the same points have one function
            for i, (of_limit, picked) in enumerate(its_parts):
                if of_limit == index and near_to[i].any():
                    together.setdefault(near_to[i].tobytes(), []).extend(range(len(rows))[picked])
            for where, picked in together.items():
                chosen = np.flatnonzero(np.frombuffer(where, dtype=bool))
                mapped = mapped_at(function(tuple(picked)), chosen)
                blocks.append(Block.of(mapped, [rows[i] for i in picked], chosen // points_of_stage))
    return blocks


def _bounds(scenario: Scenario, mesh: Mesh, grid: Grid, blocks: list[Block]) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the rows of all blocks."""
    starts = np.append(0.0, np.cumsum(grid.steps)) / grid.steps.sum()
    limits = {row.limit for block in blocks for row in block.rows if row.limit is not None}
    tightening = mesh.tightening(scenario, limits)
    bounds = np.concatenate([_bounds_of(block, starts, tightening, scenario) for block in blocks])
    return bounds[:, 0], bounds[:, 1]


def _bounds_of(
    block: Block, starts: np.ndarray, tightening: Mapping[Limit, Tightening], scenario: Scenario
) -> np.ndarray:
    """Return the bounds of a block; what a point has of the duration may change where a leg ends."""
    bounds = block.bounds(starts, tightening)
    ends = np.searchsorted(starts, np.array(passed(scenario)) - SAME) - 1
    for index, row in enumerate(block.rows):
        if row.name == DURATION and len(ends):
            bounds.reshape(len(block.stages), len(block.rows), 2)[ends, index] = -np.inf, np.inf
    return bounds


def _single_rows(scenario: Scenario, layout: Layout, X: ca.MX, grid: Grid) -> list[Block]:
    """Return the rows that occur once: periodic ends, waypoints, legs' durations, start and end of the acceleration."""
    blocks, lengths = _waypoint_rows(scenario, layout, X, grid), grid.steps
    if (place := layout.at(DURATION)) is not None and scenario.passing and (span := scenario.duration_range):
        whole = ca.dot(X[place, :-1], ca.DM(np.diff(grid.shares)).T)
        its = Row("legs", span.min / scenario.duration, span.max / scenario.duration)
        blocks.append(Block(whole, [its], np.array([0])))
    words = platform_ends(scenario.task), carrier_ends(scenario.task)
    cyclic = [i for i, (owner, _) in enumerate(scenario.owners()) if words[owner is not None] == "periodic"]
    if cyclic:
        balanced = _balanced_angles(scenario)
        picked = [
            order * layout.n + i
            for order in range(layout.derivatives)
            for i in cyclic
            if order != 2 or i not in balanced
        ]
        rows: list[Row] = [Row("periodic", 0.0, 0.0)] * len(picked)
        blocks.append(Block(X[picked, 0] - X[picked, -1], rows, np.array([0])))
    if scenario.scheme.smooth and (ending := [i for i in range(layout.n) if i not in cyclic]):
        # Values at the nodes leave a cubic spline one freedom at each end, which would be used where nobody looks.
        rows = [Row("snap", 0.0, 0.0)] * len(ending)
        for k in (0, len(lengths) - 1):
            change = (X[layout.snap, k + 1] - X[layout.snap, k])[ending]
            blocks.append(Block(change, rows, np.array([k])))
    return blocks


def _balanced_angles(scenario: Scenario) -> list[int]:
    """Return the free angles whose accelerations follow from pose, velocity and the balance on too few cables.

    Rows for these at periodic ends would repeat what others imply, and the program could have too many equations.
    """
    missing = len(scenario.robot.platform.dof) - scenario.robot.m
    angles = [i for i, (owner, axis) in enumerate(scenario.owners()) if owner is None and axis in ATTITUDE]
    return angles[: max(missing, 0)]


def _waypoint_rows(scenario: Scenario, layout: Layout, X: ca.MX, grid: Grid) -> list[Block]:
    """Return rows that lead the platform through the waypoints, by the polynomial of the interval of each."""
    times, missed = scenario.passes()
    platform = [i for i, owner in enumerate(scenario.owners()) if owner[0] is None]
    if not (len(times) and platform):
        return []
    blocks, lengths, size = [], grid.steps, scenario.scheme.size
    starts, given = grid.shares[::size], scenario.duration / len(lengths)
    coordinates = [coordinate for owner, coordinate in scenario.owners() if owner is None]
    for share, off in zip(times / scenario.duration, missed[:, coordinates], strict=True):
        k = min(int(np.searchsorted(starts, share, side="right")), len(lengths)) - 1
        its = [X[:, k * size + i] for i in range(size + 1)]
        position = points(scenario, layout, float(lengths[k]) * stretch(layout, its[0]), given, its).position
        rows = [Row("waypoint", float(value), float(value)) for value in off]
        into = float((share - starts[k]) / (starts[k + 1] - starts[k]))
        blocks.append(Block(bernstein.value(position, into)[platform], rows, np.array([k])))
    return blocks


def _simple_bounds(scenario: Scenario, mesh: Mesh, layout: Layout, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the unknowns: of tensions, attitude in the tube, fixed ends, and what is shared."""
    n = layout.n
    lower, upper = (np.full((len(nodes), layout.width), bound) for bound in (-np.inf, np.inf))
    low, high = scenario.bounds_at(nodes)
    reserve = np.minimum(mesh.reserve, (high - low) / 4)
    if mesh.reserve:
        shares = nodes / nodes[-1]
        reserve = reserve * eased(held_wrench(scenario, mesh.reserve), shares, shares)[:, None]
    for end, state in ((0, scenario.task.initial), (-1, scenario.task.final)):
        if state is not None:
            reserve[end] = 0.0  # what is given there may be next to a limit
    for part, count in ((layout.tensions, 1), (layout.wind_tensions, layout.winds)):
        lower[:, part] = np.tile((low + reserve) / scenario.robot.force_scale, count)
        upper[:, part] = np.tile((high - reserve) / scenario.robot.force_scale, count)
    lower[:, layout.slacks] = 0.0
    if (place := layout.at(DURATION)) is not None and (span := scenario.duration_range) is not None:
        least, most = span.min / scenario.duration, span.max / scenario.duration
        lower[:, place], upper[:, place] = LEGS if scenario.passing else (least, most)
    if (place := layout.at(MARGIN)) is not None:
        lower[:, place] = 0.0
    turn = scenario.task.tube.turn
    for column, (owner, coordinate) in enumerate(scenario.owners()):
        if owner is None and coordinate in ATTITUDE:
            lower[:, column], upper[:, column] = -turn, turn
    if (measured := scenario.start_tensions) is not None:
        # A little freedom: where balance fixes the tensions, they would be fixed twice.
        band, force = START_BAND, scenario.robot.force_scale
        lower[0, layout.tensions] = np.maximum(low[0] / force, measured / force - band)
        upper[0, layout.tensions] = np.minimum(high[0] / force, measured / force + band)
    for end, column, order, value in fixed_values(scenario):
        lower[end, order * n + column] = upper[end, order * n + column] = value
    _on_ground(scenario, layout, nodes, lower, upper)
    return lower.ravel(), upper.ravel()


def _on_ground(scenario: Scenario, layout: Layout, nodes: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> None:
    """Bound the forces of the ground, and keep the platform at rest on its path where it is on the ground.

    Position and velocity are fixed where it comes to rest: the acceleration, which is zero then, keeps them.
    """
    phases, scale = scenario.phases, scenario.robot.force_scale
    if not phases.rest:
        return
    lower[:, layout.supports], upper[:, layout.supports] = phases.support_bounds(nodes) / scale
    resting = phases.resting(nodes)
    starts = np.flatnonzero(resting & ~np.append(False, resting[:-1]))
    for column, (owner, _) in enumerate(scenario.owners()):
        if owner is None:
            for bound in (lower, upper):
                bound[resting, layout.a.start + column] = 0.0
                bound[starts, column] = bound[starts, layout.v.start + column] = 0.0
    for end, phase in ((0, phases.all[0]), (-1, phases.all[-1])):
        known = known_tensions(scenario, phase, end) if phase.rests else None
        if known is not None:
            lower[end, layout.tensions] = upper[end, layout.tensions] = known / scale
