"""Paper F's balance of forces and moments: Eqs. 24, 26, 29 and 33 to 38, compared with Newton and Euler in {G}."""

import numpy as np

from ...models import Dynamics, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .instants import Instants, instants
from .rotations import body_rates, printed_acceleration

WIND = np.array([5.0, 6.0, 2.0])  # the paper's strongest [m/s]
INCREMENTS = np.array([0.3, -0.2, 0.1, 0.4, -0.1, 0.2])  # dT of the six cables, any [N]


def chapter() -> Chapter:
    """Compare the equations of section IV at random instants of both bodies."""
    dynamics, samples = Dynamics(load("wang-flying")), instants()
    return Chapter(
        [
            _newton(dynamics, samples),
            _force(dynamics, samples),
            _euler(dynamics, samples),
            _last_term(dynamics, samples),
            _right_side(dynamics, samples),
            _first_term(dynamics, samples),
            _turned_increments(dynamics, samples),
            _moment(dynamics, samples),
            _moment_printed(dynamics, samples),
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
    acceleration = samples.base.acceleration[:, :3] + _turn(ddR, x) + 2 * _turn(dR, dx) + _turn(R, ddx)
    whole, I_b = samples.R_A.then(samples.R_B), dynamics.robot.inertia
    moment = _turn(whole.dR, whole.rate @ I_b.T) + _turn(whole.R, whole.acceleration @ I_b.T)  # of L = R I_b Omega
    return np.hstack([dynamics.robot.platform.mass * (acceleration - np.array(dynamics.robot.gravity)), moment])


def _newton(dynamics: Dynamics, samples: Instants) -> Claim:
    """Give the platform the tensions that hold it in the wind, and form m ddx_B - m g - [u] (T + dT) - F_e."""
    pose, velocity, acceleration = dynamics.relative.motion_in_world(*samples.body, *samples.base)
    A = dynamics.wrench_matrix(pose, samples.base.pose[:, None])
    w = dynamics.required_wrench(pose, velocity, acceleration, wind=WIND)
    T = np.linalg.solve(A, w[..., None])[..., 0]
    wind = dynamics.aerodynamic_wrench(pose, velocity, WIND)[:, :3]
    left = newton_euler(dynamics, samples)[:, :3] - _turn(A[:, :3], T) - wind
    return claim("eq-24").compared(float(np.linalg.norm(left, axis=1).max()), wind=np.linalg.norm(wind, axis=1).max())


def _euler(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare I alpha + omega x I omega in {G}, with I = R I_b R^T, with dL/dt."""
    whole, I_b = samples.R_A.then(samples.R_B), dynamics.robot.inertia
    inertia = whole.R @ I_b @ whole.R.transpose(0, 2, 1)
    omega, alpha = _turn(whole.R, whole.rate), _turn(whole.R, whole.acceleration)
    printed = _turn(inertia, alpha) + np.cross(omega, _turn(inertia, omega))
    return claim("eq-29").compared(float(np.abs(printed - newton_euler(dynamics, samples)[:, 3:]).max()))


def _last_term(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare the left side of Eq. 33, which ends in P_b dTheta_b x R I_b P_b dTheta_b, with dL/dt."""
    accelerations = samples.R_A.acceleration, samples.R_B.acceleration
    off = _moment_off(dynamics, samples, *accelerations, last=samples.R_B.rate)
    rest = float(_moment_off(dynamics, samples, *accelerations).max())
    return claim("eq-33").compared(float(np.median(off)), rest=rest)


def _right_side(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare [R_B b x u] (T' + F') with T' = dT, as step 7 needs it, and F' = F = T + dT with the moment of T + dT."""
    J = dynamics.relative.wrench_matrix(samples.body.pose)
    T = np.linalg.solve(J, dynamics.relative.required_wrench(*samples.body, *samples.base)[..., None])[..., 0]
    twice, once = (_turn(J[:, 3:], T + count * INCREMENTS) for count in (2, 1))
    off = np.linalg.norm(twice - once, axis=1) / np.linalg.norm(once, axis=1)
    return claim("eq-33-right").compared(float(np.median(off)))


def _first_term(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare the left side of Eq. 34 with dTheta_b, as printed, in place of ddTheta_b, with dL/dt."""
    printed = samples.body.velocity[:, 3:] - samples.body.acceleration[:, 3:]
    I_b, R = dynamics.robot.inertia, samples.R_B.R
    P = body_rates(samples.body.pose, printed)
    true = _turn_back(samples.R_A.R, newton_euler(dynamics, samples)[:, 3:])
    off = np.linalg.norm(_turn(R, P @ I_b.T), axis=1) / np.linalg.norm(true, axis=1)
    return claim("eq-34").compared(float(np.median(off)))


def _turned_increments(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare R_A [R_B b x u] dT of Eq. 34 with [R_B b x u] dT, which stands beside the same matrix times T."""
    moments = dynamics.relative.wrench_matrix(samples.body.pose)[:, 3:] @ INCREMENTS
    off = np.linalg.norm(_turn(samples.R_A.R, moments) - moments, axis=1) / np.linalg.norm(moments, axis=1)
    return claim("eq-34-dT").compared(float(np.median(off)))


def _force(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare D_F of Eq. 26, literally and with 2 dR_A dx_b, with this toolkit's form in omega and alpha.

    Literally, bars are second derivatives, and the last term is 2 R_A ddx_b.
    """
    m, g = dynamics.robot.platform.mass, np.array(dynamics.robot.gravity)
    R, dR, ddR = samples.R_A
    x, dx, ddx = (part[:, :3] for part in samples.body)
    felt = samples.base.acceleration[:, :3] + _turn(ddR, x) - g
    printed, meant = (m * _turn_back(R, felt + 2 * term) for term in (_turn(R, ddx), _turn(dR, dx)))
    ours = dynamics.relative.base_disturbance(samples.body.pose, samples.body.velocity, *samples.base)[:, :3]
    return claim("eq-26").compared(
        float(np.median(np.linalg.norm(printed - ours, axis=1) / np.linalg.norm(ours, axis=1))),
        apart=np.abs(meant - ours).max(),
    )


def _moment(dynamics: Dynamics, samples: Instants) -> Claim:
    off = _moment_off(dynamics, samples, samples.R_A.acceleration, samples.R_B.acceleration)
    return claim("eq-36").compared(float(off.max()))


def _moment_printed(dynamics: Dynamics, samples: Instants) -> Claim:
    off = _moment_off(dynamics, samples, printed_acceleration(*samples.base), printed_acceleration(*samples.body))
    return claim("eq-36-alpha").compared(float(np.median(off)), off=off.max())


def _moment_off(
    dynamics: Dynamics, samples: Instants, alpha_A: np.ndarray, alpha_B: np.ndarray, last: np.ndarray | None = None
) -> np.ndarray:
    """Return the relative difference of the left side of Eq. 34 from dL/dt, in {A}, (n,).

    `last` (n, 3) is the first factor of the last term of D_M; default: omega_A, as in Eq. 36.
    """
    I_b = dynamics.robot.inertia
    R, omega_A, Omega = samples.R_B.R, samples.R_A.rate, samples.R_B.rate
    I_A = R @ I_b @ R.transpose(0, 2, 1)
    turned = _turn(R, Omega)
    F_M = _turn(R, alpha_B @ I_b.T) + np.cross(turned, _turn(R, Omega @ I_b.T))
    D_M = (
        _turn(I_A, alpha_A)
        + _turn(I_A, np.cross(omega_A, turned))
        + np.cross(omega_A + turned, _turn(I_A, omega_A))
        + np.cross(omega_A if last is None else last, _turn(R, Omega @ I_b.T))
    )
    whole = samples.R_A.then(samples.R_B)
    spin = whole.acceleration @ I_b.T + np.cross(whole.rate, whole.rate @ I_b.T)  # dL/dt in {B}
    true = _turn(R, spin)
    return np.linalg.norm(F_M + D_M - true, axis=1) / np.linalg.norm(true, axis=1)


def _whole(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare M ddX + F + D_B in {A} with Newton and Euler in {G}."""
    in_A = dynamics.relative.required_wrench(*samples.body, *samples.base)
    in_G = newton_euler(dynamics, samples)
    turned = np.hstack([_turn(samples.R_A.R, in_A[:, :3]), _turn(samples.R_A.R, in_A[:, 3:])])
    return claim("eq-38").compared(float(np.abs(turned - in_G).max()))


def _directions(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare u in {A} with u = L / l in {G}, which Eq. 26 uses among vectors in {A}."""
    u = dynamics.relative.wrench_matrix(samples.body.pose)[:, :3].transpose(0, 2, 1)  # (n, m, 3) in {A}
    in_G = u @ samples.R_A.R.transpose(0, 2, 1)
    apart = np.degrees(np.arccos(np.clip((u * in_G).sum(axis=-1), -1, 1)))
    tilt = float(np.degrees(np.abs(samples.base.pose[:, 3:]).max()))
    return claim("eq-26-frame").compared(float(apart.max()), tilt=tilt)


def _wind_frame(dynamics: Dynamics, samples: Instants) -> Claim:
    force = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), WIND)[:3]
    felt = _turn_back(samples.R_A.R, np.tile(force, (len(samples.base.pose), 1)))
    off = np.linalg.norm(felt - force, axis=1) / np.linalg.norm(force)
    return claim("eq-26-wind").compared(float(off.max()))


def _arms(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare R_B r_B x u of Eq. 37, where r_B = R_B b is already rotated, with R_B b x u."""
    robot, R = dynamics.robot, samples.R_B.R
    u = dynamics.relative.wrench_matrix(samples.body.pose)[:, :3].transpose(0, 2, 1)
    arms = robot.attachments @ R.transpose(0, 2, 1)
    twice = arms @ R.transpose(0, 2, 1)
    true, printed = np.cross(arms, u), np.cross(twice, u)
    off = np.linalg.norm(printed - true, axis=-1) / np.linalg.norm(true, axis=-1)
    return claim("eq-37-J").compared(float(np.median(off)))


def _turn(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", R, vectors)


def _turn_back(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nji,nj->ni", R, vectors)
