"""Paper F's figures 12 to 15: the tension of cable 1 with and without D_B, under a quadrotor that moves and pitches.

The recognised text has the captions of these figures and not their section. Assumed, as in `plans`: VI.A's line,
pitching by 0.1 sin(0.2 pi t) rad, with the surge that a quadrotor has when its thrust pitches; and a circle of radius
0.15 m in {A}, on which every cable pulls. "Without D_B" means with the D_B of a level, hovering quadrotor, which is the
weight alone.
"""

import numpy as np

from ...figures.curves import Panel, curve_in_space, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, load
from ...ocp.tasks.paths import Motion
from ..accounts.claim import Chapter
from .claims import claim
from .helix import flight
from .plans import FEASIBLE, NOT_READ, PITCH, SECONDS, TIMES, circle, pitching_flight, steady_tensions

CAPTIONS = {
    "disturbance-flight": "Figure 12: the quadrotor's flight in {G}, assumed",
    "disturbance": "Figures 13 to 15: pitch, tension of cable 1 with and without D_B, and its relative error",
    "mobility": "Conclusion 3: the range of all tensions against the quadrotor's largest pitch",
}
PITCHES = np.linspace(0.0, 0.3, 7)  # largest pitch [rad]


def chapter() -> Chapter:
    """Compare tensions with and without D_B, and their range as the quadrotor moves more."""
    dynamics = Dynamics(load("wang-flying"))
    body, base = circle(FEASIBLE), flown(PITCH)
    without, moving = steady_tensions(dynamics, body), steady_tensions(dynamics, body, base)
    straight = steady_tensions(dynamics, body, pitching_on_the_line())
    error, worse = (100 * np.abs(without - part) / np.abs(part) for part in (moving, straight))
    spans = np.array([np.ptp(steady_tensions(dynamics, body, flown(float(pitch)))) for pitch in PITCHES])
    claims = [
        claim("fig-12-13").undetermined(np.degrees(PITCH), not_read=NOT_READ),
        claim("fig-15").undetermined(error[:, 0].max(), not_read=NOT_READ, worse=worse[:, 0].max()),
        claim("conclusion-D_B").stated(f"{error.max():.1f} %", error.max() > 1.0),
        claim("conclusion-mobility").stated(
            f"{spans[0]:.2f} N at rest, {spans[-1]:.2f} N pitching by {np.degrees(PITCHES[-1]):.0f} degrees",
            (np.diff(spans) > 0).all(),
        ),
    ]
    panels = [
        Panel("pitch [degrees]", {"assumed": np.degrees(base.pose[:, 4])}),
        Panel("tension [N]", {"with D_B": moving[:, 0], "without D_B": without[:, 0]}),
        Panel("relative error [%]", {"of cable 1": error[:, 0]}),
    ]
    span = Panel("largest - smallest T [N]", {"": spans})
    figures = {
        "disturbance-flight": curve_in_space({"quadrotor": base.pose[:, :3]}),
        "disturbance": curves(TIMES, "time [s]", panels),
        "mobility": curves(np.degrees(PITCHES), "largest pitch [degrees]", [span]),
    }
    return Chapter(claims, {name: Drawing(CAPTIONS[name], figure) for name, figure in figures.items()})


def flown(pitch: float) -> Motion:
    """Return the motion of the quadrotor in {G}, pitching by up to `pitch` [rad] with its surge, (n, 6) each."""
    return pitching_flight(pitch).at(TIMES, SECONDS)


def pitching_on_the_line() -> Motion:
    """Return the same pitch on VI.A's straight line, which a thrust along the quadrotor's axis cannot give."""
    turned, line = flown(PITCH), flight()
    return Motion(*(np.hstack([ahead[:, :3], tilt[:, 3:]]) for ahead, tilt in zip(line, turned, strict=True)))
