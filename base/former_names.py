"""Former names of packages, most of which can be imported for one more release: `install`, `renamed`, `moved_name`."""

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any
from warnings import warn

PACKAGE = __name__.split(".")[0]
NOW = {
    "calibration": "estimation.calibration",
    "distribution": "statics.distribution",
    "errors": "base.errors",
    "models.mjcf": "export.mjcf",
    "models.ranges": "models.part",
    "models.statics": "statics.equilibria",
}
# Where each name is now, and its new name if it was renamed: the old one goes with the next release.
MOVED: dict[tuple[str | None, str], tuple[str, str | None]] = {
    (None, "Timing"): ("ocp", "Plan"),
    ("ocp", "Timing"): ("ocp", "Plan"),
    ("models", "PoseEstimate"): ("estimation", None),
    ("models", "branches"): ("estimation", None),
    ("models", "pose_from_lengths"): ("estimation", None),
}
SHORT = {"calibration", "errors"}  # these two remain, as short names


def renamed(name: str) -> str | None:
    """Return what a module of towline is called today, without `towline.`, or None if it has no former name."""
    for old, new in NOW.items():
        if name == old or name.startswith(f"{old}."):
            return new + name[len(old) :]
    return None


def moved_name(package: str | None, name: str) -> Any:
    """Return what a package, or `towline` itself (None), once exported under a name, or raise AttributeError."""
    whole = PACKAGE if package is None else f"{PACKAGE}.{package}"
    if (package, name) not in MOVED:
        raise AttributeError(f"module {whole!r} has no attribute {name!r}")
    home, new = MOVED[package, name]
    if new is not None:
        warn(
            f"{whole}.{name} is called {new} now; the former name is removed in the next release", DeprecationWarning, 3
        )
    return getattr(import_module(f"{PACKAGE}.{home}"), new or name)


def install() -> None:
    """Let former names be imported."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())  # before the finder of paths, which finds folders that were left behind


class _Finder:
    """Find modules of towline by their former names; no subclass of `importlib.abc`, which takes 16 ms to import."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        package, _, name = fullname.partition(".")
        new = renamed(name) if package == PACKAGE else None
        loader: Any = _Loader(name, new) if new else None
        return ModuleSpec(fullname, loader) if loader else None


class _Loader:
    """Load the module of today, which remains the only one."""

    def __init__(self, old: str, new: str) -> None:
        self.old, self.new = old, new

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        if self.old.split(".")[0] not in SHORT:
            old, new = f"{PACKAGE}.{self.old}", f"{PACKAGE}.{self.new}"
            warn(f"{old} is called {new} now; the former name is removed in the next release", DeprecationWarning, 2)
        module = import_module(f"{PACKAGE}.{self.new}")
        self.spec: Any = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self.spec  # the import system has put the spec of the former name there
