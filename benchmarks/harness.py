"""What all benchmarks share: the machine that their figures come from, turns, medians, ratios and tables."""

import gc
import os
import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
Times = float | Sequence[float]  # of a turn


def machine(packages: tuple[str, ...] = ("casadi", "numpy")) -> str:
    """Return processor, cores and versions in one line; packages that are not installed are left out."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    models = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    processor = models[0] if models else platform.processor()
    versions = []
    for name in packages:
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    python = f"Python {platform.python_version()}"
    return f"{processor}, {os.cpu_count()} cores, {platform.system()}; {', '.join([python, *versions])}"


def alternating(contenders: Sequence[T], turns: int) -> Iterator[tuple[int, T]]:
    """Yield number and contender of each turn: a machine that slows down does so for all.

    Each turn begins with another contender, so that none always runs after the same neighbour. Garbage is collected
    between turns only.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        for turn in range(turns):
            first = turn % len(contenders)
            for contender in (*contenders[first:], *contenders[:first]):
                yield turn, contender
            gc.collect()
    finally:
        if collecting:
            gc.enable()


def ratio(times: Mapping[int, Times], reference: Mapping[int, Times]) -> float:
    """Return the median over the turns of the ratio of both medians; nan without times.

    A turn that the reference does not have is compared with the median of all its times.
    """
    if not times or not reference:
        return float("nan")
    usual = np.concatenate([np.atleast_1d(block) for block in reference.values()])
    return float(np.median([np.median(block) / np.median(reference.get(turn, usual)) for turn, block in times.items()]))


def timed(work: Callable[[], T], runs: int = 5) -> tuple[T, float]:
    """Return the result of a call, and the median of its times [s] after a run that is not counted."""
    result, times = work(), []
    for _ in range(runs):
        start = time.perf_counter()
        result = work()
        times.append(time.perf_counter() - start)
    return result, float(np.median(times))


def row(*cells: Any) -> str:
    """Return a row of a Markdown table."""
    return f"| {' | '.join(map(str, cells))} |"


def head(columns: str, words: int = 1) -> str:
    """Return the head of a table of columns with bars between them: `words` of text, then numbers."""
    names = columns.split(" | ")
    return f"{row(*names)}\n|{'---|' * words}{'---:|' * (len(names) - words)}"


def table(columns: str, rows: Iterable[Iterable[Any]], words: int = 1) -> list[str]:
    """Return the lines of a whole table."""
    return [*head(columns, words).splitlines(), *(row(*cells) for cells in rows)]
