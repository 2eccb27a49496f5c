"""Check the workflows of GitHub Actions, which run nowhere else: their schema, and what a release relies on."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import towline

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / ".github" / "workflows"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
WHEELS = PROJECT["tool"]["cibuildwheel"]
TEXTS = {path.stem: path.read_text() for path in sorted(FOLDER.glob("*.yml"))}
WORKFLOWS = {name: YAML(typ="safe").load(text) for name, text in TEXTS.items()}
JOBS = [(name, job) for name, workflow in WORKFLOWS.items() for job in workflow["jobs"]]
ADDRESS = PROJECT["project"]["urls"]["Repository"]
RELEASE, TESTS = WORKFLOWS["release"], WORKFLOWS["tests"]


def steps_of(name, job):
    return WORKFLOWS[name]["jobs"][job]["steps"]


def scripts_of(name, job):
    return "\n".join(step["run"] for step in steps_of(name, job) if "run" in step)


def test_they_keep_to_the_schema():
    pytest.importorskip("check_jsonschema", reason="the extra dev installs the schema")
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.github-workflows"]
    done = subprocess.run([*command, *map(str, FOLDER.glob("*.yml"))], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_tests_run_for_every_change_on_all_pythons_of_the_project():
    assert TESTS["on"] == {"push": {"branches": ["main"]}, "pull_request": None}
    pythons = TESTS["jobs"]["tests"]["strategy"]["matrix"]["python"]
    named = [line.rpartition(" ")[2] for line in PROJECT["project"]["classifiers"] if "Python :: 3." in line]
    assert pythons == named == ["3.11", "3.12", "3.13"]
    assert PROJECT["project"]["requires-python"] == f">={pythons[0]}"
    assert scripts_of("tests", "tests") == "bash .ci/run"


def test_a_selection_runs_on_the_other_platforms_and_with_other_versions_of_the_dependencies():
    platforms, versions = (TESTS["jobs"][job]["strategy"]["matrix"] for job in ("platforms", "versions"))
    assert platforms["python"] == TESTS["jobs"]["tests"]["strategy"]["matrix"]["python"]
    assert {runner.partition("-")[0] for runner in platforms["runner"]} == {"macos", "windows"}
    oldest, newest = platforms["python"][0], platforms["python"][-1]
    assert versions["include"] == [{"versions": "lowest", "python": oldest}, {"versions": "newest", "python": newest}]
    assert scripts_of("tests", "versions") == "bash .ci/versions ${{ matrix.versions }}"


def refusal(tmp_path, name, **variables):
    """Run the Python of a step of the release, where these files and variables are; return how it refuses."""
    (step,) = [step for step in steps_of("release", "sdist") if step.get("name") == name]
    assert step["if"] == "startsWith(github.ref, 'refs/tags/')"
    (code,) = re.findall(r"python - <<'END'\n(.*?)END\n", step["run"], re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ | variables, capture_output=True, text=True
    )
    assert (done.returncode == 0) == (done.stderr == "")
    return done.stderr


@pytest.mark.parametrize("other", [None, "pyproject.toml", "CITATION.cff"])
def test_a_release_is_refused_if_an_address_is_of_another_repository(other, tmp_path):
    for name in ("pyproject.toml", "CITATION.cff"):
        text = (ROOT / name).read_text(encoding="utf-8").replace(ADDRESS, "https://git.example/us/ours")
        if name == other:
            text = text.replace("/us/ours", "/us/ours-too")
        (tmp_path / name).write_text(text, encoding="utf-8")
    variables = {"GITHUB_SERVER_URL": "https://git.example", "GITHUB_REPOSITORY": "us/ours"}
    message = refusal(tmp_path, "The addresses are this repository's", **variables)
    assert message == "" if other is None else f"in {other} must be https://git.example/us/ours" in message


def test_a_release_is_refused_if_the_tag_is_of_another_version(tmp_path):
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "1.2.3"\n')
    assert refusal(tmp_path, "The tag is the version", GITHUB_REF_NAME="v1.2.3") == ""
    assert "must be v1.2.3, got v1.2.4" in refusal(tmp_path, "The tag is the version", GITHUB_REF_NAME="v1.2.4")


def test_the_oldest_python_builds_the_wheel_and_all_test_it():
    pythons = TESTS["jobs"]["tests"]["strategy"]["matrix"]["python"]
    assert WHEELS["build"] == [f"cp{python.replace('.', '')}-*" for python in pythons]
    limited_api = re.search(r'"Py_LIMITED_API", "(\w+)"', (ROOT / "setup.py").read_text())[1]
    assert int(limited_api, 16) >> 16 == 0x300 + int(pythons[0].partition(".")[2])


def test_wheels_are_built_for_all_platforms():
    rows = RELEASE["jobs"]["wheels"]["strategy"]["matrix"]["include"]
    assert {row["platform"]: re.sub(r"-(\d+\.?)+", "", row["runner"]) for row in rows} == {
        "linux-x86_64": "ubuntu",
        "linux-aarch64": "ubuntu-arm",
        "macos-arm64": "macos",
        "macos-x86_64": "macos-intel",
        "windows-x86_64": "windows",
    }


def test_only_a_tag_publishes_and_only_after_all_else_passed():
    assert RELEASE["on"]["push"] == {"tags": ["v*"]}
    publish = RELEASE["jobs"]["publish"]
    assert publish["if"] == "github.event_name == 'push' && startsWith(github.ref, 'refs/tags/v')"
    assert sorted(publish["needs"]) == sorted(set(RELEASE["jobs"]) - {"publish"})
    assert publish["environment"] == "pypi"


def test_the_version_that_the_tag_must_have_is_the_one_of_the_package():
    assert towline.__version__ == PROJECT["project"]["version"]


def test_what_is_built_is_what_is_published():
    uploads = {
        step["with"]["name"]: step["with"]["path"]
        for job in ("wheels", "sdist")
        for step in steps_of("release", job)
        if step.get("uses", "").startswith("actions/upload-artifact@")
    }
    assert uploads == {"dist-${{ matrix.platform }}": "dist/*.whl", "dist-sources": "dist/*.tar.gz"}
    download, publish = steps_of("release", "publish")
    assert download["with"] == {"pattern": "dist-*", "path": "dist", "merge-multiple": True}
    assert publish["uses"].startswith("pypa/gh-action-pypi-publish@")
    assert "with" not in publish  # its folder is dist, and it needs no address and no password


@pytest.mark.parametrize(("name", "job"), JOBS)
def test_jobs_may_read_and_only_publishing_may_identify_itself(name, job):
    assert WORKFLOWS[name]["permissions"] == {"contents": "read"}
    expected = {"id-token": "write"} if job == "publish" else None
    assert WORKFLOWS[name]["jobs"][job].get("permissions") == expected
    assert "secrets." not in TEXTS[name]


@pytest.mark.parametrize(("name", "job"), JOBS)
def test_every_job_ends(name, job):
    assert WORKFLOWS[name]["jobs"][job]["timeout-minutes"] <= 120


@pytest.mark.parametrize("name", TEXTS)
def test_actions_are_pinned_to_commits_and_images_to_versions(name):
    """A tag of another's repository can be moved; a commit cannot."""
    used = re.findall(r"uses: (.*)", TEXTS[name])
    assert used
    for action in used:
        assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}  # v\d+\.\d+\.\d+", action)
    assert "-latest" not in TEXTS[name]


@pytest.mark.parametrize(("name", "job"), JOBS)
def test_installed_programs_have_a_version(name, job):
    for line in re.findall(r"pip install (.*)", scripts_of(name, job)):
        assert "--constraint constraints.txt" in line or all("==" in word for word in line.split())


def test_the_files_that_they_name_exist():
    changed = RELEASE["on"]["pull_request"]["paths"]
    tested = [word.removeprefix("{project}/") for line in WHEELS["test-command"] for word in shlex.split(line)]
    tested += scripts_of("release", "sdist").split()
    tested += scripts_of("tests", "platforms").split()
    tested += (ROOT / ".ci" / "versions").read_text().split()
    tested = [word for word in tested if word.startswith("tests/")]
    assert len(tested) > 4
    for pattern in [*changed, *tested]:
        assert list(ROOT.glob(pattern)), pattern
