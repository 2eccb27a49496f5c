"""`Sweep`: the plans of a sweep as a table, files, a figure and a report."""

from __future__ import annotations

import csv
import io
import json
import math
import os
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...base.display import Displayed, Fact
from ...base.inputs import InputError, file_path, printable, whole_number
from ...base.netcdf import Contents, Variable, save_netcdf
from ...base.text import column, quantity
from ...base.version import __version__
from ...base.writing import check_writable, whole_file
from ...figures.drawing import Drawing
from ...figures.report import Report, Reported, Section, Table
from ...models.parsing import to_yaml
from ..plan import Plan
from ..planner import plan
from ..tasks.task import MotionStatus
from .axis import check_figure
from .cases import FAILED, Cases, Row

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

MOST_LINES = 60  # of the table in a report
SAME = 1e-3  # [N], of a margin that is as large as asked


_RESULTS = (  # name, unit and description of the results of a row
    ("status", "", "feasible, infeasible, not-found, or failed: planning raised an error"),
    ("reason", "", "reason why the plan is not feasible"),
    ("cost", "1", "objective of the task, of feasible plans"),
    ("duration", "s", "duration of the motion"),
    ("margin", "N", "smallest distance of any tension from its limits"),
    ("tension_max", "N", "largest tension"),
    ("iterations", "1", "iterations of the last run of the solver"),
    ("seconds", "s", "wall time to plan"),
)
_NUMBERS = ("cost", "duration", "margin", "tension_max")  # what a report shows of each plan


@dataclass(frozen=True)
class Sweep(Reported, Displayed):
    """The plans of one task for all combinations of some values of its fields.

    Attributes:
        cases: The combinations: robot, task and varied fields.
        rows: Results of each plan, in the order of the combinations, the last field fastest.
    """

    cases: Cases
    rows: tuple[Row, ...]

    def _headline(self) -> str:
        total = len(self.rows)
        others = [f"{quantity(count)} {status}" for status, count in self.counts.items() if status != "feasible"]
        first = f"{self.cases.title}: {quantity(self.feasible)} of {quantity(total)} plans feasible"
        return ", ".join([first, *others])

    def _facts(self) -> Iterable[Fact]:
        varied = [(axis.field.key, ", ".join(axis.texts)) for axis in self.cases.axes]
        return [(name, printable(text)) for name, text in varied + self._best()]

    @property
    def feasible(self) -> int:
        """Return the number of feasible plans."""
        return self.counts[MotionStatus.FEASIBLE]

    @property
    def counts(self) -> Counter[str]:
        """Return the number of plans with each status."""
        return Counter(row.status for row in self.rows)

    @cached_property
    def table(self) -> xr.Dataset:
        """Return the table: one dimension for each varied field, `task.margin` for `margin`; units as attributes.

        Variables: plan (its number, see `plan`), status, reason, cost, duration [s], margin [N], tension_max [N],
        iterations, seconds [s]. Missing numbers are nan.
        """
        return self._contents.dataset()

    @cached_property
    def _contents(self) -> Contents:
        cases, dims = self.cases, tuple(axis.field.name for axis in self.cases.axes)
        number = np.arange(len(cases)).reshape(cases.shape)
        variables = {"plan": Variable(dims, number, {"long_name": "number of the plan, from 0"})}
        for name, unit, about in _RESULTS:
            attributes = {"units": unit, "long_name": about} if unit else {"long_name": about}
            variables[name] = Variable(dims, self._values(name), attributes)
        coordinates = {
            axis.field.name: Variable((axis.field.name,), axis.coordinates, {"units": unit} if unit else {})
            for axis, unit in zip(cases.axes, cases.units(), strict=True)
        }
        attributes = {
            "title": f"towline sweep of {cases.title}",
            "robot": to_yaml(cases.robot),
            "task": to_yaml(cases.task.in_file()),
            "vary": json.dumps({axis.field.key: list(axis.values) for axis in cases.axes}),
            "towline": __version__,
        }
        return Contents(variables, coordinates, attributes)

    def _values(self, name: str) -> np.ndarray:
        """Return one result of all plans, by the values of the varied fields."""
        values = [getattr(row, name) for row in self.rows]
        return np.array(values).reshape(self.cases.shape)

    def plan(self, index: int) -> Plan:
        """Recompute plan `index` (from 0) to get its full result.

        Raises `InputError` if there is no such plan, or planning raises an error again.
        """
        return plan(*self.cases.case(whole_number("index", index, 0, len(self.rows) - 1)))

    def save(self, file: str | os.PathLike[str]) -> tuple[Path, Path]:
        """Save the table as NetCDF, and as CSV with the suffix .csv; return both paths.

        Raises:
            InputError: If a file cannot be written, or `file` ends in .csv (reserved for the second file).
        """
        path = file_path("file", file)
        beside = path.with_suffix(".csv")
        if beside == path:
            raise InputError(f"file must be a NetCDF file (.nc), got {path}")
        check_writable(beside)
        save_netcdf(self._contents, path)
        with whole_file(beside) as temporary:
            temporary.write_text(self._csv(), encoding="utf-8")
        return path, beside

    def _csv(self) -> str:
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        units = [(axis.field.name, unit) for axis, unit in zip(self.cases.axes, self.cases.units(), strict=True)]
        units += [(name, "" if unit == "1" else unit) for name, unit, _ in _RESULTS]
        writer.writerow(["plan", *(f"{name} [{unit}]" if unit else name for name, unit in units)])
        for number, row in enumerate(self.rows):
            cells = ["" if isinstance(value, float) and math.isnan(value) else value for value in row]
            writer.writerow([number, *(axis.labels[index] for axis, index in self.cases.places(number)), *cells])
        return stream.getvalue()

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `towline plan --vary --json`, ready for JSON; missing numbers are None."""

        def existing(value: Any) -> Any:
            return None if isinstance(value, float) and math.isnan(value) else value

        rows = []
        for number, row in enumerate(self.rows):
            varied = {axis.field.key: axis.values[index] for axis, index in self.cases.places(number)}
            results = {name: existing(value) for name, value in row._asdict().items()}
            rows.append({"plan": number, "varied": varied, **results})
        every = [*(str(status) for status in MotionStatus), FAILED]
        return {
            "plans": len(rows),
            "feasible": self.feasible,
            "counts": {status: self.counts[status] for status in every},
            "vary": {axis.field.key: list(axis.values) for axis in self.cases.axes},
            "rows": rows,
        }

    def figure(self) -> Figure:
        """Draw cost, margin and, unless it is varied, duration over the varied fields.

        One field: curves. Two: maps. Three: maps for each value of the third. Plans that are not feasible are marked.

        Raises `InputError` if there are more than three fields, or more than six values of the third.
        """
        from ...figures.sweep import Axis, sweep

        check_figure(self.cases.axes)
        axes = []
        for axis, unit in zip(self.cases.axes, self.cases.units(), strict=True):
            label = f"{axis.field.key} [{unit}]" if unit else axis.field.key
            axes.append(Axis(label, axis.coordinates.tolist()))
        feasible = self._values("status") == MotionStatus.FEASIBLE
        quantities = {}
        for name, unit, _ in _RESULTS:
            values = np.where(feasible, self._values(name), np.nan) if name in ("cost", "margin", "duration") else None
            if values is not None and not (name != "cost" and _is_known(self.cases, name, values)):
                title = "tension margin" if name == "margin" else name  # the task's margin may be a varied field
                quantities[title if unit == "1" else f"{title} [{unit}]"] = values
        return sweep(axes, self._values("status"), quantities, [name for name in quantities if "margin" not in name])

    def _report(self) -> Report:
        about, _, summary = self._headline().partition(": ")
        tables = [self._table()] if len(self.rows) <= MOST_LINES else []
        best = [Section("", self._best())] if self._best() else []
        return Report(about, "", summary, [*best, *tables], self._drawings)

    def _drawings(self) -> list[Drawing]:
        with suppress(InputError):  # too many fields for a figure
            return [Drawing("Results by the varied fields", self.figure())]
        return []

    def _best(self) -> list[tuple[str, str]]:
        """Return which feasible plans have the lowest cost, the shortest duration and the largest margin."""
        known = [number for number, row in enumerate(self.rows) if row.status == MotionStatus.FEASIBLE]
        lines = []
        for title, name, unit, sign in (
            ("lowest cost", "cost", "", 1),
            ("shortest", "duration", "s", 1),
            ("largest margin", "margin", "N", -1),
        ):
            values = {number: getattr(self.rows[number], name) for number in known}
            if len(set(values.values())) > 1:
                best = min(known, key=lambda number: sign * values[number])
                lines.append((title, f"{quantity(values[best], unit)} with {self.cases.described(best)}"))
        return lines

    def _table(self) -> Table:
        units = {name: unit for name, unit, _ in _RESULTS}
        heads = [axis.field.key for axis in self.cases.axes]
        texts = [[axis.texts[index] for axis, index in self.cases.places(number)] for number in range(len(self.rows))]
        columns = [list(of_axis) for of_axis in zip(*texts, strict=True)]
        columns.append([row.status for row in self.rows])
        columns += [column([getattr(row, name) for row in self.rows]) for name in _NUMBERS]
        ends = ["reason"] * any(row.reason for row in self.rows)
        columns += [[row.reason for row in self.rows] for _ in ends]
        named = [name if units[name] == "1" else f"{name} [{units[name]}]" for name in _NUMBERS]
        named = [name.replace("tension_max", "largest tension") for name in named]
        numeric = [k for k, axis in enumerate(self.cases.axes) if axis.numeric]
        numeric += range(len(heads) + 1, len(heads) + 1 + len(_NUMBERS))
        return Table("", [*heads, "status", *named, *ends], list(zip(*columns, strict=True)), numeric)


def _is_known(cases: Cases, name: str, values: np.ndarray) -> bool:
    """Return whether the values of feasible plans are those that were varied, or durations that are all the same."""
    known = np.isfinite(values)
    varied = next((axis for axis in cases.axes if axis.field.key == name and axis.numeric), None)
    if varied is not None:
        shape = [1] * values.ndim
        shape[cases.axes.index(varied)] = -1
        apart = np.abs(values - np.asarray(varied.values, dtype=float).reshape(shape))[known]
        return name == "duration" or bool(known.any() and (apart < SAME).all())
    return name == "duration" and (not known.any() or np.ptp(values[known]) == 0)
