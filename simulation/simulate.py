"""Fly a reference with a controller, once or many times: `simulate`."""

from __future__ import annotations

import os
import pickle
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..control import ComputedTorque, Controller, Reference
from ..errors import InputError
from ..inputs import finite_array, number, shown, whole_number
from ..models import air
from ..models.dynamics import dynamics_of
from ..models.files import as_robot
from ..models.parsing import validate
from ..models.plant import Plant
from ..models.robot import Robot
from ..solvers import solve_batch
from .conditions import Conditions, Wind
from .faults import read_faults
from .flight import Flight
from .flights import flights, fly_block
from .flying import fly
from .machine import prepare
from .noise import Noise
from .orders import Orders
from .record import Record
from .steps import steps_in
from .trajectory import Motion, Trajectory, read_trajectory

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["simulate"]

LONGEST = 1e6  # periods of one flight
SOFT = 1e8  # weight of the wrench where no tensions give it
SIDE_BY_SIDE = 250  # flights in one block


class ConstantWind:
    """The same wind at all times."""

    def __init__(self, velocity: np.ndarray):
        self._velocity = velocity

    def __call__(self, times: np.ndarray, seed: int) -> np.ndarray:
        """Return it, (K, 3) [m/s]."""
        return air.constant(times, self._velocity.tolist())


class Gusts(ConstantWind):
    """Dryden turbulence about a mean wind, with half of the intensity upwards."""

    def __init__(self, velocity: np.ndarray, intensity: float):
        super().__init__(velocity)
        self._intensity = intensity

    def __call__(self, times: np.ndarray, seed: int) -> np.ndarray:
        """Return the wind of a seed, (K, 3) [m/s]."""
        intensity = (self._intensity, self._intensity, self._intensity / 2)
        return air.dryden(times, self._velocity.tolist(), intensity, seed=seed)


def simulate(
    robot: Robot | str | os.PathLike[str],
    reference: Any,
    controller: Controller | None = None,
    wind: Any = None,
    noise: Noise | dict[str, Any] | None = None,
    faults: Sequence[str] = (),
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
) -> Any:
    """Fly a reference: the plant, a controller, wind, sensors and faults, step by step.

    Parameters
    ----------
    robot
        A `Robot`, the name of one in the library, or the path of a robot file.
    reference
        A plan, the NetCDF file of one, a timing, a path, or a pose (6,) to stay at.
    controller
        Default: `ComputedTorque(robot)`.
    wind
        Velocity of the air in {G} [m/s], (3,), or a function of times (K,) [s] and a seed that returns (K, 3); default:
        no air, and so no drag.
    noise
        Of the sensors, see `Noise`; default: none.
    faults
        Lines: "cut 3 at 2.5" (cables count from 1, times in [s]), "stick 2 at 1", "miss 0.05 at 1.2".
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
        How many processes share many flights.

    Returns
    -------
    Flight or xarray.Dataset
        With `runs`, a dataset with the figures of each flight.

    Raises
    ------
    InputError
        If an argument has a wrong value, or the reference belongs to another robot.
    """
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
        wind=_wind(the_robot, wind, number("gusts", gusts, 0.0, 100.0)),
        disturbance=finite_array("disturbance", np.zeros(6) if disturbance is None else disturbance, (6,)),
        noise=noise if isinstance(noise, Noise) else validate({} if noise is None else noise, Noise, "noise"),
        faults=read_faults(the_robot, faults),
    )
    pilot = ComputedTorque(the_robot) if controller is None else controller
    first, error = whole_number("seed", seed, 0, 2**63 - 1), number("tolerance", tolerance, 0.0, 1e6)
    prepare()  # not in the time of the flight
    processes = whole_number("workers", workers, 1, 1024)
    if runs is None:
        return _one(plant, pilot, conditions, first, error)
    count = whole_number("runs", runs, 1, 10**7)
    return _many(plant, pilot, conditions, range(first, first + count), error, processes)


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


def _wind(robot: Robot, wind: Any, gusts: float) -> Wind | None:
    if wind is None:
        if gusts:
            raise InputError(f"gusts must be 0 without a wind, got {gusts:g} m/s")
        return None
    if robot.platform.aero is None:
        raise InputError(f"wind must be None for robot {robot.name!r}, which has no platform.aero, got a wind")
    if callable(wind):
        function: Any = wind
        if gusts:
            raise InputError(f"gusts must be 0 with a wind that is a function, got {gusts:g} m/s")
        return function
    try:
        velocity = np.asarray(wind, dtype=float)
    except (TypeError, ValueError, OverflowError):
        velocity = np.empty(0)
    if velocity.shape != (3,) or not (np.abs(velocity) <= 1e3).all():
        raise InputError(f"wind must be three numbers from -1000 to 1000 m/s or a function of times, got {shown(wind)}")
    return Gusts(velocity, gusts) if gusts else ConstantWind(velocity)


def _one(plant: Plant, controller: Controller, conditions: Conditions, seed: int, tolerance: float) -> Flight:
    robot, periods = plant.robot, len(conditions.references)
    record = Record(periods, len(robot.carriers), robot.m)
    start = perf_counter()
    lasted, seconds = fly(plant, controller, conditions, [seed], record)
    wall = perf_counter() - start
    wind = Orders(plant, conditions, [seed]).wind
    return Flight(
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


def _many(
    plant: Plant, controller: Controller, conditions: Conditions, seeds: range, tolerance: float, workers: int
) -> xr.Dataset:
    blocks = [seeds[first : first + SIDE_BY_SIDE] for first in range(0, len(seeds), SIDE_BY_SIDE)]
    given = [(plant, controller, conditions, block) for block in blocks]
    if workers == 1:
        parts = [fly_block(*each) for each in given]
    else:
        try:
            pickle.dumps((controller, conditions))
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            reason = str(error).splitlines()[0]
            raise InputError(
                f"workers must be 1 for a controller or a wind that no process can receive: {reason}"
            ) from None
        with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
            parts = list(pool.map(fly_block, *zip(*given, strict=True)))
    return flights(plant.robot, conditions, seeds, tolerance, parts)
