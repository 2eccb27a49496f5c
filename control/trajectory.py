"""`Trajectory`: the reference of a controller over time, from a plan, its file, a path or a pose."""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from pydantic import BaseModel

from ..base.inputs import InputError, file_path, finite_array, number, real_array, shown
from ..base.netcdf import Contents, load_netcdf, numbers_of
from ..figures.scene import outlines_from
from ..models.motion_jumps import rows_with_jumps
from ..models.parsing import parse_yaml
from ..models.part import LARGEST
from ..models.rigid_load import RigidLoad
from ..models.robot import Robot
from ..models.trajectory import Motion, Trajectory

if TYPE_CHECKING:
    import xarray as xr

ACCEPTED = "a plan, the NetCDF file of one, a path or a pose (6,)"
DOUBTS = {  # by the status of a plan
    "infeasible": "a plan that is infeasible: no motion of its task keeps every limit",
    "not-found": "a plan that breaks a limit: no feasible one was found",
}
GROUND = "a plan with phases on the ground, which simulations do not have: the cables bear everything"
LITTLE = 1e-3  # of the robot's forces: less is no reaction of the ground
SHORTEST = 1e-9  # between two samples [s]
SHORT = 5e-4  # between two nodes of a motion [s]
_PARTS = ("pose", "velocity", "acceleration")


class InPhase(BaseModel):
    """A phase of the task of a plan, whatever else it has."""

    load: dict[str, Any] | None = None
    ground: Any = None


class InPhases(BaseModel):
    """The phases of the task of a plan, whatever else it has."""

    phases: list[InPhase]


class HasTrajectory(Protocol):
    """An object with the samples of a motion: a `Plan`, a `Simulation` or a `Stop`."""

    @property
    def trajectory(self) -> xr.Dataset:
        """Return the samples, as a plan's `trajectory` has them."""
        ...


def samples_of(name: str, given: object) -> Contents | None:
    """Return the samples of a plan, also of one that is in a file; None if it has none.

    Raises `InputError`, with the `name` of the argument, if no such file can be read.
    """
    samples: Any = _loaded(name, given) if isinstance(given, str | os.PathLike) else given
    if not hasattr(samples, "data_vars"):  # first, because a dataset searches long for similar names
        # Without loading xarray, unless somebody has the dataset, and may have changed it.
        contents = given if "trajectory" in getattr(given, "__dict__", {}) else getattr(given, "_contents", given)
        if isinstance(contents, Contents):
            return contents
        samples = getattr(given, "trajectory", None)
    return Contents.of(samples) if hasattr(samples, "data_vars") else None


def read_trajectory(robot: Robot, reference: Any, duration: float | None) -> Trajectory:
    """Return `reference` as a trajectory.

    Raises `InputError` if it has another type, or belongs to another robot.
    """
    samples = samples_of("reference", reference)
    if samples is not None:
        return _of_samples(robot, samples)
    if callable(getattr(reference, "at", None)):
        return _of_path(robot, reference, duration)
    try:
        pose = real_array("reference", reference).astype(float)
    except InputError:
        pose = np.empty(0)
    if pose.shape != (6,) or not (np.abs(pose) <= LARGEST).all():
        raise InputError(f"reference must be {ACCEPTED}, got {shown(reference)}")
    return Trajectory(None, lambda times: (_still(times, pose), _still(times, robot.carrier_home)))


def _loaded(name: str, file: str | os.PathLike[str]) -> xr.Dataset:
    path = file_path(name, file)
    try:
        there = path.is_file()
    except OSError:  # too long for a file name
        there = False
    if not there:
        raise InputError(f"{name} must be {ACCEPTED}, got {shown(str(path))}: no such file")
    return load_netcdf(path, f"{name} must be {ACCEPTED}, got {shown(str(path))}")


def _still(times: np.ndarray, pose: np.ndarray) -> Motion:
    poses = np.tile(pose, (len(times), *[1] * pose.ndim))
    return poses, np.zeros_like(poses), np.zeros_like(poses)


def _of_path(robot: Robot, path: Any, duration: float | None) -> Trajectory:
    wanted = getattr(path, "natural_duration", None) if duration is None else duration
    if not wanted:
        raise InputError("duration must be the time that the path takes [s], got None")
    lasting = number("duration", wanted, 1e-3, 1e6)
    if getattr(path, "frame", "world") != "world":
        raise InputError(f"reference must be a path in the frame world, got one in {path.frame!r}")

    def at(times: np.ndarray) -> tuple[Motion, Motion]:
        return _resting(path.at(np.minimum(times, lasting), lasting), times, lasting), _still(times, robot.carrier_home)

    return Trajectory(lasting, at)


def _resting(motion: Any, times: np.ndarray, end: float) -> Motion:
    pose, velocity, acceleration = (np.array(part) for part in motion)
    velocity[times > end] = acceleration[times > end] = 0.0
    return pose, velocity, acceleration


def _of_samples(robot: Robot, samples: Contents) -> Trajectory:
    """Interpolate the samples of a plan: its pieces are polynomials of time between far fewer nodes, and its jumps."""
    needed = (*_PARTS, *(f"carrier_{part}" for part in _PARTS), "time")
    if why := samples.attributes.get("no_reference"):
        raise InputError(f"reference must be a plan whose motion a robot can follow, got {why}")
    rows, samples = samples, rows_with_jumps(samples)
    read = partial(numbers_of, samples, where="reference", largest=LARGEST)
    missing = [name for name in needed if samples.get(name) is None]
    if missing:
        raise InputError(f"reference must be a plan with the variable {missing[0]}, got a dataset without it")
    first, *_ = str(samples.attributes.get("robot", "")).splitlines() or [""]
    name = first.removeprefix("name:").strip().strip("\"'")
    count, m, bases = len(robot.carriers), robot.m, samples.get("carrier_pose")
    if (name and name != robot.name) or bases is None or np.shape(bases.values)[1:] != (count, 6):
        raise InputError(f"reference must be a plan of robot {robot.name!r}, got one of {name!r}")
    nodes = read("time", (-1,))
    n = len(nodes)
    # The platform first, then the carriers, (n, 1 + c, 6) each.
    motion = [
        np.concatenate([read(part, (n, 6))[:, None], read(f"carrier_{part}", (n, count, 6))], axis=1) for part in _PARTS
    ]
    motion[0][..., 3:] = np.unwrap(motion[0][..., 3:], axis=0)  # angles of a flight are measured, and may jump by turns
    if n < 2 or nodes[0] < 0 or (np.diff(nodes).min() < SHORTEST and samples is rows):  # jumps have a time twice
        given = f"{n} of them from {nodes[0]:g} s to {nodes[-1]:g} s" if n else "none"
        raise InputError(f"reference must be a plan of two times or more that increase from 0 s on, got {given}")

    def at(times: np.ndarray) -> tuple[Motion, Motion]:
        pose, velocity, acceleration = _interpolated(nodes, motion, times)
        return (pose[:, 0], velocity[:, 0], acceleration[:, 0]), (pose[:, 1:], velocity[:, 1:], acceleration[:, 1:])

    air = samples.attributes.get("wind")
    wind = None if air is None or robot.platform.aero is None else finite_array("reference.wind", air, (3,))
    keep_out = outlines_from(samples, "reference")
    doubt, loads = DOUBTS.get(str(samples.attributes.get("status")), ""), _loads_of(samples, read)
    if samples.get("ground_reaction") and read("ground_reaction", (-1,)).max(initial=0.0) > LITTLE * robot.force_scale:
        doubt = "; ".join(filter(None, [doubt, GROUND]))
    planned = read("tensions", (n, m), gaps=True) if samples.get("tensions") else np.full((n, m), np.nan)
    known = np.isfinite(planned).all(axis=1)
    if not known.any():
        return Trajectory(float(nodes[-1]), at, keep_out=keep_out, doubt=doubt, wind=wind, loads=loads)

    def tensions(times: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(times, nodes[known], column[known]) for column in planned.T], axis=1)

    return Trajectory(float(nodes[-1]), at, tensions, keep_out, doubt, wind, loads)


def _loads_of(samples: Contents, read: Any) -> list[tuple[float, RigidLoad | None]]:
    """Return what the platform carries in the phases of a plan, by the plan's task."""
    if samples.get("phase_load") is None or not (masses := read("phase_load", (-1,))).any():
        return []
    try:
        phases = parse_yaml(str(samples.attributes["task"]), InPhases, "reference.task").phases
        loads = [None if phase.load is None else _rigid(phase.load) for phase in phases]
    except (KeyError, InputError):
        phases, loads = [], []
    if [load.mass if load else 0.0 for load in loads] != masses.tolist():
        raise InputError(f"reference must be a plan whose task describes its loads, got one of {masses.max():g} kg")
    if any(phase.ground is not None for phase in phases):
        raise InputError("reference must have no phase on the ground if it carries loads, got a plan with such phases")
    return list(zip(read("phase_start", (len(loads),)).tolist(), loads, strict=True))


def _rigid(load: dict[str, Any]) -> RigidLoad:
    """Return a load of a task without its tolerances and its body."""
    return RigidLoad.model_validate({key: load[key] for key in RigidLoad.model_fields if key in load})


def _interpolated(nodes: np.ndarray, parts: list[np.ndarray], times: np.ndarray) -> Motion:
    """Return the polynomials of degree 5 between nodes that have their poses, velocities and accelerations."""
    inside = np.clip(times, nodes[0], nodes[-1])
    k = np.clip(np.searchsorted(nodes, inside, side="right") - 1, 0, len(nodes) - 2)
    after, (k, piece) = inside - nodes[k], np.unique(k, return_inverse=True)  # most pieces have several times
    h = (nodes[k + 1] - nodes[k])[:, None, None]
    (p, q), (u, v), (a, b) = ((part[k], part[k + 1]) for part in parts)
    u, v, a, b = h * u, h * v, h * h * a, h * h * b
    # From the start of the piece on: p + u s + a s^2 / 2 + c3 s^3 + c4 s^4 + c5 s^5.
    gap, speed, bend = q - p - u - a / 2, v - u - a, b - a
    # In a short piece the velocities alone give c3 and c4, because differences of poses over h^2 are rounding errors.
    short, off = h < SHORT, speed - bend / 2
    c3 = np.where(short, off + bend / 6, 10 * gap - 4 * speed + bend / 2)
    c4 = np.where(short, -off / 2, -15 * gap + 7 * speed - bend)
    c5 = np.where(short, 0.0, 6 * gap - 3 * speed + bend / 2)
    h, p, u, a, c3, c4, c5 = (part[piece] for part in (h, p, u, a, c3, c4, c5))
    s = after[:, None, None] / h
    pose = p + s * (u + s * (a / 2 + s * (c3 + s * (c4 + s * c5))))
    velocity = (u + s * (a + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h
    acceleration = (a + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / h**2
    return _resting((pose, velocity, acceleration), times, float(nodes[-1]))
