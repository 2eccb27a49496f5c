"""Test that texts for users avoid the private words of early versions: plain technical English, ordinary words welcome.

Texts are the pages, the change log, notebooks and examples; the help of every command; reports of a feasible, an
infeasible and an undecided plan; the schemas of files; and, of every shipped module, docstrings and string literals
(error messages, labels of figures, rows of reports).
"""

import ast
import json
import re
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from towline import Robot, Task, load, plan
from towline.cli.main import app
from towline.ocp import MotionStatus

ROOT = Path(__file__).parent.parent

# What is banned, and what to write. Each pattern matches whole words, in any case.
BANNED = {
    r"whole or not at all": "atomically",
    r"goes on from|go on from|going on from": "continues from",
    r"in turns": "alternating",
    r"stands there|stand there": "exists, is real",
    r"lea(ve|ves|ving) open|left open|leaves it open": "unobservable, undetermined, free",
    r"paces?|the way along|way of time": "time law",
    r"tall(y|ies)": "counts",
    r"rungs?|ladders?": "stage",
    r"hanging (pose|posture|point|place|state)s?|hangings": "three-cable pose, pose at rest",
    r"counts? as none": "tolerance",
    r"most of each": "maximum of each",
    r"can(not)? but|nothing but|none but": "only",
    r"(goes|go|going) by": "depends on, follows",
    r"dear(er)?": "costly",
    r"what was found|how it was found|what is found": "the result",
    r"tears?|tore": "breaks",
    r"by itself": "alone",
    r"forward time": "simulation",
    r"likel(iest|ier)": "most likely",
    r"robots? of (the|an) uncertainty": "uncertain robots",
    r"beyond all numbers": "diverges",
    r"samples? left out|left[- ]out samples?": "validation samples",
    r"wanted acceleration": "desired acceleration",
    r"places? to keep out of": "keep-out region",
    r"what it is worth": "its value, its accuracy",
    r"as for [A-Z`]\S*\.": "write it out",
}
PHRASES = {
    r"\b[Nn]one: ": "default: ...",
    r"; accepted: ": "x must be ..., got ...",
    r"\bis (-?\d[\d.]*|nan); ": "x must be ..., got ...",
    r"(?<![\w ] )\bfound: ": "result: ",
}
WORDS = {re.compile(rf"(?<![\w`'-])({words})(?![\w`-])", re.IGNORECASE): instead for words, instead in BANNED.items()}
FORBIDDEN = WORDS | {re.compile(words): instead for words, instead in PHRASES.items()}
# All at once, in a quarter of the time: nearly all texts have none.
ANY_WORD = re.compile(rf"(?<![\w`'-])({'|'.join(BANNED)})(?![\w`-])", re.IGNORECASE)
ANY_PHRASE = re.compile("|".join(PHRASES))
# A function's docstring begins with a verb, and so with none of these.
NO_VERB = re.compile(
    r"(an?|all|and|as|at|being|both|by|each|for|from|here|how|if|in|is|its?|least|largest|many|most|no|none|not|of|on"
    r"|one|only|or|other|same|smallest|so|some|such|that|the|their|them|then|there|these|they|this|those|to|true|two"
    r"|under|what|when|where|whether|which|who|why|with|without)[,.:]?",
    re.IGNORECASE,
)
# Inline code, addresses, and quotations of what others wrote.
NOT_OURS = re.compile(r"``[^`]+``|`[^`\n]+`|https?://\S+|“[^”]*”")


def offences(text):
    """Return the forbidden words in a text, each with its surroundings."""
    ours = " ".join(NOT_OURS.sub("", text).split())
    if not ANY_WORD.search(ours) and not ANY_PHRASE.search(ours):
        return []
    return [
        f"'{match[0].strip()}' (write: {instead}): ...{ours[max(match.start() - 40, 0) : match.end() + 40]!r}"
        for pattern, instead in FORBIDDEN.items()
        for match in pattern.finditer(ours)
    ]


PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
MODULES = [
    str(file.relative_to(ROOT)) for package in PACKAGES for file in ROOT.joinpath(*package.split(".")[1:]).glob("*.py")
]
PAGES = [
    ROOT / "README.md",
    ROOT / "CHANGELOG.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "mkdocs.yml",
    ROOT / "Makefile",
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / "examples").glob("*.py"),
    *(ROOT / "notebooks").glob("*.ipynb"),
    *(ROOT / "models" / "library").glob("*.yaml"),
    *(ROOT / "cli" / "templates").glob("*.yaml"),
]


@cache
def nodes():
    """Return the nodes of the syntax tree of each module."""
    return {module: list(ast.walk(ast.parse((ROOT / module).read_text()))) for module in MODULES}


def literals():
    """Yield place and text of each docstring and of each string literal that is prose."""
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for module, found in nodes().items():
        docstrings = {
            id(node.body[0].value)
            for node in found
            if isinstance(node, documented) and node.body and isinstance(node.body[0], ast.Expr)
        }
        for node in found:
            text = node.value if isinstance(node, ast.Constant) else None
            if isinstance(text, str) and (id(node) in docstrings or " " in text):
                yield f"{module}:{node.lineno}", text


def openings(kind):
    """Yield place and first word of each docstring of a kind of node."""
    for module, found in nodes().items():
        for node in found:
            if isinstance(node, kind) and (told := ast.get_docstring(node)):
                yield f"{module}:{node.lineno}", told.split()[0]


def cells(file):
    """Return the text of a notebook's cells and of their outputs."""
    texts = []
    for cell in json.loads(file.read_text())["cells"]:
        texts.append("".join(cell["source"]))
        for output in cell.get("outputs", []):
            shown = [
                output.get("text", ""),
                *(output.get("data", {}).get(f"text/{kind}", "") for kind in ("plain", "markdown")),
            ]
            texts += ["".join(text) for text in shown]
    return "\n".join(texts)


def descriptions(schema):
    """Return all descriptions in a JSON Schema."""
    if isinstance(schema, list):
        return [text for part in schema for text in descriptions(part)]
    if not isinstance(schema, dict):
        return []
    own = schema.get("description")
    return [
        *([own] if isinstance(own, str) else []),
        *(text for part in schema.values() for text in descriptions(part)),
    ]


def commands(group, name=()):
    """Return the words of each command, groups included."""
    context = typer.Context(group)
    names = group.list_commands(context) if hasattr(group, "list_commands") else []
    return [name, *(words for own in names for words in commands(group.get_command(context, own), (*name, own)))]


@pytest.mark.parametrize("text", ["it is left open", "None: home.", "pose: is -1; accepted: six", "counts as none"])
def test_the_list_finds_what_is_banned(text):
    assert offences(text)


@pytest.mark.parametrize(
    "text", ["of course", "six rows", "the paper says", "`told`", "the Rungekutta scheme", "see also"]
)
def test_the_list_leaves_plain_english_alone(text):
    assert not offences(text)


def test_pages():
    texts = {page: cells(page) if page.suffix == ".ipynb" else page.read_text() for page in PAGES}
    hits = [f"{page.relative_to(ROOT)}: {hit}" for page, text in texts.items() for hit in offences(text)]
    assert not hits, "\n".join(hits)


def test_docstrings_and_messages():
    hits = [f"{place}: {hit}" for place, text in literals() for hit in offences(text)]
    assert not hits, "\n".join(hits)


def test_messages_that_troubleshooting_quotes_exist():
    """Check each part between the values of a message; its first word may be the name of a field."""
    texts = "\n".join(text for _, text in literals())
    page = (ROOT / "docs" / "troubleshooting.md").read_text()
    quoted = [part for line in re.findall(r"^`.+`", page, re.MULTILINE) for part in re.findall(r"`([^`]+)`", line)]
    ours = [text for text in quoted if not text.startswith(("towline", "No module"))]  # of the shell, of Python
    parts = [part.strip() for text in ours for part in re.split(r"…|; |'[^']*'", text) if " " in part.strip()]
    assert len(parts) > 5
    assert not [part for part in parts if part not in texts and part.partition(" ")[2] not in texts]


def test_sections_of_docstrings_are_those_that_the_site_reads():
    hits = [place for place, text in literals() if re.search(r"^ *[A-Z][a-z]+\n *-{4,}$", text, re.MULTILINE)]
    assert not hits, f"use Args:, Returns:, Raises: and Attributes: in {', '.join(hits)}"


def test_docstrings_of_functions_begin_with_a_verb():
    hits = [f"{place}: {word} ..." for place, word in openings(ast.FunctionDef) if NO_VERB.fullmatch(word)]
    assert not hits, "\n".join(hits)


def test_docstrings_of_classes_do_or_are_something():
    """Check that a class that does something begins with a verb, and data with the noun for them."""
    classes = openings(ast.ClassDef)
    hits = [f"{place}: {word} ..." for place, word in classes if re.fullmatch("What|How|Where|When|Which", word)]
    assert not hits, "\n".join(hits)


@pytest.mark.parametrize("words", commands(typer.main.get_command(app)), ids=" ".join)
def test_help(words):
    assert not offences(" ".join(CliRunner().invoke(app, [*words, "--help"]).output.split()))


def test_reports():
    """Check one feasible, one infeasible and one undecided report, and their JSON."""
    robot = load("wang-flying")
    rest = {"name": "rest", "path": {"kind": "rest", "pose": [0, 0, -1]}, "duration": 1}
    sideways = {"name": "sideways", "path": {"kind": "line", "start": [0, 0, -1], "end": [0.8, 0, -1]}, "duration": 1}
    feasible, infeasible = plan(robot, rest), plan(robot, sideways)
    undecided = replace(infeasible, status=MotionStatus.NOT_FOUND)
    assert (feasible.status, infeasible.status) == (MotionStatus.FEASIBLE, MotionStatus.INFEASIBLE)
    for result in (feasible, infeasible, undecided):
        assert not offences(result.report())


@pytest.mark.parametrize("model", [Robot, Task])
def test_schemas(model):
    assert not offences("\n".join(descriptions(model.model_json_schema())))
