"""The report of a plan as one HTML file: the facts of `report` as tables, figures inside, nothing to load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...figures import page as html
from ...figures import style
from ...models.parsing import to_yaml
from ..result import PlanData
from .drawings import drawings
from .report import headline, phases_table, sections, spans_table, stages_table

if TYPE_CHECKING:
    import xarray as xr

# Distinct with any kind of colour vision; the word stands beside them.
COLOURS = {"feasible": style.colour(0), "infeasible": style.colour(1), "not-found": style.colour(5)}


def page(plan: PlanData, trajectory: xr.Dataset) -> str:
    """Return the whole page."""
    robot, task, status = plan.scenario.robot, plan.scenario.task, plan.status.value
    decisive = headline(plan).partition(f"{status.upper()}, ")[2]
    pictures = [html.picture(drawing) for drawing in drawings(plan, trajectory).values()]
    files = [
        html.file("The robot's file", to_yaml(robot)),
        html.file("The task with all keys (frame: world is {G})", to_yaml(task.in_file())),
    ]
    parts = [*_tables(plan), *pictures, *files]
    return html.page(f"{robot.name}: {task.name}", status, decisive, COLOURS[status], parts)


def _tables(plan: PlanData) -> list[str]:
    """Return the sections, with the spans without tensions after the first, which states why there is no plan."""
    tables, spans = [html.facts(*section) for section in sections(plan)], spans_table(plan)
    after_first = [] if spans is None else [html.columns(*spans)]
    last = [html.columns(*table) for table in (phases_table(plan), stages_table(plan)) if table is not None]
    return [tables[0], *after_first, *tables[1:], *last]
