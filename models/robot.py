"""A robot as data: one platform, the carriers that hold its cables, and the cables.

SI units throughout: metres, kilograms, seconds, newtons, radians. {G} is the global frame (down is where
gravity points), the platform frame sits on the platform, a carrier frame on each carrier. Poses are (x, y, z, roll,
pitch, yaw) with R = Rz(yaw) Ry(pitch) Rx(roll).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from pydantic import Field, model_validator

from ..base.display import BLUE, ORANGE, Curve, Fact, picture
from ..base.inputs import InputError, number, printable, required, shown, whole_number
from ..base.text import counted, quantity, quantity_range, quantity_row
from . import parameters, points
from .cable import Cable, Encoder
from .carriers import AnyCarrier, Carrier, Drive
from .part import COORDINATES, LARGEST, Box, Finite, Name, Part, Vector3, inertia_matrix, optional
from .platform import Platform
from .uncertainty import Uncertainty

PLANES = {"x": [[0, 0], [1, 0], [0, 1]], "y": [[1, 0], [0, 0], [0, 1]], "z": [[1, 0], [0, 1], [0, 0]]}  # without it
OBLIQUE = [[0.9, -0.25], [-0.45, -0.45], [0.0, 0.95]]  # (3, 2), from above


def _without_default(schema: dict[str, Any]) -> None:
    """Remove a default that stands for one that depends on other fields."""
    del schema["default"]


class Robot(Part):
    """A cable robot: one platform, carriers, cables. `load` and `Robot.model_validate` create it; it cannot be changed.

    Arrays such as `anchors` have one row per cable or carrier, in the order of the file.
    """

    name: Name = Field(description="name of the robot, for reports and file names")
    source: str = Field(min_length=1, description="source of the numbers, and which of them are assumed")
    gravity: Vector3 = optional("acceleration of gravity in {G} [m/s^2]", (0.0, 0.0, -9.81))
    drive: Drive = optional(
        "drives that move the platform. fixed-length: carriers, with cables of constant length; "
        "variable-length: winches, with mobile carriers at home; both: carriers and winches. Default: "
        "fixed-length "
        "if all cables hang from quadrotors or mobile carriers and none has a winch, an encoder or a pulley; else both",
        cast(Any, None),
        json_schema_extra=_without_default,
    )
    platform: Platform
    carriers: tuple[AnyCarrier, ...] = Field(min_length=1, description="bodies from which the cables hang")
    cables: tuple[Cable, ...] = Field(min_length=1, description="cables; results number them in this order")
    uncertainty: Uncertainty | None = optional(
        "uncertainty of anchors, attachments, pulley radii and encoders; default: no uncertainty"
    )

    floor: Finite | None = optional(
        "height z in {G} below which no part of platform and load may be [m]; default: none"
    )
    workspace_box: Box | None = optional(
        "box in {G} in which the bodies of platform and load stay [m]; default: no walls"
    )

    @model_validator(mode="after")
    def _parts_fit(self) -> Self:
        names = [carrier.name for carrier in self.carriers]
        for index, name in enumerate(names):
            if name == "world":
                raise ValueError(f"carriers[{index}].name must not be 'world', which means the global frame")
            if name in names[:index]:
                raise ValueError(f"carriers[{index}].name must be unique, got {name!r} twice")
        for index, cable in enumerate(self.cables):
            if cable.carrier not in names:
                raise ValueError(f"cables[{index}].carrier must be one of {', '.join(names)}, got {cable.carrier!r}")
        lengths = np.linalg.norm(self.home_anchors - self.home_attachments, axis=1)
        object.__setattr__(
            self,
            "drive",
            self.drive or usual_drive([self.carriers[index] for index in self.carrier_of_cable], self.cables),
        )
        if self.drive == "fixed-length":
            object.__setattr__(self, "cables", lengths_to_keep(self.cables, lengths))
        shortest = int(np.argmin(lengths))
        if not lengths[shortest] > 1e-9:
            raise ValueError(
                f"cables[{shortest}] must have a length > 0 m at home, got an anchor and an attachment that coincide"
            )
        if self.pulley_radii.any():
            turned = points.rotations(self.carrier_home[self.carrier_of_cable, 3:])
            axes = np.einsum("mij,mj->mi", turned, self.pulley_axes)
            check_pulleys(self.home_attachments - self.home_anchors, axes, self.pulley_radii, self.cables)
        for index, name in enumerate(self.uncertainty.parameters if self.uncertainty else ()):
            try:
                parameters.locate(name, self.cables)
            except ValueError as error:
                raise ValueError(f"uncertainty.parameters[{index}] {error}") from None
        return self

    def parameter_values(self, names: Iterable[str]) -> np.ndarray:
        """Return cable parameters by name, such as `cables[2].anchor.x` or `cables[2].encoder.scale`, (p,) [m, -, 1/m].

        Raises:
            InputError: If `names` is not a list of names, or the robot has no such parameter.
        """
        try:
            listed = None if isinstance(names, str) else list(names)
        except Exception:  # not iterable, as an array of CasADi is, which has `__iter__`
            listed = None
        if listed is None:
            raise InputError(f"names must be a list of names of a robot's parameters, got {shown(names)}")
        numbers = {"anchor": self.anchors, "attachment": self.attachments, "radius": self.pulley_radii[:, None]}
        numbers["encoder"] = self.encoders
        found = (parameters.located("names", name, self.cables) for name in listed)
        return np.array([numbers[one.part][one.cable, one.axis] for one in found])  # (p,)

    def with_parameters(self, values: Mapping[str, float]) -> Robot:
        """Return the robot with other cable parameters, by the names of `parameter_values`.

        Raises `InputError` if `values` is not a mapping, the robot has no such parameter, or a value is impossible.
        """
        data = self.model_dump()
        cables = [dict(cable) for cable in data["cables"]]
        for name, value in required("values", values, Mapping).items():
            cable, part, axis = parameters.located("keys of values", name, self.cables)
            new = number(name, value, -LARGEST, LARGEST)
            if part == "radius":
                cables[cable]["pulley"] = {**cables[cable]["pulley"], "radius": new}
            elif part == "encoder":
                cables[cable]["encoder"] = {**cables[cable]["encoder"], parameters.ENCODER[axis]: new}
            else:
                point = list(cables[cable][part])
                point[axis] = new
                cables[cable][part] = point
        return Robot.model_validate({**data, "cables": cables})

    def drawn(self, count: int, seed: int = 0) -> tuple[Robot, ...]:
        """Sample `count` robots from the `uncertainty` of the file; the samples have no uncertainty of their own.

        The first robots of a `seed` do not depend on the count.

        Raises:
            InputError: If the robot has no uncertainty, an argument is wrong, or a sample is geometrically invalid.
        """
        whole_number("count", count, 1, 1_000_000)
        whole_number("seed", seed, 0, 2**63 - 1)
        if self.uncertainty is None:
            raise InputError("robot.uncertainty must be given to draw robots from it, got none")
        names = self.uncertainty.parameters
        exact = self.model_copy(update={"uncertainty": None})
        numbers = self.parameter_values(names) + self.uncertainty.errors(count, seed)
        return tuple(exact.with_parameters(dict(zip(names, row.tolist(), strict=True))) for row in numbers)

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the robot as a robot file atomically; `load` reads an equal robot from it.

        Raises `InputError` if the file cannot be written.
        """
        from .parsing import save_yaml

        return save_yaml(self, file)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with changed fields, without the numbers that were computed from the old ones."""
        copy = super().model_copy(update=update, deep=deep)
        for name in vars(copy).keys() - type(self).model_fields.keys():
            del vars(copy)[name]
        return copy

    def __hash__(self) -> int:
        """Return a hash of the numbers of the robot, the same in each process."""
        return self._hash

    @cached_property
    def _hash(self) -> int:  # a stream of measurements looks up what is known of its robot at each sample
        return hash((self.platform.mass, *self.t_max, *self.anchors.flat, *self.attachments.flat))

    def _headline(self) -> str:
        kinds = [carrier.kind for carrier in self.carriers]
        carriers = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        return f"{self.name}: {counted(self.m, 'cable')}, {carriers} carrier{'s' * (len(kinds) != 1)}"

    def _facts(self) -> Iterable[Fact]:
        return [
            ("mass", quantity(self.platform.mass, "kg")),
            ("moves", ", ".join(self.platform.dof)),
            ("home", f"({quantity_row(self.home)}) [m, rad]"),
            (
                "cable lengths there",
                quantity_range(np.linalg.norm(self.home_anchors - self.home_attachments, axis=1), "m"),
            ),
            ("t_min", quantity_range(self.t_min, "N")),
            ("t_max", quantity_range(self.t_max, "N")),
            ("drive", self.drive),
            ("source", printable(self.source)),
        ]

    def _picture(self) -> str:
        """Return cables and platform at home, in the plane of a planar robot, else obliquely from above."""
        flat = [plane for name, plane in PLANES.items() if name not in self.platform.dof]
        view = np.array(flat[0] if flat else OBLIQUE)
        anchors, attachments = self.home_anchors @ view, self.home_attachments @ view  # (m, 2)
        rows = [i for pair in combinations(range(self.m), 2) for i in (*pair, 0)] or [0]
        body = attachments[rows]
        body[2::3] = np.nan
        cables: list[Curve] = [(*np.stack([a, b]).T, BLUE) for a, b in zip(anchors, attachments, strict=True)]
        return picture([(*body.T, ORANGE), *cables], equal=True)

    @property
    def m(self) -> int:
        """Return the number of cables."""
        return len(self.cables)

    @property
    def anchors(self) -> np.ndarray:
        """Return the anchors A_i, each in the frame of its carrier, (m, 3) [m]."""
        return np.array([cable.anchor for cable in self.cables])  # (m, 3)

    @property
    def attachments(self) -> np.ndarray:
        """Return the attachments B_i in the platform frame, (m, 3) [m]."""
        return np.array([cable.attachment for cable in self.cables])  # (m, 3)

    @property
    def pulley_radii(self) -> np.ndarray:
        """Return the radius of each cable's pulley, (m,) [m], 0 for a point anchor."""
        return np.array([cable.pulley.radius if cable.pulley else 0.0 for cable in self.cables])  # (m,)

    @property
    def encoders(self) -> np.ndarray:
        """Return offset [m], scale, build-up [1/m] of each cable's encoder, (m, 3); default: readings are lengths."""
        of = [cable.encoder or Encoder() for cable in self.cables]
        return np.array([(one.offset, one.scale, one.build_up) for one in of])  # (m, 3)

    @property
    def pulley_axes(self) -> np.ndarray:
        """Return the swivel axis of each cable's pulley in its carrier's frame, (m, 3) [-]; z for a point anchor."""
        axes = np.array([cable.pulley.axis if cable.pulley else (0.0, 0.0, 1.0) for cable in self.cables])
        return axes / np.linalg.norm(axes, axis=1, keepdims=True)  # (m, 3)

    @property
    def carrier_of_cable(self) -> np.ndarray:
        """Return the index of the carrier of each cable, (m,)."""
        names = [carrier.name for carrier in self.carriers]
        return np.array([names.index(cable.carrier) for cable in self.cables])  # (m,)

    @property
    def t_min(self) -> np.ndarray:
        """Return the smallest tensions, (m,) [N]."""
        return np.array([cable.t_min for cable in self.cables])  # (m,)

    @property
    def t_max(self) -> np.ndarray:
        """Return the largest tensions, (m,) [N]: the file's or, if less, those at which winches can still haul in."""
        winches = [cable.winch if self.drive != "fixed-length" else None for cable in self.cables]
        most = np.array([winch.tension_max if winch else np.inf for winch in winches])
        return np.minimum([cable.t_max for cable in self.cables], np.maximum(most, self.t_min))  # (m,)

    @property
    def fixed_lengths(self) -> np.ndarray | None:
        """Return the constant cable lengths, (m,) [m], or None if winches change them."""
        if self.drive != "fixed-length":
            return None
        return np.array([cable.length for cable in self.cables], dtype=float)

    @property
    def carrier_home(self) -> np.ndarray:
        """Return the home poses of the carriers in {G}, (c, 6) [m, rad]."""
        return np.array([carrier.home for carrier in self.carriers])  # (c, 6)

    @property
    def carrier_radius(self) -> np.ndarray:
        """Return the radii of the balls about the carriers' origins that contain their bodies, (c,) [m]; 0: a point."""
        anchors, owner = self.anchors, self.carrier_of_cable
        return np.array([each.body_radius(anchors[owner == i]) for i, each in enumerate(self.carriers)])  # (c,)

    @property
    def home(self) -> np.ndarray:
        """Return the platform's home pose in {G}, (6,) [m, rad]: the file's, or else between or below the anchors."""
        return np.array(self.platform.home or points.default_home(self.home_anchors, self.attachments))  # (6,)

    @property
    def home_anchors(self) -> np.ndarray:
        """Return the anchors in {G} with the carriers at home, (m, 3) [m]."""
        return points.anchors(self, self.carrier_home)  # (m, 3)

    @property
    def home_attachments(self) -> np.ndarray:
        """Return the attachments in {G} with the platform at home, (m, 3) [m]."""
        return points.attachments(self, self.home)  # (m, 3)

    @property
    def home_com(self) -> np.ndarray:
        """Return the CoM in {G} with the platform at home, (3,) [m]."""
        return points.placed(self.home, np.array([self.platform.com]))[0]  # (3,)

    @property
    def inertia(self) -> np.ndarray:
        """Return the inertia matrix I_b about the CoM in platform axes, (3, 3) [kg m^2], or 0 without an inertia."""
        return inertia_matrix(self.platform.inertia or (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))  # (3, 3)

    @property
    def dof_mask(self) -> np.ndarray:
        """Return 1 for the wrench rows that the cables must balance, 0 for coordinates that cannot move, (6,)."""
        return np.array([float(name in self.platform.dof) for name in COORDINATES])  # (6,)

    @property
    def weight(self) -> float:
        """Return the weight of the platform [N]."""
        return float(self.platform.mass * np.linalg.norm(self.gravity))

    @property
    def force_scale(self) -> float:
        """Return the characteristic force [N]: the weight, or without gravity the mean of the largest tensions."""
        return self.weight or float(self.t_max.mean())

    @property
    def wrench_scale(self) -> np.ndarray:
        """Return the factors that convert a wrench to newtons, (6,): 1 for forces, 1 / `length` for moments [1/m]."""
        return np.repeat([1.0, 1.0 / self.length], 3)  # (6,)

    @cached_property
    def length(self) -> float:
        """Return the characteristic length [m]: the largest distance from the CoM to an attachment."""
        arms = np.linalg.norm(self.attachments - np.array(self.platform.com), axis=1)
        return float(arms.max()) if arms.max() > 0 else 1.0

    @property
    def size(self) -> float:
        """Return the longest edge of the box about all cables at home [m]."""
        return float(np.ptp(np.vstack([self.home_anchors, self.home_attachments]), axis=0).max())


def check_pulleys(offsets: np.ndarray, axes: np.ndarray, radii: np.ndarray, cables: tuple[Cable, ...]) -> None:
    """Refuse an attachment on the swivel axis of its pulley, or inside the sheave.

    - `offsets`, `axes`: from anchors to attachments, (m, 3) [m], and the swivel axes, (m, 3) [-], in {G} at home.
    - `radii`: radii of the sheaves, (m,) [m]; 0 for a cable without.

    Raises `ValueError` that names the attachment.
    """
    up = np.sum(offsets * axes, axis=1)
    across = np.linalg.norm(offsets - up[:, None] * axes, axis=1)
    outside = (across > 1e-9) & (across**2 - 2 * across * radii + up**2 > 0)
    for index in np.flatnonzero((radii > 0) & ~outside):
        raise ValueError(
            f"cables[{index}].attachment must lie off the swivel axis and outside the sheave of its pulley at "
            f"home, got {cables[index].attachment}"
        )


def usual_drive(carriers: Iterable[Carrier], cables: Sequence[Cable]) -> Drive:
    """Return the drive of a robot whose file has none, from its cables and the carriers that hold these.

    Cables keep their lengths if all hang from carriers that move them about, such as quadrotors, and none has a winch,
    or an encoder or a pulley, which belong to one. All others have winches. Raises `ValueError` if one of these has a
    length to keep.
    """
    towed = all(carrier.tows for carrier in carriers)
    winches = any(part is not None for cable in cables for part in (cable.winch, cable.encoder, cable.pulley))
    if towed and not winches:
        return "fixed-length"
    for index, cable in enumerate(cables):
        if cable.length is not None:
            raise ValueError(
                f"drive must be given, because cables[{index}] has a length ({cable.length:g} m), which cables keep "
                "only with fixed-length"
            )
    return "both"


def lengths_to_keep(cables: tuple[Cable, ...], at_home: np.ndarray) -> tuple[Cable, ...]:
    """Return the cables of a robot with fixed lengths; one without a length has its distance at home, (m,) [m].

    Raises `ValueError` if a cable without a length runs over a pulley.
    """
    for index, cable in enumerate(cables):
        if cable.length is None and cable.pulley is not None:
            raise ValueError(
                f"cables[{index}].length must be a number > 0 [m] if drive is fixed-length and the cable has a pulley, "
                "got none"
            )
    return tuple(
        cable if cable.length is not None else cable.model_copy(update={"length": float(length)})
        for cable, length in zip(cables, at_home, strict=True)
    )
