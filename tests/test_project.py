"""Check what a visitor and a package index get: addresses, links, citation, templates, lower bounds, gallery."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from runpy import run_path

import pytest
from ruamel.yaml import YAML

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
REPOSITORY, VERSION = PROJECT["urls"]["Repository"], PROJECT["version"]
README = (ROOT / "README.md").read_text(encoding="utf-8")
TARGET = re.compile(r"\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"")
TEXTS = (".github", "benchmarks", "docs", "examples", "tests")
SCHEMAS = {
    "citation-file-format": "CITATION.cff",
    "github-issue-forms": ".github/ISSUE_TEMPLATE/[!c]*.yml",
    "github-issue-config": ".github/ISSUE_TEMPLATE/config.yml",
}


def targets(text):
    return ["".join(match) for match in TARGET.findall(text)]


@pytest.fixture(scope="module")
def shown():
    """Return the README as a package index shows it."""
    return run_path(str(ROOT / "setup.py"))["with_addresses"](README, REPOSITORY, VERSION)


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md"])
def test_links_lead_somewhere_in_a_clone(page):
    paths = [path.partition("#")[0] for path in targets((ROOT / page).read_text(encoding="utf-8"))]
    assert len(paths) > 8
    assert not [path for path in paths if ":" in path or not (ROOT / path).exists()]


def test_on_a_package_index_every_link_is_an_address_at_the_release(shown):
    addresses = targets(shown)
    assert len(addresses) == len(targets(README))
    for path, address in zip(targets(README), addresses, strict=True):
        if not path.startswith("#"):
            kind = "raw" if path.endswith((".png", ".gif")) else "blob"
            assert address == f"{REPOSITORY}/{kind}/v{VERSION}/{path}"
    assert shown.replace(f"{REPOSITORY}/blob/v{VERSION}/", "").replace(f"{REPOSITORY}/raw/v{VERSION}/", "") == README


def test_addresses_stay_as_they_are():
    with_addresses = run_path(str(ROOT / "setup.py"))["with_addresses"]
    text = "[a](https://a.example/b.png) [b](#place) [c](mailto:d@e.example)"
    assert with_addresses(text, REPOSITORY, VERSION) == text


def test_the_address_of_the_repository_has_one_place():
    """The others and that of the citation begin with `Repository`, and the README clones it; no other file has it."""
    others = {"Documentation": "/tree/main/docs", "Changelog": "/blob/main/CHANGELOG.md", "Issues": "/issues"}
    assert PROJECT["urls"] == {"Repository": REPOSITORY} | {name: REPOSITORY + path for name, path in others.items()}
    owner = REPOSITORY.rpartition("/")[0]
    texts = [*ROOT.glob("*.*"), *(path for folder in TEXTS for path in (ROOT / folder).rglob("*.*"))]
    texts = [path for path in texts if path.suffix in (".cff", ".md", ".py", ".toml", ".txt", ".yml")]
    named = {path.name for path in texts if f"{owner}/" in path.read_text(encoding="utf-8")}
    assert len(texts) > 100
    assert named == {"pyproject.toml", "CITATION.cff", "README.md"}
    assert f"\ngit clone {REPOSITORY} && cd towline\n" in README


def test_the_citation_is_of_this_project():
    citation = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == VERSION
    assert citation["repository-code"] == REPOSITORY
    assert citation["license"] == PROJECT["license"]
    assert citation["authors"] == PROJECT["authors"]


@pytest.mark.parametrize("schema", SCHEMAS)
def test_citation_and_templates_keep_to_their_schemas(schema):
    pytest.importorskip("check_jsonschema", reason="the extra dev installs the schemas")
    files = [str(path) for path in sorted(ROOT.glob(SCHEMAS[schema]))]
    assert files
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}"]
    done = subprocess.run([*command, "--force-filetype", "yaml", *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_every_dependency_has_a_lower_bound():
    """Check that `.ci/versions` can install the oldest version of each, name==bound."""
    for requirement in sum(PROJECT["optional-dependencies"].values(), PROJECT["dependencies"]):
        assert re.fullmatch(r"[\w.-]+>=\d[\w.]*(,<\d+)?", requirement), requirement


def test_the_gallery_has_every_picture():
    """Or the film of the same motion. Those of the reference illustrate its pages."""
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    drawn = {path.relative_to(ROOT / "docs").with_suffix("").as_posix() for path in (ROOT / "docs").rglob("*.png")}
    drawn = {path for path in drawn if not path.startswith("reference/")}
    shown = [path for path in targets(page) if path.endswith((".png", ".gif"))]
    assert {path.rpartition(".")[0] for path in shown} == drawn
    assert all((ROOT / "docs" / path).exists() for path in shown)


@pytest.mark.parametrize("page", sorted((ROOT / "docs").glob("adding-a-*.md")), ids=lambda page: page.stem)
def test_an_extension_is_an_example_of_at_most_30_lines(page):
    """Tests of their own run the examples: a method, a carrier, a condition, a limit, a cost, a controller."""
    for code in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        assert len([line for line in code.splitlines() if line.strip()]) <= 30
