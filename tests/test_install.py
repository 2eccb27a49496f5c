"""Installation with and without a C compiler: both succeed, and give the same tensions. Editable, tools find it."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from importlib.metadata import version
from pathlib import Path
from zipfile import ZipFile

import pytest

import towline

ROOT = Path(__file__).parent.parent
# What no wheel needs, or what belongs to a build in the repository itself.
LEFT_OUT = shutil.ignore_patterns(
    *(".*", "*.so", "*.egg-info", "__pycache__", "build", "dist", "docs", "examples", "notebooks", "site", "tests")
)
EDITABLE = "from setuptools import build_meta; print(build_meta.build_editable('dist'))"
BUILD = "from setuptools import build_meta; print(build_meta.build_wheel('dist'))"
# Ten states of a robot, some of which are out of reach, one by one and in a batch.
SOLVE = """
import json
from pathlib import Path
import numpy as np
import towline
from towline import Dynamics, TensionProblem, load, solve, solve_batch
from towline import core

robot = load("cogiro")
A = Dynamics(robot).wrench_matrix(np.tile(robot.home, (10, 1)))
w = np.linspace(0.1, 6.0, 10)[:, None] * (A[0] @ np.full(robot.m, 0.3 * robot.t_max.max()))
batch = solve_batch(A, w, robot.t_min, robot.t_max)
single = [solve(TensionProblem(A[k], w[k], robot.t_min, robot.t_max)) for k in range(10)]
print(json.dumps({
    "folder": str(Path(towline.__file__).parent),
    "core": core.CABLES > 0,
    "statuses": [batch.status.tolist(), [str(solution.status.value) for solution in single]],
    "tensions": [batch.tensions[batch.feasible].tolist(), [s.tensions.tolist() for s in single if s.feasible]],
    "proven": [int(np.isfinite(batch.shortfall).sum()), sum(s.certificate is not None for s in single)],
}))
"""


def run(code, folder, path, **variables):
    """Run Python in a folder, with this PATH and no other compiler named; return the last line that it prints."""
    left = {name: value for name, value in os.environ.items() if name not in ("CC", "CXX", "LDSHARED", "PYTHONPATH")}
    environment = {**left, "PATH": path, **variables}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


def install(folder, path):
    """Build a wheel from a copy of the sources and unpack it, as an installer does; return where it lies."""
    shutil.copytree(ROOT, folder / "sources", ignore=LEFT_OUT)
    wheel = run(BUILD, folder / "sources", path)
    with ZipFile(folder / "sources" / "dist" / wheel) as archive:
        archive.extractall(folder / "installed")
    return folder / "installed"


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Return what towline answers as installed where there is a compiler, if there is one, and where there is none."""
    if int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools >= 77, which the extra dev installs")
    compiler = sysconfig.get_config_var("CC").split()[0]
    if Path(compiler).is_absolute():
        pytest.skip(f"Python takes {compiler} as its compiler, whatever PATH is")
    answers = {}
    for name, path in (("compiler", os.environ["PATH"]), ("none", "")):
        folder = tmp_path_factory.mktemp(name)
        installed = install(folder, path)
        answers[name] = json.loads(run(SOLVE, folder, path, PYTHONPATH=str(installed)))
        assert Path(answers[name].pop("folder")) == installed / "towline"
    return answers


def test_without_a_compiler_it_is_installed_and_solves(answers):
    answer = answers["none"]
    assert not answer["core"]
    for statuses, tensions, proven in zip(answer["statuses"], answer["tensions"], answer["proven"], strict=True):
        assert statuses.count("optimal") == len(tensions) > 2
        assert statuses.count("infeasible") == proven > 2


def test_with_a_compiler_it_has_the_core_and_answers_the_same(answers):
    if shutil.which(sysconfig.get_config_var("CC").split()[0]) is None:
        pytest.skip("there is no C compiler")
    answer = answers["compiler"]
    assert answer["core"]
    assert answer["statuses"] == answers["none"]["statuses"]
    assert answer["proven"] == answers["none"]["proven"]
    for own, other in zip(answer["tensions"], answers["none"]["tensions"], strict=True):
        for row, expected in zip(own, other, strict=True):
            assert row == pytest.approx(expected, rel=1e-7)


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
        wheel = run(EDITABLE, folder / "sources", "")
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
    wheel = run(EDITABLE, tmp_path / "sources", "")
    with ZipFile(tmp_path / "sources" / "dist" / wheel) as archive:
        archive.extractall(tmp_path / "installed")
    code = f"import site; site.addsitedir({str(tmp_path / 'installed')!r}); import towline; print(towline.__file__)"
    done = subprocess.run([sys.executable, "-S", "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()) == tmp_path / "sources" / "__init__.py"
