"""`BodyBounds`: lower bounds of the distances of bodies from regions, for many poses of the platform in one call.

The plane of a face of one of two convex bodies is as far from the other as its nearest corner, and the bodies are no
nearer. Where a face is nearest, the largest of these distances is the distance itself, at a hundredth of its price.
"""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from ...models.points import placed, rotations
from ...models.shapes import Block, ConvexMesh, Shape, skeleton
from ..limits import Limit
from ..limits.places import BodyOutside


class BodyBounds:
    """The bodies and regions of some limits, each pair with all of its limits.

    - `pairs`: the limits of each pair.
    - `size`: the largest extent of a body [m].
    """

    def __init__(self, limits: Sequence[Limit]):
        solid = [
            limit
            for limit in limits
            if isinstance(limit, BodyOutside) and (skeleton(limit.body).solid or skeleton(limit.region).solid)
        ]
        self.pairs = [tuple(its) for _, its in groupby(solid, lambda limit: (id(limit.body), id(limit.region)))]
        self._of_bodies = [
            (np.array([k for k, its in enumerate(self.pairs) if its[0].body is body]), _Body(body))
            for body in {id(limit.body): limit.body for limit in solid}.values()
        ]
        self._regions = [_Regions([self.pairs[k][0].region for k in which]) for which, _ in self._of_bodies]
        least = [its[0].low + its[0].body.rounding + its[0].region.rounding for its in self.pairs]
        self._least = np.array(least)
        self.size = max((float(np.ptp(body.corners, axis=0).max()) for _, body in self._of_bodies), default=0.0)

    def __call__(self, platform: np.ndarray) -> np.ndarray:
        """Return by how much each pair keeps its limits at least, at poses of the platform (n, 6), (n, pairs) [m]."""
        bounds = np.full((len(platform), len(self.pairs)), -np.inf)
        for (which, body), regions in zip(self._of_bodies, self._regions, strict=True):
            bounds[:, which] = np.maximum(regions.above(body, platform), regions.below(body, platform))
        return bounds - self._least


def _faces(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (f, 3) and offsets (f,) [m] of the faces of a shape's skeleton."""
    return shape.body[:2] if isinstance(shape, Block | ConvexMesh) else (np.zeros((0, 3)), np.zeros(0))


class _Body:
    """The corners and faces of a body in the platform's frame."""

    def __init__(self, shape: Shape):
        self.corners, (self.normals, self.offsets) = skeleton(shape).corners, _faces(shape)


class _Regions:
    """The corners and faces of regions in {G}, one region after the other."""

    def __init__(self, shapes: Sequence[Shape]):
        corners, faces = [skeleton(shape).corners for shape in shapes], [_faces(shape) for shape in shapes]
        self._count, self._corners = len(shapes), np.concatenate(corners)
        self._normals, self._offsets = (np.concatenate(part) for part in zip(*faces, strict=True))
        self._solid = np.flatnonzero([len(offsets) for _, offsets in faces])
        self._first_corner = np.cumsum([0, *(len(its) for its in corners[:-1])])
        self._first_face = np.cumsum([0, *(len(faces[k][1]) for k in self._solid[:-1])])

    def above(self, body: _Body, platform: np.ndarray) -> np.ndarray:
        """Return how far a body is beyond a face of each region, (n, k) [m]; -inf for regions without faces."""
        result = np.full((len(platform), self._count), -np.inf)
        if self._solid.size:
            heights = (placed(platform, body.corners) @ self._normals.T).min(axis=1) - self._offsets
            result[:, self._solid] = np.maximum.reduceat(heights, self._first_face, axis=1)
        return result

    def below(self, body: _Body, platform: np.ndarray) -> np.ndarray:
        """Return how far each region is beyond a face of a body, (n, k) [m]; -inf for a body without faces."""
        if not len(body.offsets):
            return np.full((len(platform), self._count), -np.inf)
        normals = np.einsum("nij,fj->nif", rotations(platform[:, 3:]), body.normals)
        heights = self._corners @ normals - (platform[:, None, :3] @ normals + body.offsets)
        return np.minimum.reduceat(heights, self._first_corner, axis=1).max(axis=2)
