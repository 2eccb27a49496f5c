"""`Conditions`: wind, sensors and events of a simulation, its time and its steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.display import Displayed
from ..base.inputs import finite_array, number, one_of, whole_number
from ..control.noise import Noise
from ..models.parsing import validate
from ..plant.plant import DRIVES
from .mismatch import Mismatch


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
        drive: Type of command of the plant, see `Plant`; default: "forces" if all cables have winches, "lengths" if all
            are elastic or of fixed length, otherwise "tensions".
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
            one_of("drive", self.drive, DRIVES)
        for name, kind in (("noise", Noise), ("mismatch", Mismatch)):
            if not isinstance(given := getattr(self, name), kind):
                object.__setattr__(self, name, validate({} if given is None else given, kind, name))
        push = finite_array("disturbance", np.zeros(6) if self.disturbance is None else self.disturbance, (6,))
        object.__setattr__(self, "disturbance", push)
