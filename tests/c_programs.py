"""C of the core, compiled for tests: without a warning, with the bits of the extension, and watched by sanitizers.

Each source is compiled once for all tests, mostly without optimisation: a third of the time, for the same bits.
"""

import shutil
import subprocess
import sysconfig
from collections.abc import Iterable
from pathlib import Path

import pytest

from towline.core import PROCESSOR

from .once import made_once

CORE = Path(__file__).parent.parent / "core"
WARNINGS = ["-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-Wno-psabi"]
FLAGS = ["-std=c99", *WARNINGS, f"-I{CORE}", f"-I{CORE}/distribution", "-isystem", sysconfig.get_path("include"),
         "-DPy_LIMITED_API=0x030B0000", "-DTOWLINE_CABLES=32",
         "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]  # fmt: skip
WATCH = ["-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
OPTIMISED = ("plant", "horizon")  # parts that tests run for longer than it takes
WITHOUT_LANES = "-DTOWLINE_NO_LANES"


def sources_of(*parts: str) -> list[Path]:
    """Return the sources of parts of the core, each a folder or a file in one."""
    each = [CORE / part for part in parts]
    return [file for part in each for file in ([part] if part.suffix else sorted(part.glob("*.c")))]


def require(compiler: str) -> None:
    """Skip the test where there is no such command."""
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no C compiler: no command {compiler}")


def watched_object(factory: pytest.TempPathFactory, source: Path, *options: str, compiler: str = "cc") -> Path:
    """Compile a source to an object that ends its program with an error where a sanitizer finds one."""
    require(compiler)
    named = Path(shutil.which(compiler) or compiler).resolve().name  # cc and gcc are mostly the same
    # What this processor cannot run need not be watched, which takes seconds to compile.
    watch = WATCH if PROCESSOR == 2 or not source.stem.endswith("avx512") else []

    level = "-O1" if source.parent.name in OPTIMISED else "-O0"

    def make(folder: Path) -> None:
        command = [compiler, *FLAGS, *watch, *options, level, "-fPIC", "-c", str(source)]
        subprocess.run([*command, "-o", str(folder / "object.o")], check=True)

    return made_once(factory, "-".join([named, *options, source.parent.name, source.stem]), make) / "object.o"


def watched_objects(
    factory: pytest.TempPathFactory, sources: Iterable[Path], *, lanes: bool = True, compiler: str = "cc"
) -> list[Path]:
    """Compile sources to such objects; without lanes, the plain form is that of compilers that have no vectors."""
    options = {each: [WITHOUT_LANES] if not lanes and each.stem.endswith("_plain") else [] for each in sources}
    return [watched_object(factory, each, *of_it, compiler=compiler) for each, of_it in options.items()]


def link_watched(made: Path, parts: Iterable[Path], *options: str, compiler: str = "cc") -> Path:
    """Link objects, and sources among them, to a program, or to what options say."""
    subprocess.run([compiler, *FLAGS, *WATCH, *options, *map(str, parts), "-lm", "-o", str(made)], check=True)
    return made


def program_of(
    factory: pytest.TempPathFactory, driver: str, parts: Iterable[Path], *options: str, compiler: str = "cc"
) -> Path:
    """Link a driver, a file beside this one, with objects to a program that sanitizers watch."""
    made = factory.mktemp(Path(driver).stem) / "program"
    return link_watched(made, [Path(__file__).parent / driver, *parts], *options, compiler=compiler)
