"""Logs: recordings of robots in any usual kind of file, and the measurements in them."""

from .mapping import read_map
from .measurements import Sigma
from .opening import recordings
from .reading import read_log, read_measurements

__all__ = ["Sigma", "read_log", "read_map", "read_measurements", "recordings"]
