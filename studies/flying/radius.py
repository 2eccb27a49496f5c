"""The largest circle of paper F's robot under a hovering quadrotor, by bisection, and at other depths below it.

A radius is feasible if tensions above a floor exist at every instant of the turn, by the tension solver. The smallest
tension falls with the radius, so bisection gives the largest feasible one.
"""

from __future__ import annotations

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, load
from ...solvers import solve_batch
from ..accounts.account import Chapter
from ..accounts.claim import Verdict, stated
from .motion import RADIUS, TIMES, circle, steady_tensions
from .plans import BELOW

PRECISION = 1e-4  # [m]
TURN = TIMES[:-1:5]  # 200 instants of one turn
RADII = np.linspace(0.0, 1.2, 61)
DEPTHS = np.linspace(0.4, 4.0, 10)  # of the circle under the quadrotor [m]


def largest_radius(dynamics: Dynamics, floor: float = 0.0, below: float = BELOW, most: float = 2.0) -> float:
    """Return the largest radius [m], up to `most`, at which tensions of at least `floor` [N] exist all the time."""
    low, high = 0.0, most
    while high - low > PRECISION:
        middle = (low + high) / 2
        if feasible(dynamics, middle, floor, below):
            low = middle
        else:
            high = middle
    return low


def feasible(dynamics: Dynamics, radius: float, floor: float, below: float = BELOW) -> bool:
    """Return whether tensions from `floor` [N] to the robot's t_max exist at every instant of the turn."""
    robot, motion = dynamics.robot, circle(radius, TURN, below)
    A, w = dynamics.relative.wrench_matrix(motion.pose), dynamics.relative.required_wrench(*motion)
    return bool(solve_batch(A, w, np.full(robot.m, floor), robot.t_max).feasible.all())


def chapter() -> Chapter:
    """Compare the largest radius at the paper's depth with the printed one."""
    dynamics = Dynamics(load("wang-flying"))
    floor = float(dynamics.robot.t_min.max())
    taut, kept = largest_radius(dynamics), largest_radius(dynamics, floor)
    with_floor = f"with tensions of at least {floor:g} N it is {kept:.3f} m"
    claim = stated(
        "radius",
        "VI.A, VI.B",
        "The platform follows a circle of this radius, 1 m below the hovering quadrotor, on cables that only pull.",
        RADIUS,
        taut,
        holds=taut >= RADIUS,
        otherwise=Verdict.IMPOSSIBLE,
        agrees=f"The largest radius without a pushing cable is not smaller; {with_floor}.",
        differs=f"Beyond the computed radius some cable would have to push; {with_floor}.",
        unit="m",
        figure="radius",
    )
    return Chapter([claim], {"radius": _against_radius(dynamics, taut), "depth": _against_depth(dynamics, floor)})


def _against_radius(dynamics: Dynamics, taut: float) -> Drawing:
    tensions = np.stack([steady_tensions(dynamics, circle(radius, TURN)) for radius in RADII])
    panel = Panel(
        "tension [N]",
        {"smallest of the turn": tensions.min(axis=(1, 2)), "largest": tensions.max(axis=(1, 2))},
        {"0 N": 0.0},
    )
    marks = {"largest without pushing": taut, "printed": RADIUS}
    return Drawing(
        "Smallest and largest tension of a turn, 1 m below a hovering quadrotor, against the circle's radius",
        curves(RADII, "radius [m]", [panel], marks=marks),
    )


def _against_depth(dynamics: Dynamics, floor: float) -> Drawing:
    names = {"no cable pushes": 0.0, f"tensions of {floor:g} N at least": floor}
    reached = {
        name: np.array([largest_radius(dynamics, least, float(below)) for below in DEPTHS])
        for name, least in names.items()
    }
    panel = Panel("largest radius [m]", reached, {"printed radius": RADIUS})
    return Drawing(
        "Largest radius under a hovering quadrotor, against the circle's depth below it",
        curves(DEPTHS, "depth below the quadrotor [m]", [panel], marks={"printed depth": BELOW}),
    )
