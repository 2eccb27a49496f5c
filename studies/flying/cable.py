"""Paper F's cable: its elongation (Eq. 6) and its tension increment by finite elements (Eqs. 12 to 22)."""

import numpy as np

from ...models import Dynamics, Robot, load
from ...models.cables import ElementChain
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .motion import RADIUS, circle, steady_tensions

ELEMENTS = (1, 2, 5, 16, 64)
STRETCH = 1e-5  # of the attachment, away from the anchor [m]
WINDING = 1e-6  # of each element [m]
NEGLIGIBLE = 1e-2  # elongation that may be ignored, assumed: by the paper it goes to 0


def chapter() -> Chapter:
    """Check the equations of section III on cable 1 at home."""
    robot = load("wang-flying")
    checks = (_elongation, _one_element, _stiffness_of_winding, _axis, _assembled, _switch, _sign)
    return Chapter([check(robot) for check in checks])


def constants(robot: Robot) -> tuple[float, float]:
    """Return E A [N] and C [N s/m] of cable 1; all cables of the paper have the same."""
    cable = robot.cables[0]
    assert cable.stiffness is not None
    assert cable.damping is not None
    return cable.stiffness, cable.damping


def chain(robot: Robot, elements: int) -> ElementChain:
    """Return cable 1 at home as a chain of elements that is always taut."""
    return ElementChain(robot.anchors[0], robot.home_attachments[0], constants(robot)[0], elements, np.inf)


def _elongation(robot: Robot) -> Claim:
    stiffness, _ = constants(robot)
    largest = steady_tensions(Dynamics(robot), circle(RADIUS)).max()
    share = largest / stiffness
    return claim("eq-6").stated(
        share,
        share < NEGLIGIBLE,
        largest=largest,
        stiffness=stiffness,
        negligible=NEGLIGIBLE,
        weights=NEGLIGIBLE * stiffness / robot.weight,
    )


def _one_element(robot: Robot) -> Claim:
    """Compare chains of n elements with the whole cable, E A / l times the elongation."""
    whole = chain(robot, 1)
    increments = {n: chain(robot, n).end_increment(STRETCH * whole.direction) for n in ELEMENTS}
    spring = whole.stiffness / whole.length * STRETCH
    spread = max(increments.values()) - min(increments.values())
    return claim("eq-21").stated(
        f"{increments[1]:.4g} N for n = 1, {increments[ELEMENTS[-1]]:.4g} N for n = {ELEMENTS[-1]}",
        spread >= 1e-9 * spring,
        each=", ".join(map(str, ELEMENTS)),
        spread=spread,
    )


def _stiffness_of_winding(robot: Robot) -> Claim:
    """Compare the force of an element that is lengthened by de with E A / de times de, as in Eq. 15."""
    elements = 8
    cable = chain(robot, elements)
    nodes = np.zeros((elements + 1, 3))
    held = cable.node_forces(nodes, WINDING)[-1] @ cable.direction
    printed = cable.stiffness / WINDING * WINDING
    return claim("eq-15").compared(held, printed=printed, within=1e-06 * cable.stiffness, winding=WINDING * 1000000.0)


def _axis(robot: Robot) -> Claim:
    """Compare the direction of x_c in {G} by the row u^T of Eq. 17 with the direction of the cable."""
    cable = chain(robot, 1)
    vector = robot.anchors[0] - robot.home_attachments[0]  # L by Eq. 4
    u = vector / np.linalg.norm(vector)
    return claim("eq-17").compared(u @ cable.direction)


def _assembled(robot: Robot) -> Claim:
    """Compare K_n of two elements, from the blocks k_1 to k_4 of Eq. 19, with that of the chain."""
    cable = chain(robot, 2)
    u = cable.direction
    block = cable.stiffness * cable.elements / cable.length * np.outer(u, u)
    element = np.block([[block, -block], [-block, block]])
    printed = np.zeros((9, 9))
    printed[:6, :6] += element
    printed[3:, 3:] += element
    return claim("eq-19").compared(np.abs(printed - cable.K_n().toarray()).max())


def _switch(robot: Robot) -> Claim:
    """Compare the force on the pulley with the force by Eq. 16, where element 1 never pulls: node 0 never moves."""
    cable = chain(robot, 8)
    nodes = cable.displacements(STRETCH * cable.direction)
    along = nodes @ cable.direction
    printed = ((along[:-1] > 0) & (along[1:] > 0)).astype(float)
    forces = (cable.K_n(printed) @ nodes.ravel()).reshape(-1, 3) @ cable.direction
    true = cable.node_forces(nodes) @ cable.direction
    return claim("eq-16").compared(abs(true[0]), printed=abs(forces[0]))


def _sign(robot: Robot) -> Claim:
    """Check the sign of the increment of a taut cable whose end comes nearer: its tension falls, a norm never does."""
    cable = chain(robot, 8)
    shorter = cable.end_increment(-STRETCH * cable.direction)
    return claim("eq-22").stated(shorter, shorter >= 0, printed=abs(shorter), stretch=STRETCH * 1000000.0)
