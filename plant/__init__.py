"""Forward time: what a robot does for commands of its cables and carriers, in wind, with cables that get slack."""

from .plant import History, Plant
from .reading import Reading

__all__ = ["History", "Plant", "Reading"]
