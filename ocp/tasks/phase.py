"""`Phase`: a part of a task with a path, a load and the ground under it; `Phases`: those of a task, laid out.

On the ground the balance of wrenches is A t + S n = w. Each column of S is the wrench of a unit force that pushes
against gravity at one support point, and n >= 0. The tensions are continuous from phase to phase. So where a phase on
the ground meets one without ground, S n is the difference of the wrenches that their loads need at rest: zero where
the load stays, its weight where the load is left on the ground or not yet fixed to the platform.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from pydantic import Field

from ...base.display import Displayed
from ...models.part import Name, NonNegative, Part, Pose, Positive, PositiveRange, Vector3, optional
from ...models.rigid_load import RigidLoad
from ...models.shapes import AnyBody
from .paths import RestPath, SequencePath, SinglePath
from .paths.sequence import Piece, check_continuity, lasting

SAME_TIME = 1e-9  # of the duration: an instant so near to the start of a phase belongs to it


class Load(RigidLoad):
    """A rigid body that is fixed to the platform, in addition to the platform of the robot's file."""

    mass: Positive = Field(description="mass [kg]")
    mass_tolerance: float = optional(
        "relative tolerance of the mass; 0.1: tensions exist for every mass from 0.9 to 1.1 times this one",
        0.0,
        ge=0,
        lt=1,
    )
    com_tolerance: tuple[NonNegative, NonNegative, NonNegative] = optional(
        "distance by which the CoM may differ along each axis of the platform [m]: tensions exist for "
        "every CoM in this box",
        (0.0, 0.0, 0.0),
    )
    body: AnyBody | None = optional(
        "convex body in the platform frame, which the plan keeps above the floor, inside the workspace box and "
        "out of keep-out regions while the load is carried; default: none"
    )

    @property
    def numbers(self) -> np.ndarray:
        """Return mass, CoM and inertia, (10,), as `Dynamics.carried_wrench` takes them."""
        return np.array([self.mass, *self.com, *self.inertia])

    @property
    def extremes(self) -> np.ndarray:
        """Return the extreme loads within the tolerances, (k, 10); none without tolerances.

        If tensions exist for these loads, they exist for all within the tolerances. The wrench of a load is affine
        in its mass, and in its CoM if its inertia about the nominal CoM is proportional to its mass. Each wrench is
        therefore a weighted mean of the wrenches of the extreme loads, and the available wrench set is convex.
        """
        masses = np.unique([self.mass * (1 - self.mass_tolerance), self.mass * (1 + self.mass_tolerance)])
        offsets = list(product(*(np.unique([-off, off]) + 0.0 for off in self.com_tolerance)))
        loads = []
        for mass, (x, y, z) in product(masses.tolist(), offsets):
            # About its own CoM, from that about the nominal one (parallel axes).
            nearer = mass * np.array([y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z])
            inertia = np.array(self.inertia) * mass / self.mass - nearer
            loads.append([mass, self.com[0] + x, self.com[1] + y, self.com[2] + z, *inertia])
        return np.array(loads) if len(loads) > 1 else np.zeros((0, 10))


class Ground(Part):
    """Ground under the platform or its load: vertical forces that only push, without friction."""

    support: tuple[Vector3, ...] | None = optional(
        "points at which the ground pushes, in the platform frame [m]; default: one below each attachment, "
        "level with the lowest",
        min_length=1,
    )
    slack: bool = optional("true if cables may be slack: their tensions then have the lower limit 0", False)


class Phase(Part):
    """A part of a task: a path, the load, and the ground."""

    name: Name = Field(description="name of the phase, for reports")
    path: SinglePath | None = optional("path of the platform; default: rest at the end of the previous phase")
    duration: Positive | PositiveRange | None = optional(
        "duration [s], at least 0.01; or a range {min, max}, from which the planner takes the shortest "
        "feasible duration; default: the path's own"
    )
    load: Load | None = optional("load fixed to the platform; default: none")
    ground: Ground | None = optional("contact of the platform or its load with the ground; default: no contact")


def path_of(phases: Sequence[Phase]) -> SequencePath:
    """Return the paths of phases as a sequence.

    Raises `ValueError` if a path is missing, does not begin where the one before ends, or has no duration; one line
    that names it.
    """
    joined: list[tuple[SinglePath, float]] = []
    for index, phase in enumerate(phases):
        key, path = f"phases[{index}]", phase.path
        if phase.name in (other.name for other in phases[:index]):
            raise ValueError(f"{key}.name must be unique, got {phase.name!r} twice")
        if path is None:
            if not joined:
                raise ValueError(f"{key}.path must be a path, since no phase comes before it, got nothing")
            before, seconds = joined[-1]
            x, y, z, roll, pitch, yaw = before.at(np.array([seconds]), seconds).pose[0].tolist()
            pose: Pose = (x, y, z, roll, pitch, yaw)
            path = RestPath(kind="rest", frame=before.frame, pose=pose)
        if joined and path.frame != joined[0][0].frame:
            raise ValueError(f"{key}.path.frame must be {joined[0][0].frame!r}, as before, got {path.frame!r}")
        if phase.ground is not None and not isinstance(path, RestPath):
            raise ValueError(f"{key}.path must be of kind rest in a phase on the ground, got {path.kind}")
        try:
            longest = phase.duration.max if isinstance(phase.duration, PositiveRange) else phase.duration
            joined.append((path, lasting(path, longest)))
        except ValueError as error:
            raise ValueError(f"{key}.{error}") from None
    check_continuity(joined, "phases", [k for k, phase in enumerate(phases) if phase.ground is not None])
    parts = tuple(Piece(path=path, duration=seconds) for path, seconds in joined)
    return SequencePath(kind="sequence", frame=joined[0][0].frame, parts=parts)


@dataclass(frozen=True, eq=False)
class LaidPhase(Displayed):
    """A phase of a task."""

    name: str
    start: float  # [s]
    end: float  # likewise
    load: np.ndarray  # what the platform carries, (10,), as `Dynamics.carried_wrench` takes it; zeros: nothing
    # S, (6, s) [N per N, N m per N], moments about the platform's CoM, in {G}; s is 0 without ground.
    columns: np.ndarray
    slack: bool  # whether the lower limit of its tensions is 0
    at_start: np.ndarray  # bounds of the support forces at its ends, (2, s) [N]; the upper one may be infinite
    at_end: np.ndarray  # likewise
    extremes: np.ndarray  # loads within the tolerances that decide, (k, 10), as `load`; k is 0 for one that is known

    @property
    def rests(self) -> bool:
        """Return whether it is on the ground."""
        return self.columns.shape[1] > 0


@dataclass(frozen=True, eq=False)
class Phases(Displayed):
    """All phases of a task in order; none for a task that is not given in phases."""

    all: tuple[LaidPhase, ...] = ()

    @cached_property
    def boundaries(self) -> np.ndarray:
        """Return the times at which the phases begin, and the end, (k + 1,) [s]; empty without phases."""
        return np.array([phase.start for phase in self.all] + [phase.end for phase in self.all[-1:]])

    @cached_property
    def carry(self) -> bool:
        """Return whether the platform carries a load in some phase."""
        return any(phase.load[0] for phase in self.all)

    @cached_property
    def rest(self) -> bool:
        """Return whether some phase is on the ground."""
        return any(phase.rests for phase in self.all)

    @cached_property
    def supports(self) -> int:
        """Return the largest number of support points."""
        return max((phase.columns.shape[1] for phase in self.all), default=0)

    @cached_property
    def jumps(self) -> list[float]:
        """Return the times at which the load changes with no adjacent phase on the ground: the tensions jump [s]."""
        return [
            after.start
            for before, after in pairwise(self.all)
            if not (before.rests or after.rests) and not np.array_equal(before.load, after.load)
        ]

    def index_at(self, times: np.ndarray) -> np.ndarray:
        """Return the index of the phase to which each of `times` belongs, (n,): at a boundary the later one."""
        boundaries = self.boundaries
        return np.searchsorted(boundaries[1:-1] - SAME_TIME * boundaries[-1], times, side="right")

    def at(self, time: float) -> LaidPhase | None:
        """Return the phase to which a time belongs; None for a task without phases."""
        return self.all[int(self.index_at(np.array([time]))[0])] if self.all else None

    def rows(self, times: np.ndarray) -> list[tuple[LaidPhase, np.ndarray]]:
        """Return the phases to which some of `times` belong, each with the indices of these."""
        which = self.index_at(times)
        return [(self.all[index], np.flatnonzero(which == index)) for index in np.unique(which)]

    @cached_property
    def extremes(self) -> int:
        """Return the largest number of loads that decide within the tolerances of a phase."""
        return max((len(phase.extremes) for phase in self.all), default=0)

    def loads_at(self, times: np.ndarray, extreme: int | None = None) -> np.ndarray:
        """Return what the platform carries at `times`, (n, 10): the loads as given, or an extreme of each phase."""
        loads = [
            phase.load if extreme is None or extreme >= len(phase.extremes) else phase.extremes[extreme]
            for phase in self.all
        ]
        return np.array(loads)[self.index_at(times)]

    def columns_at(self, times: np.ndarray) -> np.ndarray:
        """Return S at `times`, (n, 6, s), zero without ground; s is `supports`."""
        columns = np.zeros((len(self.all), 6, self.supports))
        for index, phase in enumerate(self.all):
            columns[index, :, : phase.columns.shape[1]] = phase.columns
        return columns[self.index_at(times)]

    def resting(self, times: np.ndarray) -> np.ndarray:
        """Return at which of `times` the platform is on the ground, boundaries included, (n,)."""
        resting = np.zeros(len(times), bool)
        for phase in self.all:
            if phase.rests:
                resting |= self.within(phase, times)
        return resting

    def within(self, phase: LaidPhase, times: np.ndarray) -> np.ndarray:
        """Return which of `times` are within a phase, its boundaries included, (n,)."""
        reach = SAME_TIME * self.boundaries[-1]
        return (times >= phase.start - reach) & (times <= phase.end + reach)

    def support_bounds(self, times: np.ndarray) -> np.ndarray:
        """Return lower and upper bounds of the support forces at `times`, (2, n, supports) [N]."""
        bounds = np.zeros((2, len(times), self.supports))
        reach = SAME_TIME * self.boundaries[-1] if self.all else 0.0
        for phase, rows in self.rows(times):
            count = phase.columns.shape[1]
            bounds[1, rows, :count] = np.inf
            for end, limits in ((phase.start, phase.at_start), (phase.end, phase.at_end)):
                bounds[:, rows[np.abs(times[rows] - end) <= reach], :count] = limits[:, None]
        return bounds
