"""One control step of a robot as C for a controller's own processor: its mechanics and the solver in two files."""

from .export import export_step

__all__ = ["export_step"]
