"""Robots as data, and their mechanics as CasADi Functions. This room knows no solver."""

from .dynamics import Dynamics
from .files import available, load
from .relative_dynamics import RelativeDynamics
from .robot import Robot

__all__ = ["Dynamics", "RelativeDynamics", "Robot", "available", "load"]
