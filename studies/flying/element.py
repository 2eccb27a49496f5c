"""Paper F's element of a cable: signs and sizes in Eqs. 12 to 15, 18, 20 and 21, and figure 3.

Element j of a cable lies between the nodes j - 1 and j. Its tension increment is E A / e times what it gets longer, and
the forces that hold its nodes are minus and plus that. The equations are evaluated for one element of cable 1 as they
are printed, and their products are formed with the sizes that are printed.
"""

from functools import cache, reduce

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import load
from ...models.cables import ElementChain
from ..accounts.claim import Chapter, Claim
from .cable import STRETCH, chain
from .claims import claim

ELEMENTS = 8
OFFSETS = np.array([1e-6, 3e-6])  # of the nodes j - 1 and j along the cable, away from the pulley [m]
WOUND = 2e-6  # de [m]
UNDEFINED = "undefined"


def chapter() -> Chapter:
    """Check signs and sizes of the equations of one element, and the nodes of figure 3."""
    return Chapter([*_forces(), *_sizes()], {"elements": _figure()})


@cache
def cable_1() -> ElementChain:
    """Return cable 1 at home as elements."""
    return chain(load("wang-flying"), ELEMENTS)


def stiffness() -> float:
    """Return E A / e of an element of cable 1 at home [N/m]."""
    cable = cable_1()
    return cable.stiffness * cable.elements / cable.length


def by_13(offsets: np.ndarray, wound: float) -> np.ndarray:
    """Return the node forces by the right-hand sides of Eq. 13, (2,) [N]."""
    before, after = offsets
    return stiffness() * np.array([before - after - wound, -before + after + wound])


def product(*shapes: tuple[int, int]) -> str:
    """Return the size of a product of matrices with these sizes, or that it is undefined."""
    try:
        return "{} x {}".format(*reduce(np.matmul, [np.zeros(shape) for shape in shapes]).shape)
    except ValueError:
        return UNDEFINED


def _forces() -> list[Claim]:
    """Compare d tau of Eq. 12, k_l of Eq. 15 with E A / e for its size, and k_n dx + k_l de with Eq. 13."""
    used = {node for j in range(1, ELEMENTS + 1) for node in (j - 1, j)}  # which Eqs. 12, 13 and 21 use
    before, after = OFFSETS
    energy = stiffness() / 2 * (np.array([after - before + WOUND + step for step in (STRETCH, -STRETCH)]) ** 2)
    pull = (energy[0] - energy[1]) / (2 * STRETCH)  # the derivative of the strain energy by the elongation
    along, wound = by_13(OFFSETS, WOUND), by_13(np.zeros(2), WOUND)
    by_15 = stiffness() * np.array([1.0, -1.0]) * WOUND
    by_18 = stiffness() * np.array([-1.0, 1.0]) * WOUND  # k_5 = -S u, k_6 = S u
    u = cable_1().direction
    k_1 = stiffness() * np.outer(u, u)
    k_n = np.block([[k_1, -k_1], [-k_1, k_1]])
    in_G = k_n @ np.concatenate([before * u, after * u]) + stiffness() * np.concatenate([-u, u]) * WOUND
    return [
        claim("fig-3").compared((min(used), max(used)), printed=(1, ELEMENTS + 1), elements=ELEMENTS),
        claim("eq-12-13-sign").compared(along[0], printed=stiffness() * (after - before + WOUND), pull=pull),
        claim("eq-15-sign").compared(wound, printed=by_15, apart=np.abs(by_18 - wound).max()),
        claim("eq-20").compared(np.abs(in_G - np.concatenate([along[0] * u, along[1] * u])).max()),
    ]


def _sizes() -> list[Claim]:
    """Form [k_5 k_6]^T of Eq. 18 and the products of Eqs. 14, 20 and 21 with the printed sizes."""
    nodes, column = 3 * (ELEMENTS + 1), np.zeros((3, 1))
    bracket = "{} x {}".format(*np.concatenate([column, column]).shape)
    claims = [claim("eq-18-size").stated(bracket, bracket == "6 x 1")]
    for name, size, meant in (
        ("eq-14-size", (2, 1), ((2, 1), (1, 1))),
        ("eq-20-size", (6, 1), ((6, 1), (1, 1))),
        ("eq-21-size", (nodes, 1), ((nodes, ELEMENTS), (ELEMENTS, 1))),
    ):
        printed, computed = "{} x {}".format(*size), product(size, size)
        fields = {"elements": ELEMENTS, "nodes": nodes, "meant": product(*meant)}
        claims.append(claim(name).stated(computed, computed == printed, printed, **fields))
    return claims


def _figure() -> Drawing:
    cable = cable_1()
    nodes = cable.displacements(STRETCH * cable.direction)
    increments = stiffness() * cable.elongations(nodes)
    place = np.linspace(0.0, cable.length, ELEMENTS + 1)
    panels = [
        Panel("node moved [um]", {"": 1e6 * nodes @ cable.direction}, dots={"nodes": 1e6 * nodes @ cable.direction}),
        Panel("tension added [N]", {"": np.concatenate([increments[:1], increments])}, {"0 N": 0.0}),
    ]
    return Drawing(
        f"Figure 3: cable 1 as {ELEMENTS} elements, its end moved by {STRETCH * 1e6:g} um; the tension is the same in "
        "each element",
        curves(place, "from the pulley [m]", panels),
    )
