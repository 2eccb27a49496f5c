r"""A cable cut into axial elements: the tension increment at its end when the platform vibrates a little.

The cable runs from its anchor (node 0, held by the pulley) straight to its attachment (node n, moves with the
platform), in n elements of length e = l / n, direction c = (B - A) / l. Node j is displaced by dx_j, each element is
lengthened by de more (by winding), so that element j, between the nodes j - 1 and j, carries the increment

    dtau_j = E A / e (c . dx_j - c . dx_{j-1} + de)

and the nodes the increments  K_n dX + K_l dE, where

    K_n = sum_j  sgn(j) E A / e [ c c^T  -c c^T ; -c c^T  c c^T ]      K_l = sum_j  sgn(j) E A / e [ -c ; c ]

The cable has no mass, so its interior nodes rest where the forces on them vanish: every element carries the same, and
with equal elements dx_j = (j / n) dx_n. The chain then equals E A / l times the elongation, for every n.

The slack switch: sgn(j) = 1 while the element, with the tension it had before, still pulls. An element that would have
to push carries nothing, so that its increment is minus what it had. With no tension before, that is the paper's rule.

Source: paper F, section III, Eqs. 12 to 22, corrected: k_l has E A / e (Eq. 15 prints E A / de); sgn follows from the
elongation of an element (Eq. 16 takes the signs of its nodes' displacements, by which element 1, whose node 0 is
held, never pulls); increments have a sign (Eq. 22 takes the norm).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.display import Displayed
from ...base.inputs import HUGE, TINY, number, whole_number
from ..batch import as_array

if TYPE_CHECKING:  # scipy.sparse takes a tenth of a second to import
    from scipy.sparse import csr_array

MOST = 1_000_000  # elements


@dataclass(frozen=True)
class ElementChain(Displayed):
    """One cable as n axial elements, straight from its anchor to its attachment, in {G} or any other frame.

    Raises `InputError` if a number is not of its kind, or the cable has no length.
    """

    anchor: Any  # A, (3,) [m]
    attachment: Any  # B, (3,) [m]
    stiffness: float  # E A [N]
    elements: int  # n
    pretension: float = 0.0  # of every element before the increments [N]; `inf`: the cable cannot become slack

    def __post_init__(self):
        for name in ("anchor", "attachment"):
            object.__setattr__(self, name, as_array(name, getattr(self, name), (3,)).reshape(3))
        number("stiffness", self.stiffness, TINY, HUGE)
        whole_number("elements", self.elements, 1, MOST)
        number("pretension", self.pretension, 0.0, np.inf)
        number("the distance of anchor and attachment", self.length, TINY, HUGE)

    @property
    def length(self) -> float:
        """Return the length l [m]."""
        return float(np.linalg.norm(self.attachment - self.anchor))

    @property
    def direction(self) -> np.ndarray:
        """Return the unit vector c, (3,), from the anchor to the attachment, opposite to the pull on the platform."""
        return (self.attachment - self.anchor) / self.length

    def displacements(self, end: Any) -> np.ndarray:
        """Return the displacement of each node in equilibrium [m], (n + 1, 3), if node n moves by `end` (3,) [m]."""
        return np.arange(self.elements + 1)[:, None] / self.elements * as_array("end", end, (3,))

    def elongations(self, displacements: Any, winding: float = 0.0) -> np.ndarray:
        """Return c . (dx_j - dx_{j-1}) + de of each element [m], (n,), for node displacements (n + 1, 3) [m]."""
        nodes = as_array("displacements", displacements, (self.elements + 1, 3))
        return np.diff(nodes @ self.direction) + winding

    def taut(self, displacements: Any, winding: float = 0.0) -> np.ndarray:
        """Return sgn(j), (n,): 1.0 for the elements that pull, 0.0 for those that are slack."""
        carried = self.pretension + self._element_stiffness * self.elongations(displacements, winding)
        return (carried > 0).astype(float)

    def K_n(self, taut: Any = None) -> csr_array:
        """Return the stiffness to node displacements [N/m], sparse, 3(n + 1) square, node by node.

        `taut` (n,) is a result of the method `taut`; default: no element is slack.
        """
        from scipy.sparse import csr_array, diags_array, kron

        steps = self._steps()
        axial = steps.T @ diags_array(self._stiffnesses(taut)) @ steps
        return csr_array(kron(axial, np.outer(self.direction, self.direction)))

    def K_l(self, taut: Any = None) -> csr_array:
        """Return the stiffness to the additional elongations de [N/m], sparse, (3(n + 1), n); `taut` as in `K_n`."""
        from scipy.sparse import csr_array, diags_array, kron

        return csr_array(kron(self._steps().T @ diags_array(self._stiffnesses(taut)), self.direction[:, None]))

    def node_forces(self, displacements: Any, winding: float = 0.0) -> np.ndarray:
        """Return the increments of the forces that hold each node [N], (n + 1, 3): K_n dX + K_l dE.

        `displacements` belong to the nodes [m], (n + 1, 3); `winding` is de [m], the additional elongation of each
        element, its share of the cable that the winch did not pay out.
        """
        # An element that would have to push loses what it had.
        carried = np.maximum(self._element_stiffness * self.elongations(displacements, winding), -self.pretension)
        return -np.diff(carried, prepend=0.0, append=0.0)[:, None] * self.direction

    def end_increment(self, end: Any, winding: float = 0.0) -> float:
        """Return dT_K [N], the increment at the attachment if it moves by `end` (3,) [m]; positive: it pulls more."""
        return float(self.node_forces(self.displacements(end), winding)[-1] @ self.direction)

    @property
    def _element_stiffness(self) -> float:
        return self.stiffness * self.elements / self.length

    def _stiffnesses(self, taut: Any) -> np.ndarray:
        switch = np.ones(self.elements) if taut is None else as_array("taut", taut, (self.elements,))
        return self._element_stiffness * switch

    def _steps(self) -> csr_array:
        """Return the matrix (n, n + 1) from values at the nodes to their differences over the elements."""
        from scipy.sparse import csr_array, eye_array

        n = self.elements
        return csr_array(eye_array(n, n + 1, k=1) - eye_array(n, n + 1))
