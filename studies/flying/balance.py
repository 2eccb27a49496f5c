"""Paper F's balance of forces and moments: Eqs. 24, 26, 29 and 33 to 38, compared with Newton and Euler in {G}."""

from __future__ import annotations

import numpy as np

from ...models import Dynamics, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim, compared
from .instants import Instants, instants
from .rotations import body_rates, printed_acceleration

ROUNDING = 1e-11
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
    return compared(
        "eq-24",
        "Eq. 24",
        "m ddx_B = m g + [u] (T + dT) + F_e in {G} (largest force left over, with the tensions that the motion "
        "requires in the strongest wind).",
        0.0,
        float(np.linalg.norm(left, axis=1).max()),
        within=ROUNDING,
        agrees="The equation is in balance, with F_e of the air relative to the platform; the wind alone has "
        f"{np.linalg.norm(wind, axis=1).max():.1f} N at most.",
        differs="The equation is not in balance.",
        unit="N",
    )


def _euler(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare I alpha + omega x I omega in {G}, with I = R I_b R^T, with dL/dt."""
    whole, I_b = samples.R_A.then(samples.R_B), dynamics.robot.inertia
    inertia = whole.R @ I_b @ whole.R.transpose(0, 2, 1)
    omega, alpha = _turn(whole.R, whole.rate), _turn(whole.R, whole.acceleration)
    printed = _turn(inertia, alpha) + np.cross(omega, _turn(inertia, omega))
    return compared(
        "eq-29",
        "Eq. 29",
        "I_B alpha + omega x I_B omega in {G}, I_B = R I_b R^T (difference from the derivative of L = R I_b Omega).",
        0.0,
        float(np.abs(printed - newton_euler(dynamics, samples)[:, 3:]).max()),
        within=ROUNDING,
        agrees="It is the derivative of the angular momentum.",
        differs="It is not the derivative of the angular momentum.",
        unit="N m",
    )


def _last_term(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare the left side of Eq. 33, which ends in P_b dTheta_b x R I_b P_b dTheta_b, with dL/dt."""
    accelerations = samples.R_A.acceleration, samples.R_B.acceleration
    off = _moment_off(dynamics, samples, *accelerations, last=samples.R_B.rate)
    rest = float(_moment_off(dynamics, samples, *accelerations).max())
    return compared(
        "eq-33",
        "Eqs. 33, 36",
        "The left side of Eq. 33 ends in P_b dTheta_b x R_B I_b P_b dTheta_b (median relative difference from dL/dt).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The moment is the derivative of the angular momentum.",
        differs=f"The first factor must be P_a dTheta_a, as in Eq. 36, with which the difference is {rest:.0e}; one "
        "letter may be an error of the recognition.",
    )


def _right_side(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare [R_B b x u] (T' + F') with T' = dT, as step 7 needs it, and F' = F = T + dT with the moment of T + dT."""
    J = dynamics.relative.wrench_matrix(samples.body.pose)
    T = np.linalg.solve(J, dynamics.relative.required_wrench(*samples.body, *samples.base)[..., None])[..., 0]
    twice, once = (_turn(J[:, 3:], T + count * INCREMENTS) for count in (2, 1))
    off = np.linalg.norm(twice - once, axis=1) / np.linalg.norm(once, axis=1)
    return compared(
        "eq-33-right",
        "Eqs. 29, 33, 34",
        "The right side of Eq. 33 has the moments of T' + F' (median relative difference from those of T + dT, with "
        "T' = dT, as step 7 needs it, F' = F = T + dT, and increments of 0.1 N to 0.4 N).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The moments are the same.",
        differs="Neither T' nor F' is defined, and dT counts twice if they are read like this. T + dT is meant, as in "
        "Eqs. 29 and 34.",
    )


def _first_term(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare the left side of Eq. 34 with dTheta_b, as printed, in place of ddTheta_b, with dL/dt."""
    printed = samples.body.velocity[:, 3:] - samples.body.acceleration[:, 3:]
    I_b, R = dynamics.robot.inertia, samples.R_B.R
    P = body_rates(samples.body.pose, printed)
    true = _turn_back(samples.R_A.R, newton_euler(dynamics, samples)[:, 3:])
    off = np.linalg.norm(_turn(R, P @ I_b.T), axis=1) / np.linalg.norm(true, axis=1)
    return compared(
        "eq-34",
        "Eqs. 34, 37",
        "Eq. 34 begins with R_B I_b P_b dTheta_b, first derivatives (median relative difference from dL/dt).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The moment is the derivative of the angular momentum.",
        differs="It must be ddTheta_b, as in Eq. 37; a dot may be an error of the recognition, as may the letters F_o "
        "and D_o there, which are the F_M and D_M of Eqs. 35 and 36.",
    )


def _turned_increments(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare R_A [R_B b x u] dT of Eq. 34 with [R_B b x u] dT, which stands beside the same matrix times T."""
    moments = dynamics.relative.wrench_matrix(samples.body.pose)[:, 3:] @ INCREMENTS
    off = np.linalg.norm(_turn(samples.R_A.R, moments) - moments, axis=1) / np.linalg.norm(moments, axis=1)
    return compared(
        "eq-34-dT",
        "Eqs. 33, 34, 37",
        "In Eq. 34 the moments of dT have R_A in front, those of T have not (median relative difference).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The rotation changes nothing.",
        differs="Eq. 33 times R_A^T has no R_A in front of either, as in Eq. 37.",
    )


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
    return compared(
        "eq-26",
        "Eq. 26",
        "D_F ends in 2 R_A ddx_b, with one bar for each second derivative (median relative difference from the force "
        "of the base's motion).",
        0.0,
        float(np.median(np.linalg.norm(printed - ours, axis=1) / np.linalg.norm(ours, axis=1))),
        within=ROUNDING,
        agrees="The printed D_F is the force of the base's motion.",
        differs="The last term must be 2 dR_A dx_b, with which the difference is at most "
        f"{np.abs(meant - ours).max():.0e} N. Bars for dots may be an error of the recognition.",
    )


def _moment(dynamics: Dynamics, samples: Instants) -> Claim:
    off = _moment_off(dynamics, samples, samples.R_A.acceleration, samples.R_B.acceleration)
    return compared(
        "eq-36",
        "Eqs. 34, 35, 36",
        "F_M and D_M with the true angular accelerations (largest relative difference from dL/dt in {A}).",
        0.0,
        float(off.max()),
        within=ROUNDING,
        agrees="The four terms of D_M, with F_M, are the derivative of the angular momentum.",
        differs="The printed terms are not the derivative of the angular momentum.",
    )


def _moment_printed(dynamics: Dynamics, samples: Instants) -> Claim:
    off = _moment_off(dynamics, samples, printed_acceleration(*samples.base), printed_acceleration(*samples.body))
    return compared(
        "eq-36-alpha",
        "Eqs. 31, 32, 35, 36",
        "F_M and D_M with alpha as printed in Eqs. 31 and 32 (median relative difference from dL/dt).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The printed alpha gives the moment.",
        differs=f"The P that Eqs. 31 and 32 leave out changes the moment by up to {off.max():.0%} here; D_B is "
        "computed "
        "with it.",
    )


def _moment_off(
    dynamics: Dynamics,
    samples: Instants,
    alpha_A: np.ndarray,
    alpha_B: np.ndarray,
    last: np.ndarray | None = None,
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
    return compared(
        "eq-38",
        "Eqs. 37, 38",
        "M_B ddX_b + F_B + D_B with alpha corrected (difference from m ddx_B - m g and dL/dt in {G}).",
        0.0,
        float(np.abs(turned - in_G).max()),
        within=ROUNDING,
        agrees="Paper F's form, with D_B, is Newton's and Euler's equations, rotated.",
        differs="Paper F's form is not Newton's and Euler's equations.",
        unit="N, N m",
    )


def _directions(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare u in {A} with u = L / l in {G}, which Eq. 26 uses among vectors in {A}."""
    u = dynamics.relative.wrench_matrix(samples.body.pose)[:, :3].transpose(0, 2, 1)  # (n, m, 3) in {A}
    in_G = u @ samples.R_A.R.transpose(0, 2, 1)
    apart = np.degrees(np.arccos(np.clip((u * in_G).sum(axis=-1), -1, 1)))
    tilt = float(np.degrees(np.abs(samples.base.pose[:, 3:]).max()))
    return compared(
        "eq-26-frame",
        "Eqs. 4, 26, 37",
        "u_i = L_i / l_i, in {G} by Eq. 4, multiplies T in an equation in {A} (largest angle between u_i in {G} and in "
        "{A}).",
        0.0,
        float(apart.max()),
        within=1e-6,
        agrees="Both directions are the same.",
        differs=f"The directions of the cables must be rotated into {{A}} too, R_A^T L_i / l_i; the quadrotor's angles "
        f"are up to {tilt:.0f} degrees here.",
        unit="degrees",
    )


def _wind_frame(dynamics: Dynamics, samples: Instants) -> Claim:
    force = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), WIND)[:3]
    felt = _turn_back(samples.R_A.R, np.tile(force, (len(samples.base.pose), 1)))
    off = np.linalg.norm(felt - force, axis=1) / np.linalg.norm(force)
    return compared(
        "eq-26-wind",
        "Eqs. 26, 37",
        "F_e, the force of the wind in {G}, is subtracted in {A} without rotation (largest relative difference from "
        "R_A^T F_e).",
        0.0,
        float(off.max()),
        within=ROUNDING,
        agrees="The force needs no rotation.",
        differs="F_e must be rotated into {A}, as Eq. 34 does with M_e.",
    )


def _arms(dynamics: Dynamics, samples: Instants) -> Claim:
    """Compare R_B r_B x u of Eq. 37, where r_B = R_B b is already rotated, with R_B b x u."""
    robot, R = dynamics.robot, samples.R_B.R
    u = dynamics.relative.wrench_matrix(samples.body.pose)[:, :3].transpose(0, 2, 1)
    arms = robot.attachments @ R.transpose(0, 2, 1)
    twice = arms @ R.transpose(0, 2, 1)
    true, printed = np.cross(arms, u), np.cross(twice, u)
    off = np.linalg.norm(printed - true, axis=-1) / np.linalg.norm(true, axis=-1)
    return compared(
        "eq-37-J",
        "Eqs. 34, 37",
        "J contains R_B r_B,i x u_i, where r_B,i = R_B b_i (median relative difference from R_B b_i x u_i).",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The second rotation changes nothing.",
        differs="r_B,i is rotated twice; J must contain R_B b_i x u_i, as in Eq. 33. Where the platform is level, both "
        "are "
        "the same.",
    )


def _turn(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", R, vectors)


def _turn_back(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nji,nj->ni", R, vectors)
