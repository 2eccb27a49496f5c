"""The version of towline."""

__version__ = "0.2.0"
