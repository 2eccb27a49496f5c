"""The reference has what the code has: every command and option, key, status word and robot; pictures stay small."""

import ast
import json
import sys
from itertools import pairwise
from pathlib import Path

import pytest
import typer
from PIL import Image

from towline import Robot, Task, available, design, load, plan
from towline.cli.main import COMMANDS, app
from towline.control.controller import ANSWERS
from towline.ocp import MotionStatus
from towline.ocp.sweeps.cases import FAILED
from towline.solvers import Status
from towline.studies.accounts.claim import Verdict

ROOT = Path(__file__).parent.parent
SCHEMAS = {Robot: ROOT / "models" / "library" / "robot.schema.json", Task: ROOT / "ocp" / "tasks" / "task.schema.json"}
DOCS = ROOT / "docs"
REFERENCE = DOCS / "reference"
sys.path.insert(0, str(DOCS))  # as MkDocs does for its hooks
from generated import pages  # noqa: E402

sys.path.remove(str(DOCS))


@pytest.fixture(scope="module")
def made():
    return pages()


def leaves(group, path=()):
    """Return all commands by their words, those of groups too."""
    context = typer.Context(group, info_name="towline")
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if hasattr(command, "list_commands"):
            yield from leaves(command, (*path, name))
        else:
            yield (*path, name), command


def sections(page):
    """Return the text below each heading of the second level by its anchor."""
    parts = page.split("\n## ")[1:]
    return {part.partition("{ #")[2].partition(" }")[0]: part for part in parts}


def test_every_command_is_there_with_its_options_and_defaults(made):
    page = sections(made["reference/commands.md"])
    found = dict(leaves(typer.main.get_command(app)))
    assert {words[0] for words in found} == set(COMMANDS)
    for words, command in found.items():
        text = " ".join(page["-".join(words)].split())
        for parameter in command.params:
            names = [name for name in parameter.opts if name.startswith("--")] or [parameter.metavar]
            assert f"\n`{', '.join(names)}" in page["-".join(words)], (words, names)
            if names[0].startswith("--") and parameter.default and not parameter.is_flag:
                shown = str(parameter.default)
                assert f"[default: {shown}]" in text, (words, names, shown)


@pytest.mark.parametrize(("model", "page"), [(Robot, "robot-keys"), (Task, "task-keys")])
def test_every_key_of_every_part_is_there(model, page, made):
    text = sections(made[f"reference/{page}.md"])
    schema, published = model.model_json_schema(), json.loads(SCHEMAS[model].read_text())["$defs"]
    own = {key.lower(): part for key, part in schema["$defs"].items() if key in published}  # not those of other tests
    parts = {f"{model.__name__.lower()}-file": schema} | own
    assert set(text) >= set(parts)
    for anchor, part in parts.items():
        rows = {line.split("|")[1].strip(): line for line in text[anchor].splitlines() if line.startswith("| `")}
        assert set(rows) == {f"`{key}`" for key in part["properties"]}
        for key in part["properties"]:
            cells = [cell.strip() for cell in rows[f"`{key}`"].split(" | ")]
            assert len(cells) == 5
            assert ("required" in cells[3]) == (key in part.get("required", []))
            assert cells[1], key
            assert cells[2] or cells[4].strip(" |"), f"{anchor}.{key} has neither unit nor description"


@pytest.mark.parametrize("model", SCHEMAS, ids=lambda model: model.__name__)
def test_ranges_are_in_the_words_of_json_schema(model):
    """An editor that checks a file ignores keywords that it does not know."""

    def schemas(part):
        if isinstance(part, dict):
            yield part
        for each in part.values() if isinstance(part, dict) else part if isinstance(part, list) else ():
            yield from schemas(each)

    every = list(schemas(json.loads(SCHEMAS[model].read_text())))
    numbers = [each for each in every if each.get("type") in ("number", "integer")]
    assert not [each for each in numbers if {"ge", "gt", "le", "lt"} & {*each}]
    assert sum("maximum" in each or "exclusiveMaximum" in each for each in numbers) > 100


def test_units_and_defaults_are_those_of_the_schema(made):
    """A few rows as they should be, written by hand."""
    robot, task = made["reference/robot-keys.md"], made["reference/task-keys.md"]
    for row in (
        "| `gravity` | 3 numbers | m/s² | `[0, 0, -9.81]` | acceleration of gravity in &#123;G&#125; |",
        "| `t_max` | number &gt; 0 | N | required | largest tension |",
        "| `friction` | number &gt;= 0 | N | 0 | dry friction, as a force on the cable |",
    ):
        assert row in robot
    assert "| `margin` | number &gt;= 0 | N | 0 | smallest distance of every tension from its limits |" in task
    assert "| `steps` | whole number &gt;= 4, &lt;= 20000 |  | 100 |" in task


def test_every_robot_has_its_picture(made):
    page = sections(made["reference/robots.md"])
    assert set(page) == set(available())
    for name in available():
        file = REFERENCE / "pictures" / "robots" / f"{name}.png"
        assert f"(pictures/robots/{name}.png)" in page[name]
        assert file.stat().st_size < 25_000
        assert Image.open(file).width >= 400
    assert {path.stem for path in (REFERENCE / "pictures" / "robots").iterdir()} == set(available())


def test_every_status_word_is_explained():
    """Each is a term with a sentence, in the section of what has it."""
    text = {part.partition("\n")[0]: part for part in (REFERENCE / "status.md").read_text().split("\n## ")}
    for section, words in (
        ("Motions", [*MotionStatus, FAILED]),
        ("Tensions", Status),
        ("Steps of a controller", ANSWERS),
        ("Claims of a paper", Verdict),
    ):
        terms = [line.strip("`") for line in text[section].splitlines() if line.startswith("`") and line.endswith("`")]
        assert sorted(terms) == sorted(str(word) for word in words)
    codes = [line.split("|")[1].strip() for line in text["Exit codes"].splitlines() if line.startswith("| ")]
    assert codes[1:] == ["0", "1", "2", "3", "130", "141", "143"]


def test_every_row_of_reports_is_explained():
    """Rows of plans that are feasible and not, and of an impossible design, with those whose names are computed."""
    page = {part.partition("\n")[0]: part for part in (REFERENCE / "reports.md").read_text().split("\n## ")}
    robot = load("wang-flying")
    rest = {"path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 0.5}
    side = {"path": {"kind": "line", "start": [0, 0, -1], "end": [0.8, 0, -1]}, "duration": 0.5}
    flown = {"path": {"kind": "line", "start": [0, 0, -1], "end": [0.1, 0, -1]}, "duration": 2, "steps": 8}
    plans = [plan(robot, task) for task in ({**rest, "wind": [1, 0, 0]}, side, {**flown, "base": {"kind": "free"}})]
    assert [found.status for found in plans] == ["feasible", "infeasible", "feasible"]
    free = [{"part": "t_max", "range": {"min": 20, "max": 500}, "equal": True}]
    impossible = design("ipanema-2", free, [{"poses": [[9, 0, 2.5, 0, 0, 0]]}])
    assert impossible.status == "infeasible"
    names = {carrier.name for carrier in robot.carriers} | {""}
    for results, section in ((plans, "Plans"), ([impossible], "Designs")):
        for result in results:
            parts = [part for part in result._report().parts if hasattr(part, "facts")]
            rows = {name for part in parts for name, _ in part.facts} - names
            assert rows
            assert not [name for name in rows if f"`{name}`" not in page[section]]


ROWS = {  # the modules that write the reports of a section
    "Plans": [f"ocp/reports/{name}.py" for name in ("reasons", "report")],
    "Simulations": ["simulation/simulation.py", "simulation/flights.py"],
    "Designs": ["layout/result.py", "layout/impossibility.py"],
    "Replays": ["simulation/log_replay.py"],
}
# Rows without a name, files of pages, rows of `repr` alone, and words of a sentence.
NO_ROWS = {
    "",
    "The robot's file",
    "Complete task, defaults included (frame: world is {G})",
    "poses",
    "audited",
    "starts",
}
NO_ROWS |= {"the best of all pairings at the poses of the grid"}


def text_of(node):
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""


def rows_in(function):
    """Yield the names of rows that a function writes as pairs or into a dict, unless they are computed."""
    for node in ast.walk(function):
        if isinstance(node, ast.Tuple) and len(node.elts) == 2:
            yield text_of(node.elts[0])
        elif isinstance(node, ast.Dict) and function.name == "_facts":
            yield from map(text_of, node.keys)
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript):
            yield text_of(node.targets[0].slice)


def functions(*files):
    for file in files:
        yield from (node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.FunctionDef))


def test_every_row_that_the_code_names_is_explained():
    """Those that few results have, too: they are read from the code."""
    page = {part.partition("\n")[0]: part for part in (REFERENCE / "reports.md").read_text().split("\n## ")}
    for section, files in ROWS.items():
        found = functions(*(ROOT / file for file in files))
        kept = [
            one
            for one in found
            if one.name.strip("_") == "report" or (one.returns and "Fact" in ast.unparse(one.returns))
        ]
        rows = {row for function in kept for row in rows_in(function)} - NO_ROWS
        assert len(rows) > 3
        assert not [row for row in rows if f"`{row}`" not in page[section]], section
    changes = functions(*(ROOT / "ocp" / "search").glob("*.py"))
    calls = [node for one in changes for node in ast.walk(one) if isinstance(node, ast.Call) and node.args]
    named = [node.args[0] for node in calls if ast.unparse(node.func) in ("Change", "Relaxed")]
    offered = {text_of(name) for name in named} - {""}
    assert len(offered) > 10
    assert not [name for name in offered if f"`feasible {name}`" not in page["Plans"]]


def test_the_glossary_is_in_order_and_has_the_words_of_robots():
    lines = (REFERENCE / "glossary.md").read_text().splitlines()
    terms = [line for line, after in pairwise(lines) if after.startswith(":   ")]
    assert terms == sorted(terms, key=str.lower)
    for term in ("Anchor", "Attachment", "Carrier", "Platform", "Certificate", "Tube", "Wrench matrix", "Plant"):
        assert term in terms


def test_notebooks_are_pages_with_their_pictures(made):
    for notebook in sorted((DOCS.parent / "notebooks").glob("*.ipynb")):
        page = made[f"notebooks/{notebook.stem}.md"]
        assert page.startswith("# ")
        for picture in [name for name in made if name.startswith(f"notebooks/{notebook.stem}-")]:
            assert made[picture].startswith(b"\x89PNG")
            assert f"({Path(picture).name})" in page
