"""Paper F's Table 1: the parameters of this run, and whether they are consistent."""

import numpy as np

from ...models import Robot, load
from ..accounts.claim import Chapter, Claim
from .cable import constants
from .claims import claim
from .plans import BELOW

# As printed, in the paper's own units.
PRINTED = {
    "E": 100.0,  # [GPa]
    "cross section": 0.13,  # [mm^2]
    "C": 0.2,  # [N/(mm/s)]
    "r_A": 0.52,  # [m]
    "alpha_A": 60.0,  # [degrees]
    "H_1": 0.07,  # [m]
    "r_B": 0.25,  # [m]
    "alpha_B": 60.0,  # [degrees]
    "H_2": 0.03,  # [m]
    "m_B": 1.2,  # [kg]
    "I_x": 0.81,  # [kg m^2]
    "I_y": 0.81,  # [kg m^2]
    "I_z": 1.57,  # [kg m^2]
    "rho": 1.29,  # [kg/m^3]
    "C_d": 0.45,
    "C_l": 0.05,
    "S": 0.16,  # [m^2]
}
QUADROTOR, CIRCLE = 100.0, 99.0  # heights in {G} that section VI.B prints [m]
CENTRE = 1.0  # z of the circle's centre in {A}, as sections VI.A and VI.B print it [m]


def chapter() -> Chapter:
    """Compare Table 1 with the robot that this run uses, and check its consistency."""
    robot = load("wang-flying-printed")
    others, I_z, m_B = PRINTED["I_x"] + PRINTED["I_y"], PRINTED["I_z"], PRINTED["m_B"]
    # m r^2 is the largest I_z that a body within the radius r can have.
    reach = max(PRINTED["r_B"], float(np.sqrt(PRINTED["S"] / np.pi)))
    most = m_B * reach**2
    # The signs of z in {A} compared with the heights in {G}.
    centre = CIRCLE - QUADROTOR
    claims = [
        claim("table-1-rigid").stated(others, I_z <= others, printed=I_z),
        claim("table-1-gyration").stated(most, I_z <= most, printed=I_z, reach=reach, radius=float(np.sqrt(I_z / m_B))),
        claim("eq-2-height").compared(
            (np.sign(centre) * PRINTED["H_1"], centre),
            printed=(PRINTED["H_1"], CENTRE),
            circle=CIRCLE,
            quadrotor=QUADROTOR,
            anchor=robot.anchors[0, 2],
            below=-BELOW,
        ),
    ]
    return Chapter([*_used(robot), *claims])


def _used(robot: Robot) -> list[Claim]:
    """Compare the robot file with the table, by group: statement, names in the table, robot's numbers."""
    aero = robot.platform.aero
    assert aero is not None
    pascal, square_metre, per_metre = 1e9, 1e-6, 1e3
    stiffness = PRINTED["E"] * pascal * PRINTED["cross section"] * square_metre
    table = PRINTED | {"E A": stiffness, "C": PRINTED["C"] * per_metre}
    groups = {
        "geometry": (
            "r_A [m], alpha_A [degrees], H_1 [m] and r_B, alpha_B, H_2",
            ("r_A", "alpha_A", "H_1", "r_B", "alpha_B", "H_2"),
            [*_ring(robot.anchors), *_ring(robot.attachments)],
        ),
        "cable": ("E A = 100 GPa x 0.13 mm^2 [N] and C = 0.2 N/(mm/s) [N s/m]", ("E A", "C"), constants(robot)),
        "mass": (
            "m_B [kg] and I_x, I_y, I_z [kg m^2]",
            ("m_B", "I_x", "I_y", "I_z"),
            [robot.platform.mass, *np.diag(robot.inertia)],
        ),
        "air": (
            "rho [kg/m^3], C_d, C_l and S [m^2]",
            ("rho", "C_d", "C_l", "S"),
            [aero.air_density, aero.drag, aero.lift, aero.area],
        ),
    }
    claims = []
    for name, (statement, names, used) in groups.items():
        printed = [table[each] for each in names]
        within = 1e-09 * max(printed)
        claims.append(claim("table-1-{name}").compared(used, printed, within, name=name, statement=statement))
    return claims


def _ring(points: np.ndarray) -> tuple[float, float, float]:
    """Return radius [m], angle between neighbours [degrees] and distance along z [m] of six points, (6, 3)."""
    angles = np.sort(np.arctan2(points[:, 1], points[:, 0]))
    radii = np.hypot(points[:, 0], points[:, 1])
    return radii.mean(), np.degrees(np.diff(angles)).mean(), np.abs(points[:, 2]).mean()
