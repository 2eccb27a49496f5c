"""Optimal control and tension distribution of cable robots.

`import towline` costs nothing: each name below loads its package when it is first used (PEP 562). Packages, from the
ground up: `towline.models` (robots and their mechanics), `towline.solvers` (tension distribution on plain arrays),
`towline.figures` (matplotlib), `towline.distribution` (one instant of a robot as a tension problem),
`towline.workspace` (reachable poses), `towline.calibration` (the robot as built), `towline.control` (one step of a
controller), `towline.simulation` (flights), `towline.embedded` (a control step as C), `towline.ocp` (planning),
`towline.studies` (the papers), `towline.cli`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .calibration import Calibration, Measurements, calibrate, read_measurements
    from .control import Controller
    from .distribution import tensions
    from .embedded import export_step
    from .errors import InputError, SolverError, TowlineError
    from .models import Dynamics, Robot, available, load
    from .ocp import Plan, Planner, Sweep, Task, Timing, plan, read_task, sweep, time_along
    from .simulation import Flight, simulate
    from .solvers import Certificate, TensionProblem, TensionSolution, methods, solve, solve_batch
    from .workspace import sample

__version__ = "0.2.0"

_HOMES = {
    "models": ("Dynamics", "Robot", "available", "load"),
    "solvers": ("Certificate", "TensionProblem", "TensionSolution", "methods", "solve", "solve_batch"),
    "distribution": ("tensions",),
    "ocp": ("Plan", "Planner", "Sweep", "Task", "Timing", "plan", "read_task", "sweep", "time_along"),
    "workspace": ("sample",),
    "calibration": ("Calibration", "Measurements", "calibrate", "read_measurements"),
    "control": ("Controller",),
    "simulation": ("Flight", "simulate"),
    "embedded": ("export_step",),
    "errors": ("InputError", "SolverError", "TowlineError"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Calibration",
    "Certificate",
    "Controller",
    "Dynamics",
    "Flight",
    "InputError",
    "Measurements",
    "Plan",
    "Planner",
    "Robot",
    "SolverError",
    "Sweep",
    "Task",
    "TensionProblem",
    "TensionSolution",
    "Timing",
    "TowlineError",
    "available",
    "calibrate",
    "export_step",
    "load",
    "methods",
    "plan",
    "read_measurements",
    "read_task",
    "sample",
    "simulate",
    "solve",
    "solve_batch",
    "sweep",
    "tensions",
    "time_along",
]


def __getattr__(name: str) -> Any:
    """Load a public name, or a package, when it is first used."""
    if name in _HOME:
        value = getattr(import_module(f".{_HOME[name]}", __name__), name)
        globals()[name] = value
        return value
    if name in _HOMES:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted({*globals(), *_HOME, *_HOMES})
