"""Controllers: each step maps a measured state and a reference to a command.

`Controller` is their base class. `ComputedTorque` works for every robot, `Predictive` looks ahead, `LengthControl` is
for winches that take lengths, `Filtered` estimates velocities from poses, and `OpenLoop` commands the plan without
sensors.
"""

from .computed_torque import ComputedTorque
from .controller import ANSWERS, Command, Controller, Reference, State
from .fault_tolerant import FaultTolerant
from .filtered import Filtered
from .length_control import LengthControl
from .open_loop import OpenLoop
from .planned_references import Stop, longest_stop, references, stop
from .predictive import Predictive

__all__ = [
    "ANSWERS",
    "Command",
    "ComputedTorque",
    "Controller",
    "FaultTolerant",
    "Filtered",
    "LengthControl",
    "OpenLoop",
    "Predictive",
    "Reference",
    "State",
    "Stop",
    "longest_stop",
    "references",
    "stop",
]
