"""Optimal control and tension distribution of cable robots.

`import towline` costs nothing: each name below loads its package when it is first used (PEP 562). Packages, from the
ground up: `towline.base` (what all others use), `towline.models` (robots and their mechanics), `towline.solvers`
(tension distribution on plain arrays), `towline.figures` (matplotlib), `towline.statics` (one instant of a robot),
`towline.plant` (motion in time), `towline.workspace` (poses at which a condition holds), `towline.estimation` (the pose
from lengths, the calibrated robot), `towline.control` (one step of a controller), `towline.ocp` (planning),
`towline.simulation` (closed loops), `towline.layout` (where anchors should be), `towline.export` (C code, MuJoCo, FMU),
`towline.studies` (the papers), `towline.benchmarks`, `towline.viewer`, `towline.cli`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .base import former_names, version

__version__ = version.__version__
former_names.install()

if TYPE_CHECKING:
    from .base.errors import InputError, SolverError, TowlineError
    from .control import Controller
    from .estimation.calibration import Calibration, Measurements, calibrate, read_measurements
    from .export.fmu import export_fmu
    from .export.step import export_step
    from .layout import Design, Requirements, design, read_requirements
    from .models import Dynamics, Robot, available, load
    from .ocp import Plan, Planner, Sweep, Task, plan, read_task, sweep, time_along
    from .simulation import Simulation, simulate
    from .solvers import Certificate, TensionProblem, TensionSolution, methods, solve, solve_batch
    from .statics.distribution import tensions
    from .workspace import sample

_HOMES = {
    "models": ("Dynamics", "Robot", "available", "load"),
    "solvers": ("Certificate", "TensionProblem", "TensionSolution", "methods", "solve", "solve_batch"),
    "statics.distribution": ("tensions",),
    "ocp": ("Plan", "Planner", "Sweep", "Task", "plan", "read_task", "sweep", "time_along"),
    "workspace": ("sample",),
    "estimation.calibration": ("Calibration", "Measurements", "calibrate", "read_measurements"),
    "control": ("Controller",),
    "simulation": ("Simulation", "simulate"),
    "layout": ("Design", "Requirements", "design", "read_requirements"),
    "export.step": ("export_step",),
    "export.fmu": ("export_fmu",),
    "base.errors": ("InputError", "SolverError", "TowlineError"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}
# Reached as attributes. The last two are short names that stay.
_PACKAGES = {
    *("base", "benchmarks", "calibration", "cli", "control", "core", "errors", "estimation", "export", "figures"),
    *("layout", "models", "ocp", "plant", "simulation", "solvers", "statics", "studies", "viewer", "workspace"),
}

__all__ = [
    "Calibration",
    "Certificate",
    "Controller",
    "Design",
    "Dynamics",
    "InputError",
    "Measurements",
    "Plan",
    "Planner",
    "Requirements",
    "Robot",
    "Simulation",
    "SolverError",
    "Sweep",
    "Task",
    "TensionProblem",
    "TensionSolution",
    "TowlineError",
    "available",
    "calibrate",
    "design",
    "export_fmu",
    "export_step",
    "load",
    "methods",
    "plan",
    "read_measurements",
    "read_requirements",
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
    if (None, name) in former_names.MOVED:
        return former_names.moved_name(None, name)
    if name in _PACKAGES or former_names.renamed(name):
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the public names and the packages, loaded or not: what an editor offers after `towline.`."""
    return sorted({*__all__, *_PACKAGES, "__version__"})
