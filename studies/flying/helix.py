"""Paper F's section VI.A: the quadrotor flies straight, the platform circles below it (figures 6 and 7)."""

import numpy as np

from ...figures.curves import Panel, curve_in_space, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, load
from ...ocp.tasks.paths import Motion
from ...solvers import TensionProblem, solve
from ..accounts.claim import Chapter, Claim, Verdict
from .claims import claim
from .every_pairing import PAIRINGS, TURN, at_centre, pull_inward, tensions as tensions_of
from .plans import LINE, RADIUS, RATE, SECONDS, TIMES, circle, steady_tensions
from .rotations import instants

LIKE_A_SINE = 0.05  # of the amplitude, assumed: a smaller deviation is not visible in figure 7


def chapter() -> Chapter:
    """Check trajectories, lengths and tensions of VI.A."""
    dynamics = Dynamics(load("wang-flying"))
    body, base = circle(RADIUS), flight()
    world = Motion(*dynamics.relative.motion_in_world(*body, *base))
    lengths = dynamics.cable_lengths(world.pose, base.pose[:, None])
    tensions = steady_tensions(dynamics, body, base)
    arm = world.pose[:, :3] - base.pose[:, :3]  # about the line of the flight
    angle = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    radius_and_turns = np.linalg.norm(arm[:, :2], axis=1).mean(), np.ptp(angle) / (2 * np.pi)
    change = _change_with_attitude(dynamics)
    # Lengths compared with a sine; the printed pairing has lengths though its J has no inverse.
    printed = Dynamics(load("wang-flying-printed")).cable_lengths(body.pose)
    off, others = (off_sine(TIMES, each).max() for each in (printed, lengths))
    # Tensions compared with a sine, of every pairing that holds the platform at the centre.
    held = tensions_of(circle(RADIUS, TURN), PAIRINGS[at_centre().taut])
    most = off_sine(TURN, held.reshape(len(TURN), -1)).reshape(held.shape[1:]).max(axis=1)
    claims = [
        claim("fig-6").compared(radius_and_turns, printed=(1.0, 0.2 * SECONDS / 2)),
        claim("eq-5").stated(f"{change:.0e} m", change > 1e-9),
        claim("fig-7-lengths").undetermined(off, others=others),
        claim("fig-7-tensions").stated(most.min(), most.min() <= LIKE_A_SINE, like_a_sine=LIKE_A_SINE, count=len(most)),
        claim("VI.A-flight").compared(np.abs(steady_tensions(dynamics, body) - tensions).max()),
        _positive(dynamics, world, base, tensions),
    ]
    from_quadrotor = Panel("from the quadrotor [m]", dict(zip("xyz", arm.T, strict=True)))
    drawings = {
        "helix": Drawing(
            "Figure 6: the quadrotor's straight flight and the platform's helix in {G}",
            curve_in_space({"quadrotor": base.pose[:, :3], "platform": world.pose[:, :3]}),
        ),
        "helix-arm": Drawing(
            "Figure 6, enlarged: the platform's position relative to the quadrotor, along the axes of {G}",
            curves(TIMES, "time [s]", [from_quadrotor]),
        ),
        "helix-cables": Drawing(
            "Figure 7: lengths, and the tensions that the motion requires; below 0 N a cable would have to push",
            curves(
                TIMES,
                "time [s]",
                [Panel.of_cables("length [m]", lengths), Panel.of_cables("tension [N]", tensions, {"0 N": 0.0})],
            ),
        ),
    }
    return Chapter(claims, drawings)


def flight() -> Motion:
    """Return the quadrotor's flight, level and at constant speed, (n, 6) each."""
    return LINE.at(TIMES, SECONDS)


def _change_with_attitude(dynamics: Dynamics) -> float:
    """Return how much lengths at one relative pose differ under quadrotors of different attitudes [m]."""
    samples = instants()
    body, zero = np.tile(circle(RADIUS).pose[0], (len(samples.base.pose), 1)), np.zeros_like(samples.base.pose)
    world = dynamics.relative.motion_in_world(body, zero, zero, samples.base.pose, zero, zero)[0]
    return np.ptp(dynamics.cable_lengths(world, samples.base.pose[:, None]), axis=0).max()


def off_sine(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the largest distances of (n, k) values from the nearest sine of the printed rate, over its amplitude."""
    basis = np.stack([np.ones_like(times), np.cos(RATE * times), np.sin(RATE * times)], axis=1)
    fit = np.linalg.lstsq(basis, values)[0]
    return np.abs(values - basis @ fit).max(axis=0) / np.hypot(fit[1], fit[2])


def _positive(dynamics: Dynamics, world: Motion, base: Motion, tensions: np.ndarray) -> Claim:
    """Check the smallest tension, with the certificate of its instant."""
    row = int(tensions.min(axis=1).argmin())
    problem = TensionProblem(
        dynamics.wrench_matrix(world.pose[row], base.pose[row, None]),
        dynamics.required_wrench(*(part[row] for part in world)),
        np.zeros(6),
        dynamics.robot.t_max,
    )
    proof = solve(problem).certificate
    shortfall = proof.shortfall if proof is not None and proof.verify(problem) else 0.0
    pull = pull_inward(RADIUS)
    excluded = pull.least > pull.needed
    return claim("fig-7-positive").stated(
        f"{tensions.min():.1f} N",
        shortfall <= 0 and not excluded,
        otherwise=Verdict.IMPOSSIBLE if excluded else Verdict.NOT_DETERMINED,
        why=f"With any pairing, the cables would have to pull inward with at least {pull.least:.1f} N to carry the "
        f"weight, but the motion needs only {pull.needed:.2f} N. With crossed pairs, tensions that are "
        f"not negative give {shortfall:.2f} N too little at {TIMES[row]:.1f} s, along a verified direction."
        if excluded
        else "With crossed pairs no tensions give the wrench, which excludes no other pairing.",
    )
