r"""A cable as point masses joined by springs with dampers: it sags, sways and rings, and its ends may move.

L0 is cut into n segments of unstrained length e = L0 / n; between them sit n - 1 masses of rho e each. A segment with
the nodes p_j, p_{j+1} at its ends is l_j = |p_{j+1} - p_j| long and pulls them together with

    T_j = E A (l_j - e) / e + n C dl_j/dt      while l_j > e and T_j > 0, otherwise nothing

(n dampers of n C in a row are one of C). The masses move by

    rho e ddp_j = T_j u_j - T_{j-1} u_{j-1} + rho e g        u_j = (p_{j+1} - p_j) / l_j

The two halves of a segment's mass that are left, rho e / 2 at each end (`end_mass`), ride with what holds the ends:
their weight and inertia are in neither the forces nor the energy here. So the power that the ends put in is exactly
what the energy gains and the dampers lose, at every state; with resting ends the energy never grows.

Source: point-mass cables as in any textbook of multibody dynamics; elasticity and damping as in `elastic`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ...base.display import Displayed
from ...base.inputs import HUGE, TINY, number, whole_number
from ..batch import as_array
from . import elastic

MOST = 1_000_000  # segments


@dataclass(frozen=True)
class LumpedChain(Displayed):
    """A cable of point masses. Its state is (positions, velocities) of the inner nodes from start to end, in {G}.

    Parameters
    ----------
    length
        Unstrained length L0 [m].
    stiffness
        E A [N].
    density
        Mass per unstrained length rho [kg/m].
    damping
        C of the whole cable [N s/m].
    segments
        N, at least 2.
    gravity
        In {G} [m/s^2], (3,).

    Raises
    ------
    InputError
        If a number is not of its kind.
    """

    length: float
    stiffness: float
    density: float
    damping: float = 0.0
    segments: int = 10
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)

    def __post_init__(self):
        for name in ("length", "stiffness", "density"):
            number(name, getattr(self, name), TINY, HUGE)
        number("damping", self.damping, 0.0, HUGE)
        whole_number("segments", self.segments, 2, MOST)
        as_array("gravity", self.gravity, (3,))

    @property
    def segment_length(self) -> float:
        """Return the unstrained length e of a segment [m]."""
        return self.length / self.segments

    @property
    def node_mass(self) -> float:
        """Return the mass of an inner node [kg]."""
        return self.density * self.segment_length

    @property
    def end_mass(self) -> float:
        """Return the mass at each end, which moves with the body that holds the end [kg]."""
        return self.node_mass / 2

    @property
    def state_size(self) -> int:
        """Return the length of the state, 6 (n - 1)."""
        return 6 * (self.segments - 1)

    def straight(self, start: Any, end: Any) -> np.ndarray:
        """Return the state at rest with the nodes evenly on the line between the ends [m, m/s], (6 (n - 1),)."""
        start, end = as_array("start", start, (3,)), as_array("end", end, (3,))
        share = np.arange(1, self.segments)[:, None] / self.segments
        positions = start + share * (end - start)
        return np.concatenate([positions.ravel(), np.zeros(positions.size)])

    @cached_property
    def dynamics(self) -> ca.Function:
        """Return the equation of motion as a CasADi Function.

        Inputs: `state` (6 (n - 1),); `start`, `start_velocity`, `end`, `end_velocity` (3,) each, in {G} [m, m/s].
        Outputs: `dstate`, its time derivative; `start_force`, `end_force` (3,): what the cable pulls at its ends
        [N], in {G}; `tensions` (n,) [N].
        """
        inputs = self._symbols()
        _, velocities, tensions, directions, *_ = self._segments(inputs)
        pulls = directions * ca.repmat(tensions.T, 3, 1)  # (3, n), each on its segment's first node
        weight = ca.repmat(ca.DM(self.gravity), 1, self.segments - 1)
        acceleration = (pulls[:, 1:] - pulls[:, :-1]) / self.node_mass + weight
        dstate = ca.vertcat(ca.vec(velocities[:, 1:-1]), ca.vec(acceleration))
        outputs = {"dstate": dstate, "start_force": pulls[:, 0], "end_force": -pulls[:, -1], "tensions": tensions}
        return ca.Function("lumped_chain", [*inputs.values()], [*outputs.values()], [*inputs], [*outputs])

    @cached_property
    def energy(self) -> ca.Function:
        """Return kinetic, elastic and potential energy [J] as a CasADi Function with the inputs of `dynamics`.

        Outputs: `kinetic`, `elastic`, `potential` (zero at the origin of {G}), `total`, and `dissipation` [W], what the
        dampers take, never negative. A damper that has slackened its segment by outweighing its spring takes all that
        the spring gives.
        """
        inputs = self._symbols()
        positions, velocities, tensions, _, stretch, rates = self._segments(inputs)
        kinetic = self.node_mass / 2 * ca.sumsqr(velocities[:, 1:-1])
        spring = self.stiffness / self.segment_length * ca.fmax(stretch, 0)
        elastic_energy = ca.dot(spring, ca.fmax(stretch, 0)) / 2
        potential = -self.node_mass * ca.dot(ca.DM(self.gravity), ca.sum2(positions[:, 1:-1]))
        outputs = {
            "kinetic": kinetic,
            "elastic": elastic_energy,
            "potential": potential,
            "total": kinetic + elastic_energy + potential,
            "dissipation": ca.dot(tensions - spring, rates),
        }
        return ca.Function("lumped_chain_energy", [*inputs.values()], [*outputs.values()], [*inputs], [*outputs])

    def _symbols(self) -> dict[str, ca.SX]:
        ends = ("start", "start_velocity", "end", "end_velocity")
        return {"state": ca.SX.sym("state", self.state_size)} | {name: ca.SX.sym(name, 3) for name in ends}

    def _segments(self, inputs: dict[str, ca.SX]) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
        """Return positions and velocities of all nodes, (3, n + 1), and what each segment has.

        Its tension [N], (n, 1), u_j, (3, n), the elongation l_j - e [m] and dl_j/dt [m/s], (n, 1) each.
        """
        half = self.state_size // 2
        inner = ca.reshape(inputs["state"][:half], 3, -1)
        inner_velocity = ca.reshape(inputs["state"][half:], 3, -1)
        positions = ca.horzcat(inputs["start"], inner, inputs["end"])
        velocities = ca.horzcat(inputs["start_velocity"], inner_velocity, inputs["end_velocity"])
        vectors = positions[:, 1:] - positions[:, :-1]
        # A segment whose nodes coincide has no direction, but it is slack: any finite one will do.
        lengths = ca.fmax(ca.sqrt(ca.sum1(vectors**2)), 1e-12 * self.segment_length)
        directions = vectors / ca.repmat(lengths, 3, 1)
        along = ca.sum1(directions * vectors).T
        rates = ca.sum1(directions * (velocities[:, 1:] - velocities[:, :-1])).T
        tensions = elastic.tension(along, rates, self.segment_length, self.stiffness, self.segments * self.damping)
        return positions, velocities, tensions, directions, along - self.segment_length, rates
