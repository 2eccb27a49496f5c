"""Fly a reference with a controller, once or many times: `simulate`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from time import perf_counter
from typing import Any
from warnings import warn

import numpy as np

from ..base.checkpoint import checkpoint_path
from ..base.errors import InputError
from ..base.execution import check_workers
from ..base.inputs import finite_array, number, shown, whole_number
from ..control import ComputedTorque, Controller, Reference
from ..models.dynamics import dynamics_of
from ..models.files import as_robot
from ..models.parsing import validate
from ..models.robot import Robot
from ..plant import Plant
from ..solvers import solve_batch
from .conditions import Conditions
from .faults import read_faults
from .flights import flights
from .flying import fly
from .machine import prepare
from .noise import Noise
from .orders import Orders
from .record import Record
from .runs import Execution, Progress, fly_many
from .simulation import Simulation
from .steps import steps_in
from .trajectory import Motion, Trajectory, read_trajectory
from .winds import read_wind

__all__ = ["simulate"]

LONGEST = 1e6  # periods of one flight
SOFT = 1e8  # weight of the wrench where no tensions give it
MOST_RUNS = 10_000_000


def simulate(
    robot: Robot | str | os.PathLike[str],
    reference: Any,
    controller: Controller | None = None,
    wind: Any = None,
    noise: Noise | dict[str, Any] | None = None,
    events: Sequence[str] = (),
    duration: float | None = None,
    seed: int = 0,
    *,
    gusts: float = 0.0,
    disturbance: Any = None,
    period: float = 1e-3,
    substeps: int | None = None,
    tolerance: float = 0.05,
    drive: str | None = None,
    runs: int | None = None,
    workers: int = 1,
    scheduler: str | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    faults: Sequence[str] | None = None,
) -> Any:
    """Simulate a robot along a reference: the plant, a controller, wind, sensors and events, step by step.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file.
    reference
        A plan, the NetCDF file of one, a timing, a path (also as a mapping, as in a task), or a pose (6,) to stay at.
    controller
        Default: `ComputedTorque(robot)`. One run calls its `reset` and uses it as it is; many use copies, unless it
        accepts batches.
    wind
        Velocity of the air in {G} [m/s], (3,), or a function of times (K,) [s] and a seed that returns (K, 3); default:
        no air, and so no drag.
    noise
        Of the sensors, see `Noise`; default: none.
    events
        What happens to the robot on the way, a line each: "cut 3 at 2.5", a cable tears (they count from 1; times in
        [s]); "stick 2 at 1", its winch stops; "lose quad-1 at 2", the actuators of a carrier give nothing any more;
        "miss 0.05 at 1.2", the controller is late.
    duration
        [s]; default: that of the reference. A reference that ends earlier rests at its end.
    seed
        Of wind and noise. The same seed gives the same flight.
    gusts
        Intensity of Dryden turbulence about a constant wind [m/s].
    disturbance
        Constant force [N] and moment about the CoM [N m] on the platform in {G}, (6,); default: none.
    period
        Of the controller [s].
    substeps
        Runge-Kutta steps of the plant in a period; default: as many as the stiffness and the damping of the cables
        require, see `steps.steps_in`.
    tolerance
        Largest error of the position of a flight that passes [m].
    drive
        What the plant is commanded, see `Plant`; default: "forces" if all cables have winches, "lengths" if all stretch
        or keep their lengths, else "tensions".
    runs
        How many flights, with the seeds from `seed` on; default: one.
    workers
        Processes of this machine that share many flights; 1: this process. The figures do not depend on it.
    scheduler
        Address of a Dask scheduler whose workers are used instead (extra `cluster`).
    checkpoint
        File to which the figures of many flights are appended every few seconds.
    resume
        Whether to continue the checkpoint if the file exists. It must be of the same flights.
    progress
        Function that is called with (flights done, flights in total, those that passed) of many flights.
    faults
        The former name of `events`.

    Returns
    -------
    Simulation or xarray.Dataset
        With `runs`, a dataset with the figures of each flight.

    Raises
    ------
    InputError
        If an argument has a wrong value, the reference belongs to another robot, the checkpoint cannot be written, is
        damaged or of other flights, or there is no such scheduler.
    SolverError
        If workers end before their work is done, or the extra `cluster` is not installed.
    """
    if faults is not None:
        if events:
            raise InputError(f"faults must be left out with events, whose former name it is, got {shown(faults)}")
        warn("faults is called events now; the former name goes with the next release", DeprecationWarning, 2)
        events = faults
    the_robot = as_robot(robot)
    trajectory = read_trajectory(the_robot, reference, duration)
    if duration is None and trajectory.duration is None:
        raise InputError("duration must be the time of the flight [s] where the reference is a pose, got None")
    step = number("period", period, 1e-6, 10.0)
    lasting = trajectory.duration if duration is None else number("duration", duration, step, 1e6)
    assert lasting is not None
    periods = max(1, round(lasting / step))
    if periods > LONGEST:
        raise InputError(f"duration must be at most {LONGEST:g} periods of {step:g} s, got {lasting:g} s")
    if controller is not None and not isinstance(controller, Controller):
        raise InputError(f"controller must be a Controller, got {shown(controller)}")
    plant = Plant(the_robot, drive=_drive(the_robot) if drive is None else drive)
    conditions = Conditions(
        period=step,
        substeps=steps_in(step, plant) if substeps is None else whole_number("substeps", substeps, 1, 1000),
        references=_references(the_robot, trajectory, step * np.arange(periods)),
        wind=read_wind(the_robot, wind, number("gusts", gusts, 0.0, 100.0)),
        disturbance=finite_array("disturbance", np.zeros(6) if disturbance is None else disturbance, (6,)),
        noise=noise if isinstance(noise, Noise) else validate({} if noise is None else noise, Noise, "noise"),
        faults=read_faults(the_robot, events, periods * step, "events" if faults is None else "faults"),
    )
    pilot = ComputedTorque(the_robot) if controller is None else controller
    first, error = whole_number("seed", seed, 0, 2**63 - 1), number("tolerance", tolerance, 0.0, 1e6)
    execution = _execution(runs, workers, scheduler, checkpoint, resume, progress)
    prepare()  # not in the time of the flight
    if runs is None:
        return _one(plant, pilot, conditions, first, error)
    seeds = range(first, first + whole_number("runs", runs, 1, MOST_RUNS))
    return flights(the_robot, conditions, seeds, error, fly_many(plant, pilot, conditions, seeds, error, execution))


def _execution(
    runs: int | None, workers: int, scheduler: Any, checkpoint: Any, resume: Any, progress: Progress | None
) -> Execution:
    check_workers(workers, scheduler)
    file = checkpoint_path(checkpoint, resume, progress)
    if runs is None and workers != 1:
        raise InputError(f"workers must be 1 without runs, got {workers}")
    if runs is None and (file is not None or scheduler is not None):
        name, value = ("checkpoint", file) if file is not None else ("scheduler", scheduler)
        raise InputError(f"{name} must be None without runs, got {shown(str(value))}")
    return Execution(workers, scheduler, file, resume, progress)


def _drive(robot: Robot) -> str:
    if all(cable.winch is not None for cable in robot.cables):
        return "forces"
    if robot.fixed_lengths is not None:
        return "lengths"
    return "lengths" if all(cable.stiffness for cable in robot.cables) else "tensions"


def _references(robot: Robot, trajectory: Trajectory, times: np.ndarray) -> list[Reference]:
    platform, carriers = trajectory.at(times)
    planned = trajectory.tensions(times) if trajectory.tensions else _tensions_along(robot, platform, carriers)
    rows = zip(*platform, *carriers, planned, strict=True)
    return [Reference(*row) for row in rows]


def _tensions_along(robot: Robot, platform: Motion, carriers: Motion) -> np.ndarray:
    """Return the smallest tensions that a reference needs, (n, m) [N], or where there are none the nearest."""
    dynamics, mask = dynamics_of(robot), robot.dof_mask
    A = dynamics.wrench_matrix(platform[0], carriers[0]) * mask[:, None]
    w = dynamics.required_wrench(*platform, *carriers) * mask
    return solve_batch(A, w, robot.t_min, robot.t_max, length=robot.length, rho=SOFT).tensions


def _one(plant: Plant, controller: Controller, conditions: Conditions, seed: int, tolerance: float) -> Simulation:
    robot, periods = plant.robot, len(conditions.references)
    record = Record(robot, periods)
    start = perf_counter()
    lasted, seconds = fly(plant, [controller], conditions, [seed], record)
    wall = perf_counter() - start
    wind = Orders(plant, conditions, [seed]).wind
    return Simulation(
        robot=robot,
        conditions=conditions,
        seed=seed,
        record=record,
        lasted=int(lasted[0]),
        tolerance=tolerance,
        wind=None if wind is None else wind[:, 0],
        seconds=np.array(seconds),
        wall=wall,
    )
