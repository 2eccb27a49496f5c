"""What README and documentation say works: the blocks of a page run in order, in one folder.

A `python` block is run, all of a page in one namespace. A `yaml` block is a robot or a task, a `c` block a file; either
is written to the folder if it has a `title="FILE"`. In an `sh` block lines that begin with `towline` are run as the
command line does, others by a shell. A block right after `<!-- not run: why -->` is left out.
"""

import importlib
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest
from typer.testing import CliRunner

from towline.cli.main import app
from towline.models import Robot, load
from towline.models.parsing import parse_yaml
from towline.ocp import Task, plan
from towline.studies.accounts.claim import Verdict
from towline.studies.flying import repair, vibration
from towline.studies.flying import study as flying
from towline.studies.towing import modes, ranges
from towline.studies.towing import study as towing

ROOT = Path(__file__).parent.parent
PAGES = {str(path.relative_to(ROOT)): path.read_text() for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]}
BLOCK = re.compile(
    r"(?:^<!-- not run: (?P<reason>.+?) -->\n)?"
    r"^```(?P<language>\w*)(?: title=\"(?P<title>[\w.-]+)\")?\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
TUTORIAL = "docs/tutorial.md"
SLOW = {repair.chapter, vibration.chapter, ranges.chapter, modes.chapter}  # seconds each
COMPILER = shutil.which("cc")


class Block(NamedTuple):
    language: str
    text: str
    title: str | None
    reason: str | None

    @property
    def lines(self):
        """Commands of a shell block, without comments."""
        whole = self.text.replace("\\\n", " ").splitlines()
        return [line.strip() for line in whole if line.strip() and not line.startswith("#")]


def blocks(page):
    return [
        Block(found["language"], found["text"], found["title"], found["reason"])
        for found in BLOCK.finditer(PAGES[page])
    ]


def run(block, namespace):
    if block.title:
        Path(block.title).write_text(block.text)
    if block.language == "python":
        exec(compile(block.text, "example", "exec"), namespace)
    elif block.language == "yaml":
        model = Robot if "\nplatform:" in block.text else Task
        parse_yaml(block.text, model, block.title or "block")
    elif block.language == "sh":
        for line in block.lines:
            shell(line)
    else:
        assert block.language == "c", f"a block of {block.language or 'no language'}"
        assert block.title, "a block of C without a title"


def shell(line):
    if line.startswith("towline "):
        done = CliRunner().invoke(app, split(line), catch_exceptions=False)
        assert done.exit_code == 0, done.output
    elif COMPILER:
        done = subprocess.run(line, shell=True, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def split(line):
    """Arguments of a command as a shell splits them, without the command."""
    return [quoted or plain for quoted, plain in re.findall(r'"([^"]*)"|(\S+)', line)][1:]


def run_page(page, folder, monkeypatch):
    """Run the blocks of a page in a folder; return the names that its Python defined."""
    monkeypatch.chdir(folder)
    namespace = {"__name__": "example"}
    for block in blocks(page):
        if block.reason is None:
            run(block, namespace)
    return namespace


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page) and page not in ("README.md", TUTORIAL)])
def test_examples_run(page, tmp_path, monkeypatch):
    run_page(page, tmp_path, monkeypatch)


def test_every_fence_is_a_block():
    """None escapes by an unusual spelling, and only shell commands may be left out."""
    for page, text in PAGES.items():
        found = blocks(page)
        assert len(re.findall(r"^\s*(?:```|~~~)", text, re.MULTILINE)) == 2 * len(found), page
        assert all(block.language == "sh" for block in found if block.reason), page


def test_indented_commands_are_shapes_of_commands():
    """A command line that could be run as it is belongs into a block that is run."""
    for page, text in PAGES.items():
        for line in re.findall(r"^    (towline .+)$", text, re.MULTILINE):
            assert re.search(r"\[|[A-Z]{3}", line), f"{page}: {line}"


def test_what_the_readme_says_comes_out(tmp_path, monkeypatch, capsys):
    run_page("README.md", tmp_path, monkeypatch)
    told = capsys.readouterr().out
    assert "optimal" in told
    assert "FEASIBLE" in told
    assert "INFEASIBLE" not in told
    assert (tmp_path / "circle.nc").exists()
    (task,) = [block.text for block in blocks("README.md") if block.language == "yaml"]
    assert plan(load("wang-ctmrts"), parse_yaml(task, Task, "README")).feasible


def test_what_the_tutorial_says_comes_out(tmp_path, monkeypatch):
    known = run_page(TUTORIAL, tmp_path, monkeypatch)
    assert known["proof"].verify(known["problem"])
    assert (known["hovering"].status, known["found"].status) == ("infeasible", "feasible")
    assert 0 < known["reachable"].attrs["accepted"] < 20_000


@pytest.mark.parametrize("study", [flying, towing], ids=lambda study: study.PAPER.name)
def test_errata_are_current(study):
    """Claims that are quickly computed stand in the page exactly if they were not reproduced; else: `make errata`."""
    sections = PAGES[f"docs/errata/{study.PAPER.name}.md"].split("\n## ")
    titles = {Verdict.DIFFERS: "What is printed", Verdict.IMPOSSIBLE: "What cannot", Verdict.NOT_DETERMINED: "What the"}
    for claim in [claim for chapter in study.CHAPTERS.values() if chapter not in SLOW for claim in chapter().claims]:
        where = [section for section in sections if f"| {claim.id} |" in section]
        if claim.verdict is Verdict.REPRODUCED:
            assert not where, claim.id
        else:
            (section,) = where
            assert section.startswith(titles[claim.verdict]), claim.id


@pytest.mark.parametrize("room", ["models", "solvers", "workspace", "ocp", "viewer", "errors"])
def test_every_public_name_is_in_the_reference(room):
    page = PAGES[f"docs/api/{room}.md"]
    for name in importlib.import_module(f"towline.{room}").__all__:
        # A function in a module of the same name is found as the module's.
        assert re.search(rf"^::: towline\.{room}(\.{name})?\.{name}$", page, re.MULTILINE), name


def test_schemas_that_are_published_are_those_of_the_code():
    """Both commands that the how-tos name print a schema that knows the blocks' keys."""
    for command, key in (("robots", "cables"), ("plan", "path")):
        done = CliRunner().invoke(app, [command, "--schema"])
        assert key in json.loads(done.output)["properties"]
