"""Check that the sdist, and the wheel built from it, have all that belongs in them and nothing else."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from importlib.metadata import version
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
BUILD = "from setuptools import build_meta; build_meta.build_{}('dist')"
METADATA = re.compile(r"PKG-INFO|setup\.cfg|towline\.egg-info/.*")
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


def build(kind, folder):
    """Build an sdist or a wheel in a folder of sources and return its path."""
    done = subprocess.run([sys.executable, "-c", BUILD.format(kind)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return next((folder / "dist").iterdir())


@pytest.fixture(scope="module")
def tracked():
    """Return the paths of all files that git tracks."""
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("only a clone knows which files belong to the project")
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {name for name in listed.split("\0") if name and (ROOT / name).exists()}


@pytest.fixture(scope="module")
def sdist(tracked, tmp_path_factory):
    """Return the folder that an sdist unpacks to, which was built where work had left files behind."""
    if int(version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools >= 77, which the extra dev installs")
    clone, unpacked = tmp_path_factory.mktemp("clone"), tmp_path_factory.mktemp("unpacked")
    for name in tracked:
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, clone / name)
    for name in LEFT_BEHIND:
        (clone / name).parent.mkdir(parents=True, exist_ok=True)
        (clone / name).write_text(str(clone))
    if sys.platform != "win32":  # where a link needs permission
        (clone / ".editable").mkdir()
        (clone / ".editable" / "towline").symlink_to(os.pardir, target_is_directory=True)
    with tarfile.open(build("sdist", clone)) as archive:
        archive.extractall(unpacked, filter="data")
    return unpacked / f"towline-{PROJECT['project']['version']}"


@pytest.fixture(scope="module")
def wheel(sdist, tmp_path_factory):
    """Return the folder that the wheel of the sdist unpacks to."""
    sources, unpacked = tmp_path_factory.mktemp("sources") / "sources", tmp_path_factory.mktemp("wheel")
    shutil.copytree(sdist, sources)
    with ZipFile(build("wheel", sources)) as archive:
        archive.extractall(unpacked)
    return unpacked


def files_in(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_the_sdist_is_what_git_tracks(sdist, tracked):
    files = files_in(sdist)
    metadata = {name for name in files if METADATA.fullmatch(name)}
    assert {"PKG-INFO", "towline.egg-info/SOURCES.txt"} <= metadata
    assert sorted(files - metadata) == sorted(tracked)


def test_the_wheel_is_the_packages_and_their_data(wheel, tracked):
    packages = {package.replace(".", "/") for package in PROJECT["tool"]["setuptools"]["packages"]}
    files = {name for name in files_in(wheel) if ".dist-info/" not in name}
    modules = {f"towline/{name}" for name in tracked if name.endswith(".py")}
    modules = {name for name in modules if os.path.dirname(name) in packages} - {"towline/setup.py"}
    assert {name for name in files if name.endswith(".py")} == modules
    robots = {name for name in tracked if re.fullmatch(r"models/library/[^/]*\.(yaml|json)", name)}
    assert len(robots) > 20
    step = {name for name in tracked if name.startswith("export/step/template/")}
    pages = {name for name in tracked if re.fullmatch(r"(figures|viewer)/[^/]*\.(html|js)", name)}
    claims = {name for name in tracked if re.fullmatch(r"studies/\w+/claims\.yaml", name)}
    data = {f"towline/{name}" for name in robots | step | pages | claims | {"py.typed", "ocp/tasks/task.schema.json"}}
    core = re.compile(r"towline/core/((\w+/)?\w+\.[ch]|_core\.pyi|_core(\.abi3\.so|\.pyd))")
    assert {name for name in files - modules if not core.fullmatch(name)} == data


def test_the_description_on_a_package_index_has_no_path_of_the_clone(sdist, wheel):
    release = f"{PROJECT['project']['urls']['Repository']}/raw/v{PROJECT['project']['version']}"
    for metadata in (sdist / "PKG-INFO", next(wheel.glob("*.dist-info/METADATA"))):
        text = metadata.read_text(encoding="utf-8")
        assert "Description-Content-Type: text/markdown" in text
        assert f"]({release}/docs/pictures/circle.png)" in text
        assert not re.search(r'(\]\(|src=")(docs|notebooks|examples)/', text)
        assert f"Project-URL: Repository, {PROJECT['project']['urls']['Repository']}" in text


def test_one_wheel_serves_all_pythons_from_the_oldest(wheel):
    (tag,) = re.findall(r"^Tag: (.*)$", next(wheel.glob("*.dist-info/WHEEL")).read_text(), re.MULTILINE)
    oldest = PROJECT["project"]["requires-python"].removeprefix(">=").replace(".", "")
    assert tag.startswith(f"cp{oldest}-abi3-")


def test_no_path_of_the_machine_that_built_them(sdist, wheel):
    """The extension may name the folder of the Python that linked it, as every extension does."""
    places = {str(ROOT), str(sdist.parent.parent)}
    for folder in (sdist, wheel):
        for name in files_in(folder):
            content = (folder / name).read_bytes()
            assert not [place for place in places if place.encode() in content], name
