"""The report of a plan as one HTML file: `report`'s facts as tables, figures inside, nothing to load."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...figures import page as html
from ...figures import style
from ...models.parsing import to_yaml
from .drawings import drawings
from .finding import Finding
from .report import missing, sections, verdict

if TYPE_CHECKING:
    import xarray as xr

# Told apart with any kind of colour vision, and the word stands beside them.
COLOURS = {"feasible": style.colour(0), "infeasible": style.colour(1), "not-found": style.colour(5)}


def page(plan: Finding, trajectory: xr.Dataset) -> str:
    """The whole page."""
    robot, task, status = plan.scenario.robot, plan.scenario.task, plan.status.value
    decisive = verdict(plan).partition(f"{status.upper()}, ")[2]
    pictures = [html.picture(drawing) for drawing in drawings(plan, trajectory).values()]
    files = [html.file("The robot's file", to_yaml(robot)), html.file("The task", to_yaml(task))]
    parts = [*_tables(plan), *pictures, *files]
    return html.page(f"{robot.name}: {task.name}", status, decisive, COLOURS[status], parts)


def _tables(plan: Finding) -> list[str]:
    """The sections; after the first, which tells why there is no plan, when wrench is missing."""
    told, gaps = [html.facts(*section) for section in sections(plan)], missing(plan)
    return told if gaps is None else [told[0], html.columns(*gaps), *told[1:]]
