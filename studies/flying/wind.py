"""Paper F's wind (figure 5) and its force on the platform (Eq. 25)."""

from math import erfc, sqrt

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, load
from ...models.air import trapezoid
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .motion import TIMES

PEAK = (5.0, 6.0, 2.0)  # printed in section VI [m/s]
NOISE = 0.5  # printed, of either sign [m/s]
DEVIATIONS = 3.0  # of the noise up to its amplitude, assumed by `trapezoid`
STEADY = (0.35, 0.65)  # of the time, inside the top of the trapezoid
AGAINST = np.array([-5.0, 0.0, 0.0])  # a wind that blows towards -x [m/s]


def chapter() -> Chapter:
    """Check figure 5 as drawn by this run, and the force of the printed formula."""
    dynamics = Dynamics(load("wang-flying"))
    wind, calm = trapezoid(TIMES, PEAK, noise=NOISE), trapezoid(TIMES, PEAK, noise=0.0)
    still = np.zeros((len(TIMES), 6))
    force = dynamics.aerodynamic_wrench(still, still, wind)[:, :3]
    claims = [_top(wind), _noise(wind - calm), _shape(), _sign(dynamics), _lift(dynamics)]
    return Chapter(claims, {"wind": _figure(wind, force)})


def _top(wind: np.ndarray) -> Claim:
    share = TIMES / TIMES[-1]
    top = wind[(share > STEADY[0]) & (share < STEADY[1])].mean(axis=0)
    return claim("fig-5-peak").undetermined(tuple(float(value) for value in top), printed=PEAK)


def _noise(noise: np.ndarray) -> Claim:
    """Report how many samples of a Gaussian sequence with this deviation are outside of the printed amplitudes."""
    deviation = NOISE / DEVIATIONS
    outside = erfc(NOISE / deviation / sqrt(2))
    return claim("fig-5-noise").undetermined(float(np.abs(noise).max()), printed=NOISE, outside=outside)


def _shape() -> Claim:
    corners = (0.1, 0.3, 0.7, 0.9)
    return claim("fig-5-shape").undetermined(tuple(corner * TIMES[-1] for corner in corners))


def _sign(dynamics: Dynamics) -> Claim:
    """Compare V^2, which has no direction, with V |V| in a wind along -x."""
    aero = dynamics.robot.platform.aero
    assert aero is not None
    printed = 0.5 * aero.drag * aero.air_density * AGAINST[0] ** 2 * aero.area
    return claim("eq-25-drag").compared(
        float(dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), AGAINST)[0]), printed=printed, against=AGAINST[0]
    )


def _lift(dynamics: Dynamics) -> Claim:
    """Report C_l rho (V_x^2 + V_y^2) S / 2 at the strongest wind, which nothing in the paper checks."""
    aero = dynamics.robot.platform.aero
    assert aero is not None
    printed = 0.5 * aero.lift * aero.air_density * (PEAK[0] ** 2 + PEAK[1] ** 2) * aero.area
    lift = float(dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), np.array(PEAK))[2])
    used = "as printed" if np.isclose(lift, printed) else "another one"
    return claim("eq-25-lift").undetermined(lift, printed=printed, used=used)


def _figure(wind: np.ndarray, force: np.ndarray) -> Drawing:
    winds = {name: wind[:, axis] for axis, name in enumerate("xyz")}
    forces = {name: force[:, axis] for axis, name in enumerate("xyz")}
    panels = [Panel("wind [m/s]", winds), Panel("force [N]", forces)]
    return Drawing(
        "Figure 5: the wind along x, y and z, and its force on a platform at rest", curves(TIMES, "time [s]", panels)
    )
