"""The base class of tension-distribution methods, and what a method returns."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

from ...base.display import record
from ..problem import Array, TensionProblem
from ..standard_form import StandardForm

__all__ = ["Array", "Method", "Proposal", "StandardForm"]


class Proposal(NamedTuple):
    """The proposal of a method; `towline.solvers.solve` checks it.

    Attributes:
        s: The point in standard form, shape (k,), or None if the method has none.
        iterations: How many it took, None if not counted.
        detail: The reason when `s` is None.
        final: True if `solve` reports this failure even if the problem is feasible, for example because the feasible
            tensions are unbounded; it then does not try exact arithmetic.
    """

    s: Array | None
    iterations: int | None = None
    detail: str = ""
    final: bool = False

    __repr__ = record


class Method(ABC):
    """A method to choose tensions. Subclass it, set the class variables, write `propose`, and pass it to `solve`."""

    name: ClassVar[str]
    """The name that `solve` takes."""

    guarantee: ClassVar[str]
    """One line: what the tensions are, and what happens if there are none."""

    source: ClassVar[str]
    """Where the method is published."""

    exact: ClassVar[bool]
    """True if the method ends at the optimum of its own criterion. If w is on the boundary of the available wrench set
    and the method fails because of rounding, `solve` computes least squares in exact arithmetic. If the criterion is
    another one, `solve` then calls the method again, for the cables whose tensions are not determined there."""

    continuous: ClassVar[bool] = False
    """True if the tensions follow A, w and the limits without a jump wherever the feasible tensions have an interior,
    that is, can all be off their limits at once."""

    least_squares: ClassVar[bool] = False
    """True if the method's tensions solve the problem's own least squares: then `solve` calls them optimal only where
    multipliers prove it."""

    seeks_reference: ClassVar[bool] = False
    """True if s = 0, tensions at t_ref, is the method's result wherever it is a feasible one."""

    always_answers: ClassVar[bool] = False
    """True if the tensions are worth having even if w is out of reach: then they come with the certificate."""

    options: ClassVar[dict[str, str] | None] = {}
    """Keyword arguments of `propose` and what they mean; None = whatever the back end takes."""

    def backends(self) -> list[str]:
        """Return the names of the installed back ends, the default first; empty for methods that have none."""
        return []

    def for_options(self, problem: TensionProblem, options: dict[str, Any]) -> Method:
        """Return the method for these options; default: this one."""
        return self

    @abstractmethod
    def propose(self, form: StandardForm, backend: str | None, **options: Any) -> Proposal:
        """Choose s with Q s = b and lower <= s <= upper.

        Args:
            form: The problem in standard form.
            backend: One of `backends`; None = the first.
            options: As `options` lists them.
        """
