"""`Columns`: the arguments of the functions of nodes and intervals, for all of them or for some."""

from typing import Any

import casadi as ca
import numpy as np

from ..tasks.scheme import Scheme
from .derivatives import Mapped


class Columns:
    """The columns of a program.

    Parameters
    ----------
    unknowns
        Unknowns of all points, (width, points), one point after the other.
    scheme
        The scheme, which selects points and groups them into intervals.
    references
        The reference motions at all points, (18 (1 + c), points), as numbers or parameters.
    carried
        Loads and columns of the ground, (., nodes).
    intervals
        `Grid.intervals`, (2, steps), as numbers or parameters.
    """

    def __init__(
        self, unknowns: ca.MX, scheme: Scheme, references: ca.DM | ca.MX, carried: np.ndarray, intervals: ca.DM | ca.MX
    ):
        size, where = scheme.size, np.arange(unknowns.numel()).reshape(-1, unknowns.shape[0]).T
        self._of_nodes = {"x": unknowns, "p": references, "carried": ca.DM(carried)}
        self._of_intervals = {
            "x": _groups(unknowns, size),
            "x_end": unknowns[:, size::size],
            "p": _groups(references, size),
            "p_end": references[:, size::size],
            "grid": intervals,
        }
        self._at_nodes = where
        self._between = np.vstack([where[:, :-1].T.reshape(-1, len(where) * size).T, where[:, size::size]])

    def at_nodes(self, function: ca.Function, chosen: np.ndarray | None = None) -> Mapped:
        """Return a function of nodes at those `chosen` among them; default: at all."""
        return _mapped(function, self._of_nodes, self._at_nodes, chosen)

    def between(self, function: ca.Function, chosen: np.ndarray | None = None) -> Mapped:
        """Return a function of intervals for those `chosen`; default: for all."""
        return _mapped(function, self._of_intervals, self._between, chosen)


def _mapped(function: ca.Function, columns: dict[str, Any], places: np.ndarray, chosen: Any) -> Mapped:
    inputs = [columns[name] for name in function.name_in()]
    if chosen is not None:
        inputs = [each[:, chosen.tolist()] for each in inputs]
        places = places[:, chosen]
    return Mapped(function, inputs, places)


def _groups(values: ca.MX | ca.DM, size: int) -> ca.MX | ca.DM:
    """Return the columns of each interval but its end's, one below the other."""
    return ca.reshape(values[:, :-1], values.shape[0] * size, -1)
