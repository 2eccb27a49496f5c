"""Write a page as one HTML file with a status, tables and figures, which loads nothing.

All text passes `html.escape`; the figures are images, in which no script can run.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from string import Template

from . import style
from .drawing import Drawing

PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
:root { color-scheme: light; }
body { font: 16px/1.45 system-ui, sans-serif; color: #222; background: #fff; max-width: 46rem; margin: 0 auto;
  padding: 0.5rem 1rem 3rem; overflow-wrap: anywhere; }
h1 { font-size: 1.5rem; margin: 0.8rem 0 0.3rem; }
h2 { font-size: 1.1rem; margin: 1.6rem 0 0.3rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 0.2rem; }
.status { border-left: 0.4rem solid $colour; padding: 0.3rem 0.8rem; background: #f6f6f6; margin: 0.6rem 0; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: 0.25rem 0.8rem 0.25rem 0; border-top: 1px solid #ddd; }
th { font-weight: 600; width: 9.5rem; }
.wide { overflow-x: auto; overflow-wrap: normal; }
table.columns th { width: auto; }
tr.more th, tr.more td { border-top: 0; padding-top: 0; }
figure { margin: 1.2rem 0; }
img { max-width: 100%; height: auto; display: block; margin: auto; }
figcaption, footer, .source { color: #555; font-size: 0.9rem; }
pre { overflow-x: auto; font-size: 0.8rem; background: #f6f6f6; padding: 0.6rem; overflow-wrap: normal; }
</style>
</head>
<body>
<h1>$title</h1>
<p class="status"><strong>$word</strong>: $summary</p>
$parts
<footer>towline $version</footer>
</body>
</html>
""")


def page(title: str, word: str, summary: str, colour: str, parts: Iterable[str]) -> str:
    """Return the page.

    Parameters
    ----------
    title
        Title of the page.
    word, summary, colour
        The status in one word, the reason for it, and the colour of the bar beside them, from `style.colour`.
    parts
        Results of the other functions of this module, in order.
    """
    from .. import __version__

    return PAGE.substitute(
        title=escape(title),
        word=escape(word),
        summary=escape(summary),
        colour=colour,
        parts="\n".join(parts),
        version=escape(__version__),
    )


def heading(text: str, level: int = 2) -> str:
    """Return a heading of level 2 or 3."""
    return f"<h{level}>{escape(text)}</h{level}>"


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def facts(title: str, rows: Iterable[tuple[str, str]], level: int = 2) -> str:
    """Return a table of named facts with a heading; a fact without a name continues the one before it."""
    lines = [
        f'<tr{"" if name else " class=more"}><th scope="row">{escape(name)}</th><td>{escape(fact)}</td></tr>'
        for name, fact in rows
    ]
    return heading(title, level) + "\n<table>\n" + "\n".join(lines) + "\n</table>"


def columns(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table with a heading and column names; on a narrow screen it scrolls."""
    first = "".join(f'<th scope="col">{escape(head)}</th>' for head in heads)
    lines = ["<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    inner = "\n".join([f"<tr>{first}</tr>", *lines])
    return f'{heading(title)}\n<div class="wide"><table class="columns">\n{inner}\n</table></div>'


def picture(drawing: Drawing) -> str:
    """Return a figure with its caption as an embedded image."""
    caption = escape(drawing.caption)
    image = base64.b64encode(style.svg(drawing.figure).encode()).decode()
    source = f"data:image/svg+xml;base64,{image}"
    return f'<figure><img alt="{caption}" src="{source}"><figcaption>{caption}</figcaption></figure>'


def file(title: str, text: str) -> str:
    """Return the text of a file, folded under its title."""
    return f"<details><summary>{escape(title)}</summary><pre>{escape(text)}</pre></details>"
