"""The page on adding a condition: its example runs, also from the command line, resumed, and by several workers."""

import contextlib
import json
import re
import shlex
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from towline.models import Dynamics, load
from towline.workspace import Condition, Places, StaticEquilibrium, sample

from .warm import run, towline

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "adding-a-condition.md").read_text()
HIGH = '{"kind": "above-ground", "height": 0.3}'
COMMAND = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)[0]


@pytest.fixture
def folder(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert code.count("\n") <= 30
    (tmp_path / "conditions.py").write_text(code)
    return tmp_path


def test_the_example_runs_and_resumes(folder):
    """Compute in another way that every accepted place is at rest and above the ground."""
    done = run(folder / "conditions.py", cwd=folder)
    both, lowest, high = done.stdout.split()
    robot = load("cogiro")
    found = sample(robot, StaticEquilibrium(), samples=10_000, keep="all")
    poses = np.tile(robot.home, (10_000, 1))
    poses[:, :3] = found["position"].values
    heights = Dynamics(robot).points(poses)[1][:, :, 2].min(axis=1)
    assert int(high) == np.count_nonzero(heights >= 0.3)
    rest = found["accepted"].values.astype(bool)
    assert int(both) == np.count_nonzero(rest & (heights >= 0.3))
    assert 0 < int(both) < min(int(high), rest.sum())
    assert float(lowest) == poses[rest & (heights >= 0.3), 2].min()

    checkpoint = folder / "run.checkpoint"
    with contextlib.closing(sqlite3.connect(checkpoint)) as database, database:
        whole = database.execute("SELECT * FROM record").fetchall()
        database.execute("DELETE FROM record WHERE number > 0")
    program, *arguments = shlex.split(COMMAND.replace("\\\n", ""))
    assert program == "towline"
    done = towline(*arguments, "--json", cwd=folder)
    assert json.loads(done.stdout)["accepted"] == int(both)
    with contextlib.closing(sqlite3.connect(checkpoint)) as database:
        assert database.execute("SELECT * FROM record").fetchall() == whole


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("nowhere.py", None, "No module named 'nowhere'"),
        ("json.py", "x = 1", "another module of that name"),
        ("broken.py", "x =", "SyntaxError"),
        ("raising.py", "raise OSError('disk\\nand more')", "OSError: disk"),
        ("script.py", "import sys; sys.exit(0)", "(SystemExit: 0)"),
        ("farewell.py", "import sys; sys.exit('bye')", "(SystemExit: bye)"),
        ("interrupt.py", "raise KeyboardInterrupt", "(KeyboardInterrupt)"),
        ("generator.py", "raise GeneratorExit", "(GeneratorExit)"),
        ("silent.py", "raise type('Silent', (Exception,), {'__str__': lambda _: 1 / 0})", "(Silent)"),
    ],
)
def test_a_file_that_cannot_be_imported_is_one_line(tmp_path, file, text, message):
    if text is not None:
        (tmp_path / file).write_text(text)
    done = towline("workspace", "cogiro", "--define", file, "--condition", HIGH, cwd=tmp_path, code=2)
    assert done.stdout == ""
    assert done.stderr.startswith(f"towline: --define must be a Python file that can be imported, got {file} (")
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_condition_that_ends_the_process_is_no_yes(tmp_path):
    text = "from typing import Literal\n\nfrom towline.workspace import Condition\n\n\nclass Ending(Condition):\n"
    text += "    kind: Literal['ending'] = 'ending'\n\n"
    text += "    def evaluate(self, dynamics, places):\n        raise SystemExit(0)\n"
    (tmp_path / "ending.py").write_text(text)
    done = towline("workspace", "cogiro", "--define", "ending.py", "--condition", "ending", cwd=tmp_path, code=3)
    assert done.stdout == ""
    assert done.stderr.startswith("towline: an error in towline itself: SystemExit: 0 (")
    assert done.stderr.count("\n") == 1


def test_every_condition_is_on_the_pages():
    """The registry is the list of the conditions; the pages are checked against it."""
    names = {kind: one for kind, one in Condition.kinds.items() if one.__module__.startswith("towline.")}
    table, reference = ((ROOT / "docs" / page).read_text() for page in ("workspace.md", "api/workspace.md"))
    assert len(names) >= 13
    for kind, one in names.items():
        assert f"::: towline.workspace.{one.__name__}\n" in reference
        assert kind in ("all", "any") or f"`{one.__name__}" in table


def test_a_condition_holds_nowhere_where_a_number_is_not_finite():
    robot = load("wang-flying")
    poses = np.tile(robot.home, (2, 1))
    poses[1, 0] = np.nan
    assert StaticEquilibrium().holds(robot, Places.at_home(robot, poses)).tolist() == [True, False]
