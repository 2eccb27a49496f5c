r"""An elastic cable that sags under its weight, at rest between two points: Irvine's elastic catenary.

With s the unstrained length from the start, T(s) = (H, V(s)) the tension in the vertical plane of the cable,
V(s) = V_m + w (s - L0 / 2), and T_1, T_2 its norms at both ends, the end lies from the start

    x = H   L0 (1 / EA + 2 g / (T_1 + T_2))       g = artanh(q) / q,   q = w L0 / (T_1 + T_2)
    z = V_m L0 (1 / EA + 2 / (T_1 + T_2))

This is Irvine's pair of equations with the differences of asinh and of the square roots taken exactly, so that it
holds its digits from w = 0 (the straight elastic cable: g = 1) to a cable that hangs in a heap (q = 1).

(x, z) is the gradient of the complementary energy, the integral of T^2 / (2 EA) + T over s, which is strictly convex in
(H, V_m). So the forces of given end points are the minimum of that energy less H x + V_m z: one and only one, and
Newton's method with a line search finds it from any start.

Source: H. M. Irvine, Cable Structures, MIT Press, 1981 (the elastic catenary); its form here is derived anew.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.display import Displayed
from ...base.errors import InputError, SolverError
from ...base.inputs import HUGE, TINY, leading, number
from ..batch import as_array

TOLERANCE = 1e-14  # how exactly the ends have to meet, in unstrained lengths or spans, the longer ones
ITERATIONS = 200
STEEP = 0.3  # of the slope at the start of a step: what the line search lets the energy rise with at its end
TAUT = 10.0  # sum of both end tensions in weights of the cable
BEGIN = 0.3  # of the weight: tension of a slack cable in the first step
VERTICAL = 1e-13  # horizontal distance in unstrained lengths: below, the cable hangs in a vertical line
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True)
class SaggingCable(Displayed):
    """Elastic catenaries at rest, one or a batch of shape (...)."""

    start: np.ndarray  # as given to `hang`, like the next four; `up` of unit length
    length: np.ndarray
    stiffness: float
    weight: float
    up: np.ndarray
    across: np.ndarray  # horizontal unit vector from start to end, (..., 3); zero for a cable in a vertical line
    H: np.ndarray  # horizontal tension [N], (...)
    V_m: np.ndarray  # vertical component of the tension towards the end at mid-cable [N], (...)
    iterations: int  # Newton steps that were taken, for the slowest of the batch

    @property
    def start_force(self) -> np.ndarray:
        """Return the force of the cable on what holds its start [N], (..., 3); with `end_force` it is the weight."""
        return self._vector(self.H, self._V(0.0))

    @property
    def end_force(self) -> np.ndarray:
        """Return the force of the cable on what holds its end [N], (..., 3)."""
        return -self._vector(self.H, self._V(1.0))

    @property
    def start_tension(self) -> np.ndarray:
        """Return the norm of `start_force` [N], (...)."""
        return np.hypot(self.H, self._V(0.0))

    @property
    def end_tension(self) -> np.ndarray:
        """Return the norm of `end_force` [N], (...)."""
        return np.hypot(self.H, self._V(1.0))

    def points(self, fractions: Any) -> np.ndarray:
        """Return the points at fractions (k,) of the unstrained length from the start [m], (..., k, 3)."""
        share = as_array("fractions", fractions, ())
        if share.ndim != 1 or not ((share >= 0) & (share <= 1)).all():
            raise InputError(f"fractions must be a list of numbers from 0 to 1, got {fractions!r}")
        unit = (self.weight * self.length)[..., None]
        middle = (self.V_m / unit[..., 0])[..., None] + (share - 1) / 2
        x, z = _reach(self.H[..., None] / unit, middle, share, unit / self.stiffness)
        x, z = x * self.length[..., None], z * self.length[..., None]
        return self.start[..., None, :] + x[..., None] * self.across[..., None, :] + z[..., None] * self.up

    def tension(self, fractions: Any) -> np.ndarray:
        """Return the tension at fractions (k,) of the unstrained length from the start [N], (..., k)."""
        return np.hypot(self.H[..., None], self._V(np.atleast_1d(as_array("fractions", fractions, ()))))

    def _V(self, share: Any) -> np.ndarray:
        """Return the vertical component of the tension at one fraction of the length, (...), or at k, (..., k)."""
        step = np.asarray(share) - 0.5
        V_m, length = (self.V_m, self.length) if step.ndim == 0 else (self.V_m[..., None], self.length[..., None])
        return V_m + self.weight * length * step

    def _vector(self, across: np.ndarray, up: np.ndarray) -> np.ndarray:
        return across[..., None] * self.across + up[..., None] * self.up


def hang(start: Any, end: Any, length: Any, stiffness: float, weight: float, up: Any = (0.0, 0.0, 1.0)) -> SaggingCable:
    """Hang cables between two points each, at rest.

    - `start`, `end`: positions of the ends [m], (..., 3); for a robot's cable, its anchor and its attachment.
    - `length`: unstrained length L0 [m], (...).
    - `stiffness`: E A [N]; `inf`: it does not stretch, and then must be longer than the distance of its ends.
    - `weight`: weight per unstrained length, w = rho g [N/m], above zero (`elastic`: a cable without weight).
    - `up`: against gravity, (3,), of any length.

    Raises `InputError` if an argument has a wrong shape or value, or a cable that does not stretch is too short;
    `SolverError` if Newton's method did not meet the ends within 1e-14 of the length.
    """
    stiffness = number("stiffness", stiffness, TINY, np.inf)
    weight = number("weight", weight, TINY, HUGE)
    upward = as_array("up", up, (3,)).reshape(3)
    upward = upward / number("the length of up", np.linalg.norm(upward), TINY, HUGE)
    start, end, length = as_array("start", start, (3,)), as_array("end", end, (3,)), as_array("length", length, ())
    batch = leading({"start": start.shape[:-1], "end": end.shape[:-1], "length": length.shape})
    start, length = np.broadcast_to(start, (*batch, 3)), np.broadcast_to(length, batch)
    if not (length > 0).all():
        raise InputError(f"length must have numbers > 0, got {length.min():g}")
    span = np.broadcast_to(end, (*batch, 3)) - start
    if np.isinf(stiffness) and not (np.linalg.norm(span, axis=-1) < length).all():
        raise InputError("length must exceed the distance of the ends if the stiffness is infinite, got a shorter one")

    z = span @ upward
    level = span - z[..., None] * upward
    x = np.linalg.norm(level, axis=-1)
    vertical = x <= VERTICAL * length
    across = np.where(vertical[..., None], 0.0, level) / np.where(vertical, 1.0, x)[..., None]
    unit = weight * length  # forces in weights of the cable, lengths in unstrained lengths
    spans = np.stack([np.where(vertical, 0.0, x), z]) / length
    forces, iterations = _forces(spans.reshape(2, -1), (unit / stiffness).ravel())
    H, V_m = forces.reshape(2, *batch) * unit
    return SaggingCable(start, length, stiffness, weight, upward, across, H, V_m, iterations)


def _reach(h: np.ndarray, v: np.ndarray, share: np.ndarray | float, softness: np.ndarray | float) -> tuple[Any, Any]:
    """Return the dimensionless span (x, z) of a piece, `share` of a cable, with the force (h, v) in its middle."""
    half = np.asarray(share) / 2
    T_1, T_2 = np.hypot(h, v - half), np.hypot(h, v + half)
    total = np.maximum(T_1 + T_2, np.finfo(float).tiny)
    return h * (share * softness + 2 * _artanh(h, v, half, T_1, T_2)), v * share * (softness + 2 / total)


def _artanh(h: np.ndarray, v: np.ndarray, half: np.ndarray, T_1: np.ndarray, T_2: np.ndarray) -> np.ndarray:
    """Return artanh(q) of q = 2 half / (T_1 + T_2), exact also for q near 1; 0 where it is infinite, at h = 0."""
    a, b = v - half, v + half
    with np.errstate(divide="ignore", invalid="ignore"):
        # T_1 + a and T_2 - b, whose sum is T_1 + T_2 - 2 half, each without cancellation
        below = np.where(a < 0, h**2 / (T_1 - a), T_1 + a)
        above = np.where(b > 0, h**2 / (T_2 + b), T_2 - b)
        return np.where(h == 0, 0.0, np.log1p(4 * half / (below + above)) / 2)


def _forces(spans: np.ndarray, softness: np.ndarray) -> tuple[np.ndarray, int]:
    """Return (h, v) for spans (x, z), (2, k) each, of cables of unit length and weight, and the number of steps.

    `softness` is w L0 / EA, (k,).
    """
    (x, z), chord = spans, np.hypot(*spans)
    # From a force along the chord: `BEGIN` and what stretches the cable to it.
    stretched = np.divide(chord - 1, softness, out=np.zeros_like(chord), where=chord > 1)
    forces = spans * np.divide(BEGIN + stretched, chord, out=np.zeros_like(chord), where=x > 0)
    # In a vertical line: taut, or folded where its ends are nearer than its length.
    folded = z / (softness + 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        taut = np.sign(z) * (np.abs(z) - 1) / softness
    forces[1] = np.where(x > 0, forces[1], np.where(np.abs(folded) <= 0.5, folded, taut))
    left, steps = np.flatnonzero(x > 0), 0
    while left.size:
        if steps == ITERATIONS:
            worst = left[0]
            raise SolverError(
                f"sag: {left.size} of {x.size} cables did not converge in {ITERATIONS} steps; the first spans "
                f"{x[worst]:.6g} lengths across and {z[worst]:.6g} up, w L0 / EA = {softness[worst]:.6g}"
            )
        forces[:, left] += _step(forces[:, left], spans[:, left], softness[left])
        misses = _misses(forces[:, left], spans[:, left], softness[left])
        left = left[~(np.abs(misses).max(axis=0) <= TOLERANCE * np.maximum(1, chord[left]))]
        steps += 1
    return forces, steps


def _misses(forces: np.ndarray, spans: np.ndarray, softness: np.ndarray) -> np.ndarray:
    """Return the distances of the ends beyond their positions, (2, k): the gradient of the energy."""
    h, v = forces
    return np.stack(_reach(h, v, 1.0, softness)) - spans


def _step(forces: np.ndarray, spans: np.ndarray, softness: np.ndarray) -> np.ndarray:
    """Return Newton's step, (2, k), halved while the energy rises steeply at its end; h stays > 0.

    The energy is convex: while it still falls at the end of a step, the step was not too long.
    """
    (h, v), misses = forces, _misses(forces, spans, softness)
    compliance = _compliance(h, v) + softness * np.eye(2)[..., None]
    step = -np.linalg.solve(np.moveaxis(compliance, -1, 0), misses.T[..., None])[..., 0].T
    # The second term: rounding of the misses.
    allowed = STEEP * np.abs((misses * step).sum(axis=0)) + 1e-15 * np.abs(step).sum(axis=0)
    d_h = step[0]
    taken = np.where(h + d_h > 0, 1.0, -0.9 * h / np.where(d_h < 0, d_h, -1.0))
    for _ in range(60):
        rising = (_misses(forces + taken * step, spans, softness) * step).sum(axis=0) > allowed
        if not rising.any():
            break
        taken = np.where(rising, taken / 2, taken)
    return taken * step


def _compliance(h: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the integral of ((V^2, -h V), (-h V, h^2)) / T^3 over the cable, (2, 2, k): its shape's compliance."""
    a, b = v - 0.5, v + 0.5
    T_1, T_2 = np.hypot(h, a), np.hypot(h, b)
    c_zz = b / T_2 - a / T_1
    c_xz = h / T_2 - h / T_1
    c_xx = 2 * _artanh(h, v, np.asarray(0.5), T_1, T_2) - c_zz
    # These are small differences for a taut cable; there three points of Gauss and Legendre are exact enough
    V = v[:, None] + _NODES / 2
    T = np.hypot(h[:, None], V)
    along = [(f / T**3) @ (_WEIGHTS / 2) for f in (V**2, -h[:, None] * V, h[:, None] ** 2 + 0 * V)]
    xx, xz, zz = np.where(T_1 + T_2 > TAUT, along, [c_xx, c_xz, c_zz])
    return np.array([[xx, xz], [xz, zz]])
