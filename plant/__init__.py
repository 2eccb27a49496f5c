"""Simulate a robot's response to commands of cables and carriers, with wind, slack cables and winches."""

from .plant import History, Plant
from .reading import Reading

__all__ = ["History", "Plant", "Reading"]
