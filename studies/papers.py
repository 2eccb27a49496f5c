"""The papers that `towline reproduce` knows, by name."""

from __future__ import annotations

from collections.abc import Callable

from . import flying
from .account import Account, Progress

PAPERS: dict[str, Callable[[Progress | None], Account]] = {"flying": flying.account}
