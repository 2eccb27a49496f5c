"""C of the core, compiled for tests: without a warning, with the bits of the extension, and watched by sanitizers."""

import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import pytest

CORE = Path(__file__).parent.parent / "core"
FLAGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-Wno-psabi", f"-I{CORE}",
         "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]  # fmt: skip
WATCH = ["-g1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


def sources_of(*parts: str) -> list[Path]:
    """Return the sources of parts of the core, each a folder or a file in one."""
    each = [CORE / part for part in parts]
    return [file for part in each for file in ([part] if part.suffix else sorted(part.glob("*.c")))]


def require(compiler: str) -> None:
    """Skip the test where there is no such command."""
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no C compiler: no command {compiler}")


def compile_watched(made: Path, sources: Iterable[Path], *options: str, compiler: str = "cc") -> Path:
    """Compile sources to a program, or to what options say, that ends with an error where a sanitizer finds one."""
    require(compiler)
    command = [compiler, *FLAGS, *WATCH, *options, *map(str, sources), "-lm", "-o", str(made)]
    subprocess.run(command, check=True)
    return made


def program_of(folder: Path, driver: str, sources: Iterable[Path], *options: str, compiler: str = "cc") -> Path:
    """Compile a driver, a file beside this one, with sources to a program that sanitizers watch."""
    return compile_watched(
        folder / Path(driver).stem, [Path(__file__).parent / driver, *sources], *options, compiler=compiler
    )
