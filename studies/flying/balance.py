"""Paper F's balance of forces and moments: Eqs. 24, 26, 29 and 33 to 38, compared with Newton and Euler in {G}."""

import numpy as np

from ...models import Dynamics, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .instants import Instants, instants, relative_error, turn, turn_back
from .motion import solved, steady_tensions
from .rotations import body_rates, printed_acceleration

WIND = np.array([5.0, 6.0, 2.0])  # the paper's strongest [m/s]
INCREMENTS = np.array([0.3, -0.2, 0.1, 0.4, -0.1, 0.2])  # dT of the six cables, any [N]


def chapter() -> Chapter:
    """Compare the equations of section IV at random instants of both bodies."""
    dynamics, samples = Dynamics(load("wang-flying")), instants()
    alpha = samples.R_A.acceleration, samples.R_B.acceleration
    printed = printed_acceleration(*samples.base), printed_acceleration(*samples.body)
    last = _moment_off(dynamics, samples, *alpha, last=samples.R_B.rate)  # Eq. 33 ends in P_b dTheta_b x R I_b ...
    true, with_printed = (_moment_off(dynamics, samples, *parts) for parts in (alpha, printed))
    return Chapter(
        [
            _newton(dynamics, samples),
            _force(dynamics, samples),
            _euler(dynamics, samples),
            claim("eq-33").compared(np.median(last), rest=true.max()),
            _right_side(dynamics, samples),
            _first_term(dynamics, samples),
            _turned_increments(dynamics, samples),
            claim("eq-36").compared(true.max()),
            claim("eq-36-alpha").compared(np.median(with_printed), off=with_printed.max()),
            _whole(dynamics, samples),
            _directions(dynamics, samples),
            _wind_frame(dynamics, samples),
            _arms(dynamics, samples),
        ]
    )


def newton_euler(dynamics: Dynamics, samples: Instants) -> np.ndarray:
    """Return m ddx_B - m g and dL/dt in {G} from the derivatives of both rotations, (n, 6) [N, N m]."""
    x, dx, ddx = (part[:, :3] for part in samples.body)
    R, dR, ddR = samples.R_A
    acceleration = samples.base.acceleration[:, :3] + turn(ddR, x) + 2 * turn(dR, dx) + turn(R, ddx)
    whole, I_b = samples.R_A.then(samples.R_B), dynamics.robot.inertia
    moment = turn(whole.dR, whole.rate @ I_b.T) + turn(whole.R, whole.acceleration @ I_b.T)  # of L = R I_b Omega
    return np.hstack([dynamics.robot.platform.mass * (acceleration - np.array(dynamics.robot.gravity)), moment])


def _newton(dynamics: Dynamics, samples: Instants) -> Claim:
    """Give the platform the tensions that hold it in the wind, and form m ddx_B - m g - [u] (T + dT) - F_e."""
    pose, velocity, acceleration = dynamics.relative.motion_in_world(*samples.body, *samples.base)
    A = dynamics.wrench_matrix(pose, samples.base.pose[:, None])
    T = solved(A, dynamics.required_wrench(pose, velocity, acceleration, wind=WIND))
    wind = dynamics.aerodynamic_wrench(pose, velocity, WIND)[:, :3]
    left = newton_euler(dynamics, samples)[:, :3] - turn(A[:, :3], T) - wind
    return claim("eq-24").compared(np.linalg.norm(left, axis=1).max(), wind=np.linalg.norm(wind, axis=1).max())


def _euler(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare I alpha + omega x I omega in {G}, with I = R I_b R^T, with dL/dt."""
    whole, I_b = samples.R_A.then(samples.R_B), dynamics.robot.inertia
    inertia = whole.R @ I_b @ whole.R.transpose(0, 2, 1)
    omega, alpha = turn(whole.R, whole.rate), turn(whole.R, whole.acceleration)
    printed = turn(inertia, alpha) + np.cross(omega, turn(inertia, omega))
    return claim("eq-29").compared(np.abs(printed - newton_euler(dynamics, samples)[:, 3:]).max())


def _right_side(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare [R_B b x u] (T' + F') with T' = dT, as step 7 needs it, and F' = F = T + dT with the moment of T + dT."""
    J = dynamics.relative.wrench_matrix(samples.body.pose)
    T = steady_tensions(dynamics, samples.body, samples.base)
    twice, once = (turn(J[:, 3:], T + count * INCREMENTS) for count in (2, 1))
    return claim("eq-33-right").compared(np.median(relative_error(twice, once)))


def _first_term(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare the left side of Eq. 34 with dTheta_b, as printed, in place of ddTheta_b, with dL/dt."""
    excess = samples.body.velocity[:, 3:] - samples.body.acceleration[:, 3:]
    P = body_rates(samples.body.pose, excess)
    true = turn_back(samples.R_A.R, newton_euler(dynamics, samples)[:, 3:])
    printed = true + turn(samples.R_B.R, P @ dynamics.robot.inertia.T)
    return claim("eq-34").compared(np.median(relative_error(printed, true)))


def _turned_increments(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare R_A [R_B b x u] dT of Eq. 34 with [R_B b x u] dT, which stands beside the same matrix times T."""
    moments = dynamics.relative.wrench_matrix(samples.body.pose)[:, 3:] @ INCREMENTS
    return claim("eq-34-dT").compared(np.median(relative_error(turn(samples.R_A.R, moments), moments)))


def _force(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare D_F of Eq. 26, literally and with 2 dR_A dx_b, with this toolkit's form in omega and alpha.

    Literally, bars are second derivatives, and the last term is 2 R_A ddx_b.
    """
    m, g = dynamics.robot.platform.mass, np.array(dynamics.robot.gravity)
    R, dR, ddR = samples.R_A
    x, dx, ddx = (part[:, :3] for part in samples.body)
    felt = samples.base.acceleration[:, :3] + turn(ddR, x) - g
    printed, meant = (m * turn_back(R, felt + 2 * term) for term in (turn(R, ddx), turn(dR, dx)))
    ours = dynamics.relative.base_disturbance(samples.body.pose, samples.body.velocity, *samples.base)[:, :3]
    return claim("eq-26").compared(np.median(relative_error(printed, ours)), apart=np.abs(meant - ours).max())


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


def _whole(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare M ddX + F + D_B in {A} with Newton and Euler in {G}."""
    in_A = dynamics.relative.required_wrench(*samples.body, *samples.base)
    turned = np.hstack([turn(samples.R_A.R, in_A[:, :3]), turn(samples.R_A.R, in_A[:, 3:])])
    return claim("eq-38").compared(np.abs(turned - newton_euler(dynamics, samples)).max())


def _directions(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare u in {A} with u = L / l in {G}, which Eq. 26 uses among vectors in {A}."""
    u = dynamics.relative.wrench_matrix(samples.body.pose)[:, :3].transpose(0, 2, 1)  # (n, m, 3) in {A}
    in_G = u @ samples.R_A.R.transpose(0, 2, 1)
    apart = np.degrees(np.arccos(np.clip((u * in_G).sum(axis=-1), -1, 1)))
    return claim("eq-26-frame").compared(apart.max(), tilt=np.degrees(np.abs(samples.base.pose[:, 3:]).max()))


def _wind_frame(dynamics: Dynamics, samples: Instants) -> Claim:
    force = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), WIND)[:3]
    felt = turn_back(samples.R_A.R, np.tile(force, (len(samples.base.pose), 1)))
    return claim("eq-26-wind").compared(relative_error(felt, force).max())


def _arms(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare R_B r_B x u of Eq. 37, where r_B = R_B b is already rotated, with R_B b x u."""
    R = samples.R_B.R.transpose(0, 2, 1)  # of rows, from the right
    u = dynamics.relative.wrench_matrix(samples.body.pose)[:, :3].transpose(0, 2, 1)
    arms = dynamics.robot.attachments @ R
    return claim("eq-37-J").compared(np.median(relative_error(np.cross(arms @ R, u), np.cross(arms, u))))
