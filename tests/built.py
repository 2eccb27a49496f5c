"""The wheel of the sources: compiling the core takes half a minute, so that is done once, by `make setup` or here."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import pytest

from .c_programs import WARNINGS
from .once import made_once

ROOT = Path(__file__).parent.parent
BACKEND = "import sys; sys.path.insert(0, 'core/packaging'); import backend"
# What no wheel needs, or what belongs to a build in the repository itself.
LEFT_OUT = shutil.ignore_patterns(
    *(".*", "*.so", "*.egg-info", "__pycache__", "build", "dist", "docs", "examples", "notebooks", "site", "tests")
)
# What work in a clone leaves there, and git does not track.
LEFT_BEHIND = (
    ".venv/lib/site.py",
    "build/lib/old.py",
    "notes.txt",
    "notebooks/.ipynb_checkpoints/01_quickstart.ipynb",
    "shared/notes.md",
    "site/index.html",
    "core/_core.abi3.so",
    "tests/__pycache__/test_sdist.cpython-311.pyc",
    "towline-demo/circle-free.nc",
)


def started(code, folder, path, **variables):
    """Run Python in a folder, with this PATH and no other compiler named; return the finished process."""
    left = {name: value for name, value in os.environ.items() if name not in ("CC", "CXX", "LDSHARED", "PYTHONPATH")}
    environment = {**left, "PATH": path, **variables}
    return subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)


def run(code, folder, path, **variables):
    """Run Python in the same way; return the last line that it prints."""
    done = started(code, folder, path, **variables)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


def build(kind, folder, path=None, **variables):
    """Build a wheel, an sdist or an editable installation in a folder of sources; return the path of what was built."""
    path = os.environ["PATH"] if path is None else path
    return folder / "dist" / run(f"{BACKEND}; print(backend.build_{kind}('dist'))", folder, path, **variables)


def require_setuptools():
    """Skip the test where there is none that is new enough; building needs nothing else and no network."""
    if int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools >= 77, which the extra dev installs")


def has_compiler():
    """Return whether the machine has the compiler that Python names."""
    return shutil.which(sysconfig.get_config_var("CC").split()[0]) is not None


def tracked_files():
    """Return the paths of all files that git tracks; None where that cannot be known."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        return None
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {name for name in listed.split("\0") if name and (ROOT / name).exists()}


def unpacked_sdist(factory):
    """Return the folder that an sdist unpacks to, which was built in a clone where work had left files behind."""
    require_setuptools()

    def make(folder):
        clone = folder / "clone"
        for name in tracked_files():
            (clone / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, clone / name)
        for name in LEFT_BEHIND:
            (clone / name).parent.mkdir(parents=True, exist_ok=True)
            (clone / name).write_text(str(clone))
        if sys.platform != "win32":  # where a link needs permission
            (clone / ".editable").mkdir()
            (clone / ".editable" / "towline").symlink_to(os.pardir, target_is_directory=True)
        with tarfile.open(build("sdist", clone)) as archive:
            archive.extractall(folder, filter="data")

    return next(made_once(factory, "sdist", make).glob("towline-*"))


def warned():
    """Return the variable that lets GCC and Clang optimise all sources without a warning: some are due only then."""
    command = sysconfig.get_config_var("CC") or ""
    return {"CFLAGS": " ".join(WARNINGS)} if re.search("gcc|clang|cc", command) and has_compiler() else {}


def compiled_before():
    """Return the core that `make setup` has compiled, with all warnings, from the sources as they are; None without."""
    core, kind = ROOT / "core", f"lib.{sysconfig.get_platform()}-{sys.implementation.cache_tag}"
    compiled = next(ROOT.glob(f"build/{kind}/towline/core/_core.*[od]"), None)
    sources = [ROOT / "setup.py", *core.glob("packaging/*.py"), *core.rglob("*.[ch]")]
    newest = max(each.stat().st_mtime for each in sources)
    return compiled if compiled is not None and compiled.stat().st_mtime > newest else None


def built_sources(factory):
    """Return the folder of sources, those of the sdist in a clone, in which a wheel was built, in dist/."""
    require_setuptools()
    if not has_compiler() and find_spec("ziglang") is None:
        pytest.skip("there is no C compiler; to run this: pip install ziglang")

    def make(folder):
        sources, compiled = folder / "sources", compiled_before()
        if tracked_files() is None:
            shutil.copytree(ROOT, sources, ignore=LEFT_OUT)
        else:
            shutil.copytree(unpacked_sdist(factory), sources)
        if compiled is not None:
            (sources / compiled.parent.relative_to(ROOT)).mkdir(parents=True)
            shutil.copy(compiled, sources / compiled.relative_to(ROOT))  # newer than the sources, so it is taken
        build("wheel", sources, **warned())

    return made_once(factory, "wheel", make) / "sources"
