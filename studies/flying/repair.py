"""Paper F's motions with r = 1 m: a proof that the base cannot hover, and plans with the base free.

The quadrotor of the paper hovers or flies straight, so a plan with a free one reproduces nothing: it is a repair.
"""

import numpy as np

from ...figures import plan as figures
from ...figures.drawing import Drawing
from ...models import load
from ...ocp import Plan, plan
from ..accounts.claim import Chapter, Claim, Verdict
from . import plans
from .circle import tasks
from .claims import claim
from .every_pairing import pull_inward
from .plans import RADIUS

ON_CIRCLE = 0.01  # [m], allowed distance of the platform from its circle


def chapter() -> Chapter:
    """Plan the circle under a hovering quadrotor, and circle and helix with the quadrotor free."""
    hovering = plan(load("wang-flying"), tasks()[0])
    circle, helix = plans.planned("circle"), plans.planned("helix")
    claims = [
        _hovering(hovering),
        _repaired("circle-repair", "VI.B", "circle", circle, "repair"),
        _repaired("helix-repair", "VI.A", "helix", helix, "repair-helix"),
    ]
    both = {"quadrotor hovering": hovering.trajectory, "quadrotor free": circle.trajectory}
    drawings = {
        "circle-tensions": Drawing("The circle of radius 1 m: tensions", figures.tensions_side_by_side(both)),
        "repair": Drawing("The circle of radius 1 m with the quadrotor free", figures.path(circle.trajectory)),
        "repair-base": Drawing("The position of the free quadrotor", figures.base_offset(circle.trajectory)),
        "repair-helix": Drawing("The helix with the quadrotor free", figures.path(helix.trajectory)),
    }
    return Chapter(claims, drawings)


def _hovering(planned: Plan) -> Claim:
    proof, robot = planned.certificate, planned.scenario.robot
    pull = pull_inward(RADIUS)
    excluded = pull.least > pull.needed
    why = "There is no certificate."
    if proof is not None:
        cables = ", ".join(str(index + 1) for index in proof.binding)
        why = (
            f"Without wind, at {proof.time:.2f} s, tensions from {robot.t_min.min():g} N to {robot.t_max.max():g} N "
            f"give {proof.shortfall:.2f} N too little along a verified direction; cables {cables} are at their limits."
        )
    why += (
        f" With any other pairing, the cables would have to pull inward with at least {pull.least:.1f} N to carry the "
        f"weight, but the motion needs only {pull.needed:.2f} N."
        if excluded
        else " That excludes crossed pairs alone."
    )
    return claim("circle").stated(
        planned.status.value,
        planned.feasible,
        otherwise=Verdict.IMPOSSIBLE if proof is not None and excluded else Verdict.NOT_DETERMINED,
        radius=RADIUS,
        why=why,
    )


def _repaired(name: str, place: str, what: str, planned: Plan, figure: str) -> Claim:
    """Check the audited plan with the base free."""
    low, high = planned.tension_min, planned.tension_max
    tensions = "" if low is None or high is None else f"tensions from {low:.2f} N to {high:.2f} N"
    apart = planned.trajectory["carrier_pose"].values[:, 0, :2] - planned.trajectory["pose"].values[:, :2]
    return claim("free-quadrotor").repaired(
        planned.tracking_error_max,
        planned.feasible and planned.tracking_error_max <= ON_CIRCLE,
        name=name,
        place=place,
        what=what,
        radius=RADIUS,
        figure=figure,
        away=100 * np.linalg.norm(apart, axis=1).max(),
        tensions=tensions,
        rate=planned.audit.rate,
    )
