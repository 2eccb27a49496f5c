"""The papers that `towline reproduce` knows, by name."""

from __future__ import annotations

from collections.abc import Callable

from . import flying, towing
from .account import Account, Progress

PAPERS: dict[str, Callable[[Progress | None], Account]] = {
    "flying": flying.account,
    "ctmrts": towing.account,
}
