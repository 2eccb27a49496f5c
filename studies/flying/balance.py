"""Paper F's balance of forces and moments: Eqs. 24, 26, 29 and 33 to 38, compared with Newton and Euler in {G}."""

import numpy as np

from ...models import Dynamics, load
from ..accounts.claim import Chapter, Claim
from .claims import claim
from .plans import solved, steady_tensions
from .rotations import Instants, body_rates, instants, printed_acceleration, relative_error, turn, turn_back

WIND = np.array([5.0, 6.0, 2.0])  # the paper's strongest [m/s]
INCREMENTS = np.array([0.3, -0.2, 0.1, 0.4, -0.1, 0.2])  # dT of the six cables, any [N]


def chapter() -> Chapter:
    """Compare the equations of section IV at random instants of both bodies."""
    dynamics, samples = Dynamics(load("wang-flying")), instants()
    given = dynamics, samples, newton_euler(dynamics, samples), dynamics.relative.wrench_matrix(samples.body.pose)
    return Chapter([*_forces(*given), *_moments(*given), *_frames(*given)])


def newton_euler(dynamics: Dynamics, samples: Instants) -> np.ndarray:
    """Return m ddx_B - m g and dL/dt in {G} from the derivatives of both rotations, (n, 6) [N, N m]."""
    x, dx, ddx = (part[:, :3] for part in samples.body)
    R, dR, ddR = samples.R_A
    acceleration = samples.base.acceleration[:, :3] + turn(ddR, x) + 2 * turn(dR, dx) + turn(R, ddx)
    whole, I_b = samples.R_A.then(samples.R_B), dynamics.robot.inertia
    moment = turn(whole.dR, whole.rate @ I_b.T) + turn(whole.R, whole.acceleration @ I_b.T)  # of L = R I_b Omega
    return np.hstack([dynamics.robot.platform.mass * (acceleration - np.array(dynamics.robot.gravity)), moment])


def _forces(dynamics: Dynamics, samples: Instants, true: np.ndarray, J: np.ndarray) -> list[Claim]:
    """Check forces; `true` is the result of `newton_euler`, and J the wrench matrix in {A}, as in the others."""
    # Eq. 24: with the tensions that hold the platform in the wind, m ddx_B - m g - [u] (T + dT) - F_e.
    pose, velocity, acceleration = dynamics.relative.motion_in_world(*samples.body, *samples.base)
    A = dynamics.wrench_matrix(pose, samples.base.pose[:, None])
    T = solved(A, dynamics.required_wrench(pose, velocity, acceleration, wind=WIND))
    wind = dynamics.aerodynamic_wrench(pose, velocity, WIND)[:, :3]
    left = true[:, :3] - turn(A[:, :3], T) - wind
    # D_F of Eq. 26, literally (bars are second derivatives, the last term is 2 R_A ddx_b) and with 2 dR_A dx_b, and
    # this toolkit's form in omega and alpha.
    R, dR, ddR = samples.R_A
    x, dx, ddx = (part[:, :3] for part in samples.body)
    felt = samples.base.acceleration[:, :3] + turn(ddR, x) - np.array(dynamics.robot.gravity)
    m = dynamics.robot.platform.mass
    printed, meant = (m * turn_back(R, felt + 2 * term) for term in (turn(R, ddx), turn(dR, dx)))
    ours = dynamics.relative.base_disturbance(samples.body.pose, samples.body.velocity, *samples.base)[:, :3]
    return [
        claim("eq-24").compared(np.linalg.norm(left, axis=1).max(), wind=np.linalg.norm(wind, axis=1).max()),
        claim("eq-26").compared(np.median(relative_error(printed, ours)), apart=np.abs(meant - ours).max()),
    ]


def _moments(dynamics: Dynamics, samples: Instants, true: np.ndarray, J: np.ndarray) -> list[Claim]:
    # I alpha + omega x I omega of Eq. 29 in {G}, with I = R I_b R^T.
    whole, I_b = samples.R_A.then(samples.R_B), dynamics.robot.inertia
    inertia = whole.R @ I_b @ whole.R.transpose(0, 2, 1)
    omega, alpha = turn(whole.R, whole.rate), turn(whole.R, whole.acceleration)
    by_29 = turn(inertia, alpha) + np.cross(omega, turn(inertia, omega))
    # Eq. 33 ends in P_b dTheta_b x R I_b ...
    exact = samples.R_A.acceleration, samples.R_B.acceleration
    printed = printed_acceleration(*samples.base), printed_acceleration(*samples.body)
    last = _moment_off(dynamics, samples, *exact, last=samples.R_B.rate)
    off, with_printed = (_moment_off(dynamics, samples, *parts) for parts in (exact, printed))
    # [R_B b x u] (T' + F') with T' = dT, as step 7 needs it, and F' = F = T + dT, compared with the moment of T + dT.
    T = steady_tensions(dynamics, samples.body, samples.base)
    twice, once = (turn(J[:, 3:], T + count * INCREMENTS) for count in (2, 1))
    # The left side of Eq. 34 has dTheta_b, as printed, in place of ddTheta_b.
    P = body_rates(samples.body.pose, samples.body.velocity[:, 3:] - samples.body.acceleration[:, 3:])
    moment = turn_back(samples.R_A.R, true[:, 3:])
    by_34 = moment + turn(samples.R_B.R, P @ I_b.T)
    added = J[:, 3:] @ INCREMENTS  # [R_B b x u] dT, which Eq. 34 turns by R_A and adds to the same matrix times T
    return [
        claim("eq-29").compared(np.abs(by_29 - true[:, 3:]).max()),
        claim("eq-33").compared(np.median(last), rest=off.max()),
        claim("eq-33-right").compared(np.median(relative_error(twice, once))),
        claim("eq-34").compared(np.median(relative_error(by_34, moment))),
        claim("eq-34-dT").compared(np.median(relative_error(turn(samples.R_A.R, added), added))),
        claim("eq-36").compared(off.max()),
        claim("eq-36-alpha").compared(np.median(with_printed), off=with_printed.max()),
    ]


def _moment_off(
    dynamics: Dynamics, samples: Instants, alpha_A: np.ndarray, alpha_B: np.ndarray, last: np.ndarray | None = None
) -> np.ndarray:
    """Return the relative difference of the left side of Eq. 34 from dL/dt, in {A}, (n,).

    `last` (n, 3) is the first factor of the last term of D_M; default: omega_A, as in Eq. 36.
    """
    I_b = dynamics.robot.inertia
    R, omega_A, Omega = samples.R_B.R, samples.R_A.rate, samples.R_B.rate
    I_A = R @ I_b @ R.transpose(0, 2, 1)
    turned = turn(R, Omega)
    F_M = turn(R, alpha_B @ I_b.T) + np.cross(turned, turn(R, Omega @ I_b.T))
    D_M = (
        turn(I_A, alpha_A)
        + turn(I_A, np.cross(omega_A, turned))
        + np.cross(omega_A + turned, turn(I_A, omega_A))
        + np.cross(omega_A if last is None else last, turn(R, Omega @ I_b.T))
    )
    whole = samples.R_A.then(samples.R_B)
    spin = whole.acceleration @ I_b.T + np.cross(whole.rate, whole.rate @ I_b.T)  # dL/dt in {B}
    return relative_error(F_M + D_M, turn(R, spin))


def _frames(dynamics: Dynamics, samples: Instants, true: np.ndarray, J: np.ndarray) -> list[Claim]:
    R_A, R_B = samples.R_A.R, samples.R_B.R.transpose(0, 2, 1)  # R_B turns rows, from the right
    in_A = dynamics.relative.required_wrench(*samples.body, *samples.base)  # M ddX + F + D_B
    turned = np.hstack([turn(R_A, in_A[:, :3]), turn(R_A, in_A[:, 3:])])
    # u in {A} compared with u = L / l in {G}, which Eq. 26 uses among vectors in {A}.
    u = J[:, :3].transpose(0, 2, 1)  # (n, m, 3)
    apart = np.degrees(np.arccos(np.clip((u * (u @ R_A.transpose(0, 2, 1))).sum(axis=-1), -1, 1)))
    force = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), WIND)[:3]
    felt = turn_back(R_A, np.tile(force, (len(samples.base.pose), 1)))
    # R_B r_B x u of Eq. 37, where r_B = R_B b is already rotated, compared with R_B b x u.
    arms = dynamics.robot.attachments @ R_B
    return [
        claim("eq-38").compared(np.abs(turned - true).max()),
        claim("eq-26-frame").compared(apart.max(), tilt=np.degrees(np.abs(samples.base.pose[:, 3:]).max())),
        claim("eq-26-wind").compared(relative_error(felt, force).max()),
        claim("eq-37-J").compared(np.median(relative_error(np.cross(arms @ R_B, u), np.cross(arms, u)))),
    ]
