"""Find the C compiler of the core: the machine's, or the package ziglang."""

import os
import shutil
import sys
import sysconfig
from importlib.util import find_spec

ZIG = "ziglang"


def _of_the_machine() -> bool:
    """Return whether setuptools will find a compiler. On Windows it looks for one of Microsoft's by itself."""
    if sys.platform == "win32":
        return True
    command = os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc"
    return shutil.which(command.split()[0]) is not None


def required() -> list[str]:
    """Return the packages to install before the core is built."""
    return [] if _of_the_machine() else [ZIG]


def choose() -> None:
    """Let setuptools use ziglang where the machine has no compiler.

    Raises `SystemExit` if there is neither, in one line.
    """
    if _of_the_machine():
        return
    if find_spec(ZIG) is None:
        raise SystemExit(
            "towline needs a C compiler to be built: install gcc or clang, or the package ziglang (pip install ziglang)"
        )
    zig = f"{sys.executable} -m {ZIG}"
    # Without -mcpu it would build for this very processor.
    os.environ |= {"CC": f"{zig} cc -mcpu=baseline", "LDSHARED": f"{zig} cc -shared", "AR": f"{zig} ar"}
