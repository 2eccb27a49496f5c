"""Check that the sdist, and the wheel built from it, have all that belongs in them and nothing else."""

import os
import re
import tomllib
from zipfile import ZipFile

import pytest

from .built import ROOT, built_sources, tracked_files, unpacked_sdist

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
METADATA = re.compile(r"PKG-INFO|setup\.cfg|towline\.egg-info/.*")


@pytest.fixture(scope="module")
def tracked():
    """Return the paths of all files that git tracks."""
    files = tracked_files()
    if files is None:
        pytest.skip("only a clone knows which files belong to the project")
    return files


@pytest.fixture(scope="module")
def sdist(tracked, tmp_path_factory):
    """Return the folder that an sdist unpacks to, which was built where work had left files behind."""
    return unpacked_sdist(tmp_path_factory)


@pytest.fixture(scope="module")
def wheel(tracked, tmp_path_factory):
    """Return the folder that the wheel of the sdist unpacks to."""
    unpacked = tmp_path_factory.mktemp("wheel")
    with ZipFile(next((built_sources(tmp_path_factory) / "dist").glob("*.whl"))) as archive:
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
    step = {name for name in tracked if name.startswith(("export/step/template/", "export/fmu/sources/"))}
    pages = {name for name in tracked if re.fullmatch(r"(figures|viewer)/[^/]*\.(css|html|js)", name)}
    pages |= {name for name in tracked if name.startswith("viewer/live/")}
    claims = {name for name in tracked if re.fullmatch(r"studies/\w+/claims\.yaml", name)}
    new = {name for name in tracked if re.fullmatch(r"(cli/templates/[^/]*\.yaml|benchmarks/[^/]*\.(md|yaml))", name)}
    schema = {"py.typed", "ocp/tasks/task.schema.json"}
    data = {f"towline/{name}" for name in robots | step | pages | claims | new | schema}
    core = re.compile(r"towline/core/((\w+/)?\w+\.[ch]|_core\.pyi|_core(\.abi3\.so|\.pyd))")
    assert {name for name in files - modules if not core.fullmatch(name)} == data


def test_the_description_on_a_package_index_has_no_path_of_the_clone(sdist, wheel):
    release = f"{PROJECT['project']['urls']['Repository']}/raw/v{PROJECT['project']['version']}"
    for metadata in (sdist / "PKG-INFO", next(wheel.glob("*.dist-info/METADATA"))):
        text = metadata.read_text(encoding="utf-8")
        assert "Description-Content-Type: text/markdown" in text
        assert f"]({release}/docs/pictures/hero.gif)" in text
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
