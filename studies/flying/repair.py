"""Paper F's motions with r = 1 m: the proof that a hovering quadrotor cannot fly them, and plans with the base free."""

from __future__ import annotations

import numpy as np

from ...figures import plan as figures
from ...figures.drawing import Drawing
from ...models import load
from ...ocp import Plan, plan
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict, stated
from . import plans
from .circle import tasks
from .motion import RADIUS

ASTRAY = 0.01  # [m]: how far from its circle a plan may lead the platform


def chapter() -> Chapter:
    """The circle under a hovering quadrotor, and circle and helix with the quadrotor free."""
    robot = load("wang-flying")
    hovering_task, free_task = tasks()
    hovering, circle, helix = (plan(robot, task) for task in (hovering_task, free_task, plans.helix()))
    claims = [
        _hovering(hovering),
        _repaired("circle-repair", "VI.B", "circle", circle, "repair"),
        _repaired("helix-repair", "VI.A", "helix", helix, "repair-helix"),
    ]
    both = {"quadrotor hovering": hovering.trajectory, "quadrotor free": circle.trajectory}
    drawings = {
        "circle-tensions": Drawing("The circle of 1 m: tensions", figures.tensions_side_by_side(both)),
        "repair": Drawing("The circle of 1 m with the quadrotor free", figures.path(circle.trajectory)),
        "repair-base": Drawing("Where the free quadrotor is", figures.base_offset(circle.trajectory)),
        "repair-helix": Drawing("The helix with the quadrotor free", figures.path(helix.trajectory)),
    }
    return Chapter(claims, drawings)


def _hovering(found: Plan) -> Claim:
    proof = found.certificate
    cables = "" if proof is None else ", ".join(str(index + 1) for index in proof["binding"])
    why = (
        "no proof was found"
        if proof is None
        else f"At {proof['time']:.2f} s the wrench is {proof['shortfall']:.2f} N beyond what tensions inside "
        f"{found.scenario.robot.t_min.min():g} N to {found.scenario.robot.t_max.max():g} N can give along a verified "
        f"direction; the limits of cables {cables} bind."
    )
    return stated(
        "circle",
        "VI.B, figures 8 to 10",
        f"Under a quadrotor hovering at [50, 50, 100] m the platform flies a circle of {RADIUS:g} m at 99 m.",
        "tensions are drawn",
        found.status.value,
        holds=found.feasible,
        otherwise=Verdict.IMPOSSIBLE if proof is not None else Verdict.NOT_DETERMINED,
        agrees="Every tension is inside its limits, audited at 1 kHz.",
        differs=why,
        figure="circle-tensions",
    )


def _repaired(name: str, place: str, what: str, found: Plan, figure: str) -> Claim:
    """A plan with the base free, audited."""
    followed = found.feasible and found.tracking_error_max <= ASTRAY
    low, high = found.tension_min, found.tension_max
    tensions = "" if low is None or high is None else f"tensions from {low:.2f} N to {high:.2f} N"
    apart = found.trajectory["carrier_pose"].values[:, 0, :2] - found.trajectory["pose"].values[:, :2]
    away = float(np.linalg.norm(apart, axis=1).max())
    return stated(
        name,
        place,
        f"The platform follows the {what} of {RADIUS:g} m in {{G}}, here with the quadrotor free: farthest off it.",
        0.0,
        found.tracking_error_max,
        holds=followed,
        agrees=f"It can where the quadrotor moves along, no farther than {100 * away:.0f} cm beside it: {tensions}, "
        f"audited at {found.audit.rate:g} Hz.",
        differs="No plan was found.",
        unit="m",
        figure=figure,
    )
