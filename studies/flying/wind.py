"""Paper F's wind (figure 5) and its force on the platform (Eq. 25)."""

from math import erfc, sqrt

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, load
from ...models.air import trapezoid
from ..accounts.claim import Chapter, Claim
from .claims import claim
from .plans import TIMES

PEAK = (5.0, 6.0, 2.0)  # printed in section VI [m/s]
NOISE = 0.5  # printed, of either sign [m/s]
DEVIATIONS = 3.0  # of the noise up to its amplitude, assumed by `trapezoid`
STEADY = (0.35, 0.65)  # of the time, inside the top of the trapezoid
AGAINST = np.array([-5.0, 0.0, 0.0])  # a wind that blows towards -x [m/s]


def chapter() -> Chapter:
    """Check figure 5 as drawn by this run, and the force of the printed formula."""
    dynamics = Dynamics(load("wang-flying"))
    wind, calm = trapezoid(TIMES, PEAK, noise=NOISE), trapezoid(TIMES, PEAK, noise=0.0)
    share = TIMES / TIMES[-1]
    top = wind[(share > STEADY[0]) & (share < STEADY[1])].mean(axis=0)
    # Samples of a Gaussian sequence with this deviation that are outside of the printed amplitudes.
    outside = erfc(NOISE / (NOISE / DEVIATIONS) / sqrt(2))
    claims = [
        claim("fig-5-peak").undetermined(top, printed=PEAK),
        claim("fig-5-noise").undetermined(np.abs(wind - calm).max(), printed=NOISE, outside=outside),
        claim("fig-5-shape").undetermined(TIMES[-1] * np.array([0.1, 0.3, 0.7, 0.9])),
        *_force(dynamics),
    ]
    still = np.zeros((len(TIMES), 6))
    force = dynamics.aerodynamic_wrench(still, still, wind)[:, :3]
    given = {"wind [m/s]": wind, "force [N]": force}
    panels = [Panel(label, dict(zip("xyz", values.T, strict=True))) for label, values in given.items()]
    about = "Figure 5: the wind along x, y and z, and its force on a platform at rest"
    return Chapter(claims, {"wind": Drawing(about, curves(TIMES, "time [s]", panels))})


def _force(dynamics: Dynamics) -> list[Claim]:
    """Compare V^2, which has no direction, with V |V| in a wind along -x, and report the lift at the strongest wind.

    The lift is C_l rho (V_x^2 + V_y^2) S / 2, which nothing in the paper checks.
    """
    aero = dynamics.robot.platform.aero
    assert aero is not None
    against, strongest = (
        dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), wind) for wind in (AGAINST, np.array(PEAK))
    )
    half = 0.5 * aero.air_density * aero.area
    drag, lift = half * aero.drag * AGAINST[0] ** 2, half * aero.lift * (PEAK[0] ** 2 + PEAK[1] ** 2)
    used = "as printed" if np.isclose(strongest[2], lift) else "another one"
    return [
        claim("eq-25-drag").compared(against[0], printed=drag, against=AGAINST[0]),
        claim("eq-25-lift").undetermined(strongest[2], printed=lift, used=used),
    ]
