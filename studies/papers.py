"""The papers that `towline reproduce` recomputes, by name."""

from collections.abc import Callable

from .accounts.account import Account, Progress
from .flying import study as flying
from .towing import study as towing

PAPERS: dict[str, Callable[[Progress | None], Account]] = {"flying": flying.account, "ctmrts": towing.account}
