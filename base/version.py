"""The version of towline."""

__version__ = "0.3.0"
