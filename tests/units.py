"""Functional mock-up units for tests: written once, and run by FMPy."""

import contextlib
import hashlib
import subprocess
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from towline import export_fmu
from towline.export.fmu import export

from .c_programs import require
from .once import made_once


@contextlib.contextmanager
def compiled_once(factory: pytest.TempPathFactory) -> Iterator[None]:
    """Compile the units that are exported meanwhile without optimisation, which changes no bit.

    Sources that units share are compiled once for all tests.
    """

    def run(command: list[str], **options: Any) -> Any:
        sources, others = (
            [each for each in command if each.endswith(".c") == is_source] for is_source in (True, False)
        )
        flags = others[: others.index("-lm")]

        def compiled(source: str) -> str:
            def make(folder: Path) -> None:
                compiler = [each for each in flags if each != "-shared"]
                subprocess.run([*compiler, "-c", source, "-o", str(folder / "object.o")], check=True)

            digest = hashlib.sha256(Path(source).read_bytes()).hexdigest()
            return str(made_once(factory, f"fmu-{digest}", make) / "object.o")

        return subprocess.run([*flags, *map(compiled, sources), *others[len(flags) :]], **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFLAGS", "-O0")
        patch.setattr(export, "subprocess", SimpleNamespace(run=run))
        yield


def written(factory: pytest.TempPathFactory, robot: str, part: str, drive: str | None = None) -> Path:
    """Write a unit of a robot once for all tests, at home."""
    require("cc")

    def make(folder: Path) -> None:
        with compiled_once(factory):
            export_fmu(robot, folder / "unit.fmu", part, drive)

    return made_once(factory, f"fmu-{robot}-{part}-{drive}", make) / "unit.fmu"


class Unit:
    """A unit in step mode, with its variables by their names."""

    def __init__(self, file, folder):
        from fmpy import extract, read_model_description
        from fmpy.fmi3 import FMU3Slave

        self.description = read_model_description(file, validate=False)  # which takes half of the time
        self.variables = {each.name: each for each in self.description.modelVariables}
        self.slave = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=extract(file, unzipdir=folder),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="unit",
        )
        self.slave.instantiate()
        self.begin()

    def begin(self):
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def names(self, causality):
        return [name for name, each in self.variables.items() if each.causality == causality]

    def set(self, names, values):
        references = [self.variables[name].valueReference for name in names]
        self.slave.setFloat64(references, [float(value) for value in np.ravel(values)])

    def get(self, names):
        return np.array(self.slave.getFloat64([self.variables[name].valueReference for name in names]))

    def step(self, time, step):
        self.slave.doStep(time, step)


def motion(name, *orders):
    """Return the names of the coordinates of a motion."""
    coordinates = ("x", "y", "z", "roll", "pitch", "yaw")
    return [f"{name}.{order}.{coordinate}" for order in orders for coordinate in coordinates]


def each(name, count):
    """Return the names of the numbers of a list."""
    return [name.format(i + 1) for i in range(count)]
