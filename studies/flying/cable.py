"""Paper F's cable: its elongation (Eq. 6) and its tension increment by finite elements (Eqs. 12 to 22)."""

from __future__ import annotations

import numpy as np

from ...models import Dynamics, Robot, load
from ...models.cables import ElementChain
from ..accounts.account import Chapter
from ..accounts.claim import Claim, compared, stated
from .motion import RADIUS, circle, steady_tensions

ELEMENTS = (1, 2, 5, 16, 64)
STRETCH = 1e-5  # of the attachment, away from the anchor [m]
WINDING = 1e-6  # of each element [m]
NEGLIGIBLE = 1e-2  # elongation that may be ignored, assumed: by the paper it goes to 0


def chapter() -> Chapter:
    """Check the equations of section III on cable 1 at home."""
    robot = load("wang-flying")
    return Chapter(
        [
            _elongation(robot),
            _one_element(robot),
            _stiffness_of_winding(robot),
            _axis(robot),
            _assembled(robot),
            _switch(robot),
            _sign(robot),
        ]
    )


def chain(robot: Robot, elements: int) -> ElementChain:
    """Return cable 1 at home as a chain of elements that is always taut."""
    cable = robot.cables[0]
    assert cable.stiffness is not None
    return ElementChain(robot.anchors[0], robot.home_attachments[0], cable.stiffness, elements, np.inf)


def _elongation(robot: Robot) -> Claim:
    stiffness = robot.cables[0].stiffness
    assert stiffness is not None
    largest = float(steady_tensions(Dynamics(robot), circle(RADIUS)).max())
    share = largest / stiffness
    return stated(
        "eq-6",
        "Eq. 6",
        "F l / (E A) goes to 0 and the elongation can be ignored (l_e / l at the largest tension of the circle).",
        0.0,
        share,
        holds=share < NEGLIGIBLE,
        agrees=f"{largest:.1f} N (crossed pairs) on E A = {stiffness:g} N is less than {NEGLIGIBLE:.0%}, which is "
        f"taken as negligible: {NEGLIGIBLE * stiffness / robot.weight:.0f} times the weight on one cable would do.",
        differs=f"{largest:.1f} N on E A = {stiffness:g} N is more than {NEGLIGIBLE:.0%}.",
    )


def _one_element(robot: Robot) -> Claim:
    """Compare chains of n elements with the whole cable, E A / l times the elongation."""
    whole = chain(robot, 1)
    increments = {n: chain(robot, n).end_increment(STRETCH * whole.direction) for n in ELEMENTS}
    spring = whole.stiffness / whole.length * STRETCH
    spread = max(increments.values()) - min(increments.values())
    alike = spread < 1e-9 * spring
    return stated(
        "eq-21",
        "section III.C, Eqs. 12, 21",
        "The elastic force cannot be studied with the whole cable as a unit: n elements give another force.",
        "n matters",
        f"{increments[1]:.4g} N for n = 1, {increments[ELEMENTS[-1]]:.4g} N for n = {ELEMENTS[-1]}",
        holds=not alike,
        agrees="The increment depends on the number of elements.",
        differs="A cable without mass has the same tension everywhere: E A / l times the elongation for every n "
        f"(n = {', '.join(map(str, ELEMENTS))} differ by {spread:.0e} N).",
    )


def _stiffness_of_winding(robot: Robot) -> Claim:
    """Compare the force of an element that is lengthened by de with E A / de times de, as in Eq. 15."""
    elements = 8
    cable = chain(robot, elements)
    nodes = np.zeros((elements + 1, 3))
    held = float(cable.node_forces(nodes, WINDING)[-1] @ cable.direction)
    printed = cable.stiffness / WINDING * WINDING
    return compared(
        "eq-15",
        "Eq. 15",
        f"k_l = E A / de (force increment of an element that is lengthened by de = {WINDING * 1e6:g} um).",
        printed,
        held,
        within=1e-6 * cable.stiffness,
        agrees="The force increment is E A.",
        differs="With de as the divisor every lengthening, however small, gives E A; k_l is E A / e, as in Eq. 12.",
        unit="N",
    )


def _axis(robot: Robot) -> Claim:
    """Compare the direction of x_c in {G} by the row u^T of Eq. 17 with the direction of the cable."""
    cable = chain(robot, 1)
    vector = robot.anchors[0] - robot.home_attachments[0]  # L by Eq. 4
    u = vector / np.linalg.norm(vector)
    return compared(
        "eq-17",
        "Eqs. 4, 17, 18",
        "x_c, from the pulley along the cable, is u = L / l in {G} (cosine of the angle between them).",
        1.0,
        float(u @ cable.direction),
        within=1e-9,
        agrees="They have the same direction.",
        differs="By Eq. 4 L points from the platform to the pulley, so dX, dE and the forces of Eq. 18 have the wrong "
        "sign; k_n does not depend on it, and the norm of Eq. 22 hides it.",
    )


def _assembled(robot: Robot) -> Claim:
    """Compare K_n of two elements, from the blocks k_1 to k_4 of Eq. 19, with that of the chain."""
    cable = chain(robot, 2)
    u = cable.direction
    block = cable.stiffness * cable.elements / cable.length * np.outer(u, u)
    element = np.block([[block, -block], [-block, block]])
    printed = np.zeros((9, 9))
    printed[:6, :6] += element
    printed[3:, 3:] += element
    off = float(np.abs(printed - cable.K_n().toarray()).max())
    return compared(
        "eq-19",
        "Eqs. 18, 19, 21, figure 4",
        "k_1 to k_4 are S(j) u u^T with signs, and K_n is assembled from them (largest difference for two elements).",
        0.0,
        off,
        within=1e-6,
        agrees="K_n is the stiffness matrix of the chain.",
        differs="K_n is not the stiffness matrix of the chain.",
        unit="N/m",
    )


def _switch(robot: Robot) -> Claim:
    """Compare the force on the pulley with the force by Eq. 16, where element 1 never pulls: node 0 never moves."""
    elements = 8
    cable = chain(robot, elements)
    nodes = cable.displacements(STRETCH * cable.direction)
    along = nodes @ cable.direction
    printed = ((along[:-1] > 0) & (along[1:] > 0)).astype(float)
    forces = (cable.K_n(printed) @ nodes.ravel()).reshape(-1, 3) @ cable.direction
    true = cable.node_forces(nodes) @ cable.direction
    return compared(
        "eq-16",
        "Eq. 16",
        "sgn(j) = 1 if both nodes of element j move away from the pulley (force of a stretched cable on the pulley).",
        float(abs(forces[0])),
        float(abs(true[0])),
        within=1e-9,
        agrees="The force on the pulley is the tension of the stretched cable.",
        differs="Node 0 is fixed at the pulley, so by this rule element 1 never pulls and the force on the pulley is "
        "zero, "
        "the printed value. An element pulls as long as it is longer than at rest, its earlier elongation included.",
        unit="N",
    )


def _sign(robot: Robot) -> Claim:
    """Check the sign of the increment of a taut cable whose end comes nearer: its tension falls, a norm never does."""
    cable = chain(robot, 8)
    shorter = cable.end_increment(-STRETCH * cable.direction)
    return stated(
        "eq-22",
        "Eqs. 7, 22, 23",
        "dT_K is the norm of the force at B_i, also where the platform comes nearer to the anchor.",
        abs(shorter),
        shorter,
        holds=shorter >= 0,
        agrees="The increment is not negative.",
        differs=f"A taut cable whose end comes {STRETCH * 1e6:g} um nearer pulls less, so the increment needs its sign "
        "in "
        "F = T + dT.",
        unit="N",
    )
