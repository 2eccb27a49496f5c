"""Closed-loop simulation of a plan with wind, sensor noise, faults and a controller: `simulate`."""

from ..base.execution import Execution
from ..control.noise import Noise
from .conditions import Conditions
from .events.event import Event
from .events.faults import Cut, Lose, Miss, Stick
from .events.loads import Carry, Push, Wall
from .events.references import Follow, StopReference
from .log_replay import Replay, replay
from .mismatch import Mismatch
from .simulate import simulate
from .simulation import Simulation, simulation_of

__all__ = [
    "Carry",
    "Conditions",
    "Cut",
    "Event",
    "Execution",
    "Follow",
    "Lose",
    "Mismatch",
    "Miss",
    "Noise",
    "Push",
    "Replay",
    "Simulation",
    "Stick",
    "StopReference",
    "Wall",
    "replay",
    "simulate",
    "simulation_of",
]
