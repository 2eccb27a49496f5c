"""Replay a saved plan or simulation without interpolation: every instant shown was audited, or simulated."""

import json
import math
from functools import cached_property, partial

import numpy as np
import xarray as xr

from ..base.inputs import InputError, printable
from ..base.netcdf import numbers_of
from ..figures.scene import outlines_from
from ..models import Robot
from ..models.parsing import parse_yaml
from ..ocp import Task
from ..ocp.audits.by_phase import worst_certificate
from ..ocp.tasks.lay_out import lay_out
from ..ocp.tasks.paths import Motion
from ..ocp.tasks.scenario import Scenario
from .geometry import FARTHEST, Extent, Geometry
from .snapshot import Snapshot, least_distance

NEEDED = ("pose", "velocity", "acceleration", "carrier_pose", "tensions")
MOST_FRAMES = 1500  # of a page
MOST_MARKS = 20
WORDS_APART = 0.1  # of the duration: marks with words
LONGEST = 100  # letters of a text of the file


class Replay:
    """A plan that `Plan.save` wrote, or a simulation that `Simulation.save` wrote.

    - `dataset`: the contents of the file; `where`: its name, for errors.
    - `robot`, `title`: the robot, and a title of one line.
    - `times`: times of the saved instants, (n,) [s].
    - `tensions`: (n, m) [N], nan where there are none.
    - `reference`: origin of the platform's frame (n, 3) in {G} [m] where a simulation should have it; None for a plan.
    - `obstacles`: lines (k, 3) in {G} [m] that outline each of the regions to keep out of.

    Raises `InputError` if a variable of a plan is missing, or does not fit its robot.
    """

    def __init__(self, dataset: xr.Dataset, where: str):
        for name in (*NEEDED, "time"):
            if name not in dataset.variables:
                raise InputError(f"{where} must be a plan saved by `towline plan`, got one without {name!r}")
        self.dataset = dataset
        self._flown = "reference_pose" in dataset.variables
        for name in ("robot",) if self._flown else ("robot", "task"):
            if not isinstance(dataset.attrs.get(name), str):
                raise InputError(f"{where} must be a plan saved by `towline plan`, got one without its {name}")
        self.robot = parse_yaml(dataset.attrs["robot"], Robot, f"{where}, robot")
        self._task = None if self._flown else parse_yaml(dataset.attrs["task"], Task, f"{where}, task")
        self.title = printable(str(dataset.attrs.get("title", self.robot.name)), LONGEST)
        self.geometry = Geometry(self.robot)
        read = partial(numbers_of, dataset, where=where)
        self.times = read("time", (-1,), largest=FARTHEST)
        n, c, m = len(self.times), len(self.robot.carriers), self.robot.m
        self._pose = read("pose", (n, 6), largest=FARTHEST)
        self._velocity, self._acceleration = read("velocity", (n, 6)), read("acceleration", (n, 6))
        self._carriers = read("carrier_pose", (n, c, 6), largest=FARTHEST)
        self.tensions = read("tensions", (n, m), gaps=True)
        self.reference = read("reference_pose", (n, 6), largest=FARTHEST)[:, :3] if self._flown else None
        self._words = _answers(dataset) if self._flown else None
        self._cut = read("cut", (n, m)) > 0 if "cut" in dataset.variables else None
        self._events = _events(dataset) if self._flown else []
        self._starts = read("phase_start", (-1,)).tolist() if "phase_start" in dataset.variables else []
        self._phases = [printable(str(name), LONGEST) for name in dataset["phase"].values] if self._starts else []
        self.obstacles = outlines_from(dataset, where)
        if n == 0 or not (np.diff(self.times) > 0).all():
            raise InputError(f"{where}: time must have increasing values, got {n} instants that do not increase")
        self._points = self.geometry(self._pose, self._carriers)

    @property
    def extent(self) -> Extent:
        """Return the smallest box around the motion."""
        return Extent.of(self._points.anchors, self._points.attachments, self._carriers[..., :3])

    @property
    def duration(self) -> float:
        """Return the time from the first to the last instant [s]."""
        return float(self.times[-1] - self.times[0])

    @cached_property
    def margins(self) -> np.ndarray:
        """Return the smallest distance of a tension from its limits at each instant, (n,) [N]; nan without tensions."""
        return np.minimum(self.tensions - self._t_min, self.robot.t_max - self.tensions).min(axis=1)

    @property
    def worst(self) -> int:
        """Return the index of the instant without tensions, or with the least margin."""
        return int(np.where(np.isnan(self.margins), -np.inf, self.margins).argmin())

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Return the times to mark on a time line [s], with words: the worst instant, starts of phases, and events.

        A mark too near to one before it has no words.
        """
        marks = [(float(self.times[self.worst]), "worst")]
        marks += list(zip(self._starts, self._phases, strict=True))[:MOST_MARKS]
        marks += [(at, what.partition(": ")[2]) for at, what in self._events[:MOST_MARKS]]
        shown: list[float] = []
        for k, (at, _) in enumerate(marks):
            if all(abs(at - other) > WORDS_APART * self.duration for other in shown):
                shown.append(at)
            else:
                marks[k] = (at, "")
        return tuple(marks)

    @property
    def path(self) -> np.ndarray:
        """Return the origin of the platform's frame at each instant, (n, 3) in {G} [m]."""
        return self._pose[:, :3]

    @property
    def carrier_paths(self) -> list[np.ndarray]:
        """Return the origins of the carriers' frames that move, (n, 3) each in {G} [m]."""
        paths = np.moveaxis(self._carriers[:, :, :3], 1, 0)
        return [path for path in paths if np.ptp(path, axis=0).max() > 1e-9]

    def index_at(self, time: float) -> int:
        """Return the index of the instant nearest to `time` [s]."""
        return int(np.abs(self.times - time).argmin())

    def frames(self, rate: float) -> np.ndarray:
        """Return the indices of instants at equal intervals: `rate` per second or more, at most `MOST_FRAMES`."""
        count = min(math.ceil(self.duration * rate) + 1, MOST_FRAMES, len(self.times))
        instants = np.linspace(self.times[0], self.times[-1], count)
        return np.unique([self.index_at(time) for time in instants])

    def at(self, index: int, prove: bool = True) -> Snapshot:
        """Return the `index`-th instant with its audited tensions; if there are none, with a certificate if `prove`."""
        tensions = self.tensions[index]
        there = bool(np.isfinite(tensions).all())
        margin, nearest = least_distance(tensions, self._t_min[index], self.robot.t_max)
        certificate = None
        if prove and not there and self._task is not None:
            time, carriers = float(self.times[index]), self._carriers[index]
            motion = Motion(*(part[index] for part in (self._pose, self._velocity, self._acceleration)))
            certificate = worst_certificate(self._scenario, time, motion, carriers)
        status = "feasible" if there else "no tensions" if certificate is None else "infeasible"
        return Snapshot(
            pose=self._pose[index],
            carriers=self._carriers[index],
            points=type(self._points)(*(part[index] for part in self._points)),
            tensions=tensions,
            status=status if self._words is None else self._words[index],
            margin=margin,
            nearest=nearest,
            certificate=certificate,
            time=float(self.times[index]),
            cut=None if self._cut is None else self._cut[index],
            events=tuple(what for at, what in self._events if at <= self.times[index] + 1e-9),
        )

    @cached_property
    def _t_min(self) -> np.ndarray:
        """Return the smallest tensions at each instant, (n, m) [N]: zero where a phase permits slack cables.

        A cable that has been cut has none, and so no margin.
        """
        if self._task is None or self._task.phases is None:
            t_min = np.tile(self.robot.t_min, (len(self.times), 1))
            return t_min if self._cut is None else np.where(self._cut, -np.inf, t_min)
        return self._scenario.t_min_at(self.times)

    @cached_property
    def _scenario(self) -> Scenario:
        assert self._task is not None  # a flight has tensions at all instants, and so no certificates
        return lay_out(self.robot, self._task)


def _answers(dataset: xr.Dataset) -> list[str] | None:
    """Return the status of each step of a simulation; None if the file does not have it."""
    if "answered" not in dataset or "flag_meanings" not in dataset["answered"].attrs:
        return None
    words = str(dataset["answered"].attrs["flag_meanings"]).split()
    numbers = dataset["answered"].to_numpy().astype(int)
    if not ((numbers >= 0) & (numbers < len(words))).all():
        return None
    return [printable(words[number].replace("_", " "), LONGEST) for number in numbers]


def _events(dataset: xr.Dataset) -> list[tuple[float, str]]:
    """Return the times [s] and the texts of the events of a simulation; none if its file does not have them."""
    try:
        listed = json.loads(str(dataset.attrs.get("report", "{}")))["events"]
        found = [(float(event["at_s"]), str(event["what"])) for event in listed]
    except (ValueError, KeyError, TypeError):
        return []
    return [(at, f"{at:.4g} s: {printable(what, LONGEST)}") for at, what in found]
