"""Installation builds the core with whatever compiler there is, with the same bits. Editable, tools find it."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from zipfile import ZipFile

import pytest

import towline

ROOT = Path(__file__).parent.parent
# What no wheel needs, or what belongs to a build in the repository itself.
LEFT_OUT = shutil.ignore_patterns(
    *(".*", "*.so", "*.egg-info", "__pycache__", "build", "dist", "docs", "examples", "notebooks", "site", "tests")
)
BACKEND = "import sys; sys.path.insert(0, 'core/packaging'); import backend"
EDITABLE = f"{BACKEND}; print(backend.build_editable('dist'))"
# Where towline is, and every bit of tensions, statuses and proofs of ten states of a robot, some of them out of reach.
SOLVE = """
import hashlib
from pathlib import Path
import numpy as np
import towline
from towline import Dynamics, load, solve_batch

robot = load("cogiro")
A = Dynamics(robot).wrench_matrix(np.tile(robot.home, (10, 1)))
w = np.linspace(0.1, 6.0, 10)[:, None] * (A[0] @ np.full(robot.m, 0.3 * robot.t_max.max()))
batch = solve_batch(A, w, robot.t_min, robot.t_max, backend="c")
assert 2 < batch.feasible.sum() < 8 and np.isfinite(batch.shortfall).sum() > 2
parts = (batch.status.astype("S").tobytes(), batch.tensions.tobytes(), batch.direction.tobytes())
print(Path(towline.__file__).parent, hashlib.sha256(b"".join(parts)).hexdigest())
"""


def run(code, folder, path, **variables):
    """Run Python in a folder, with this PATH and no other compiler named; return the last line that it prints."""
    left = {name: value for name, value in os.environ.items() if name not in ("CC", "CXX", "LDSHARED", "PYTHONPATH")}
    environment = {**left, "PATH": path, **variables}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Return a copy of the sources; building needs no network, only setuptools."""
    if int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools >= 77, which the extra dev installs")
    compiler = sysconfig.get_config_var("CC").split()[0]
    if Path(compiler).is_absolute():
        pytest.skip(f"Python takes {compiler} as its compiler, whatever PATH is")
    folder = tmp_path_factory.mktemp("wheel") / "sources"
    shutil.copytree(ROOT, folder, ignore=LEFT_OUT)
    return folder


def test_a_compiler_comes_from_the_index_only_where_there_is_none(sources):
    ask = f"{BACKEND}; print(backend.get_requires_for_build_wheel(), backend.get_requires_for_build_editable())"
    assert run(ask, sources, "") == "['ziglang'] ['ziglang']"
    if shutil.which(sysconfig.get_config_var("CC").split()[0]):
        assert run(ask, sources, os.environ["PATH"]) == "[] []"


@pytest.mark.skipif(find_spec("ziglang") is not None, reason="ziglang is installed: there is a compiler")
def test_without_any_compiler_one_line_says_what_to_install(sources):
    command = [sys.executable, "-c", f"{BACKEND}; backend.build_wheel('dist')"]
    environment = {name: value for name, value in os.environ.items() if name not in ("CC", "CXX", "LDSHARED")}
    done = subprocess.run(
        command, cwd=sources, env={**environment, "PATH": ""}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1:] == [
        "towline needs a C compiler to be built: install gcc or clang, or the package ziglang (pip install ziglang)"
    ]


def data_files():
    """The files that packages read beside their modules, by their names in a wheel."""
    beside = (file for init in ROOT.glob("*/**/__init__.py") for file in init.parent.iterdir())
    files = [file.relative_to(ROOT) for file in beside if file.suffix in (".yaml", ".json", ".html", ".js")]
    return {f"towline/{file.as_posix()}" for file in files if not {"tests", "build", ".venv"} & set(file.parts)}


def test_a_wheel_has_the_core_and_what_packages_read(sources, tmp_path):
    """It solves as this installation does, on its own."""
    compilers = [os.environ["PATH"]] if shutil.which(sysconfig.get_config_var("CC").split()[0]) else []
    compilers += [""] if find_spec("ziglang") else []
    if not compilers:
        pytest.skip("there is no C compiler; to run this: pip install ziglang")
    printed = {run(SOLVE, tmp_path, os.environ["PATH"]).partition(" ")[2]}
    for number, path in enumerate(compilers):
        wheel = run(f"{BACKEND}; print(backend.build_wheel('dist{number}'))", sources, path)
        with ZipFile(sources / f"dist{number}" / wheel) as archive:
            archive.extractall(tmp_path / str(number))
            assert data_files() <= set(archive.namelist())
        folder, _, numbers = run(SOLVE, tmp_path, "", PYTHONPATH=str(tmp_path / str(number))).partition(" ")
        assert Path(folder) == tmp_path / str(number) / "towline"
        printed.add(numbers)
    assert len(printed) == 1, "compilers differ in bits"


@pytest.fixture(scope="module")
def editable(tmp_path_factory):
    """Return an environment with an editable installation, built twice, as `make demo` makes one; and its sources."""
    if int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools >= 77, which the extra dev installs")
    if sys.platform == "win32":
        pytest.skip("links need permission here; the import hook takes their place")
    folder = tmp_path_factory.mktemp("editable")
    shutil.copytree(ROOT, folder / "sources", ignore=LEFT_OUT)
    (folder / "sources" / ".editable").mkdir()
    (folder / "sources" / ".editable" / "towline").symlink_to("nowhere", target_is_directory=True)
    for _ in range(2):
        wheel = run(EDITABLE, folder / "sources", os.environ["PATH"])
    venv.create(folder / "environment", symlinks=True)
    packages = sysconfig.get_path("purelib", vars={"base": str(folder / "environment")})
    with ZipFile(folder / "sources" / "dist" / wheel) as archive:
        archive.extractall(packages)
    Path(packages, "dependencies.pth").write_text("\n".join(path for path in sys.path if "site-packages" in path))
    return folder / "environment", folder / "sources"


def test_an_editable_installation_runs_the_sources(editable):
    environment, sources = editable
    code = "import towline.ocp, os; print(os.path.realpath(towline.ocp.__file__))"
    command = [environment / "bin" / "python", "-c", code]
    found = subprocess.run(command, cwd=environment, capture_output=True, text=True, check=True).stdout
    assert Path(found.strip()) == (sources / "ocp" / "__init__.py").resolve()


def test_type_checkers_follow_an_editable_installation(editable, tmp_path):
    checker = shutil.which("basedpyright", path=str(Path(sys.executable).parent)) or shutil.which("basedpyright")
    if checker is None:
        pytest.skip("basedpyright is not installed; to run this: pip install basedpyright")
    calls = ('load("cogiro")', 'plan(load("cogiro"), "lift.yaml")')
    code = "\n".join(["from towline import load, plan", *(f"reveal_type({call})" for call in calls)])
    (tmp_path / "user.py").write_text(code)
    command = [checker, "--outputjson", "--pythonpath", editable[0] / "bin" / "python", "user.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    types = [each["message"].rpartition(" is ")[2] for each in json.loads(done.stdout)["generalDiagnostics"]]
    assert types == ['"Robot"', '"Plan"'], done.stdout


def test_editors_complete_the_names_of_an_editable_installation(editable):
    jedi = pytest.importorskip("jedi", reason="to run this: pip install jedi")
    environment = jedi.create_environment(editable[0], safe=False)
    offered = {name.name for name in jedi.Script("import towline\ntowline.", environment=environment).complete()}
    assert offered >= set(towline.__all__)


def test_without_links_an_editable_installation_has_an_import_hook(tmp_path):
    """As on Windows: here a file has the name of the folder."""
    if int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools >= 77, which the extra dev installs")
    shutil.copytree(ROOT, tmp_path / "sources", ignore=LEFT_OUT)
    (tmp_path / "sources" / ".editable").touch()
    wheel = run(EDITABLE, tmp_path / "sources", os.environ["PATH"])
    with ZipFile(tmp_path / "sources" / "dist" / wheel) as archive:
        archive.extractall(tmp_path / "installed")
    code = f"import site; site.addsitedir({str(tmp_path / 'installed')!r}); import towline; print(towline.__file__)"
    done = subprocess.run([sys.executable, "-S", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()) == tmp_path / "sources" / "__init__.py"
