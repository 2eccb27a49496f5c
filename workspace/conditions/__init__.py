"""The conditions, one a file."""

from .static_equilibrium import StaticEquilibrium

__all__ = ["StaticEquilibrium"]
