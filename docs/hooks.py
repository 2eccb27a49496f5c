"""Extend MkDocs: translate formulas and lay out the sources of the package.

Formulas become MathML when the site is built, because browsers draw MathML without any script:
`pymdownx.arithmatex` leaves `$...$` and `$$...$$` as LaTeX in elements of class arithmatex, and `on_page_content`
translates it.

The pages of `generated` are made from the code and the notebooks.

mkdocstrings looks for sources in a folder called `towline`. The repository's root is that package, whatever the folder
is called, so the sources are copied to build/docs/towline.
"""

import ast
import html
import re
import shutil
import tomllib
from pathlib import Path

from generated import pages
from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parent.parent
DOCSTRING = re.compile(r'"""[\s\S]*?"""')
# Parameters that share a description.
SHARED = re.compile(r"^( +)(\w+(?:, \*{0,2}\w+)+)(: [^\n]*\n(?:\1    [^\n]*\n)*)", re.MULTILINE)
SOURCES = ROOT / "build" / "docs"
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_startup(**_: object) -> None:
    """Lay out the sources of all packages for mkdocstrings."""
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    shutil.rmtree(SOURCES, ignore_errors=True)
    for package in packages:
        folder = SOURCES.joinpath(*package.split("."))
        folder.mkdir(parents=True)
        for source in ROOT.joinpath(*package.split(".")[1:]).glob("*.py"):
            text = DOCSTRING.sub(lambda found: SHARED.sub(_each, found[0]), source.read_text(encoding="utf-8"))
            # Parsing all sources would take a tenth of the time of the whole site.
            (folder / source.name).write_text(_with_fields(text) if "optional(" in text else text, encoding="utf-8")


def _each(shared: re.Match[str]) -> str:
    """Describe each parameter apart: mkdocstrings gives all that share a line the first one's type, and no defaults."""
    indent, names, description = shared.groups()
    return "".join(f"{indent}{name}{description}" for name in names.split(", "))


def _with_fields(text: str) -> str:
    """Write `optional` fields of parts as the `Field` that the extension for pydantic knows."""
    written = text
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "optional":
            description, *default = node.args
            known = {"default": default[0] if default else ast.Constant(None), "description": description}
            keywords = [ast.keyword(name, value) for name, value in known.items()]
            field = ast.Call(ast.Name("Field"), [], [*keywords, *node.keywords])
            written = written.replace(ast.get_source_segment(text, node) or "", ast.unparse(field))
    return written


def on_files(files: Files, config: MkDocsConfig, **_: object) -> Files:
    """Add the pages that are made from the code."""
    for path, content in pages().items():
        files.append(File.generated(config, path, content=content))
    return files


def on_page_content(content: str, **_: object) -> str:
    """Translate the formulas of an HTML page, docstrings included."""
    return FORMULA.sub(_mathml, content)


def _mathml(formula: re.Match[str]) -> str:
    display = "block" if formula[1] == "div" else "inline"
    return convert(html.unescape(formula[2]).strip(), display=display)
