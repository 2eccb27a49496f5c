"""`Region`: a body from which the cables keep a distance, fixed in {G} or moving with the platform."""

from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from ..models.batch import BLOCK, in_blocks
from ..models.body import skeleton
from ..ocp.limits.clearance import cable_outside
from ..workspace.conditions.interference import segment_distance


class Region(NamedTuple):
    """A body and the smallest distance of cables from it."""

    name: str  # for reports
    shape: Any  # a `Shape`: these are frozen, and so can be keys of a cache
    riding: bool  # in the frame of the platform, with which it moves; else in {G}
    least: float  # [m]

    def distances(self, ends: np.ndarray, anchors: np.ndarray) -> np.ndarray:
        """Return the distances of cables with ends (n, 3) in the frame of the region, (n,) [m]; negative inside."""
        return in_blocks(_distance(self.shape, False), [ends, anchors])[0][:, 0]

    def spaces(self, ends: np.ndarray, anchors: np.ndarray) -> np.ndarray:
        """Return by how much cables keep the distance, (n,) [m]: exactly if negative, otherwise at least."""
        centre, radius = _ball(self.shape)
        centres = np.broadcast_to(centre, ends.shape)
        found = segment_distance(ends, anchors, centres, centres) - radius - self.least
        near = np.flatnonzero(found < 0.0)
        if near.size:
            found[near] = self.distances(ends[near], anchors[near]) - self.least
        return found

    def slopes(self, ends: np.ndarray, anchors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the derivatives of distances by both ends, (n, 3) each."""
        (found,) = in_blocks(_distance(self.shape, True), [ends, anchors])
        return found[:, :3], found[:, 3:]


@lru_cache(maxsize=64)
def _ball(shape: Any) -> tuple[np.ndarray, float]:
    """Return centre (3,) and radius of a ball that contains a shape [m]."""
    its = skeleton(shape)
    centre = its.corners.mean(axis=0)
    return centre, float(np.linalg.norm(its.corners - centre, axis=1).max()) + its.radius


@lru_cache(maxsize=64)
def _distance(shape: Any, slopes: bool) -> ca.Function:
    end, anchor = ca.SX.sym("end", 3), ca.SX.sym("anchor", 3)
    value = cable_outside(shape, end, anchor)
    if slopes:
        value = ca.densify(ca.jacobian(value, ca.vertcat(end, anchor)).T)
    return ca.Function("distance", [end, anchor], [value], {"cse": True}).map(BLOCK)
