"""Exceptions of towline.

An infeasible problem is not among them: that is an answer, with a status and a certificate. Exceptions are for wrong
input and for a broken solver.
"""

__all__ = ["InputError", "SolverError", "TowlineError"]


class TowlineError(Exception):
    """Base class: catch this to catch everything that towline raises on purpose."""


class InputError(TowlineError, ValueError):
    """Wrong input. The message names the field, the value and what would be accepted, in one line."""


class SolverError(TowlineError, RuntimeError):
    """A numerical solver broke, or is not installed. The message names the solver and lists what is available."""
