"""Parameters of a calibration: their names, and conversion from and to a robot.

The vector x has fifteen numbers for each cable, in this order, then eighteen of the robot, then one for each slip:

    anchor x y z  attachment x y z  offset  scale  radius  build-up  compliance  capstan  friction  gain  zero
    clock  mass  com x y z  frame: shift x y z, turn x y z  body: shift x y z, turn x y z  common compliance

Frame and body are the changes of measured poses in `pose_frames`. The common compliance adds to each cable's own.

With the measured tension y of a cable and the sign s of its speed (1: paid out), the platform feels the tension
exp(capstan s) gain (y - zero) + friction s, and compliance is 1 / (E A).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...base.display import Displayed
from ...base.inputs import InputError, number, shown
from ...models import points
from ...models.parameters import ENCODER
from ...models.robot import Robot

OF_CABLE = 15  # parameters of a cable
OF_ROBOT = 18  # clock offset, mass, CoM, changes of the frames of measured poses, and common compliance
FRAMES, COMMON = slice(5, 17), 17  # of these, the last ones
GEOMETRY = ("anchors", "attachments", "offsets", "scales", "radii", "build-up", "clock", "frame", "body")
IN_BALANCE = ("mass", "com", "capstan", "friction", "gains", "zeros")  # that only the balance of forces determines
GROUPS = (*GEOMETRY, "stiffness", "elasticity", *IN_BALANCE)
COLUMNS = {"anchors": (0, 1, 2), "attachments": (3, 4, 5), "offsets": (6,), "scales": (7,), "radii": (8,)}
COLUMNS |= {"build-up": (9,), "stiffness": (10,), "capstan": (11,), "friction": (12,), "gains": (13,), "zeros": (14,)}
ROBOT_COLUMNS = {"clock": (0,), "mass": (1,), "com": (2, 3, 4), "frame": range(5, 11), "body": range(11, 17)}
ROBOT_COLUMNS |= {"elasticity": (COMMON,)}
WORDS = (
    *(f"{end}.{axis}" for end in ("anchor", "attachment") for axis in "xyz"),
    *("offset", "scale", "pulley.radius", "build-up", "compliance", "capstan", "friction", "gain", "zero"),
)
ENCODED = dict(zip((6, 7, 9), ENCODER, strict=True))  # columns of encoders, by their keys in robot files
IN_FILE = {i: WORDS[i] for i in (*range(6), 8)} | {i: f"encoder.{name}" for i, name in ENCODED.items()}
UNITS = (*("m",) * 7, "1", "m", "1/m", "1/N", "1", "N", "1", "N")
STIFFEST = 1e-12  # [1/N]; less compliance is none
IN_PLANE = 1e-9  # [m] out of it
LARGEST_PRIOR = 1e3
SMALLEST_PRIOR = 1e-9


class Parameter(NamedTuple):
    """One parameter: its name, value, standard deviation and change from the robot's file, all in `unit`.

    Sigma is inf if the parameter is unobservable.
    """

    name: str
    value: float
    sigma: float
    correction: float
    unit: str


@dataclass(frozen=True)
class Parameters(Displayed):
    """The parameters of a robot's calibration, free and fixed."""

    robot: Robot  # robot with the initial values
    groups: tuple[str, ...]  # free groups, in the order of `GROUPS`
    slips: tuple[tuple[int, int], ...] = ()  # cable and first sample of each slip

    @property
    def count(self) -> int:
        """Return the number of all parameters, free and fixed."""
        return self.clock + OF_ROBOT + len(self.slips)

    @property
    def clock(self) -> int:
        """Return the index of the clock offset."""
        return OF_CABLE * self.robot.m

    @cached_property
    def varies(self) -> np.ndarray:
        """Return which parameters are free, (count,) of bool."""
        flags = np.zeros((self.robot.m, OF_CABLE), dtype=bool)
        for group in self.groups:
            flags[:, COLUMNS.get(group, ())] = True
        flags[:, 8] &= self.robot.pulley_radii > 0
        robot = np.repeat([group in self.groups for group in ROBOT_COLUMNS], list(map(len, ROBOT_COLUMNS.values())))
        moves = self.robot.dof_mask > 0
        plane = [moves[[*{0, 1, 2} - {axis}]].all() for axis in range(3)]  # in which positions turn about the axis
        robot[FRAMES] &= np.concatenate([moves[:3], moves[3:] | plane, moves])
        return np.concatenate([flags.ravel(), robot, np.ones(len(self.slips), dtype=bool)])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the names of all parameters."""
        cables = [f"cables[{i}].{word}" for i in range(self.robot.m) for word in WORDS]
        moved = (f"{of}.{how}.{axis}" for of in ("frame", "body") for how in ("shift", "turn") for axis in "xyz")
        robot = ("clock", "mass", *(f"com.{axis}" for axis in "xyz"), *moved, "compliance")
        return (*cables, *robot, *(f"cables[{i}].slip at sample {k}" for i, k in self.slips))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Return the units of all parameters."""
        of_frames = ("m", "m", "m", "rad", "rad", "rad") * 2
        return (*(UNITS * self.robot.m), "s", "kg", *("m",) * 3, *of_frames, "1/N", *("m" for _ in self.slips))

    @cached_property
    def first(self) -> np.ndarray:
        """Return the values of the robot's file, (count,) [m, 1, s]."""
        robot = self.robot
        table = np.zeros((robot.m, OF_CABLE))
        table[:, :3], table[:, 3:6], table[:, 8] = robot.anchors, robot.attachments, robot.pulley_radii
        table[:, list(ENCODED)] = robot.encoders
        table[:, 10] = [1 / cable.stiffness if cable.stiffness else 0.0 for cable in robot.cables]
        table[:, 13] = 1.0
        of_robot = (0.0, robot.platform.mass, *robot.platform.com, *np.zeros(13))
        return np.concatenate([table.ravel(), of_robot, np.zeros(len(self.slips))])

    @cached_property
    def carriers(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the rotation (m, 3, 3) and the position (m, 3) [m] in {G} of each cable's carrier at home."""
        pose = self.robot.carrier_home[self.robot.carrier_of_cable]
        return points.rotations(pose[:, 3:]), pose[:, :3]

    def table(self, x: np.ndarray) -> np.ndarray:
        """Return the parameters of the cables, a row for each, (m, 15)."""
        return x[: self.clock].reshape(self.robot.m, OF_CABLE)

    def places(self, names: Sequence[str]) -> np.ndarray:
        """Return the indices of parameters by their names in robot files, (len(names),)."""
        named = {f"cables[{i}].{word}": OF_CABLE * i + k for i in range(self.robot.m) for k, word in IN_FILE.items()}
        return np.array([named[name] for name in names], dtype=int)

    def compliances(self, x: np.ndarray) -> np.ndarray:
        """Return 1 / (E A) of the cables, (m,) [1/N]."""
        return self.table(x)[:, 10] + x[self.clock + COMMON]

    def calibrated(self, x: np.ndarray, covariance: np.ndarray | None = None) -> Robot:
        """Return the robot with the values `x`; an encoder is written where offset or scale differ from the file.

        Without a `covariance` (p, p) of the free parameters the robot has no uncertainty.
        Raises `InputError` if no robot can have these values.
        """
        data = self.robot.model_dump(mode="json")
        before, compliances = self.table(self.first), self.compliances(x).tolist()
        for i, row in enumerate(self.table(x).tolist()):
            cable = data["cables"][i]
            cable["anchor"], cable["attachment"] = row[:3], row[3:6]
            if cable["pulley"] is not None:
                cable["pulley"]["radius"] = row[8]
            reading = [row[k] for k in ENCODED]
            if self.robot.fixed_lengths is not None:
                cable["length"] = row[6] + (row[7] + row[9] * cable["length"]) * cable["length"]
            elif cable["encoder"] is not None or reading != before[i, list(ENCODED)].tolist():
                cable["encoder"] = dict(zip(ENCODER, reading, strict=True))
            if compliances[i] != before[i, 10]:
                cable["stiffness"] = 1 / compliances[i] if compliances[i] > STIFFEST else None
            if "friction" in self.groups and cable["winch"] is not None:
                cable["winch"]["friction"] = max(row[12], 0.0)
        mass, *com = x[self.clock + 1 : self.clock + 5].tolist()
        data["platform"] |= {"mass": mass, "com": com}
        encoded = [cable["encoder"] is not None and self.robot.fixed_lengths is None for cable in data["cables"]]
        data["uncertainty"] = None if covariance is None else self._uncertainty(covariance, encoded)
        return Robot.model_validate(data)

    def _uncertainty(self, covariance: np.ndarray, encoded: list[bool]) -> dict[str, Any] | None:
        """Return the part of a covariance (p, p) that a robot file holds: geometry, and encoders where `encoded`."""
        cables = [
            (row, *divmod(int(i), OF_CABLE)) for row, i in enumerate(np.flatnonzero(self.varies)) if i < self.clock
        ]
        named = {
            row: f"cables[{i}].{IN_FILE[k]}"
            for row, i, k in cables
            if k in IN_FILE and (k not in ENCODED or encoded[i])
        }
        kept = list(named)
        if not kept:
            return None
        return {"parameters": list(named.values()), "covariance": covariance[np.ix_(kept, kept)].tolist()}


def check_free(robot: Robot, free: object) -> tuple[str, ...]:
    """Return the free groups of parameters, in the order of `GROUPS`, or raise InputError."""
    given = (free,) if isinstance(free, str) else free
    if not isinstance(given, Sequence) or not given or any(not isinstance(name, str) for name in given):
        raise InputError(f"free must be 'auto' or some of {', '.join(GROUPS)}, got {shown(free)}")
    for name in given:
        if name not in GROUPS:
            raise InputError(f"free must be 'auto' or some of {', '.join(GROUPS)}, got {shown(name)}")
    if "radii" in given and not robot.pulley_radii.any():
        raise InputError(f"free must not have radii for robot {robot.name}, which has no pulleys, got {shown(free)}")
    return tuple(name for name in GROUPS if name in given)


def check_prior(prior: Any, groups: tuple[str, ...]) -> dict[str, float]:
    """Return the standard deviations about the file's values by group [m, 1 of scales, s], or raise InputError."""
    if prior is None:
        return {}
    if not isinstance(prior, Mapping):
        raise InputError(f"prior must be a mapping of standard deviations, or None, got {shown(prior)}")
    for name in prior:
        if name not in groups:
            raise InputError(f"prior must only have keys that are in free, {', '.join(groups)}, got {shown(name)}")
    return {name: number(f"prior.{name}", value, SMALLEST_PRIOR, LARGEST_PRIOR) for name, value in prior.items()}


def prior_sigmas(parameters: Parameters, prior: Mapping[str, float]) -> np.ndarray:
    """Return the standard deviation of each parameter about the file's value, (count,) [m, 1, s]; inf: none."""
    table = np.full((parameters.robot.m, OF_CABLE), np.inf)
    for group, columns in COLUMNS.items():
        table[:, columns] = prior.get(group, np.inf)
    others = np.full(OF_ROBOT + len(parameters.slips), np.inf)
    for group, columns in ROBOT_COLUMNS.items():
        others[list(columns)] = prior.get(group, np.inf)
    return np.concatenate([table.ravel(), others])


def normal_rows(parameters: Parameters) -> np.ndarray:
    """Return unit rows (d, count) of ends of cables that stay in a plane, along its normal; none with pulleys."""
    robot, rows = parameters.robot, []
    turned, _ = parameters.carriers
    apart = robot.home_anchors - robot.home_attachments
    for axis, unit in enumerate(np.eye(3)):
        across = [axis, *(3 + other for other in range(3) if other != axis)]
        if robot.dof_mask[across].any():
            continue
        of_platform = points.rotations(robot.home[None, 3:])[0].T @ unit
        for i in np.flatnonzero((np.abs(apart[:, axis]) < IN_PLANE) & (robot.pulley_radii < IN_PLANE)):
            for first, end in ((0, turned[i].T @ unit), (3, of_platform)):
                row = np.zeros(parameters.count)
                parameters.table(row)[i, first : first + 3] = end
                rows.append(row)
    return np.array(rows).reshape(-1, parameters.count)


def in_plane(parameters: Parameters) -> np.ndarray:
    """Return the projections of both ends of each cable on the plane that they stay in, (m, 6, 6).

    Ends move normal to it without effect, to first order. Noise and errors of a model would move them far to either
    side, so fits do not move them at all.
    """
    result = np.tile(np.eye(6), (parameters.robot.m, 1, 1))
    for row in normal_rows(parameters):
        ends = parameters.table(row)[:, :6]
        result -= ends[:, :, None] * ends[:, None]
    return result
