"""Paper F's section VI.B: cable 1 while the platform vibrates under a hovering quadrotor (figures 8 to 11).

The paper prints neither the amplitude and the frequency of the vibration nor the time step. Assumed: along each axis a
sine of one amplitude at 5, 6 and 7 Hz, no rotation; steps of 10 ms; 8 elements, whose number does not matter. On the
printed circle the steady tension of cable 1 passes zero, so the ratio dT / T is computed on a circle of radius 0.15 m.
The printed pairing has no inverse, so its tensions are not determined; what depends on the choice of crossed pairs in
its place is computed for the other pairings too (`every_pairing`).
"""

from typing import Literal

import numpy as np
from scipy.optimize import root_scalar
from scipy.stats import pearsonr

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, Robot, load
from ...models.cables.driving_force import DrivingForce, driving_force
from ...ocp.tasks.paths import Motion
from ..accounts.claim import Chapter, Claim
from .cable import constants
from .claims import claim
from .every_pairing import PAIRINGS, PRINTED, at_centre, hold, tensions as tensions_of
from .plans import FEASIBLE, RADIUS, TIMES, circle, steady_tensions

RATIO = 0.1247  # printed: the largest dT / T of cable 1
STEP, STEPS = 0.01, (0.001, 0.01, 0.1)  # [s]
ELEMENTS = 8
HERTZ = np.array([5.0, 6.0, 7.0])
PHASES = np.array([0.0, 1.0, 2.0])  # [rad]
AMPLITUDES = np.geomspace(1e-8, 1e-4, 17)  # [m]
WINDINGS: tuple[Literal["printed", "paid out"], ...] = ("printed", "paid out")
COARSE = TIMES[:-1:20]  # 50 instants of one turn, for all pairings
HALF_WINDOW = 0.5  # of the figure [s]
NEAR_ZERO, FAR = 1e-10, 1e-3  # amplitudes between which the printed ratio is searched [m]


def chapter() -> Chapter:
    """Check lengths, tensions and the ratio of cable 1."""
    robot = load("wang-flying")
    dynamics = Dynamics(robot)
    motions = {f"r = {radius:g} m": circle(radius) for radius in (RADIUS, FEASIBLE)}
    lengths = {name: dynamics.cable_lengths(motion.pose)[:, 0] for name, motion in motions.items()}
    tensions = {name: steady_tensions(dynamics, motion)[:, 0] for name, motion in motions.items()}
    large = next(iter(motions))
    amplitudes = {step: amplitude_of(robot, RATIO, step) for step in STEPS}
    # Every start of the turn: where half a turn later the cable is longer, and the share of such starts.
    turn = lengths[large][:-1]
    opposite, start = np.roll(turn, -(len(turn) // 2)), int(turn.argmin())
    # Eq. 13, taken literally, on the printed circle without vibration.
    still, span = np.zeros(6), float(np.ptp(tensions[large]))
    literal, paid_out = (
        driving_force(robot, *motions[large], still, STEP, ELEMENTS, winding=how).dT_K[:, 0].max() for how in WINDINGS
    )
    steps = ", ".join(f"{size * 1e6:.3g} um with steps of {step * 1e3:g} ms" for step, size in amplitudes.items())
    ratio = float(largest_ratios(robot, np.array([amplitudes[STEP]]))[0])
    claims = [
        claim("fig-9-length").undetermined(
            f"{turn[start]:.3f} m, {opposite[start]:.3f} m, {turn[start]:.3f} m", share=(opposite > turn).mean()
        ),
        _tension(),
        claim("eq-13").compared(paid_out, printed=literal, within=0.01 * span, step=STEP * 1000.0, span=span),
        claim("fig-8").undetermined(HERTZ),
        _no_ratio(tensions[large]),
        claim("fig-11").undetermined(
            f"{ratio:.2%} at {amplitudes[STEP] * 1e6:.2f} um", printed=f"{RATIO:.2%}", feasible=FEASIBLE, steps=steps
        ),
    ]
    panels = [Panel("length [m]", lengths), Panel("tension [N]", tensions, {"0 N": 0.0})]
    drawn = Drawing("Figures 9 and 10: cable 1 over a turn, without vibration", curves(TIMES, "time [s]", panels))
    drawings = {"turn": drawn, "vibration": _curves(robot, amplitudes[STEP]), "ratio": _against_amplitude(robot)}
    return Chapter(claims, drawings)


def vibration(amplitude: float) -> np.ndarray:
    """Return the vibration of the pose at each of `TIMES`, (n, 6) [m, rad], with `amplitude` [m] along each axis."""
    shift = amplitude * np.sin(2 * np.pi * np.outer(TIMES, HERTZ) + PHASES)
    return np.hstack([shift, np.zeros_like(shift)])


def forces(robot: Robot, amplitude: float) -> DrivingForce:
    """Return the driving forces on the small circle with that vibration."""
    return driving_force(robot, *circle(FEASIBLE), vibration(amplitude), STEP, ELEMENTS)


def largest_ratios(robot: Robot, amplitudes: np.ndarray, step: float = STEP) -> np.ndarray:
    """Return the largest dT / T of cable 1 over the turn at each of the amplitudes (k,) [m], (k,)."""
    count = len(amplitudes)
    motion = Motion(*(np.tile(part, (count, 1)) for part in circle(FEASIBLE)))
    shaken = np.concatenate([vibration(float(amplitude)) for amplitude in amplitudes])
    ratio = driving_force(robot, *motion, shaken, step, ELEMENTS).ratio[:, 0]
    return np.abs(ratio).reshape(count, -1).max(axis=1)


def amplitude_of(robot: Robot, ratio: float, step: float = STEP) -> float:
    """Return the amplitude [m] at which the largest dT / T is `ratio`."""

    def above(amplitude: float) -> float:
        return float(largest_ratios(robot, np.array([amplitude]), step)[0]) - ratio

    return float(root_scalar(above, bracket=(NEAR_ZERO, FAR), method="brentq", xtol=1e-10).root)


def together(pairs: np.ndarray, radius: float) -> np.ndarray:
    """Return the correlations of length and tension of cable 1 over a turn, of pairings (k, 6), (k,)."""
    robot, motion = load(PRINTED), circle(radius, COARSE)
    ends = robot.attachments[pairs[:, 0]] + motion.pose[:, None, :3]
    lengths = np.linalg.norm(robot.anchors[0] - ends, axis=-1)
    return np.asarray(pearsonr(lengths, tensions_of(motion, pairs)[..., 0], axis=0)[0])


def _tension() -> Claim:
    taut = PAIRINGS[at_centre().taut]
    flying = hold(FEASIBLE, taut)
    correlations = together(flying, FEASIBLE)
    ends = correlations.min(), correlations.max()
    return claim("fig-10-tension").stated(ends, ends[0] > 0, feasible=FEASIBLE, flying=len(flying))


def _no_ratio(tensions: np.ndarray) -> Claim:
    """Count the pairings with an inverse whose T_1 changes its sign, where dT / T has no bound."""
    crossing = TIMES[np.flatnonzero(np.diff(np.sign(tensions)))]
    pulls = tensions_of(circle(RADIUS, COARSE), PAIRINGS[at_centre().full_rank])[..., 0]
    changing = int((np.ptp(np.sign(pulls), axis=0) > 0).sum())
    return claim("fig-11-circle").undetermined(
        f"{pulls.shape[1] - changing} of {pulls.shape[1]}",
        radius=RADIUS,
        crossing=", ".join(f"{time:.1f} s" for time in crossing),
    )


def _curves(robot: Robot, amplitude: float) -> Drawing:
    """Draw figures 9 to 11 for the second about the largest ratio, where single waves are visible."""
    shaken, still = forces(robot, amplitude), forces(robot, 0.0)
    rows = np.abs(TIMES - TIMES[np.abs(shaken.ratio[:, 0]).argmax()]) <= HALF_WINDOW
    longer = shaken.dT_C[:, 0] * STEP / constants(robot)[1]  # Eq. 11 backwards
    panels = [
        Panel("length [m]", {"expected": still.lengths[rows, 0]}),
        Panel("added [um]", {"by vibration": 1e6 * longer[rows]}),
        Panel("T [N]", {"expected": still.T[rows, 0], "with vibration": shaken.T[rows, 0]}),
        Panel("dT [N]", {"by damping": shaken.dT_C[rows, 0], "by elasticity": shaken.dT_K[rows, 0]}),
        Panel("dT / T [%]", {"with vibration": 100 * shaken.ratio[rows, 0]}, {"12.47 %": 100 * RATIO}),
    ]
    return Drawing(
        f"Figures 9 to 11 about the largest ratio: cable 1, circle of radius {FEASIBLE:g} m, {amplitude * 1e6:.2g} um",
        curves(TIMES[rows], "time [s]", panels),
    )


def _against_amplitude(robot: Robot) -> Drawing:
    """Draw the ratio for several steps, as long as it is below 1."""
    ratios = {f"step {step * 1e3:g} ms": 100 * largest_ratios(robot, AMPLITUDES, step) for step in STEPS}
    shown = {name: np.where(values < 100, values, np.nan) for name, values in ratios.items()}
    panel = Panel("largest dT / T [%]", shown, {"12.47 % (printed)": 100 * RATIO}, logarithmic=True)
    return Drawing(
        "Figure 11: the largest dT / T of cable 1 against the amplitude of the vibration",
        curves(AMPLITUDES * 1e6, "amplitude [um]", [panel], logarithmic=True),
    )
