"""The report of a plan as one HTML file: `report`'s facts as tables, figures inside, nothing to load.

Whatever comes from a file (names, sources, a solver's message) passes `html.escape`; the figures are images of their
own, in which nothing can run.
"""

from __future__ import annotations

import base64
from html import escape
from string import Template
from typing import TYPE_CHECKING

from ...figures import style
from ...models.parsing import to_yaml
from .drawings import drawings
from .finding import Finding
from .report import Section, Table, missing, sections, verdict

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

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
.verdict { border-left: 0.4rem solid $colour; padding: 0.3rem 0.8rem; background: #f6f6f6; margin: 0.6rem 0; }
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
<p class="verdict"><strong>$status</strong>: $verdict</p>
$tables
$figures
$files
<footer>towline $version</footer>
</body>
</html>
""")
# Told apart with any kind of colour vision, and the word stands beside them.
COLOURS = {"feasible": style.colour(0), "infeasible": style.colour(1), "not-found": style.colour(5)}


def page(plan: Finding, trajectory: xr.Dataset) -> str:
    """The whole page."""
    from ... import __version__

    robot, task = plan.scenario.robot, plan.scenario.task
    decisive = verdict(plan).partition(f"{plan.status.value.upper()}, ")[2]
    return PAGE.substitute(
        title=escape(f"{robot.name}: {task.name}"),
        status=escape(plan.status.value),
        colour=COLOURS[plan.status.value],
        verdict=escape(decisive),
        tables="\n".join(_tables(plan)),
        figures="\n".join(_figure(*drawing) for drawing in drawings(plan, trajectory).values()),
        files=_file("The robot's file", to_yaml(robot)) + "\n" + _file("The task", to_yaml(task)),
        version=escape(__version__),
    )


def _tables(plan: Finding) -> list[str]:
    """The sections; after the first, which tells why there is no plan, when wrench is missing."""
    told, gaps = [_table(section) for section in sections(plan)], missing(plan)
    return told if gaps is None else [told[0], _columns(gaps), *told[1:]]


def _columns(table: Table) -> str:
    """A table with a heading for each column; on a narrow screen it scrolls."""
    heads = "".join(f'<th scope="col">{escape(column)}</th>' for column in table.columns)
    rows = ["<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows]
    inner = "\n".join([f"<tr>{heads}</tr>", *rows])
    return f'<h2>{escape(table.title)}</h2>\n<div class="wide"><table class="columns">\n{inner}\n</table></div>'


def _table(section: Section) -> str:
    """One section; a fact without a name goes on with the one before it."""
    rows = [
        f'<tr{"" if name else " class=more"}><th scope="row">{escape(name)}</th><td>{escape(fact)}</td></tr>'
        for name, fact in section.facts
    ]
    return f"<h2>{escape(section.title)}</h2>\n<table>\n" + "\n".join(rows) + "\n</table>"


def _figure(caption: str, drawn: Figure) -> str:
    image = base64.b64encode(style.svg(drawn).encode()).decode()
    source = f"data:image/svg+xml;base64,{image}"
    return f'<figure><img alt="{escape(caption)}" src="{source}"><figcaption>{escape(caption)}</figcaption></figure>'


def _file(title: str, text: str) -> str:
    return f"<details><summary>{escape(title)}</summary><pre>{escape(text)}</pre></details>"
