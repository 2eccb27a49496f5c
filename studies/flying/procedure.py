"""Paper F's section V, the procedure for the driving forces, run step by step and compared with this toolkit.

Each step is taken as printed, where it can be, instant by instant and cable by cable: lengths by Eq. 5, damping by
Eq. 11, elasticity by the assembled chain of Eq. 21, T by Eq. 38. `driving_force` does the same in one pass over arrays.
The paper prints no result of a step, so that both agree is no verdict on the paper. Whether the increments are those
of a vibrating cable is checked by its plant (`shaken`).
"""

from dataclasses import dataclass

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, Robot, load
from ...models.cables import ElementChain
from ...models.cables.driving_force import driving_force
from ...models.diagnosis import diagnose
from ...models.points import rotations
from ...ocp.tasks.paths import Motion
from ..accounts.claim import Chapter, Claim, Verdict
from .cable import constants
from .claims import claim
from .plans import FEASIBLE, TIMES, circle, solved
from .rotations import turn
from .vibration import ELEMENTS, STEP, vibration

AMPLITUDE = 1e-6  # of the vibration [m], assumed
ROWS = slice(0, 101, 5)  # the instants of the run: the first second
SAME = 1e-9  # [m, N]


@dataclass(frozen=True)
class Run:
    """Results of the steps, (n, 6) each; see `driving_force` for the names."""

    times: np.ndarray  # (n,)
    lengths: np.ndarray
    elements: np.ndarray
    dT_C: np.ndarray  # noqa: N815
    dT_K: np.ndarray  # noqa: N815
    T: np.ndarray


def chapter() -> Chapter:
    """Run the eight steps and compare them."""
    robot, motion, shake = load("wang-flying"), Motion(*(part[ROWS] for part in circle(FEASIBLE))), vibration(AMPLITUDE)
    run = steps(robot, motion, shake[ROWS])
    own = driving_force(robot, *motion, shake[ROWS], STEP, ELEMENTS)
    rank = diagnose(load("wang-flying-printed")).rank_level
    dT = run.dT_C + run.dT_K
    # The balance in {G} with F = T + dT on the platform, and its error if T' is the time derivative of T.
    A, w = Dynamics(robot).wrench_matrix(motion.pose), Dynamics(robot).required_wrench(*motion)
    slope = np.gradient(run.T, run.times, axis=0)
    meant, literal = (np.abs(turn(A, run.T + part) - w).max() for part in (dT, slope))
    claims = [
        claim("step-1").undetermined(f"dt = {STEP:g} s, n = {ELEMENTS}, amplitude {AMPLITUDE * 1e6:g} um"),
        _same(2, "cable lengths l_i(t), Eq. 5", run.lengths, own.lengths, "m"),
        _same(3, "element lengths e_i(t) = l_i(t) / n", run.elements, own.lengths / ELEMENTS, "m"),
        _same(4, "damping increments dT_C, Eqs. 10 and 11", run.dT_C, own.dT_C, "N"),
        _same(5, "elastic increments dT_K, Eq. 21 as corrected", run.dT_K, own.dT_K, "N"),
        _same(6, "increments dT = dT_C + dT_K, Eq. 23", dT, own.dT, "N"),
        claim("step-7").compared(literal, within=SAME, meant=meant),
        claim("step-7-inverse").stated(rank, rank == 6, otherwise=Verdict.IMPOSSIBLE),
        # Times of t = t + k dt for k = 1, 2, 3, ..., and those of a constant step.
        claim("step-8").compared(STEP * np.arange(4), printed=np.cumsum(STEP * np.arange(4))),
    ]
    labels = {"lengths": "length [m]", "dT_C": "dT_C [N]", "dT_K": "dT_K [N]", "T": "T [N]"}
    panels = [
        Panel(label, {"in one pass": getattr(own, name)[:, 0]}, dots={"step by step": getattr(run, name)[:, 0]})
        for name, label in labels.items()
    ]
    about = f"Section V for cable 1: circle of radius {FEASIBLE:g} m, vibration of {AMPLITUDE * 1e6:g} um"
    return Chapter(claims, {"procedure": Drawing(about, curves(run.times, "time [s]", panels))})


def steps(robot: Robot, motion: Motion, shake: np.ndarray) -> Run:
    """Run steps 2 to 8 for a level, hovering quadrotor, so that {A} and {G} have the same axes."""
    rows = [_instant(robot, pose, small) for pose, small in zip(motion.pose, shake, strict=True)]
    lengths, elements, dT_C, dT_K = (np.stack(part) for part in zip(*rows, strict=True))
    dynamics = Dynamics(robot).relative
    J = dynamics.wrench_matrix(motion.pose)
    T = solved(J, dynamics.required_wrench(*motion) - turn(J, dT_C + dT_K))
    return Run(TIMES[ROWS], lengths, elements, dT_C, dT_K, T)


def _instant(robot: Robot, pose: np.ndarray, shake: np.ndarray) -> tuple[np.ndarray, ...]:
    """Run steps 2 to 5 at one instant; return lengths, element lengths, dT_C and dT_K of each cable, (6,) each."""
    rows, (stiffness, damping) = [], constants(robot)
    for anchor, arm in zip(robot.anchors, robot.attachments @ rotations(pose[3:]).T, strict=True):
        end = pose[:3] + arm
        length = np.linalg.norm(anchor - end)
        dB = shake[:3] + np.cross(shake[3:], arm)
        moved = np.linalg.norm(anchor - end - dB)
        chain = ElementChain(anchor, end, stiffness, ELEMENTS)
        rows.append((length, length / ELEMENTS, damping * (moved - length) / STEP, chain.end_increment(dB)))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


def _same(step: int, what: str, run: np.ndarray, own: np.ndarray, unit: str) -> Claim:
    """Report how far one step and `driving_force` are apart, which is no verdict on the paper."""
    off = np.abs(run - own).max()
    agree = f"agree to {off:.0e} {unit}" if off <= SAME else f"differ by up to {off:.2g} {unit}"
    return claim("one-step").undetermined(
        np.abs(run).max(), step=step, what=what, feasible=FEASIBLE, unit=unit, agree=agree
    )
