"""Test that the examples of README and documentation work: run the blocks of each page in order, in one folder.

The `python` blocks of a page share one namespace. A `yaml` block is a robot or a task, a `c` block is a file; both are
written to the folder if they have a `title="FILE"`. In an `sh` block, lines that begin with `towline` are run in this
process, others by a shell. A block right after `<!-- not run: why -->` is skipped.
"""

import importlib
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from ruamel.yaml import YAML
from scipy.optimize import lsq_linear
from typer.testing import CliRunner

import towline
from towline import Requirements, Robot, Task
from towline.cli.main import app
from towline.estimation.logs.mapping import LogMap
from towline.figures import style
from towline.layout import search
from towline.models import carriers
from towline.models.parsing import json_schema, parse_yaml

from .units import compiled_once

ROOT = Path(__file__).parent.parent
PAGES = {str(path.relative_to(ROOT)): path.read_text() for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]}
BLOCK = re.compile(
    r"(?:^<!-- not run: (?P<reason>.+?) -->\n)?"
    r"^```(?P<language>\w*)(?: title=\"(?P<title>[\w.-]+)\")?\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
CLAIMING = ("README.md", "docs/tutorial/infeasible.md", "docs/tutorial/calibrate.md")  # more than that they run
COMPILER = shutil.which("cc")


class Block(NamedTuple):
    language: str
    text: str
    title: str | None
    reason: str | None

    @property
    def lines(self):
        """Return the commands of a shell block, without comments."""
        whole = self.text.replace("\\\n", " ").splitlines()
        return [line.partition(" #")[0].strip() for line in whole if line.strip() and not line.startswith("#")]


def blocks(page):
    matches = BLOCK.finditer(PAGES[page])
    return [Block(match["language"], match["text"], match["title"], match["reason"]) for match in matches]


def run(block, namespace):
    if block.title:
        Path(block.title).write_text(block.text)
    if block.language == "python":
        exec(compile(block.text, "example", "exec"), namespace)
    elif block.language == "yaml":
        kinds = {"\nplatform:": Robot, "\nrequire:": Requirements, "\nlengths:": LogMap}
        model = next((kinds[key] for key in kinds if key in f"\n{block.text}"), Task)
        parse_yaml(block.text, model, block.title or "block")
    elif block.language == "sh":
        for line in block.lines:
            shell(line)
    else:
        assert block.language in ("c", "csv"), f"a block of {block.language or 'no language'}"
        assert block.title, f"a block of {block.language} without a title"


def shell(line):
    if line.startswith("towline "):
        done = CliRunner().invoke(app, split(line), catch_exceptions=False)
        assert done.exit_code == 0, done.output
    elif COMPILER:
        done = subprocess.run(line, shell=True, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr


def split(line):
    """Split the arguments of a command as a shell does; leave the command out."""
    return [quoted or plain for quoted, plain in re.findall(r'"([^"]*)"|(\S+)', line)][1:]


def print_nothing(canvas, form, file, dpi, metadata):
    """Leave an empty picture for a figure that has been drawn, of which printing takes most of the time."""
    file.write("<svg/>") if hasattr(file, "write") else file.write_bytes(b"")


@pytest.fixture(scope="module", autouse=True)
def _compiled_once(tmp_path_factory):
    with compiled_once(tmp_path_factory):
        yield


def run_page(page, folder, monkeypatch):
    """Run the blocks of a page in a folder; return the names that its Python defined."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(search, "_SEARCHING", 0.0)  # of longer searches and larger audits, test_design.py has tests
    monkeypatch.setattr(search, "AUDITED", 10_000)
    monkeypatch.setattr(style, "_print", print_nothing)  # test_figures.py has tests of what is printed
    monkeypatch.setattr(carriers, "_KINDS", dict(carriers._KINDS))  # other tests know nothing of a page's own carrier
    namespace = {"__name__": "example"}
    for block in blocks(page):
        if block.reason is None:
            run(block, namespace)
    json_schema.cache_clear()
    return namespace


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page) and page not in CLAIMING])
def test_examples_run(page, tmp_path, monkeypatch):
    run_page(page, tmp_path, monkeypatch)


def test_every_fence_is_a_block():
    """No block escapes the test by an unusual spelling, and only shell commands may be skipped."""
    for page, text in PAGES.items():
        known = blocks(page)
        assert len(re.findall(r"^\s*(?:```|~~~)", text, re.MULTILINE)) == 2 * len(known), page
        assert all(block.language == "sh" for block in known if block.reason), page


def test_frames_do_not_end_cells_or_headings():
    """The site's Markdown takes {G} at the end of a cell or a heading for attributes, and drops it."""
    lost = re.compile(r"^(#.*\{\w+\}|\|.*\{\w+\} *\|.*)$", re.MULTILINE)
    found = lost.findall("| pose | in {G} |\n# The frame {G}\n| in {G} now |")
    assert found == ["| pose | in {G} |", "# The frame {G}"]
    assert [(page, line) for page, text in PAGES.items() for line in lost.findall(text)] == []


def test_indented_commands_are_patterns():
    """A command that can be run as it stands must be in a block that is run."""
    for page, text in PAGES.items():
        for line in re.findall(r"^    (towline .+)$", text, re.MULTILINE):
            assert re.search(r"\[|[A-Z]{3}", line), f"{page}: {line}"


def test_the_readme_does_what_it_claims(tmp_path, monkeypatch, capsys):
    names = run_page("README.md", tmp_path, monkeypatch)
    printed = [line.strip() for line in capsys.readouterr().out.splitlines()]
    for line in re.findall(r"^    (?!towline |  *\.\.\.)(.+)$", PAGES["README.md"], re.MULTILINE):
        assert line.strip() in printed
    assert names["result"].feasible
    assert (tmp_path / "circle.nc").exists()
    for word in ("short by              6.195 N", "t = 3.273 s of 7.854 s"):
        assert word in PAGES["README.md"]
    angle = 0.8 * 3.273  # [rad], of a circle of 0.8 m at 0.8 rad/s
    outward = 0.8 * np.array([np.cos(angle), np.sin(angle), 0.0])
    assert round(missing("wang-flying-quadrotor", np.subtract(outward, [0, 0, 1]), -(0.8**2) * outward), 3) == 6.195


def missing(name, place, acceleration):
    """Return the distance [N] of the required wrench from the available wrench set, by bounded least squares.

    No code of towline is used. The platform is level and does not turn, its centre of mass is the origin of its frame,
    and the carriers are at home, not rotated. Moments are divided by the largest distance of an attachment from the
    centre of mass.
    """
    data = YAML(typ="safe").load(ROOT / "models" / "library" / f"{name}.yaml")
    assert not np.any(data["platform"]["com"])
    carriers = {carrier["name"]: np.array(carrier["home"]) for carrier in data["carriers"]}
    arms = np.array([cable["attachment"] for cable in data["cables"]])
    anchors = np.array([carriers[cable["carrier"]][:3] + cable["anchor"] for cable in data["cables"]])
    pulls = anchors - (np.array(place) + arms)
    pulls /= np.linalg.norm(pulls, axis=1, keepdims=True)
    length = np.linalg.norm(arms, axis=1).max()
    A = np.vstack([pulls.T, np.cross(arms, pulls).T / length])
    force = data["platform"]["mass"] * np.add(acceleration, [0, 0, 9.81])
    limits = [[cable[key] for cable in data["cables"]] for key in ("t_min", "t_max")]
    return np.sqrt(2 * lsq_linear(A, np.append(force, np.zeros(3)), bounds=limits, tol=1e-14).cost)


def test_the_tutorial_explains_what_is_infeasible(tmp_path, monkeypatch):
    page = CLAIMING[1]
    names = run_page(page, tmp_path, monkeypatch)
    assert names["w"] == pytest.approx([0, 0, 11.772, 0, 0, 0])
    assert (names["quick"].status, names["slower"].status) == ("infeasible", "feasible")
    assert "feasible duration" in names["quick"].report()
    for line in names["solution"].certificate.describe().splitlines():
        assert f"\n    {line}\n" in PAGES[page]


def test_the_tutorial_calibrates(tmp_path, monkeypatch):
    names = run_page(CLAIMING[2], tmp_path, monkeypatch)
    assert names["before"] > 0.03
    assert names["after"] < 0.2 * names["before"]


@pytest.mark.parametrize(
    "package",
    [
        *("models", "solvers", "workspace", "estimation", "estimation.calibration", "ocp", "control", "plant"),
        *("simulation", "layout", "viewer", "base.errors"),
    ],
)
def test_every_public_name_is_in_the_reference(package):
    page = PAGES[f"docs/api/{package.split('.')[-1]}.md"]
    page += "".join(
        PAGES[f"docs/api/{linked}.md"] for linked in re.findall(r"^\[`\w+`\]\(([\w-]+)\.md\):", page, re.MULTILINE)
    )
    for name in importlib.import_module(f"towline.{package}").__all__:
        # A name that a module has too is given by its full path: `towline.solvers.solve.solve`.
        path = rf"towline\.{re.escape(package)}\.((solve|simulate|planner)\.)?{name}"
        assert re.search(rf"^::: {path}$", page, re.MULTILINE), name


def test_the_reference_lists_every_name_of_the_front_door():
    page = PAGES["docs/api/towline.md"]
    assert all(f"[`{name}`](" in page for name in towline.__all__)


def test_schemas_that_are_published_are_those_of_the_code():
    """Both commands that the how-tos name print a schema with the main blocks."""
    for command, key in (("robots", "cables"), ("plan", "path")):
        done = CliRunner().invoke(app, [command, "--schema"])
        assert key in json.loads(done.output)["properties"]
