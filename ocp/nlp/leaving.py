"""`leaving`: a motion that starts or ends exactly with the largest speed is not faster just after or before.

At a fixed end that lies on a bound, the value of a limit of speed is given, and its slope is a matter of the
acceleration there, which may be free. The nodes alone would permit a slope that leads beyond the bound and back before
the next one, in steps of any length.
"""

from collections.abc import Iterator
from typing import NamedTuple

import casadi as ca
import numpy as np

from ..limits import Body, Limit
from ..limits.limits import motions as whole_motions
from ..tasks.ends import fixed_values
from ..tasks.scenario import Scenario
from .derivatives import Differentiable
from .held import Spans, at_ends, held_spans
from .layout import Layout
from .part import function_of
from .rows import Row, in_world, motions, reference_symbols

ON_IT = 1e-6  # of the scale of a limit: an end so near to a bound is on it


class Leaving(NamedTuple):
    """Rows of an end."""

    function: Differentiable  # of its point
    rows: list[Row]
    point: int


def leaving(scenario: Scenario, layout: Layout, references: np.ndarray) -> list[Leaving]:
    """Return the rows of both ends: what is on its bound there has a slope to the inside, in parts of its scale.

    `references` are the motions at all points, (18 (1 + c), points).
    """
    if all(limit.is_convex or limit.is_equation for limit in scenario.limits):
        return []  # they hold between the nodes anyway
    ends, last, held = [], references.shape[1] - 1, held_spans(scenario, lambda _: ON_IT)
    for end, point, forwards in ((0, 0, 1.0), (-1, last, -1.0)):
        fixed = [value.column for value in fixed_values(scenario) if (value.end, value.order) == (end, 2)]
        free = [column for column in range(layout.n) if column not in fixed]
        x = ca.SX.sym("x", layout.width)
        parameters, reference = reference_symbols("p", references)
        platform, *carriers = motions(scenario, layout, x, reference)
        bodies = [ca.vertcat(*body) for body in (in_world(scenario, platform, carriers), *carriers)]
        values, rows = [], list[Row]()
        for name, slope in _slopes_outwards(scenario, end, held):
            value = forwards * slope(*bodies)
            if ca.jacobian(value, x)[:, layout.a][:, free].nnz():
                values.append(value)
                rows.append(Row(f"slope of {name}", -np.inf, 0.0))
        if rows:
            function = function_of("leaving", {"x": x}, {"p": parameters}, ca.vertcat(*values))
            ends.append(Leaving(function, rows, point))
    return ends


def _slopes_outwards(scenario: Scenario, end: int, held: dict[Limit, Spans]) -> Iterator[tuple[str, ca.Function]]:
    """Yield the names of the limits of speed that are on a bound at an end, and how fast they leave it.

    Functions are of the motions of platform and carriers, (18, 1) each. `held` is when the task fixes what each limit
    bounds.
    """
    limits, share = scenario.limits, 0.0 if end == 0 else 1.0
    if not any((share, share) in spans for spans in held.values()):
        return
    there = [motion[end] for motion in whole_motions(*at_ends(scenario))]
    bodies = [Body.symbols() for _ in there]
    others = [ca.SX.sym("t", scenario.robot.m), ca.SX.sym("off_path", 6)]
    whole = [ca.vertcat(*body) for body in bodies]
    evaluated = limits.function(*whole, *others) if limits.all else ca.SX(0, 1)
    unknown = ca.vertcat(*(acceleration for *_, acceleration in bodies), *others)
    for limit, place in zip(limits, limits.places, strict=True):
        if (share, share) not in held.get(limit, ()) or limit.is_convex or limit.is_equation:
            continue
        value, low, high = limit.rows(evaluated[place])
        if ca.depends_on(value, unknown):
            continue
        slope = ca.SX.zeros(*value.shape)
        for pose, velocity, acceleration in bodies:
            slope += ca.jtimes(value, pose, velocity) + ca.jtimes(value, velocity, acceleration)
        at = ca.Function("at", whole, [value])(*there).full().ravel()
        for i, reached in enumerate(at):
            if reached > high - ON_IT or reached < low + ON_IT:
                sign = 1.0 if reached > high - ON_IT else -1.0
                yield limit.name, ca.Function("slope", whole, [sign * slope[i]])
