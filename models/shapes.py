"""Shapes of regions and bodies: balls, capsules, boxes, meshes; and convex bodies that are fixed in a frame."""

from itertools import combinations, product
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, model_validator
from typing_extensions import override

from ..base.inputs import InputError, shown
from .part import AT_ORIGIN, NonNegative, Part, Pose, Positive, Vector3, optional
from .points import placed, rotations
from .polyhedron import Polyhedron, convex_hull, polyhedron, read_stl

DENT = 1e-5  # of its size by which a convex surface may be inside its hull: files have 7 digits
THINNEST = 1e-5  # [m] of a body or place: distances are rounded by a tenth of it where things touch
SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))  # of a box's corners
EDGES = np.array([pair for pair in combinations(range(8), 2) if np.abs(np.diff(SIGNS[[*pair]], axis=0)).sum() == 2])


class _Round:
    """A body of all points within a radius of a centre or a line."""

    radius: float

    @property
    def rounding(self) -> float:
        """Return by how much it is larger than its centre or line on all sides [m]."""
        return self.radius

    @property
    def thickness(self) -> float:
        """Return the least distance of two planes between which it fits [m]."""
        return 2 * self.radius


class Sphere(Part, _Round):
    """A ball."""

    kind: Literal["sphere"]
    centre: Vector3 = Field(description="centre [m]")
    radius: Positive = Field(description="radius [m]")  # pyrefly: ignore[bad-override]


class Capsule(Part, _Round):
    """All points within `radius` of the line from `start` to `end`."""

    kind: Literal["capsule"]
    start: Vector3 = Field(description="start of the axis [m]")
    end: Vector3 = Field(description="end of the axis [m]")
    radius: Positive = Field(description="radius [m]")  # pyrefly: ignore[bad-override]


class Block(Part):
    """A box along the axes of its frame, or turned about its centre."""

    kind: Literal["box"]
    min: Vector3 = Field(description="lowest corner before the rotation [m]")
    max: Vector3 = Field(description="highest corner before the rotation [m]")
    attitude: Vector3 | None = optional("rotation about its centre: roll, pitch, yaw [rad]; default: none")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if any(low >= high for low, high in zip(self.min, self.max, strict=True)):
            raise ValueError(f"min must be smaller than max in each coordinate, got {self.min} and {self.max}")
        return self

    @property
    def rounding(self) -> float:
        """Return by how much it is larger than its faces on all sides [m], which is 0."""
        return 0.0

    @property
    def centre(self) -> np.ndarray:
        """Return its centre, (3,) [m]."""
        return (np.array(self.min) + np.array(self.max)) / 2

    @property
    def half(self) -> np.ndarray:
        """Return half of its edges, (3,) [m]."""
        return (np.array(self.max) - np.array(self.min)) / 2

    @property
    def thickness(self) -> float:
        """Return the least distance of two planes between which it fits [m]."""
        return 2 * float(self.half.min())

    @property
    def axes(self) -> np.ndarray:
        """Return the directions of its edges as columns, (3, 3) [-]."""
        return np.eye(3) if self.attitude is None else rotations(np.array(self.attitude))

    @property
    def body(self) -> Polyhedron:
        """Return its faces and edges in its frame [m]."""
        corners, normals = self.centre + (SIGNS * self.half) @ self.axes.T, np.vstack([self.axes.T, -self.axes.T])
        return Polyhedron(normals, (corners @ normals.T).max(axis=0), corners[EDGES], corners)


class ConvexMesh(Part):
    """A convex body: the hull of points, or of the triangles of an STL file.

    A file is read once, where the task is read: a saved task has its vertices. What a distance costs grows with the
    faces of the hull, of which there may be 200.
    """

    kind: Literal["mesh"]
    file: str | None = optional(
        "STL file, binary or text, instead of vertices; its path is relative to the robot or task file"
    )
    hull: bool = optional("true: accept an STL surface that is not convex, and use its convex hull", False)
    vertices: tuple[Vector3, ...] = optional(
        "points whose convex hull is the body, in its own axes and in units of `scale`", ()
    )
    scale: Positive = optional(
        "length of a unit of vertices or file [m]: 0.001 for millimetres; required for a file, since STL has no unit",
        1.0,
    )
    pose: Pose = optional("pose of the body's axes: x, y, z, roll, pitch, yaw [m, rad]", AT_ORIGIN)

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or not isinstance(data.get("file"), str):
            return data
        if set(data) - set(cls.model_fields):  # a misspelt key is reported before what is missing without it
            return data
        name, scale, hull = data["file"], data.get("scale"), data.get("hull", False)
        if data.get("vertices"):
            raise ValueError(f"vertices must be left out, since file has them, got both and {name!r}")
        if scale is None:
            raise ValueError(
                f"scale must be given with the file {name!r}, since STL has no unit: 0.001 for millimetres"
            )
        if not isinstance(hull, bool):  # any text is true, "no" too
            raise ValueError(f"hull of the file {name!r} must be true or false, got {shown(hull)}")
        try:
            triangles = read_stl((info.context or {}).get("folder", Path()) / name)
        except InputError as error:
            raise ValueError(f"file {error}") from None
        try:
            body = convex_hull(triangles.reshape(-1, 3))
        except ValueError as error:
            raise ValueError(f"file {name!r} {error}") from None
        dent = 0.0 if hull else _dent(body, triangles)
        if dent > DENT * body.size:
            by = dent * scale if isinstance(scale, int | float) else dent
            raise ValueError(
                f"file {name!r} must be convex, got a surface up to {by:.3g} m inside its convex hull; write hull: "
                "true to keep out of the hull, or give several convex parts"
            )
        kept = {key: value for key, value in data.items() if key not in ("file", "hull")}
        return kept | {"vertices": tuple(tuple(corner) for corner in body.corners.tolist())}

    @model_validator(mode="after")
    def _spans_a_body(self) -> Self:
        if not self.vertices:
            raise ValueError("vertices must be four points or more, or file the name of an STL file, got neither")
        try:
            polyhedron(self.vertices)
        except ValueError as error:
            raise ValueError(f"vertices {error}") from None
        return self

    @property
    def rounding(self) -> float:
        """Return by how much it is larger than the hull on all sides [m]."""
        return 0.0

    @property
    def body(self) -> Polyhedron:
        """Return its faces and edges in its frame [m]."""
        own = polyhedron(self.vertices)
        pose, turned = np.array(self.pose), rotations(np.array(self.pose[3:]))
        normals = own.normals @ turned.T
        return Polyhedron(
            normals=normals,
            offsets=self.scale * own.offsets + normals @ pose[:3],
            edges=placed(pose, self.scale * own.edges.reshape(-1, 3)).reshape(-1, 2, 3),
            corners=placed(pose, self.scale * own.corners),
        )

    @property
    def thickness(self) -> float:
        """Return the least distance of two planes between which it fits, one of them along a face [m]."""
        return float(-self.body.beyond(self.body.corners).min(axis=0).max()) + 2 * self.rounding


Shape: TypeAlias = Sphere | Capsule | Block | ConvexMesh


def _dent(body: Polyhedron, triangles: np.ndarray) -> float:
    """Return how far triangles (n, 3, 3) are inside their convex hull: the largest distance of any from a face."""
    deepest = 0.0
    for some in np.array_split(triangles, 1 + len(triangles) // 10_000):
        deepest = max(deepest, float((-body.beyond(some)).max(axis=1).min(axis=1).max()))
    return deepest


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
    return Skeleton(shape.body.corners, shape.body.edges, True, shape.rounding)
