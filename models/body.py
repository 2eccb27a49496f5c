"""Convex bodies that are fixed in a frame: those of platforms and loads, and what a distance needs of any shape."""

from itertools import combinations, product
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import AfterValidator, Field
from typing_extensions import override

from .part import NonNegative, optional
from .shapes import Block, Capsule, ConvexMesh, Shape, Sphere

THINNEST = 1e-5  # [m] of a body or place: distances are rounded by a tenth of it where things touch
SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))  # of a box's corners
EDGES = [pair for pair in combinations(range(8), 2) if np.abs(SIGNS[pair[0]] - SIGNS[pair[1]]).sum() == 2]


class BodySphere(Sphere):
    """A ball that is fixed in a frame."""


class BodyCapsule(Capsule):
    """A capsule that is fixed in a frame."""


class BodyBox(Block):
    """A box that is fixed in a frame."""


class BodyHull(ConvexMesh):
    """A convex body with plane faces that is fixed in a frame, with sharp or round edges."""

    radius: NonNegative = optional("distance by which the body extends beyond the hull on all sides [m]", 0.0)

    @property
    @override
    def rounding(self) -> float:
        return self.radius


def _check_thickness(body: Shape) -> Shape:
    if body.thickness < THINNEST:
        raise ValueError(f"must be at least {THINNEST:g} m thick, got {body.thickness:.3g} m")
    return body


AnyBody = Annotated[
    BodySphere | BodyCapsule | BodyBox | BodyHull, Field(discriminator="kind"), AfterValidator(_check_thickness)
]


DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


class Skeleton(NamedTuple):
    """A convex body as all points within a radius of the hull of its corners."""

    corners: np.ndarray  # (k, 3) [m]
    edges: np.ndarray  # the two ends of each edge, (e, 2, 3) [m]; e = 0: a point
    solid: bool  # whether the hull has faces, through which edges of others can pass
    radius: float  # [m]

    @property
    def parts(self) -> list[np.ndarray]:
        """Return its edges, (2, 3) each, or a point alone, (1, 3): nothing else of two bodies apart is nearest."""
        return list(self.edges) if len(self.edges) else [self.corners]


def surface(body: Shape) -> np.ndarray:
    """Return points on the surface of a body, (n, 3) [m], whose hull is nearly the body: for drawings."""
    its = skeleton(body)
    if not its.radius:
        return its.corners
    return (its.corners[:, None] + its.radius * DIRECTIONS).reshape(-1, 3)


def skeleton(shape: Shape) -> Skeleton:
    """Return the skeleton of a shape in its frame."""
    if isinstance(shape, Sphere):
        return Skeleton(np.array([shape.centre]), np.zeros((0, 2, 3)), False, shape.rounding)
    if isinstance(shape, Capsule):
        ends = np.array([shape.start, shape.end])
        return Skeleton(ends, ends[None], False, shape.rounding)
    if isinstance(shape, Block):
        corners = shape.centre + (SIGNS * shape.half) @ shape.axes.T
        return Skeleton(corners, corners[np.array(EDGES)], True, shape.rounding)
    return Skeleton(shape.body.corners, shape.body.edges, True, shape.rounding)
