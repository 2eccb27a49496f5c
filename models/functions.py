"""`Functions`: CasADi Functions by name, each built when it is first used."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import casadi as ca

__all__ = ["Functions"]


class Functions(Mapping[str, ca.Function]):
    """Map names to CasADi Functions that are built on first use: a plan needs three of a robot's four, a list none.

    Parameters
    ----------
    builders
        Called once each, without arguments.
    """

    def __init__(self, builders: Mapping[str, Callable[[], ca.Function]]):
        self._builders = builders
        self._built: dict[str, ca.Function] = {}

    def __getitem__(self, name: str) -> ca.Function:
        if name not in self._built:
            self._built[name] = self._builders[name]()
        return self._built[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._builders)

    def __len__(self) -> int:
        return len(self._builders)
