"""Paper F's section VI.A: the quadrotor flies straight, the platform circles below it (figures 6 and 7)."""

from __future__ import annotations

import numpy as np

from ...figures.curve_in_space import curve_in_space
from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, load
from ...ocp.tasks.paths import LinePath, Motion
from ...solvers import TensionProblem, solve
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict, compared, stated
from .instants import instants
from .motion import RADIUS, TIMES, circle, steady_tensions
from .plans import END, RATE, SECONDS, START

LIKE_A_SINE = 0.05  # of the amplitude, assumed: a smaller deviation is not visible in figure 7


def chapter() -> Chapter:
    """Check trajectories, lengths and tensions of VI.A."""
    dynamics = Dynamics(load("wang-flying"))
    body, base = circle(RADIUS), flight()
    world = Motion(*dynamics.relative.motion_in_world(*body, *base))
    lengths = dynamics.cable_lengths(world.pose, base.pose[:, None])
    tensions = steady_tensions(dynamics, body, base)
    claims = [
        _turns(world, base),
        _independent(dynamics),
        _sine("fig-7-lengths", "lengths", lengths),
        _sine("fig-7-tensions", "tensions", tensions),
        _undisturbed(dynamics, body, tensions),
        _positive(dynamics, world, base, tensions),
    ]
    drawings = {
        "helix": Drawing(
            "Figure 6: the quadrotor's straight flight and the platform's helix in {G}",
            curve_in_space({"quadrotor": base.pose[:, :3], "platform": world.pose[:, :3]}),
        ),
        "helix-arm": Drawing(
            "Figure 6, enlarged: the platform's position relative to the quadrotor, along the axes of {G}",
            curves(TIMES, "time [s]", [_arm(world, base)]),
        ),
        "helix-cables": Drawing(
            "Figure 7: lengths, and the tensions that the motion requires; below 0 N a cable would have to push",
            curves(TIMES, "time [s]", [_panel("length [m]", lengths), _panel("tension [N]", tensions, {"0 N": 0.0})]),
        ),
    }
    return Chapter(claims, drawings)


def flight() -> Motion:
    """Return the quadrotor's flight, level and at constant speed, (n, 6) each."""
    line = LinePath(kind="line", start=(*START, 0, 0, 0), end=(*END, 0, 0, 0), timing="uniform")
    return line.at(TIMES, SECONDS)


def _arm(world: Motion, base: Motion) -> Panel:
    arm = world.pose[:, :3] - base.pose[:, :3]
    return Panel("from the quadrotor [m]", {name: arm[:, axis] for axis, name in enumerate("xyz")})


def _panel(label: str, values: np.ndarray, bounds: dict[str, float] | None = None) -> Panel:
    return Panel(label, {f"cable {index + 1}": values[:, index] for index in range(6)}, bounds or {})


def _turns(world: Motion, base: Motion) -> Claim:
    """Check the radius about the line of the flight, and the number of turns."""
    arm = world.pose[:, :2] - base.pose[:, :2]
    angle = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    return compared(
        "fig-6",
        "VI.A, figure 6",
        "In {G} the platform follows a helix of r = 1 m once in 10 s, at 0.2 pi rad/s (radius in m, turns).",
        (1.0, 0.2 * SECONDS / 2),
        (float(np.linalg.norm(arm, axis=1).mean()), float(np.ptp(angle) / (2 * np.pi))),
        within=1e-9,
        agrees="It does, 1 m below the quadrotor, which flies at constant speed.",
        differs="The composed motion has another radius or another number of turns.",
        figure="helix",
    )


def _independent(dynamics: Dynamics) -> Claim:
    """Compare lengths at one relative pose under quadrotors of different attitudes."""
    samples = instants()
    body, zero = np.tile(circle(RADIUS).pose[0], (len(samples.base.pose), 1)), np.zeros_like(samples.base.pose)
    world = dynamics.relative.motion_in_world(body, zero, zero, samples.base.pose, zero, zero)[0]
    lengths = dynamics.cable_lengths(world, samples.base.pose[:, None])
    change = float(np.ptp(lengths, axis=0).max())
    return stated(
        "eq-5",
        "Eqs. 4, 5",
        "The lengths depend on the quadrotor's attitude, not on its position (change with the attitude).",
        "they change",
        f"{change:.0e} m",
        holds=change > 1e-9,
        agrees="At one pose in {A} they change with the attitude.",
        differs="R_A rotates the whole vector and does not change its norm. With x_b and R_B given in {A}, as here, "
        "the "
        "lengths depend neither on attitude nor on position.",
    )


def _sine(name: str, what: str, values: np.ndarray) -> Claim:
    """Check the largest distance from the nearest sine of the printed rate, over its amplitude."""
    basis = np.stack([np.ones_like(TIMES), np.cos(RATE * TIMES), np.sin(RATE * TIMES)], axis=1)
    fit = np.linalg.lstsq(basis, values)[0]
    off = np.abs(values - basis @ fit).max(axis=0) / np.hypot(fit[1], fit[2])
    most = float(off.max())
    return stated(
        name,
        "VI.A, figure 7",
        f"The {what} vary as a sine or cosine, because the motion is a spiral (distance from a sine over its "
        "amplitude).",
        0.0,
        most,
        holds=most <= LIKE_A_SINE,
        agrees=f"It is at most {LIKE_A_SINE:.0%}, which is not visible in a figure.",
        differs=f"It is more than {LIKE_A_SINE:.0%}, which is taken as visible in a figure: the squares of the lengths "
        "are "
        "sines, but lengths and tensions have harmonics.",
        figure="helix-cables",
    )


def _undisturbed(dynamics: Dynamics, body: Motion, tensions: np.ndarray) -> Claim:
    hovering = steady_tensions(dynamics, body)
    return compared(
        "VI.A-flight",
        "VI.A",
        "Ideally only the winding moves the platform (change of the tensions in straight flight).",
        0.0,
        float(np.abs(hovering - tensions).max()),
        within=1e-9,
        agrees="A level flight without acceleration is no disturbance: the tensions are those under a hovering "
        "quadrotor.",
        differs="The flight disturbs the tensions.",
        unit="N",
    )


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
    return stated(
        "fig-7-positive",
        "VI.A, figure 7, section II",
        "Cables pull, F > 0, along the whole helix of r = 1 m (smallest tension of its only solution).",
        "> 0 N",
        f"{tensions.min():.1f} N",
        holds=shortfall <= 0,
        otherwise=Verdict.IMPOSSIBLE,
        agrees="Tensions above zero exist, at the worst instant too.",
        differs=f"At {TIMES[row]:.1f} s no tensions from 0 N to t_max give the wrench: along a verified direction they "
        "are "
        f"short by {shortfall:.2f} N.",
        figure="helix-cables",
    )
