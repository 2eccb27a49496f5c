"""`Conditions`: wind, sensors and events of a simulation, its time and its steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.display import Displayed
from ..base.inputs import finite_array, number, one_of, whole_number
from ..models.parsing import validate
from ..plant.plant import DRIVES
from .sensors import Noise


@dataclass(frozen=True)
class Conditions(Displayed):
    """Conditions of a simulation; `simulate` accepts each field by its name too.

    Attributes
    ----------
    wind
        Velocity of the air in {G} [m/s], (3,), or a function of times (K,) [s] and a seed that returns (K, 3); default:
        no air, and so no drag.
    gusts
        Intensity of Dryden turbulence about a constant wind [m/s].
    noise
        Of the sensors, see `Noise`, also as a mapping; default: none.
    events
        What happens to the robot on the way, a line each: "cut 3 at 2.5", a cable tears (they count from 1; times in
        [s]); "stick 2 at 1", its winch stops; "lose quad-1 at 2", the actuators of a carrier give nothing any more;
        "miss 0.05 at 1.2", the controller is late.
    disturbance
        Constant force [N] and moment about the CoM [N m] on the platform in {G}, (6,); default: none.
    duration
        [s]; default: that of the reference. A reference that ends earlier rests at its end.
    period
        Of the controller [s].
    substeps
        Runge-Kutta steps of the plant in a period; default: as many as the stiffness and the damping of the cables
        require, see `steps.steps_in`.
    drive
        What the plant is commanded, see `Plant`; default: "forces" if all cables have winches, "lengths" if all stretch
        or keep their lengths, else "tensions".
    tolerance
        Largest error of the position of a run that passes [m].

    Raises
    ------
    InputError
        If a field has a wrong value.
    """

    wind: Any = None
    gusts: float = 0.0
    noise: Noise | dict[str, Any] | None = None
    events: Sequence[str] = ()
    disturbance: Any = None
    duration: float | None = None
    period: float = 1e-3
    substeps: int | None = None
    drive: str | None = None
    tolerance: float = 0.05

    def __post_init__(self) -> None:
        """Check all that needs no robot."""
        number("gusts", self.gusts, 0.0, 100.0)
        number("period", self.period, 1e-6, 10.0)
        number("tolerance", self.tolerance, 0.0, 1e6)
        if self.duration is not None:
            number("duration", self.duration, self.period, 1e6)
        if self.substeps is not None:
            whole_number("substeps", self.substeps, 1, 1000)
        if self.drive is not None:
            one_of("drive", self.drive, DRIVES)
        if not isinstance(self.noise, Noise):
            object.__setattr__(self, "noise", validate({} if self.noise is None else self.noise, Noise, "noise"))
        push = finite_array("disturbance", np.zeros(6) if self.disturbance is None else self.disturbance, (6,))
        object.__setattr__(self, "disturbance", push)
