"""Events of a simulation: faults, loads, pushes, walls and changes of the reference; a base class for more."""

from .event import Event, Running
from .faults import Cut, Lose, Miss, Stick
from .loads import Carry
from .pushes import Push, Wall
from .read import read_events
from .references import Follow, StopReference

__all__ = [
    "Carry",
    "Cut",
    "Event",
    "Follow",
    "Lose",
    "Miss",
    "Push",
    "Running",
    "Stick",
    "StopReference",
    "Wall",
    "read_events",
]
