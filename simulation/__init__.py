"""Forward time: a plant, wind, slack, sensors, faults and a controller make a flight, `simulate`."""

from typing import Any

from ..base.former_names import moved_name
from .noise import Noise
from .simulate import simulate
from .simulation import Simulation

__all__ = ["Noise", "Simulation", "simulate"]


def __getattr__(name: str) -> Any:
    """Return what a name stood for that goes with the next release."""
    return moved_name("simulation", name)
