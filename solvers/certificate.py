"""Proof that no tensions inside their limits give a wrench: `Certificate`, and `certify`, which computes the sharpest.

The available wrench set {A t : t_min <= t <= t_max} is convex. Its extent along any direction d is the support value

    h(d) = max { d . A t : t_min <= t <= t_max } = sum_i max(d . a_i t_min_i, d . a_i t_max_i)

so d . w > h(d) proves that w is not in it (Farkas), and needs no solver to check. The direction from the nearest
available wrench to w makes the gap d . w - h(d) as large as it can be: then it is the distance between them.
"""

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.display import Displayed, Fact
from ..base.inputs import finite_array, required
from ..base.text import numbered, quantity, quantity_row
from ..base.tolerances import CANCELLED, NEGLIGIBLE, ORTHOGONAL, RANK, ROUNDED_PULL
from .box_least_squares import Projection, project
from .exact_arithmetic import exact_optimum
from .problem import Array, TensionProblem, accepted_error

Indices = NDArray[np.intp]


_UNIT_ROUNDOFF = float(np.finfo(np.float64).eps) / 2  # of one operation
_NONE = np.zeros(0, dtype=np.intp)
_LEAST_PART = 0.05  # of a direction of length one: a smaller force or moment is left out of its description
_VERTICAL = 0.99  # cosine from which on a force is called vertical


class CertificateText(NamedTuple):
    """A certificate as text: `Certificate.describe` in pieces, for tables."""

    along: str
    needed: str
    available: str
    short_by: str
    limits: str


def direction_text(unit: Array) -> str:
    """Return a unit wrench direction (6,), moments divided by the length, as text: "force (0, 0, 1)"."""
    parts = zip(("force", "moment"), (unit[:3], unit[3:]), strict=True)
    return ", ".join(f"{name} {_vector(part)}" for name, part in parts if float(np.linalg.norm(part)) >= _LEAST_PART)


@dataclass(frozen=True, eq=False)
class Certificate(Displayed):
    """A wrench direction along which the required wrench exceeds everything that the cables can give.

    Attributes:
        direction: d, shape (n,), for unscaled wrench rows: d . w and d . A t are in newtons. With six rows its force
            entries are dimensionless, its moment entries are in 1/m, and |(d_force, length * d_moment)| = 1. With any
            other number of rows |d| = 1.
        support: h(d) [N]: the maximum that tensions inside the limits can give along d.
        demand: d . w [N]: the required wrench along d.
        shortfall: demand - support [N], positive. If `binding` is not empty it is the distance from w to the available
            wrench set in the norm |(force, moment / length)|; if it is empty (singular), the distance from w to the
            range of A.
        at_max, at_min: Indices of the cables that could give more along d only by exceeding t_max, or by falling below
            t_min.
        closest: Tensions inside the limits with the wrench closest to w [N], shape (m,).
        length: The characteristic length [m] of the problem.
        time: For a motion: the instant [s] at which w is required. None for a single problem.
        span: For a motion: start and end [s] of the interval about `time` in which no tensions give the wrench.
        wind: For a motion in a range of winds: the velocity of the air [m/s] in {G} at which w is required.
        load: For a motion with a load of uncertain mass or CoM: mass [kg] and CoM [m] with which w is required.
    """

    direction: Array  # (n,)
    support: float
    demand: float
    shortfall: float
    at_max: Indices
    at_min: Indices
    closest: Array  # (m,)
    length: float
    time: float | None = None
    span: tuple[float, float] | None = None
    wind: tuple[float, float, float] | None = None
    load: tuple[float, float, float, float] | None = None

    def _headline(self) -> str:
        when = "" if self.time is None else f" at t = {self.time:.3f} s"
        return f"no tensions{when}: short by {quantity(self.shortfall, 'N')}"

    def _facts(self) -> list[Fact]:
        text = self.text()
        names = ("along", "needed", "available", "limits")
        return [(name, getattr(text, name)) for name in names]

    @property
    def binding(self) -> Indices:
        """Return the indices of the cables whose limits determine the support value, ascending."""
        return np.sort(np.concatenate([self.at_max, self.at_min]))

    @property
    def singular(self) -> bool:
        """Return whether the direction is perpendicular to the wrenches of all cables.

        Not even negative tensions give w then.
        """
        return self.binding.size == 0

    def verify(self, problem: TensionProblem) -> bool:
        """Check from the problem's data alone that this certificate proves it infeasible.

        Only the direction is trusted; support, demand and binding cables are recomputed and compared. False means that
        the certificate proves nothing; the problem may still be infeasible.
        """
        required("problem", problem, TensionProblem)
        if self.direction.shape != (problem.n,) or self.closest.shape != (problem.m,):
            return False
        unit = self.direction / problem.row_scale
        if not abs(float(unit @ unit) - 1.0) < 1e-9:
            return False
        support, rounding, at_max, at_min = _support(problem, self.direction)
        demand = float(self.direction @ problem.w)
        tolerance = problem.tolerance(self.closest)
        return bool(
            demand - support > tolerance + rounding
            and abs(demand - support - self.shortfall) <= tolerance
            and np.array_equal(at_max, self.at_max)
            and np.array_equal(at_min, self.at_min)
        )

    def text(self, up: ArrayLike | None = None) -> CertificateText:
        """Return the parts of the certificate as text, such as the direction; cables are counted from 1.

        With six wrench rows the direction is a force and a moment, together of length one: "force (0.84, 0.49,
        0.23)". A force or a moment below 0.05 is omitted. Moments are divided by `length`, which the text gives if the
        direction has a moment.

        Args:
            up: The direction opposite to gravity in the frame of the wrench, shape (3,): a vertical force is then
                marked "up" or "down". Default: none is marked.

        Raises:
            InputError: If `up` is not three finite numbers.
        """
        other_way = ""
        if self.support < 0.0 and not self.singular:
            other_way = " (the cables can pull only the other way)"
            if self.demand < 0.0:
                least, needed = (quantity(-force, "N") for force in (self.support, self.demand))
                other_way = f" (the cables pull the other way with at least {least}, where {needed} is needed)"
        limits = [
            f"{name} of {numbered('cable', indices)}"
            for name, indices in (("t_min", self.at_min), ("t_max", self.at_max))
            if indices.size
        ]
        return CertificateText(
            along=self._along(None if up is None else finite_array("up", up, (3,))),
            needed=f"{quantity(self.demand, 'N')}",
            available=f"at most {quantity(self.support, 'N')}{other_way}",
            short_by=f"{quantity(self.shortfall, 'N')}",
            limits="; ".join(limits) or "no cable pulls along this direction, however large its tension",
        )

    def describe(self, up: ArrayLike | None = None) -> str:
        """Describe the certificate in two lines: first the direction, then wrenches along it and limits.

        For a motion, time, span, wind and load come first. `up` is as in `text`.
        """
        text = self.text(up)
        when = "" if self.time is None else f"at t = {self.time:.3f} s"
        if self.span is not None:
            when += f" (no tensions from {self.span[0]:.3f} s to {self.span[1]:.3f} s)"
        if self.wind is not None:
            when += f" in wind ({', '.join(f'{value + 0.0:g}' for value in self.wind)}) m/s"
        when += "" if self.load is None else f" with {self.load_text}"
        return (
            f"{when.strip() + ', ' if when else ''}along {text.along}:\n"
            f"needed {text.needed}, available {text.available}, short by {text.short_by}; limits: {text.limits}"
        )

    @property
    def load_text(self) -> str:
        """Return mass and CoM of the load as text: "a load of 22 kg, CoM (0, 0.02, -0.3) m"; empty if it is not set."""
        if self.load is None:
            return ""
        mass, *com = self.load
        return f"a load of {quantity(mass, 'kg')}, CoM ({quantity_row(com)}) m"

    def _along(self, up: Array | None) -> str:
        """Return the direction as text."""
        if self.direction.size != 6:
            return f"the wrench direction {_vector(self.direction)}"
        unit = self.direction * np.repeat([1.0, self.length], 3)
        unit /= np.linalg.norm(unit)
        text, moment = direction_text(unit), float(np.linalg.norm(unit[3:])) >= _LEAST_PART
        if up is not None and float(np.linalg.norm(up)) > 0.0:
            upright = float(unit[:3] @ up) / float(np.linalg.norm(up))
            text += f", {'up' if upright > 0.0 else 'down'}" if abs(upright) > _VERTICAL else ""
        if moment:
            text += f"; moments divided by the characteristic length, {quantity(self.length, 'm')}"
        return text

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists and numbers, ready for JSON; time, span, wind and load only if they are set."""
        given = {field.name: getattr(self, field.name) for field in fields(self)} | {"binding": self.binding}
        return {
            name: np.asarray(value).tolist() if isinstance(value, np.ndarray | tuple) else value
            for name, value in given.items()
            if value is not None
        }


def _vector(values: Array) -> str:
    """Return the components of a direction with two decimals each."""
    return f"({', '.join(f'{round(float(value), 2) + 0.0:.2f}' for value in values)})"


def certify(problem: TensionProblem) -> Certificate | None:
    """Find the certificate with the largest shortfall, or None if w is available.

    If w has a part outside the range of A, that part is the direction. Otherwise w is projected on the available wrench
    set, in newtons (moments divided by the problem's length), and the direction is the one from the projection to w.
    Support and shortfall are computed from the direction, and only a certificate that `Certificate.verify` accepts is
    returned: its shortfall exceeds `TensionProblem.tolerance`.

    Args:
        problem: The problem; its t_ref and weights play no part.

    Returns:
        A verified certificate. None means that w is available within the tolerance.
    """
    projection = project(required("problem", problem, TensionProblem))
    certificate = sharpest(problem, projection)
    if certificate is not None or np.linalg.norm(projection.residual) <= accepted_error(problem, projection.closest):
        return certificate
    return sharpest(problem, exact_optimum(problem, projection.closest))


def sharpest(problem: TensionProblem, projection: Projection) -> Certificate | None:
    """Return the certificate of `certify`, from the projection of w."""
    outside = _outside_range(problem)
    if outside is not None:
        certificate = _along(problem, outside, projection.closest)
        if certificate is not None and certificate.singular:
            return certificate
    return _along(problem, projection.residual, projection.closest)


def certificate_along(
    problem: TensionProblem, direction: Array, projection: Projection | None = None
) -> Certificate | None:
    """Return the certificate along a direction, shape (n,), of any length, or None if it proves nothing.

    Its shortfall is a lower bound of the distance to the available wrench set, and `closest` the nearest tensions that
    the projection found.
    """
    closest = (projection or project(problem)).closest
    return _along(problem, direction / problem.row_scale, closest, any_length=True)


def _outside_range(problem: TensionProblem) -> Array | None:
    """Return the part of S w outside the range of S A, or None if A has full row rank."""
    norms = problem.column_norms
    U, sigma, _ = np.linalg.svd(problem.scaled_A / np.where(norms > 0.0, norms, 1.0))  # of the same range
    null = U[:, int(np.count_nonzero(sigma > RANK * sigma[0])) :]
    return null @ (null.T @ problem.scaled_w) if null.shape[1] else None


def _along(problem: TensionProblem, vector: Array, closest: Array, any_length: bool = False) -> Certificate | None:
    """Return the certificate along a scaled wrench [N], or None if it, or its shortfall, is below the tolerance."""
    tolerance = accepted_error(problem, closest)
    size = np.sqrt(vector @ vector)
    if not (0.0 if any_length else tolerance) < size < np.inf:
        return None
    direction = problem.row_scale * (vector / size)
    support, rounding, at_max, at_min = _support(problem, direction)
    demand = float(direction @ problem.w)
    if not demand - support > tolerance + rounding:
        return None
    return Certificate(direction, support, demand, demand - support, at_max, at_min, closest, problem.length)


def _support(problem: TensionProblem, direction: Array) -> tuple[float, float, Indices, Indices]:
    """Return support value along `direction` and a bound of its rounding [N], and the cables at t_max and at t_min.

    What a cable with a limit gives counts at any size, and so does the rounding of its pull. A cable without a limit
    gives any amount, unless it pulls by less than the rounding of its own wrench: the support value is infinite. A
    smaller pull that is no rounding of its terms is in doubt, times the largest tension that counts.
    """
    pull, terms = direction @ problem.A, np.abs(direction) @ np.abs(problem.A)
    limit = np.where(pull > 0.0, problem.t_max, problem.t_min)
    known = np.isfinite(limit)
    if (np.abs(pull[~known]) > ORTHOGONAL * problem.column_norms[~known]).any():
        return np.inf, np.inf, _NONE, _NONE
    support = float(pull[known] @ limit[known])
    rounding = (problem.n + problem.m + 2) * _UNIT_ROUNDOFF * float(terms[known] @ np.abs(limit[known]))
    counts = ~known & (np.abs(pull) > ROUNDED_PULL * terms)
    rounding += CANCELLED * problem.wrench_scale * float(np.sum(np.abs(pull[counts]) / problem.column_norms[counts]))
    small = NEGLIGIBLE * problem.column_norms
    return support, rounding, np.flatnonzero(pull > small), np.flatnonzero(pull < -small)
