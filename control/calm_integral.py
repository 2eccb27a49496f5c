"""`calm_integral`: an integral gain with which a platform on damped cables comes to rest."""

import numpy as np

from ..models.dynamics import dynamics_of
from ..models.elasticity import whitening
from ..models.robot import Robot
from ..statics.distribution import tensions as tensions_at

SLOW = 0.01  # [1/s]: accepted growth, which rounding or motions that no cable damps may cause
MARGIN = 1.25  # factor by which the gain stays below the one at which oscillations no longer decay
LEAST = 1e-3  # of the usual gain; a smaller gain is replaced by 0


def calm_integral(
    robot: Robot, stiffness: np.ndarray, damping: np.ndarray, proportional: float, integral: float
) -> float:
    """Return an integral gain [1/s], at most `integral`, for lengths that are corrected by J (P e + I * integral of e).

    The cables pull with E A times their strain and C times the rate of their stretch. Deviations x from home, and their
    integral z, obey

        x'' = -G x - E ((1 + P) x + I z) - D ((1 + P) x' + I x),   z' = x

    per unit of mass, where G is the stiffness due to constant tensions, E that due to elasticity, and D the
    damping. Platforms that turn slowly, since their attachments are close to each other, need a small I.

    Args:
        robot: The robot.
        stiffness, damping: E A [N] and C [N s/m] of the cables, (m,).
        proportional, integral: P, and the usual I [1/s].
    """
    dynamics, home, rows = dynamics_of(robot), robot.home, np.flatnonzero(robot.dof_mask)
    pulls = np.asarray(tensions_at(robot, home, method="soft-wrench").tensions)
    taut = pulls > 0
    W = whitening(robot, home)
    A = W @ dynamics.wrench_matrix(home)[rows]
    G = W @ dynamics.stiffness(home, pulls, elastic=False)[np.ix_(rows, rows)] @ W.T
    E, D = ((A * taut * each) @ A.T for each in (stiffness / dynamics.cable_lengths(home), damping))
    one, none = np.eye(len(rows)), np.zeros_like(E)
    more = 1 + proportional

    def grows(gain: float) -> bool:
        loop = np.block([[none, one, none], [-G - more * E - gain * D, -more * D, -gain * E], [one, none, none]])
        return np.linalg.eigvals(loop).real.max() > SLOW

    found = integral
    while found > LEAST * integral and grows(MARGIN * found):
        found /= 2
    return found if found > LEAST * integral else 0.0
