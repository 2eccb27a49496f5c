"""`Simulation`: a simulated motion as data, dataset, file, figures and report; also of a run of one's own."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.display import Fact, tensions_over_time
from ..base.inputs import InputError, required, shown
from ..base.netcdf import Contents, Variable
from ..base.text import at_most, quantity
from ..control import ANSWERS, Reference
from ..control.controller import SOFT
from ..control.deviation import tolerance_of
from ..control.noise import Noise
from ..control.planned_references import references_at
from ..control.trajectory import read_trajectory
from ..figures.report import Report, Reported, Section
from ..figures.scene import outline_variables
from ..models.motion_file import dimensions, motion_variables, over
from ..models.parsing import to_yaml
from ..models.robot import Robot
from ..plant import Plant, layout
from ..plant.plant import History
from ..plant.reading import sensed
from ..statics.motion_result import MotionResult
from .conditions import Experiment
from .data import LEAST, Record, SimulationData, room_of
from .events.faults import Cut

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESOLVED = 0.01  # [mm]: the digits of a smaller position error mean nothing
UNCONTROLLED = -1  # the status of steps without a controller
SAME = 1e-6  # of the time between two states


@dataclass(frozen=True, eq=False)
class Simulation(SimulationData, MotionResult, Reported):
    """A simulated motion: `SimulationData`, which can also be saved, drawn and reported."""

    def figures_of_merit(self) -> dict[str, Any]:
        """Return the result metrics, without wall times: the same seed gives the same metrics."""
        tensions = self.record.tensions[: self._recorded]
        pulling = tensions[~self._cut(1)]  # where no cut falls inside the period
        shortfall = self.record.shortfall[: self._recorded]
        return {
            "passed": self.passed,
            "failures": list(self.failures),
            "events": [event.to_dict() for event in occurrences(self)],
            "error_rms": float(np.sqrt(np.mean(self.error**2))),
            "error_max": float(self.error.max()),
            "tension_min": float(pulling.min()) if pulling.size else 0.0,
            "tension_max": float(pulling.max()) if pulling.size else 0.0,
            "slack_s": self.slack_s,
            "answered": self.answered,
            "handed_over": self.handed_over,
            "reference": self.conditions.doubt or None,
            "shortfall_max": None if np.isnan(shortfall).all() else float(np.nanmax(shortfall)),
            "duration": self.lasted * self.period,
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `towline simulate --json`, ready for JSON."""
        merit, micro = self.figures_of_merit(), 1e6 * self.seconds
        if not micro.size:  # a run without a controller
            return merit
        times = {"median": np.median(micro), "p99": np.percentile(micro, 99), "max": micro.max()}
        step = {name: float(value) for name, value in times.items()}
        return merit | {"step_us": step, "real_time_factor": self.lasted * self.period / self.wall}

    @cached_property
    def _contents(self) -> Contents:
        robot, record, rows = self.robot, self.record, slice(self._recorded)
        motions, references = record.motions[rows], self.references[: self._recorded]
        body, base, cable = ("time", "coordinate"), ("time", "carrier", "coordinate"), ("time", "cable")
        moving = self._recorded > 1
        accelerations = np.gradient(motions[..., 6:], self.period, axis=0) if moving else 0 * motions[..., 6:]
        parts = motions[..., :6], motions[..., 6:], accelerations
        variables = motion_variables((part[:, 0] for part in parts), (part[:, 1:] for part in parts))
        wanted = np.stack([reference.pose for reference in references])
        variables["reference_pose"] = over(body, wanted, "m, rad", "reference pose of the platform")
        stands = np.stack([reference.carrier_pose for reference in references])
        variables["carrier_reference"] = over(base, stands, "m, rad", "reference pose of each carrier")
        variables["carrier_command"] = over(base, record.orders[rows], "m, rad", "commanded pose of each carrier")
        variables["tensions"] = over(cable, record.tensions[rows], "N", "cable tensions, means over the periods")
        variables["tensions_commanded"] = over(
            cable, record.commanded[rows], "N", "tensions commanded by the controller"
        )
        if moving and np.isfinite(record.commanded_lengths[rows]).all():  # by the end of each period
            last = record.commanded_lengths[rows][:-1]
            ordered = np.vstack([last[0] - (last[1:2] - last[:1]).sum(axis=0), last])
            variables["lengths_commanded"] = over(cable, ordered, "m", "unstrained lengths commanded for each time")
        variables["cable_lengths"] = over(cable, record.lengths[rows], "m", "from anchor to attachment")
        variables["tensions_unlimited"] = over(cable, record.commanded[rows], "N", "the same as tensions_commanded")
        missing = np.nan_to_num(record.shortfall[rows])
        variables["violation"] = over(("time",), missing, "N", "shortfall of the wrench, moments divided by the length")
        variables["tracking_error"] = over(("time",), self.error, "m", "distance from the reference")
        if np.isfinite(record.unexplained[rows]).any():
            about = "mean acceleration of the platform that was not predicted, angles times the robot's length"
            variables["unexplained"] = over(("time",), record.unexplained[rows], "m/s^2", about)
        flags = " ".join(answer.replace(" ", "_") for answer in ANSWERS)  # words without blanks, by the CF conventions
        words = {"flag_values": np.arange(len(ANSWERS), dtype=np.int8), "flag_meanings": flags}
        about = {"long_name": "status of the control step", **words}
        variables["answered"] = Variable(("time",), record.answered[rows], about)
        actuators = [actuator.name for actuator in max((c.actuators for c in robot.carriers), key=len)]
        if actuators:
            about = "commands to the actuators of each carrier"
            variables["actuation"] = over(("time", "carrier", "actuator"), record.actuation[rows], "N, N m", about)
        if (gone := self._cut()).any():
            about = {"long_name": "1 once the cable is cut or released"}
            variables["cut"] = Variable(cable, gone.astype(np.int8), about)
        if self.wind is not None:
            variables["wind"] = over(("time", "axis"), self.wind[rows], "m/s", "velocity of the air in G")
        variables["t_min"] = over(("cable",), robot.t_min, "N", "smallest tension allowed")
        variables["t_max"] = over(("cable",), robot.t_max, "N", "largest tension allowed")
        variables |= outline_variables(self.conditions.keep_out)
        status = "passed" if self.passed else "failed"
        attributes = {
            "title": f"{robot.name}, simulation: {status}",
            "status": status,
            "tolerance_m": self.tolerance,
            "robot": to_yaml(robot),
            "conditions": json.dumps({"seed": self.seed, **self.conditions.to_dict()}),
            "report": json.dumps(self.figures_of_merit()),
        }
        coordinates = dimensions(robot, self.times)
        if actuators:
            coordinates["actuator"] = Variable(("actuator",), np.array(actuators))
        return Contents(variables, coordinates, attributes)

    def figures(self) -> dict[str, Figure]:
        """Draw "simulation" (error, controller status, wind and carriers over time) and "tensions", by file names."""
        from ..figures import flight

        return {"simulation": flight.flight(self.trajectory), "tensions": flight.tensions(self.trajectory)}

    @property
    def _of_robot(self) -> Robot:
        return self.robot

    def _report(self) -> Report:
        largest = f"position error {at_most(1e3 * self.error.max(), 'mm', RESOLVED)}"
        return Report(
            about=f"{self.robot.name}, simulation of {quantity(self.lasted * self.period, 's')}",
            status="passed" if self.passed else "failed",
            summary="; ".join(self.failures) or largest,
            parts=[Section("", self._facts())],
            drawings=self._drawings,
            files=[("The robot's file", lambda: to_yaml(self.robot))],
        )

    def _facts(self) -> list[Fact]:
        merit, happened = self.figures_of_merit(), occurrences(self)
        rows = {"reference": self.conditions.doubt} if self.conditions.doubt else {}
        rows |= {"events": sentence(happened)} if happened else {}
        rows |= {"differs from file": differs} if (differs := self._differs()) else {}
        rows |= {
            "position error": f"{quantity(1e3 * merit['error_rms'], 'mm', digits=3)} rms, "
            f"{quantity(1e3 * merit['error_max'], 'mm', digits=3)} at most",
            "tensions": f"{quantity(merit['tension_min'], 'N')} to {quantity(merit['tension_max'], 'N')}",
            "slack": quantity(merit["slack_s"], "s"),
        }
        if self.seconds.size:
            counts = ((name, count) for name, count in merit["answered"].items() if count)
            rows["controller status"] = ", ".join(f"{quantity(count)} {name}" for name, count in counts)
            rows["controller time"] = (
                f"{np.median(1e6 * self.seconds):.0f} us per step, one step every {quantity(1e3 * self.period, 'ms')}"
            )
        if merit["handed_over"] is not None:
            rows["not as modelled"] = self._why()
        if merit["shortfall_max"] is not None:
            rows["wrench shortfall"] = f"up to {quantity(merit['shortfall_max'], 'N')}"
        return list(rows.items())

    def cause(self) -> str:
        """Return what led to the result, in order of time, and how the robot differed from its file."""
        happened, lacking = occurrences(self), np.flatnonzero(self.record.answered[: self._recorded] == SOFT)
        if lacking.size:
            words = "tensions gave less than the required wrench"
            happened.append(Occurrence(float(self.times[lacking[0]]), "soft", words))
        text = sentence(sorted(happened, key=lambda event: event.at))
        return "; ".join(filter(None, [text, (differs := self._differs()) and f"differs from its file: {differs}"]))

    def _differs(self) -> str:
        """Return how the robot of this run differed from its file, in words; empty if it did not."""
        mismatch = self.conditions.mismatch
        return mismatch.drawn(self.robot, self.seed).describe(mismatch)

    def _picture(self) -> str:
        tensions = self.record.tensions[: self._recorded]
        return tensions_over_time(self.times, tensions, self.robot.t_min, self.robot.t_max)

    def _why(self) -> str:
        """Return when and why computed torque took over from predictive control."""
        at = self.handed_over
        assert at is not None
        if at == 0:
            return "computed torque from the start: predictive control would be unstable at home"
        missed = self.record.unexplained[round(at / self.period)]
        return (
            f"computed torque from t = {at:.3f} s on: {quantity(missed, 'm/s^2')} of the platform's acceleration "
            "was not predicted"
        )


class Occurrence(NamedTuple):
    """An event, or the first excess of a limit, at a time [s].

    Its kind is "fault" (also of a stop, a push and any other event), "slack", "tension", "error", "room" or "end".
    """

    at: float
    kind: str
    what: str

    def to_dict(self) -> dict[str, Any]:
        """Return it ready for JSON."""
        return {"at_s": self.at, "kind": self.kind, "what": self.what}


def occurrences(flight: SimulationData) -> list[Occurrence]:
    """Return the events of a run and the first instants at which limits were exceeded, in order of time."""
    found = [Occurrence(event.at, "fault", event.describe(flight.robot)) for event in flight.conditions.events]
    released = flight.record.released[: flight.lasted]
    for cable in np.flatnonzero(released.any(axis=0)):
        at = float(flight.times[released[:, cable].argmax()])
        found.append(Occurrence(at, "fault", f"cable {cable + 1} was released"))
    room, within = room_of(flight.robot), quantity(1e3 * flight.tolerance, "mm")
    sides, most = room.names if room else (), flight.outside.max(axis=0)
    firsts: dict[str, tuple[np.ndarray, Callable[[int], str]]] = {
        "slack": (flight.slack, lambda i: f"cable {i + 1} was the first to go slack"),
        "tension": (flight.above > 0, lambda i: f"cable {i + 1} was the first to exceed its t_max"),
        "error": (~(flight.error <= flight.tolerance)[:, None], lambda _: f"the error exceeded {within}"),
        "room": (
            flight.outside > LEAST,
            lambda i: f"the platform went {sides[i]} (by {quantity(most[i], 'm')} at most)",
        ),
    }
    for kind, (where, words) in firsts.items():
        if where.any():
            row, column = np.argwhere(where)[0]
            found.append(Occurrence(float(flight.times[row]), kind, words(column)))
    if flight.lasted < len(flight.references):
        found.append(Occurrence(flight.lasted * flight.period, "end", "the simulation diverged"))
    shown = [event for event in found if event.at <= max(flight.lasted, 1) * flight.period]
    return sorted(shown, key=lambda event: event.at)


def sentence(of: list[Occurrence]) -> str:
    """Return them in one sentence."""
    return "; ".join(f"{event.what} at {event.at:.4g} s" for event in of)


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
