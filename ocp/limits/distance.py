"""`Distance`: a limit of distances between bodies that move, each the hull of one or two points, and other bodies."""

from abc import abstractmethod
from typing import NamedTuple

import casadi as ca
from typing_extensions import override

from .limit import Limit
from .state import State


class Pair(NamedTuple):
    """Two bodies: the hull of `points`, and the hull of `others`, or a fixed convex region if there are no `others`."""

    points: ca.SX  # (3, k) [m]
    others: ca.SX  # (3, j) [m], j = 0: a place


class Distance(Limit):
    """A limit of the distance of each of some pairs of bodies.

    A plane between two convex bodies proves a lower bound of their distance. A plane with the same normal does so at
    any other time, from the points alone, so the audit can bound the distance between two instants. All pairs
    of a limit have the same numbers of points.
    """

    unit = "m"

    @abstractmethod
    def pairs(self, state: State) -> list[Pair]:
        """Return the pairs at one instant, (k,), in a frame in which the regions are fixed."""

    @abstractmethod
    def apart(self, pair: Pair) -> ca.SX:
        """Return the distance of two bodies [m]; unless they overlap, it is the smallest between their points."""

    @override
    def values(self, state: State) -> ca.SX:
        return ca.vertcat(*(self.apart(pair) for pair in self.pairs(state)))
