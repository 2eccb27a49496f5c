"""`Conditions` of a simulation, its winds, and the `Experiment` of all runs of one robot and one reference."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from typing_extensions import override

from ..base.display import Displayed, record
from ..base.inputs import InputError, finite_array, number, one_of, shown, whole_number
from ..control import Reference
from ..control.noise import Noise
from ..models import air
from ..models.parsing import validate
from ..models.robot import Robot
from .events.event import Event
from .events.faults import Cut
from .mismatch import Mismatch

COMMANDED = ("lengths", "forces", "tensions")  # drives of a `Plant` for which controllers have commands

Wind = Callable[[np.ndarray, int], np.ndarray]  # the wind at times (K,) [s] for a seed, (K, 3) [m/s]


@dataclass(frozen=True)
class Conditions(Displayed):
    """Conditions of a simulation. `simulate` also accepts each field by its name.

    Attributes:
        wind: Velocity of the air in {G} [m/s], (3,), or a function of times (K,) [s] and a seed that returns (K, 3);
            default: no aerodynamic forces.
        gusts: Intensity of Dryden turbulence, which is added to a constant wind [m/s].
        noise: Sensor noise, a `Noise` or a mapping (default: none).
        events: Events, each a line, a mapping, a YAML file with the list `events`, or an `Event` (times in [s], cables
            counted from 1): "cut 3 at 2.5", a cable breaks; "stick 2 at 1", a winch stops; "lose quad1 at 2", the
            actuators of a carrier stop; "miss 0.05 at 1.2", the controller does not respond; "carry 2.5 at 1", the
            platform carries a load [kg]; "stop at 3", the reference stops on its path as `control.stop` does; "follow
            next.nc at 3", another plan becomes the reference; "push 20 0 0 at 1 for 0.5", a force on the platform in
            {G} [N]; a `Wall` that the platform meets.
        disturbance: Constant force [N] and moment about the CoM [N m] on the platform in {G}, (6,); default: none.
        duration: Simulated time [s] (default: until every reference has ended). If it is longer, the robot holds the
            final pose.
        period: Period of the controller [s].
        substeps: Runge-Kutta steps of the plant per period (default: chosen by the stiffness and damping of the cables,
            see `plant.steps.steps_in`).
        drive: Type of command of the plant: "lengths", "forces" or "tensions", see `Plant`; default: "forces" if all
            cables have winches, "lengths" if all are elastic or of fixed length, otherwise "tensions".
        tolerance: Largest position error allowed for a pass [m]; default: 0.05 m, or 5 % of the mean cable length at
            home if that is less.
        mismatch: How the simulated robot and its drives differ from the file, a `Mismatch` or a mapping (default: not
            at all).

    Raises:
        InputError: If a field has a wrong value.
    """

    wind: Any = None
    gusts: float = 0.0
    noise: Noise | dict[str, Any] | None = None
    events: Sequence[Any] = ()
    disturbance: Any = None
    duration: float | None = None
    period: float = 1e-3
    substeps: int | None = None
    drive: str | None = None
    tolerance: float | None = None
    mismatch: Mismatch | dict[str, Any] | None = None

    def __post_init__(self) -> None:
        """Check everything that does not depend on the robot."""
        number("gusts", self.gusts, 0.0, 100.0)
        number("period", self.period, 1e-6, 10.0)
        if self.tolerance is not None:
            number("tolerance", self.tolerance, 0.0, 1e6)
        if self.duration is not None:
            number("duration", self.duration, self.period, 1e6)
        if self.substeps is not None:
            whole_number("substeps", self.substeps, 1, 1000)
        if self.drive is not None:
            one_of("drive", self.drive, COMMANDED)
        for name, kind in (("noise", Noise), ("mismatch", Mismatch)):
            if not isinstance(given := getattr(self, name), kind):
                object.__setattr__(self, name, validate({} if given is None else given, kind, name))
        push = finite_array("disturbance", np.zeros(6) if self.disturbance is None else self.disturbance, (6,))
        object.__setattr__(self, "disturbance", push)


class Experiment(NamedTuple):
    """Settings shared by all runs: controller period, references, wind, noise and events, see `Conditions`."""

    period: float  # as in `Conditions`
    substeps: int  # as in `Conditions`
    references: Sequence[Reference]  # reference of each period
    wind: Wind | None  # velocity of the air in {G}; None without air
    disturbance: np.ndarray  # as in `Conditions`
    noise: Noise  # as in `Conditions`
    events: tuple[Event, ...]  # events in order of time
    keep_out: Sequence[Sequence[np.ndarray]]  # outlines of the keep-out regions of the reference, see `Trajectory`
    doubt: str = ""  # row of the report that says that the reference is a plan with a broken limit, see `Trajectory`
    mismatch: Mismatch = Mismatch()  # as in `Conditions`
    windings: int = 1  # parts of a period, see `plant.steps.windings_in`

    __repr__ = record

    def cut(self, cables: int, periods: np.ndarray) -> np.ndarray:
        """Return which cables are cut when periods begin, (n, cables); `periods`, (n,), are their numbers."""
        result = np.zeros((len(periods), cables), dtype=bool)
        for event in self.events:
            if isinstance(event, Cut):
                result[periods * self.period >= event.at - 1e-9 * self.period, event.cable - 1] = True
        return result

    def to_dict(self) -> dict[str, Any]:
        """Return all settings except the references, ready for JSON."""
        return {
            "period": self.period,
            "substeps": self.substeps,
            "disturbance": self.disturbance.tolist(),
            "noise": self.noise.model_dump(exclude_defaults=True),
            "mismatch": self.mismatch.model_dump(exclude_defaults=True),
            "events": [event.model_dump(mode="json") for event in self.events],
        }


class MeanWind:
    """A mean wind [m/s] with Dryden turbulence about it, half as intense vertically; an intensity of 0: none."""

    def __init__(self, velocity: np.ndarray, intensity: float):
        self._velocity, self._intensity = velocity.tolist(), intensity

    @override
    def __str__(self) -> str:
        gusts = f" with gusts of {self._intensity:g} m/s" if self._intensity else ""
        return f"{' '.join(f'{part:g}' for part in self._velocity)} m/s{gusts}"

    def __call__(self, times: np.ndarray, seed: int) -> np.ndarray:
        """Return the wind of a seed, (K, 3) [m/s]."""
        if not self._intensity:
            return air.constant(times, self._velocity)
        intensity = (self._intensity, self._intensity, self._intensity / 2)
        return air.dryden(times, self._velocity, intensity, seed=seed)


def read_wind(robot: Robot, wind: Any, gusts: float) -> Wind | None:
    """Return the wind from the arguments of `simulate`, see there.

    Raises `InputError` if the robot has no `platform.aero`, or an argument has a wrong value.
    """
    if wind is None:
        if gusts:
            raise InputError(f"gusts must be 0 without a wind, got {gusts:g} m/s")
        return None
    if robot.platform.aero is None:
        raise InputError(f"wind must be left out for robot {robot.name!r}, which has no platform.aero")
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
        accepted = "three numbers from -1000 to 1000 m/s or a function of times and a seed"
        raise InputError(f"wind must be {accepted}, got {shown(wind)}")
    return MeanWind(velocity, gusts)
