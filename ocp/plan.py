"""`Plan`: a planned motion and its audit, as data, dataset, file, figures, film and report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from ..base.display import Fact
from ..figures.report import Report, Reported
from ..models.robot import Robot
from ..statics.motion_result import MotionResult
from .reports.report import facts_at_once, headline, report
from .result import PlanData

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..base.netcdf import Contents


@dataclass(frozen=True, eq=False)
class Plan(PlanData, MotionResult, Reported):
    """A planned motion and its audit: `PlanData`, which can also be saved, drawn and reported."""

    def _headline(self) -> str:
        return headline(self)

    def _facts(self) -> Iterable[Fact]:
        return facts_at_once(self)

    @cached_property
    def _contents(self) -> Contents:
        from .reports.trajectory import trajectory

        return trajectory(self)

    def figures(self) -> dict[str, Figure]:
        """Draw the figures of `plot` by name: `path`, `views`, `tensions`, ...; to show in a notebook.

        Figures without content are left out, as in `plot`.
        """
        from .reports.trajectory import drawings

        return {name: drawing.figure for name, drawing in drawings(self, self.trajectory).items()}

    @property
    def _of_robot(self) -> Robot:
        return self.scenario.robot

    def _report(self) -> Report:
        from .reports.trajectory import drawings

        return report(self, lambda: drawings(self, self.trajectory).values())
