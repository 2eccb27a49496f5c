"""Define the exceptions of towline: wrong input, and a broken solver.

An infeasible problem is not an exception but a result, with a status and a certificate.
"""

__all__ = ["InputError", "SolverError", "TowlineError"]


class TowlineError(Exception):
    """Base class of all exceptions that towline raises on purpose."""


class InputError(TowlineError, ValueError):
    """Wrong input; the message names the field, what is accepted and the value, in one line."""


class SolverError(TowlineError, RuntimeError):
    """A numerical solver failed or is not installed; the message names it and lists the available solvers."""
