"""Write a page as one HTML file with a status, tables and figures, which loads nothing.

All text passes `html.escape`; the figures are images, in which no script can run.
"""

import base64
import re
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import NamedTuple

from . import style
from .drawing import Drawing

CODE = re.compile(r"`([^`]+)`")  # a command or a key, as in Markdown
PAGE = Template(Path(__file__).with_name("page.html").read_text(encoding="utf-8"))


class Link(NamedTuple):
    """A link as HTML, safe to put into a page."""

    html: str


def page(title: str, word: str, summary: str, colour: str, parts: Iterable[str]) -> str:
    """Assemble the HTML page.

    - `word`, `summary`, `colour`: status in one word, its reason, and the colour of the bar beside them (`style`).
    - `parts`: results of the other functions of this module, in order.
    """
    from ..base.version import __version__

    return PAGE.substitute(
        title=_safe(title),
        word=_safe(word),
        summary=_safe(summary),
        colour=colour,
        parts="\n".join(parts),
        version=escape(__version__),
    )


def heading(text: str, anchor: str = "") -> str:
    """Return a heading; with an `anchor`, links lead to it."""
    return f"<h2{_id(anchor)}>{_safe(text)}</h2>"


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{_safe(text)}</p>"


def link(text: str, anchor: str) -> Link:
    """Return a link to an anchor of this page, for a cell of a table or an entry of the contents."""
    return Link(f'<a href="#{escape(anchor)}">{_safe(text)}</a>')


def contents(links: Iterable[Link]) -> str:
    """Return a table of contents."""
    return "<nav><ul>\n" + "\n".join(f"<li>{one.html}</li>" for one in links) + "\n</ul></nav>"


def facts(title: str, rows: Iterable[tuple[str, str]], anchor: str = "") -> str:
    """Return a table of named facts with a heading; a fact without a name continues the one before it.

    A link to `anchor` opens a folded table: browsers unfold what hides the target of a link.
    """
    lines = [
        f'<tr{"" if name else " class=more"}><th scope="row">{_broken(name)}</th><td>{_safe(fact)}</td></tr>'
        for name, fact in rows
    ]
    table = f"<table{_id(anchor)}>\n" + "\n".join(lines) + "\n</table>"
    return f"{heading(title)}\n{table}" if title else table


def fold(title: str, inside: str) -> str:
    """Return parts of a page folded under a title."""
    return f"<details><summary>{_safe(title)}</summary>\n{inside}</details>"


def beside(left: Sequence[str], right: Sequence[str]) -> list[str]:
    """Return parts in two columns where the screen is wide enough, else below each other."""
    if not right:
        return list(left)
    return ['<div class="beside"><div>', *left, "</div><div>", *right, "</div></div>"]


def columns(title: str, heads: Sequence[str], rows: Iterable[Sequence[str | Link]]) -> str:
    """Return a table with a heading and column names; on a narrow screen each cell is a line with its column's name."""
    first = "".join(f'<th scope="col">{_safe(head)}</th>' for head in heads)
    lines = ["<tr>" + "".join(map(_cell, heads, row)) + "</tr>" for row in rows]
    inner = "\n".join([f'<tr class="heads">{first}</tr>', *lines])
    above = f"{heading(title)}\n" if title else ""
    return f'{above}<div class="wide"><table class="columns">\n{inner}\n</table></div>'


def side_by_side(pictures: Iterable[str]) -> str:
    """Return figures, side by side where the screen is wide enough."""
    return '<div class="side">\n' + "\n".join(pictures) + "\n</div>"


def picture(drawing: Drawing) -> str:
    """Return a figure with its caption as an embedded image."""
    caption = _safe(drawing.caption)
    image = base64.b64encode(style.svg(drawing.figure).encode()).decode()
    source = f"data:image/svg+xml;base64,{image}"
    return f'<figure><img alt="{caption}" src="{source}"><figcaption>{caption}</figcaption></figure>'


def verbatim(text: str) -> str:
    """Return the text of a file."""
    return f"<pre>{escape(text)}</pre>"


def _safe(text: str) -> str:
    """Return text with mark-up escaped, the powers of units raised, and `commands` as code."""
    return style.typeset(CODE.sub(r"<code>\1</code>", escape(text)))


def _id(anchor: str) -> str:
    return f' id="{escape(anchor)}"' if anchor else ""


def _broken(name: str) -> str:
    """Return the name of a fact, which may break after a dot or an underscore: "limits.cable_speed"."""
    return re.sub(r"(?<=\w)([._])(?=\w)", r"\1<wbr>", _safe(name))


def _cell(head: str, cell: str | Link) -> str:
    inside = cell.html if isinstance(cell, Link) else _safe(cell)
    return f'<td data-label="{escape(head)}">{inside}</td>'
