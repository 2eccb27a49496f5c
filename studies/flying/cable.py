"""Paper F's cable: its elongation (Eq. 6) and its tension increment by finite elements (Eqs. 12 to 22)."""

import numpy as np

from ...models import Dynamics, Robot, load
from ...models.cables import ElementChain
from ..accounts.claim import Chapter, Claim
from .claims import claim
from .plans import RADIUS, circle, steady_tensions

ELEMENTS = (1, 2, 5, 16, 64)
STRETCH = 1e-5  # of the attachment, away from the anchor [m]
WINDING = 1e-6  # of each element [m]
NEGLIGIBLE = 1e-2  # elongation that may be ignored, assumed: by the paper it goes to 0


def chapter() -> Chapter:
    """Check the equations of section III on cable 1 at home."""
    robot = load("wang-flying")
    return Chapter([_elongation(robot), *_stiffness(robot), *_slack(robot)])


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


def _stiffness(robot: Robot) -> list[Claim]:
    # Chains of n elements compared with the whole cable, E A / l times the elongation.
    whole, cable, double = (chain(robot, n) for n in (1, 8, 2))
    increments = {n: chain(robot, n).end_increment(STRETCH * whole.direction) for n in ELEMENTS}
    spread = max(increments.values()) - min(increments.values())
    # The force of an element that is lengthened by de compared with E A / de times de, as in Eq. 15.
    held = cable.node_forces(np.zeros((cable.elements + 1, 3)), WINDING)[-1] @ cable.direction
    # The direction of x_c in {G} by the row u^T of Eq. 17 compared with the direction of the cable.
    vector = robot.anchors[0] - robot.home_attachments[0]  # L by Eq. 4
    # K_n of two elements, from the blocks k_1 to k_4 of Eq. 19, besides the K_n of the chain.
    block = double.stiffness * double.elements / double.length * np.outer(double.direction, double.direction)
    printed = np.zeros((9, 9))
    for start in (0, 3):
        printed[start : start + 6, start : start + 6] += np.block([[block, -block], [-block, block]])
    return [
        claim("eq-21").stated(
            f"{increments[1]:.4g} N for n = 1, {increments[ELEMENTS[-1]]:.4g} N for n = {ELEMENTS[-1]}",
            spread >= 1e-9 * (whole.stiffness / whole.length * STRETCH),
            each=", ".join(map(str, ELEMENTS)),
            spread=spread,
        ),
        claim("eq-15").compared(
            held, cable.stiffness / WINDING * WINDING, within=1e-06 * cable.stiffness, winding=WINDING * 1000000.0
        ),
        claim("eq-17").compared(vector / np.linalg.norm(vector) @ whole.direction),
        claim("eq-19").compared(np.abs(printed - double.K_n().toarray()).max()),
    ]


def _slack(robot: Robot) -> list[Claim]:
    # The force on the pulley, and by Eq. 16, where element 1 never pulls: node 0 never moves.
    cable = chain(robot, 8)
    nodes = cable.displacements(STRETCH * cable.direction)
    along = nodes @ cable.direction
    printed = ((along[:-1] > 0) & (along[1:] > 0)).astype(float)
    forces = (cable.K_n(printed) @ nodes.ravel()).reshape(-1, 3) @ cable.direction
    true = cable.node_forces(nodes) @ cable.direction
    shorter = cable.end_increment(-STRETCH * cable.direction)  # its tension falls, and a norm never does
    return [
        claim("eq-16").compared(abs(true[0]), printed=abs(forces[0])),
        claim("eq-22").stated(shorter, shorter >= 0, printed=abs(shorter), stretch=STRETCH * 1000000.0),
    ]
