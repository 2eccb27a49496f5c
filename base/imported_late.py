"""Let another library import a module that it rarely uses only when it does."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any


class _LateModule(ModuleType):
    """A module whose names come from the real one, which is imported with the first of them."""

    def __getattr__(self, name: str) -> Any:
        _end()  # for a module, or another thread, that needs a name while the block runs
        return getattr(import_module(self.__name__), name)


@contextmanager
def imported_late(package: str, module: str) -> Iterator[None]:
    """Let `import package.module` inside the block wait until it is used, unless the package is imported already."""
    if package in sys.modules:
        yield
        return
    late = {name: _LateModule(name) for name in (package, f"{package}.{module}")}
    setattr(late[package], module, late[f"{package}.{module}"])
    try:
        sys.modules.update(late)
        yield
    finally:
        _end()


def _end() -> None:
    """Let all imports find the real modules again."""
    for name, module in list(sys.modules.items()):
        if type(module) is _LateModule:
            sys.modules.pop(name, None)
