"""The largest circle of paper F's robot under a hovering quadrotor, by bisection, and at other depths below it.

A radius is feasible if tensions above a floor exist at every instant of the turn, by the tension solver. The smallest
tension falls with the radius, so bisection gives the largest feasible one. The verdict holds for all pairings of
anchors and attachments (`every_pairing`), not for crossed pairs alone.
"""

from collections.abc import Callable

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, load
from ...solvers import solve_batch
from ..accounts.claim import Chapter, Claim, Verdict
from .claims import claim
from .every_pairing import PAIRINGS, at_centre, hold, pull_inward
from .plans import BELOW, RADIUS, TIMES, circle, steady_tensions

PRECISION = 1e-4  # [m]
TURN = TIMES[:-1:5]  # 200 instants of one turn
RADII = np.linspace(0.0, 1.2, 61)
DEPTHS = np.linspace(0.4, 4.0, 10)  # of the circle under the quadrotor [m]
BEYOND = (0.25, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)  # radii [m] at which all pairings are tried, besides the printed one


def largest_radius(dynamics: Dynamics, floor: float = 0.0, below: float = BELOW) -> float:
    """Return the largest radius [m], up to 2 m, at which tensions of at least `floor` [N] exist all the time."""
    return _bisected(lambda radius: feasible(dynamics, radius, floor, below), 0.0, 2.0)


def feasible(dynamics: Dynamics, radius: float, floor: float, below: float = BELOW) -> bool:
    """Return whether tensions from `floor` [N] to the robot's t_max exist at every instant of the turn."""
    robot, motion = dynamics.robot, circle(radius, TURN, below)
    A, w = dynamics.relative.wrench_matrix(motion.pose), dynamics.relative.required_wrench(*motion)
    return bool(solve_batch(A, w, np.full(robot.m, floor), robot.t_max).feasible.all())


def largest_radius_of_any(low: float) -> float:
    """Return the largest radius [m], from `low` to 0.25 m, at which some pairing holds the platform all the time."""
    pairs = hold(low)
    return _bisected(lambda radius: len(hold(radius, pairs)) > 0, low, BEYOND[0])


def _bisected(holds: Callable[[float], bool], low: float, high: float) -> float:
    while high - low > PRECISION:
        middle = (low + high) / 2
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def chapter() -> Chapter:
    """Compare the largest radius at the paper's depth with the printed one, for every pairing."""
    dynamics = Dynamics(load("wang-flying"))
    floor = float(dynamics.robot.t_min.max())
    taut, kept = largest_radius(dynamics), largest_radius(dynamics, floor)
    best = largest_radius_of_any(taut - PRECISION)
    beyond = [radius for radius in (*BEYOND, RADIUS) if radius > best]
    largest = claim("radius").stated(
        best,
        best >= RADIUS or any(len(hold(radius)) for radius in beyond),
        printed=RADIUS,
        otherwise=Verdict.IMPOSSIBLE,
        pairings=len(PAIRINGS),
        taut=at_centre().taut.sum(),
        beyond=", ".join(f"{radius:g}" for radius in beyond),
        crossed=taut,
        kept=f"or {kept:.3f} m if every tension is at least {floor:g} N",
    )
    drawings = {"radius": _against_radius(dynamics, taut), "depth": _against_depth(dynamics, floor)}
    return Chapter([largest, _inward()], drawings)


def _inward() -> Claim:
    pull = pull_inward(RADIUS)
    return claim("circle-any-pairing").stated(
        pull.least, pull.least <= pull.needed, printed=pull.needed, otherwise=Verdict.IMPOSSIBLE, radius=RADIUS
    )


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
