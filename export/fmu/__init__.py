"""A robot as a functional mock-up unit of FMI 3.0: its plant, its controller or both, for other simulators."""

from .export import export_fmu

__all__ = ["export_fmu"]
