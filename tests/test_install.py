"""Installation builds the core with whatever compiler there is, with the same bits. Editable, tools find it."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from importlib.util import find_spec
from pathlib import Path
from zipfile import ZipFile

import pytest

import towline

from .built import BACKEND, LEFT_OUT, ROOT, build, built_sources, has_compiler, require_setuptools, run, started

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


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """Return a copy of the sources, for builds in which PATH decides which compiler there is."""
    require_setuptools()
    compiler = sysconfig.get_config_var("CC").split()[0]
    if Path(compiler).is_absolute():
        pytest.skip(f"Python takes {compiler} as its compiler, whatever PATH is")
    folder = tmp_path_factory.mktemp("sources") / "sources"
    shutil.copytree(ROOT, folder, ignore=LEFT_OUT)
    return folder


def test_a_compiler_comes_from_the_index_only_where_there_is_none(sources):
    ask = f"{BACKEND}; print(backend.get_requires_for_build_wheel(), backend.get_requires_for_build_editable())"
    assert run(ask, sources, "") == "['ziglang'] ['ziglang']"
    if has_compiler():
        assert run(ask, sources, os.environ["PATH"]) == "[] []"


@pytest.mark.skipif(find_spec("ziglang") is not None, reason="ziglang is installed: there is a compiler")
def test_without_any_compiler_one_line_says_what_to_install(sources):
    done = started(f"{BACKEND}; backend.build_wheel('dist')", sources, "")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1:] == [
        "towline needs a C compiler to be built: install gcc or clang, or the package ziglang (pip install ziglang)"
    ]


def data_files():
    """The files that packages read beside their modules, by their names in a wheel."""
    beside = (file for init in ROOT.glob("*/**/__init__.py") for file in init.parent.iterdir())
    files = [file.relative_to(ROOT) for file in beside if file.suffix in (".yaml", ".json", ".html", ".js")]
    return {f"towline/{file.as_posix()}" for file in files if not {"tests", "build", ".venv"} & set(file.parts)}


def test_a_wheel_has_the_core_and_what_packages_read(sources, tmp_path_factory, tmp_path, capsys):
    """It solves as this installation does, on its own."""
    wheels = [next((built_sources(tmp_path_factory) / "dist").glob("*.whl"))]
    if has_compiler() and find_spec("ziglang"):
        wheels.append(build("wheel", sources, ""))
    exec(SOLVE, {})
    printed = {capsys.readouterr().out.split()[-1]}
    for number, wheel in enumerate(wheels):
        with ZipFile(wheel) as archive:
            archive.extractall(tmp_path / str(number))
            assert data_files() <= set(archive.namelist())
        folder, _, numbers = run(SOLVE, tmp_path, "", PYTHONPATH=str(tmp_path / str(number))).partition(" ")
        assert Path(folder) == tmp_path / str(number) / "towline"
        printed.add(numbers)
    assert len(printed) == 1, "compilers differ in bits"


def copied(factory, folder):
    """Copy the sources to a folder, with what building a wheel of the same sources has compiled."""
    shutil.copytree(ROOT, folder, ignore=LEFT_OUT)
    shutil.copytree(built_sources(factory) / "build", folder / "build")
    return folder


@pytest.fixture(scope="module")
def editable(tmp_path_factory):
    """Return an environment with an editable installation, as `make demo` makes one, and its sources."""
    if sys.platform == "win32":
        pytest.skip("links need permission here; the import hook takes their place")
    folder = tmp_path_factory.mktemp("editable")
    sources = copied(tmp_path_factory, folder / "sources")
    (sources / ".editable").mkdir()
    (sources / ".editable" / "towline").symlink_to("nowhere", target_is_directory=True)
    wheel = build("editable", sources)
    venv.create(folder / "environment", symlinks=True)
    packages = sysconfig.get_path("purelib", vars={"base": str(folder / "environment")})
    with ZipFile(wheel) as archive:
        archive.extractall(packages)
    Path(packages, "dependencies.pth").write_text("\n".join(path for path in sys.path if "site-packages" in path))
    return folder / "environment", sources


def test_an_editable_installation_runs_the_sources(editable):
    environment, sources = editable
    code = "import towline.ocp, os; print(os.path.realpath(towline.ocp.__file__))"
    command = [environment / "bin" / "python", "-E", "-c", code]
    found = subprocess.run(command, cwd=environment, capture_output=True, text=True, check=True).stdout
    assert Path(found.strip()) == (sources / "ocp" / "__init__.py").resolve()


def test_type_checkers_follow_an_editable_installation(editable, tmp_path):
    checker = shutil.which("pyrefly", path=str(Path(sys.executable).parent)) or shutil.which("pyrefly")
    if checker is None:
        pytest.skip("pyrefly is not installed; to run this: pip install pyrefly")
    calls = ('load("cogiro")', 'plan(load("cogiro"), "lift.yaml")')
    code = "\n".join(["from towline import load, plan", *(f"reveal_type({call})" for call in calls)])
    (tmp_path / "user.py").write_text(code)
    interpreter = editable[0] / "bin" / "python"
    command = [checker, "check", "--python-interpreter-path", interpreter, "--output-format", "json", "user.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    texts = [each["description"] for each in json.loads(done.stdout)["errors"]]
    assert texts == ["revealed type: Robot", "revealed type: Plan"], done.stdout


def test_editors_complete_the_names_of_an_editable_installation(editable):
    jedi = pytest.importorskip("jedi", reason="to run this: pip install jedi")
    environment = jedi.create_environment(editable[0], safe=False)
    offered = {name.name for name in jedi.Script("import towline\ntowline.", environment=environment).complete()}
    assert offered >= set(towline.__all__)


def test_only_what_changed_is_compiled(editable):
    """With a compiler that always fails: a second installation of the sources does without, one of others does not."""
    sources = editable[1]
    code = f"{BACKEND}; backend.build_editable('dist')"
    extension = next((sources / "core").glob("_core.*[od]"))
    extension.write_bytes(b"of another machine")
    assert started(code, sources, os.environ["PATH"], CC="false").returncode == 0
    assert extension.read_bytes() == next(sources.glob("build/*/towline/core/_core.*[od]")).read_bytes()
    (sources / "core" / "vectors.h").touch()
    done = started(code, sources, os.environ["PATH"], CC="false")
    assert done.returncode != 0
    assert "false" in done.stderr


def test_without_links_an_editable_installation_has_an_import_hook(tmp_path_factory, tmp_path):
    """As on Windows: here a file has the name of the folder."""
    sources = copied(tmp_path_factory, tmp_path / "sources")
    (sources / ".editable").touch()
    with ZipFile(build("editable", sources)) as archive:
        archive.extractall(tmp_path / "installed")
    code = f"import site; site.addsitedir({str(tmp_path / 'installed')!r}); import towline; print(towline.__file__)"
    done = subprocess.run([sys.executable, "-ES", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()) == sources / "__init__.py"
