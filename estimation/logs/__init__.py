"""Logs: recordings of robots in any usual kind of file, and the measurements in them."""

from .mapping import LogMap, fields_of, read_map
from .measurements import Measurements, Sigma
from .opening import recordings
from .reading import Log, read_log, read_measurements
from .recording import Recording, Topic

__all__ = [
    "Log",
    "LogMap",
    "Measurements",
    "Recording",
    "Sigma",
    "Topic",
    "fields_of",
    "read_log",
    "read_map",
    "read_measurements",
    "recordings",
]
