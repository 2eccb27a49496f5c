"""One step of control: a measured state and a reference in, a command out.

`Controller` is the base of all controllers, `ComputedTorque` one for every robot, `Predictive` one that looks ahead,
and `OpenLoop` the plan without sensors.
"""

from .command import ANSWERS, Command
from .computed_torque import ComputedTorque
from .controller import Controller
from .open_loop import OpenLoop
from .predictive import Predictive
from .reference import Reference
from .state import State

__all__ = ["ANSWERS", "Command", "ComputedTorque", "Controller", "OpenLoop", "Predictive", "Reference", "State"]
