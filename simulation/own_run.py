"""`simulation_of`: a run of one's own, from `Plant.run`, as a `Simulation` with its files, figures, film and report."""

from typing import Any

import numpy as np

from ..base.errors import InputError
from ..base.inputs import required, shown
from ..control import Reference
from ..control.deviation import tolerance_of
from ..control.noise import Noise
from ..control.planned_references import references_at
from ..control.trajectory import read_trajectory
from ..plant import Plant, layout
from ..plant.plant import History
from ..plant.reading import sensed
from .events.faults import Cut
from .experiment import Experiment
from .record import Record
from .simulation import Simulation

UNCONTROLLED = -1  # the status of steps without a controller
SAME = 1e-6  # of the time between two states


def simulation_of(plant: Plant, history: History, reference: Any = None, tolerance: float | None = None) -> Simulation:
    """Return a run of a plant as a `Simulation`.

    Args:
        plant: The plant.
        history: Result of its `run` for one state, at equal times.
        reference: Reference of the position errors: a plan, the NetCDF file of one, a path or a pose (6,); default: the
            motion itself.
        tolerance: Largest position error allowed for a pass [m]; default: 0.05 m, or 5 % of the mean cable length at
            home if that is less.

    Raises:
        InputError: If an argument has a wrong type or value, or the reference belongs to another robot.
    """
    robot, states = required("plant", plant, Plant).robot, required("history", history, History).states
    if states.ndim != 2 or states.shape[-1] != plant.size or len(states) < 2:
        raise InputError(f"history must be of one run, states (K, {plant.size}), got {shown(states)}")
    steps = np.diff(history.times)
    period = float(steps.mean())
    if np.abs(steps - period).max() > SAME * period:
        raise InputError("history must have equally spaced times, got others")
    count, error = len(states), tolerance_of(robot, tolerance)
    record, (motions, lengths) = Record(robot, count), sensed(robot, states)
    record.motions[:], record.lengths[:] = motions, lengths[:, 0]
    record.tensions[:], record.answered[:] = history.tensions, UNCONTROLLED
    if plant.drive == "lengths" and robot.fixed_lengths is None:
        first = layout.BODY * (1 + len(robot.carriers)) + layout.REFERENCE * robot.m
        record.commanded_lengths[:] = states[[*range(1, count), -1], first : first + robot.m]
    doubt, keep_out = "", ()
    if reference is None:
        poses, velocities = record.motions[..., :6], record.motions[..., 6:]
        parts = poses, velocities, np.gradient(velocities, period, axis=0)
        references = [Reference(*rows[:, 0], *rows[:, 1:]) for rows in np.stack(parts, axis=1)]
    else:
        wanted = read_trajectory(robot, reference, float(history.times[-1]))
        references, doubt, keep_out = references_at(robot, wanted, history.times), wanted.doubt, wanted.keep_out
    gone = plant.read(states).cut  # (K, m)
    at = history.times[gone.argmax(axis=0)].tolist()
    cuts = tuple(Cut(cable=i + 1, at=at[i]) for i in np.flatnonzero(gone[-1]).tolist())
    conditions = Experiment(period, 1, references, None, np.zeros(6), Noise(), cuts, keep_out, doubt)
    without_controller = np.zeros(0), np.inf  # seconds and wall time
    return Simulation(robot, conditions, 0, record, count, error, None, *without_controller)
