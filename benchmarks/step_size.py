"""Code and stack of an exported control step, as gcc lays them out."""

from __future__ import annotations

import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ..base.errors import InputError
from ..export.step.export import step_files
from ..models import Robot

CORTEX_M7 = ("arm-none-eabi-gcc", "-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard")
HERE = ("gcc",)
# Of the functions of the C library there is no figure; those called are leaves.


class Size(NamedTuple):
    """The size of a step: code with constants, and the deepest stack without that of sin, cos, sqrt and memcpy."""

    text: int  # [bytes]
    stack: int  # [bytes]


def target() -> tuple[str, ...]:
    """Return the compiler to measure with: that for a Cortex-M7 if there is one, else gcc for this machine.

    Raises
    ------
    InputError
        If there is neither.
    """
    for compiler in (CORTEX_M7, HERE):
        if shutil.which(compiler[0]) is not None:
            return compiler
    raise InputError("code and stack must be measured by gcc or arm-none-eabi-gcc, got none in PATH")


def measure_size(robot: Robot, precision: str, folder: Path, compiler: tuple[str, ...]) -> Size:
    """Compile a step with -Os and measure it; `folder` gets the files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in step_files(robot, precision).items():
        (folder / name).write_text(text, encoding="utf-8")
    flags = ("-std=c99", "-Os", "-ffp-contract=off", "-fcallgraph-info=su", "-c", "towline_step.c", "-o", "step.o")
    subprocess.run([*compiler, *flags], cwd=folder, check=True)
    sizes = subprocess.check_output([compiler[0].replace("gcc", "size"), "step.o"], cwd=folder, text=True)
    # -fcallgraph-info names its file after the object or after the source, depending on the version of gcc.
    graph = next(path for path in (folder / "step.ci", folder / "towline_step.ci") if path.exists())
    return Size(int(sizes.splitlines()[1].split()[0]), deepest(graph.read_text(), "towline_step"))


def deepest(graph: str, start: str) -> int:
    """Return the largest sum of stack frames along the calls from a function, of a graph without recursion [bytes]."""
    frames: dict[str, int] = {}
    for title, size in re.findall(
        r'node: { title: "([^"]*)" label: "[^"]*\\n(\d+) bytes \((?:static|dynamic,bounded)', graph
    ):
        frames[title] = int(size)
    calls: dict[str, set[str]] = {}
    for source, to in re.findall(r'edge: { sourcename: "([^"]*)" targetname: "([^"]*)"', graph):
        calls.setdefault(source, set()).add(to)

    @cache
    def depth(name: str) -> int:
        return frames.get(name, 0) + max((depth(to) for to in calls.get(name, ())), default=0)

    (first,) = (name for name in frames if name.split(":")[-1] == start)
    return depth(first)
