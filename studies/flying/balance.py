"""Paper F's balance of forces and moments: Eqs. 26, 34, 36 and 37, held against Newton and Euler in {G}."""

from __future__ import annotations

import numpy as np

from ...models import Dynamics, load
from ..accounts.account import Chapter
from ..accounts.claim import Claim, compared
from .instants import Instants, instants
from .rotations import printed_acceleration

ROUNDING = 1e-11
WIND = np.array([5.0, 6.0, 2.0])  # the paper's strongest [m/s]


def chapter() -> Chapter:
    """The equations of section IV at random instants of both bodies."""
    dynamics, seen = Dynamics(load("wang-flying")), instants()
    return Chapter(
        [
            _force(dynamics, seen),
            _moment(dynamics, seen),
            _moment_printed(dynamics, seen),
            _whole(dynamics, seen),
            _directions(dynamics, seen),
            _wind_frame(dynamics, seen),
            _arms(dynamics, seen),
        ]
    )


def _force(dynamics: Dynamics, seen: Instants) -> Claim:
    """The left side of Eq. 26 with dR_A and ddR_A as printed, against this toolkit's form with omega and alpha."""
    m, g = dynamics.robot.platform.mass, np.array(dynamics.robot.gravity)
    _, dR, ddR = seen.R_A
    x, dx = seen.body.pose[:, :3], seen.body.velocity[:, :3]
    felt = seen.base.acceleration[:, :3] + _turn(ddR, x) + 2 * _turn(dR, dx) - g
    printed = m * _turn_back(seen.R_A.R, felt)
    ours = dynamics.relative.base_disturbance(seen.body.pose, seen.body.velocity, *seen.base)[:, :3]
    return compared(
        "eq-26",
        "Eq. 26",
        "D_F = m R_A^T (ddx_A + ddR_A x_b + 2 dR_A dx_b) - m R_A^T g: its difference from the form with omega_A.",
        0.0,
        float(np.abs(printed - ours).max()),
        within=ROUNDING,
        agrees="The printed D_F holds to rounding; ddR_A is that of omega_A and alpha_A.",
        differs="The printed D_F is not the force of the base's motion.",
        unit="N",
    )


def _moment(dynamics: Dynamics, seen: Instants) -> Claim:
    off = _moment_off(dynamics, seen, seen.R_A.acceleration, seen.R_B.acceleration)
    return compared(
        "eq-36",
        "Eqs. 34 to 36",
        "F_M and D_M, with the true angular accelerations: largest relative difference from dL/dt in {A}.",
        0.0,
        float(off.max()),
        within=ROUNDING,
        agrees="The four terms of D_M, with F_M, are the derivative of the angular momentum.",
        differs="The printed terms are not the derivative of the angular momentum.",
    )


def _moment_printed(dynamics: Dynamics, seen: Instants) -> Claim:
    off = _moment_off(dynamics, seen, printed_acceleration(*seen.base), printed_acceleration(*seen.body))
    return compared(
        "eq-36-alpha",
        "Eqs. 31, 32, 35, 36",
        "F_M and D_M with alpha as Eqs. 31 and 32 print it: median relative difference from dL/dt.",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The printed alpha gives the moment.",
        differs=f"The missing P of Eqs. 31 and 32 goes into the moment, up to {off.max():.0%} of it here; D_B is "
        "computed with the P.",
    )


def _moment_off(dynamics: Dynamics, seen: Instants, alpha_A: np.ndarray, alpha_B: np.ndarray) -> np.ndarray:
    """Relative difference of the left side of Eq. 34 from the change of angular momentum, in {A}, (n,)."""
    I_b = dynamics.robot.inertia
    R, omega_A, Omega = seen.R_B.R, seen.R_A.rate, seen.R_B.rate
    I_A = R @ I_b @ R.transpose(0, 2, 1)
    turned = _turn(R, Omega)
    F_M = _turn(R, alpha_B @ I_b.T) + np.cross(turned, _turn(R, Omega @ I_b.T))
    D_M = (
        _turn(I_A, alpha_A)
        + _turn(I_A, np.cross(omega_A, turned))
        + np.cross(omega_A + turned, _turn(I_A, omega_A))
        + np.cross(omega_A, _turn(R, Omega @ I_b.T))
    )
    whole = seen.R_A.then(seen.R_B)
    spin = whole.acceleration @ I_b.T + np.cross(whole.rate, whole.rate @ I_b.T)  # dL/dt in {B}
    true = _turn(R, spin)
    return np.linalg.norm(F_M + D_M - true, axis=1) / np.linalg.norm(true, axis=1)


def _whole(dynamics: Dynamics, seen: Instants) -> Claim:
    """M ddX + F + D_B in {A} against the required wrench in {G}."""
    in_A = dynamics.relative.required_wrench(*seen.body, *seen.base)
    world = dynamics.relative.motion_in_world(*seen.body, *seen.base)
    in_G = dynamics.required_wrench(*world)
    turned = np.hstack([_turn(seen.R_A.R, in_A[:, :3]), _turn(seen.R_A.R, in_A[:, 3:])])
    return compared(
        "eq-38",
        "Eqs. 37, 38",
        "M_B ddX_b + F_B + D_B, with alpha corrected: its difference from the wrench needed in {G}.",
        0.0,
        float(np.abs(turned - in_G).max()),
        within=ROUNDING,
        agrees="Paper F's form and the form in {G} are one, with D_B apart.",
        differs="Paper F's form is not the form in {G}.",
        unit="N, N m",
    )


def _directions(dynamics: Dynamics, seen: Instants) -> Claim:
    """By Eq. 4 u = L / l is in {G}, and it stands among vectors in {A} in Eq. 26."""
    u = dynamics.relative.wrench_matrix(seen.body.pose)[:, :3].transpose(0, 2, 1)  # (n, m, 3) in {A}
    in_G = u @ seen.R_A.R.transpose(0, 2, 1)
    apart = np.degrees(np.arccos(np.clip((u * in_G).sum(axis=-1), -1, 1)))
    tilt = float(np.degrees(np.abs(seen.base.pose[:, 3:]).max()))
    return compared(
        "eq-26-frame",
        "Eqs. 4, 26, 37",
        "u_i = L_i / l_i, in {G} by Eq. 4, multiplies T in an equation in {A}: largest angle between both readings.",
        0.0,
        float(apart.max()),
        within=1e-6,
        agrees="The readings are one.",
        differs=f"The cables' directions have to be turned into {{A}} too, R_A^T L_i / l_i; the quadrotor's angles are "
        f"up to {tilt:.0f} degrees here.",
        unit="degrees",
    )


def _wind_frame(dynamics: Dynamics, seen: Instants) -> Claim:
    force = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), WIND)[:3]
    felt = _turn_back(seen.R_A.R, np.tile(force, (len(seen.base.pose), 1)))
    off = np.linalg.norm(felt - force, axis=1) / np.linalg.norm(force)
    return compared(
        "eq-26-wind",
        "Eqs. 26, 37",
        "F_e, the wind's force in {G}, is subtracted in {A} as it is: largest relative difference from R_A^T F_e.",
        0.0,
        float(off.max()),
        within=ROUNDING,
        agrees="The force needs no turning.",
        differs="F_e has to be turned into {A}, as Eq. 34 does with M_e.",
    )


def _arms(dynamics: Dynamics, seen: Instants) -> Claim:
    """Eq. 37 has R_B r_B x u with r_B = R_B b already turned."""
    robot, R = dynamics.robot, seen.R_B.R
    u = dynamics.relative.wrench_matrix(seen.body.pose)[:, :3].transpose(0, 2, 1)
    arms = robot.attachments @ R.transpose(0, 2, 1)
    twice = arms @ R.transpose(0, 2, 1)
    true, printed = np.cross(arms, u), np.cross(twice, u)
    off = np.linalg.norm(printed - true, axis=-1) / np.linalg.norm(true, axis=-1)
    return compared(
        "eq-37-J",
        "Eqs. 34, 37",
        "J has R_B r_B,i x u_i, r_B,i being R_B b_i already: median relative difference from R_B b_i x u_i.",
        0.0,
        float(np.median(off)),
        within=ROUNDING,
        agrees="The second turn changes nothing.",
        differs="r_B,i is turned twice; J has R_B b_i x u_i, as Eq. 33, and a level platform does not show it.",
    )


def _turn(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", R, vectors)


def _turn_back(R: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    return np.einsum("nji,nj->ni", R, vectors)
