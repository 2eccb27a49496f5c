"""Hooks of MkDocs: what the site needs beyond its pages.

Formulas become MathML when the site is built, which browsers draw without any script: `pymdownx.arithmatex` leaves
`$...$` and `$$...$$` as LaTeX in elements of class arithmatex, and here it is translated.

The repository's root is the package `towline`, so no folder has that name, in which mkdocstrings looks for sources.
They are laid out under build/docs/towline as an installation has them.
"""

import html
import re
import shutil
import tomllib
from pathlib import Path

from latex2mathml.converter import convert

ROOT = Path(__file__).parent.parent
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
            shutil.copy(source, folder)


def on_page_content(content: str, **_: object) -> str:
    """Translate the formulas of a page, which is HTML by now; those of docstrings too."""
    return FORMULA.sub(_mathml, content)


def _mathml(found: re.Match[str]) -> str:
    display = "block" if found[1] == "div" else "inline"
    return convert(html.unescape(found[2]).strip(), display=display)
