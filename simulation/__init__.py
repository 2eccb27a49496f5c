"""Forward time: a plant, wind, slack, sensors, faults and a controller make a flight, `simulate`."""

from .flight import Flight
from .noise import Noise
from .simulate import simulate

__all__ = ["Flight", "Noise", "simulate"]
