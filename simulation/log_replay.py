"""`replay`: does the model do what the robot did? A recording, repeated by the plant, with what explains the rest."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.display import Displayed, Fact
from ..base.inputs import InputError, check_ending, file_path, flag, number, one_of
from ..base.netcdf import Contents, Variable, save_netcdf
from ..base.text import counted, quantity, quantity_row
from ..control.deviation import tolerance_of
from ..estimation.logs.reading import Paths
from ..estimation.logs.recorded import read_recorded
from ..figures.drawing import Drawn
from ..figures.report import Report, Reported, Section, Table
from ..models.files import AnyRobot, as_robot
from ..models.parsing import to_yaml
from ..models.robot import Robot
from .explanations import ALONE, Explanation, Matching, fitted_again, tied
from .replayed_robot import Parameters, changed, friction_of
from .windows import Windows

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNITS = {"position": (1e3, "mm"), "rotation": (1e3, "mrad"), "tensions": (1.0, "N"), "lengths": (1e3, "mm")}
BLOCK = 4  # windows that follow each other are fitted, or validate the fit
GAIN = 0.99  # of the squared residuals of validation windows: what a fit must leave at most
DRIVES = ("lengths", "tensions", "forces")
LATEST = 0.2  # [s]
FACTORS = ("mass", "stiffness")  # relative to the file


@dataclass(frozen=True, eq=False)
class Replay(Drawn, Reported, Displayed):
    """The result of `replay`.

    Attributes:
        matching: The recording and its simulation, compared.
        found (tuple[Explanation, ...]): Share of the residuals that each parameter alone explains, largest first.
        explained: Residuals with the first of these parameters fitted; None if it does not reduce them.
        fitted: Parameters after a fit, or None.
        validation: Root mean square of the residuals of validation windows over their noise, before and after a fit, or
            None.
        tolerance: Largest position residual for a pass [m].
    """

    matching: Matching
    found: tuple[Explanation, ...]
    explained: Mapping[str, np.ndarray] | None
    fitted: Parameters | None
    validation: tuple[float, float] | None
    tolerance: float

    @property
    def windows(self) -> Windows:
        """Return the windows of the recording."""
        return self.matching.windows

    @cached_property
    def residuals(self) -> dict[str, np.ndarray]:
        """Return measured minus simulated by kind, (W, S, 3) or (W, S, m) in SI units, nan where not measured."""
        return _by_kind(self.matching)

    def rms(self) -> dict[str, float]:
        """Return the root mean square of each kind of residual, per component, without outlying windows."""
        return self._rms(self.residuals)

    def _rms(self, parts: Mapping[str, np.ndarray]) -> dict[str, float]:
        return {name: float(np.sqrt(np.nanmean(part[self.matching.kept] ** 2))) for name, part in parts.items()}

    @cached_property
    def error(self) -> float:
        """Return the 95 % quantile of the position residuals, or without positions of the lengths [m].

        Outlying windows are included. It is nan if neither positions nor lengths were compared.
        """
        parts = self.residuals
        part = parts["position"] if "position" in parts else parts.get("lengths", np.full(1, np.nan))[..., None]
        sizes = np.sqrt(np.nansum(part**2, axis=-1))[np.isfinite(part).any(axis=-1)]
        return float(np.quantile(sizes, 0.95)) if sizes.size else float("nan")

    @property
    def passed(self) -> bool:
        """Return whether 95 % of the position residuals are within the tolerance, and the log has no input error."""
        return self.error <= self.tolerance and self.windows.recorded.doubt is None

    @property
    def named(self) -> list[str]:
        """Return the parameter that explains most, and others that the recording does not distinguish from it.

        With an input error of the log there is none.
        """
        return [] if self.windows.recorded.doubt else tied(self.found)

    @property
    def notes(self) -> list[str]:
        """Return remarks, one line each, for example that a delay may be due to commands held between samples."""
        windows, noise = self.windows, self.matching.noise
        step = float(np.median(np.diff(windows.recorded.times)))
        late = [one.value for one in self.found if one.name in self.named and one.name == "delay"]
        few = len(windows.starts) <= BLOCK and any(rms > 2 * noise[name] for name, rms in self.rms().items())
        if few and not self.named and not windows.recorded.doubt:
            few_of = f"the windows are too few to name a cause: try some shorter than {windows.window:g} s"
            return [*windows.notes, few_of]
        if windows.measured_command or not late or not 0.25 * step < late[0] < 0.75 * step:
            return windows.notes
        held = "if the controller holds each command until the next, commands act half a sample late: try --delay"
        return [*windows.notes, f"{held} {step / 2:.3g}"]

    @property
    def robot(self) -> Robot:
        """Return the robot with the fitted parameters; without a fit, the robot of the file."""
        file, fitted = self.windows.recorded.robot, self.fitted
        if fitted is None:
            return file
        # Friction that drives compensate is another, and friction without a model of winches has no place in a file.
        felt = self.windows.drive == "forces"
        return changed(file, fitted if felt else fitted._replace(friction=friction_of(file)))

    @property
    def refused(self) -> str | None:
        """Return why `save_robot` writes nothing, in one line, or None."""
        if self.windows.recorded.doubt:
            return self.windows.recorded.doubt
        if self.fitted is None:
            return "no fit was asked for"
        same = to_yaml(self.robot) == to_yaml(self.windows.recorded.robot)
        few = len(self.windows.starts) <= BLOCK  # half of which hardly show how much a fitted value scatters
        advice = f", of which there are few: try a window shorter than {self.windows.window:g} s" if few else ""
        return f"no parameter of the robot's file reduces the residuals of validation windows{advice}" if same else None

    def save_robot(self, file: str | os.PathLike[str]) -> Path:
        """Write the fitted robot as a robot file atomically.

        Raises:
            InputError: If the fit does not improve validation windows, see `refused`, or the file cannot be written.
        """
        if self.refused:
            raise InputError(f"the robot is not written: {self.refused}")
        return self.robot.save(file)

    def to_dict(self) -> dict[str, Any]:
        """Return the output of `towline simulate ROBOT LOG --json`, ready for JSON."""
        windows = self.windows
        return {
            "passed": self.passed,
            "error_95": self.error,
            "drive": windows.drive,
            "commands": "measured" if windows.measured_command else "commanded",
            "windows": len(windows.starts),
            "outliers": int((~self.matching.kept).sum()),
            "residual_rms": self.rms(),
            "noise": dict(self.matching.noise),
            "explained_by": self.named,
            "explanations": [one._asdict() for one in self.found],
            "fitted": None if self.fitted is None else self.fitted._asdict(),
            "validation": self.validation,
            "notes": self.notes,
        }

    def save(self, file: str | os.PathLike[str]) -> Path:
        """Save the residuals as NetCDF (.nc) atomically.

        Raises `InputError` if the file cannot be written.
        """
        path, times = check_ending("file", file_path("file", file), ".nc"), self._times
        variables = {"time": Variable(("window", "sample"), times, {"units": "s"})}
        for name, part in self.residuals.items():
            last = "axis" if name in ("position", "rotation") else "cable"
            about = {"units": UNITS[name][1].removeprefix("m") or "m", "long_name": "measured minus simulated"}
            variables[f"{name}_residual"] = Variable(("window", "sample", last), part, about)
        attributes = {"title": self._headline(), "report": json.dumps(self.to_dict())}
        return save_netcdf(Contents(variables, {}, attributes), path)

    @property
    def _times(self) -> np.ndarray:
        return self.windows.recorded.times[self.windows.rows]

    def figures(self) -> dict[str, Figure]:
        """Draw "replay": residuals over the recording, and those after fitting the best parameter."""
        from ..figures.flight import replay as draw

        after = self.explained or {}
        by = _words(self.found[0].name) if after else ""
        return {"replay": draw(self._times, self.residuals, after, self.matching.noise, self._summary(), by)}

    def _report(self) -> Report:
        robot, times = self.windows.recorded.robot, self.windows.recorded.times
        explanations = [] if self.windows.recorded.doubt else [self._explanation_table()]
        return Report(
            about=f"{robot.name}, replay of {quantity(float(times[-1] - times[0]), 's')}",
            status="passed" if self.passed else "failed",
            summary=self._summary(),
            parts=[Section("", self._facts()), self._residual_table(), *explanations, *self.notes],
            drawings=self._drawings,
            files=[("The robot's file", lambda: to_yaml(robot))],
        )

    def _summary(self) -> str:
        rms, noise = self.rms(), self.matching.noise
        ratios = {name: rms[name] / noise[name] for name in rms}
        first, worst = next(iter(rms)), max(ratios, key=lambda name: ratios[name])
        shown = [first] if ratios[worst] < 2 * max(ratios[first], 1.0) else [first, worst]
        sizes = {name: f"{_of(name, rms[name])} rms, noise {_of(name, noise[name])}" for name in shown}
        text = "; ".join(f"{name.removesuffix('s')} residual {size}" for name, size in sizes.items())
        if self.windows.recorded.doubt:
            return f"{text}; {self.windows.recorded.doubt}"
        if self.named:
            best = self.found[0]
            verb = "explain" if best.name in ("load_cells", "anchors", "thrusts") else "explains"
            first, *others = map(_words, self.named)
            causes = " or ".join([f"{first} ({_value(best.name, best.value)})", *others])
            text += f"; {causes} {verb} {_share(best)} of the residuals"
            after = self._rms(self.explained or {})
            more = any(after[name] > 2 * noise[name] for name in after)
            return f"{text}; the remainder has other causes" if more else text
        if max(ratios.values()) > 2:
            return f"{text}; none of {', '.join(_words(one.name) for one in self.found)} explains it"
        away = self._times[~self.matching.kept]
        where = f" except for {counted(len(away), 'outlying window')} from {away[0, 0]:.4g} s on" if len(away) else ""
        return f"{text}; the model reproduces the recording{where}"

    def _facts(self) -> list[Fact]:
        windows, outliers = self.windows, int((~self.matching.kept).sum())
        kind = f"{windows.drive}, {'measured' if windows.measured_command else 'as commanded'}"
        if windows.recorded.robot.fixed_lengths is not None:
            kind = "thrusts" if windows.commanded else "motion of the carriers"
        placed = f"{len(windows.starts)} of {quantity(windows.window, 's')}, {counted(outliers, 'outlier')}"
        error = f"95 % within {_of('position', self.error)} (tolerance {_of('position', self.tolerance)})"
        facts = {"commands": kind, "windows": placed, "error": error}
        if self.fitted is not None and self.validation is not None:
            first, (before, after) = self.matching.first.parameters, self.validation
            values = [
                f"{_words(name)} {_value(name, value)}"
                for name, value in self.fitted._asdict().items()
                if value != getattr(first, name)
            ]
            change = f"residuals of validation windows {before:.3g} times their noise, {after:.3g} times after the fit"
            same = "no parameter reduces the residuals of validation windows"
            facts["fit"] = f"{', '.join(values)}; {change}" if values else same
        return list(facts.items())

    def _residual_table(self) -> Table:
        after = None if self.explained is None else self._rms(self.explained)
        rows = []
        for (name, value), noise in zip(self.rms().items(), self.matching.noise.values(), strict=True):
            fitted = [_of(name, after[name])] if after else []
            rows.append([name, _of(name, value), _of(name, noise), f"{value / noise:.2f}", *fitted])
        columns = ["", "rms", "noise", "ratio", *([f"with {_words(self.found[0].name)} fitted"] if after else [])]
        return Table("Residuals, measured minus simulated", columns, rows, (1, 2, 3, 4))

    def _explanation_table(self) -> Table:
        rows = []
        for one in self.found:
            remark = "" if one.named else "no clear reduction" if one.shown else "not determined by this recording"
            if one.name in self.named[1:]:
                remark = "not distinguishable from the first"
            sigma = ""
            if one.name in FACTORS:
                sigma = f"{max(100 * one.sigma, 0.001):.2g} %"
            elif one.name in ALONE:
                sigma = quantity(1e3 * one.sigma, "ms", 2) if one.name == "delay" else quantity(one.sigma, "N", 2)
            value = _value(one.name, one.value) + (f" +- {sigma}" if sigma else "") if one.shown else "-"
            before = _value(one.name, one.before) if sigma else "-"
            rows.append((_words(one.name), before, value, _share(one) if one.named else "-", remark))
        title, columns = "Parameters that may explain them, each fitted alone", ("", "model", "best", "explains", "")
        return Table(title, columns, rows, (1, 2, 3))


def replay(
    robot: AnyRobot,
    log: Paths,
    poses: Paths | None = None,
    fields: str | os.PathLike[str] | None = None,
    drive: str | None = None,
    delay: float = 0.0,
    window: float = 0.5,
    tolerance: float | None = None,
    fit: bool = False,
    fix: bool = False,
) -> Replay:
    """Replay a recording: simulate its commands, in windows that each start from the recorded state.

    Args:
        robot: A `Robot`, the name of one in the library, or the path of a robot file.
        log, poses, fields: As `path`, `poses` and `fields` of `read_measurements`.
        drive: Type of the commands: "lengths", "tensions", or "forces" of the winches' motors (default: recorded
            commands, otherwise measured lengths of elastic cables, otherwise measured tensions).
        delay: Known delay from a recorded command to the response of the robot [s].
        window: Duration of a window [s].
        tolerance: Largest position residual for a pass, of 95 % of the samples [m]; default: 0.05 m, or 5 % of the mean
            cable length at home if that is less.
        fit: True to fit parameters to half of the windows, and to validate them on the other half.
        fix: True to correct probable input errors of the log first (order of cables, units, conventions, frames).

    Raises:
        InputError: If an argument has a wrong value, the log cannot be read, or lacks what a replay needs.
    """
    if drive is not None:
        one_of("drive", drive, DRIVES)
    late, lasting = number("delay", delay, -LATEST, LATEST), number("window", window, 0.05, 10.0)
    fits, the_robot = flag("fit", fit), as_robot(robot)
    largest = tolerance_of(the_robot, tolerance)
    recorded = read_recorded(the_robot, log, poses, fields, flag("fix", fix))
    windows = Windows(recorded, drive, lasting)
    matching = Matching(windows, windows.usual._replace(delay=late))
    (most, match), *others = matching.explanations(matching.first, matching.kept)
    explained = None
    if most.named and not windows.recorded.doubt:
        most, again = fitted_again(windows, most, match.parameters)
        explained = _by_kind(again)
        left, whole = (_squares(parts, matching) for parts in (explained, _by_kind(matching)))
        most = most._replace(explained=max(most.explained, 1 - left / whole))
    fitted, validation = _fitted(matching, most) if fits else (None, None)
    return Replay(matching, (most, *(one for one, _ in others)), explained, fitted, validation, largest)


def _fitted(matching: Matching, most: Explanation) -> tuple[Parameters, tuple[float, float]]:
    """Fit one parameter after the other, as long as that improves windows that are not fitted.

    Nothing is fitted if the main cause has no place in the file, because a wrong parameter would be written.
    """
    number_of = np.arange(len(matching.kept))
    fits = number_of // (BLOCK if len(number_of) > BLOCK else 1) % 2 == 0
    used, others = matching.kept & fits, matching.kept & ~fits
    best, done = matching.first, set[str]()
    while used.any() and others.any() and (most.name in ALONE or not most.named):
        tried = matching.explanations(best, used)
        found = next((one for one in tried if one[0].named and one[0].name not in done), None)
        if found is None or found[0].name not in ALONE or found[1].cost[others].sum() > GAIN * best.cost[others].sum():
            break
        done.add(found[0].name)
        best = found[1]
    size = max(int(np.count_nonzero(matching.first.left[others])), 1)
    before, after = (float(np.sqrt(match.cost[others].sum() / size)) for match in (matching.first, best))
    return best.parameters, (before, after)


def _by_kind(matching: Matching) -> dict[str, np.ndarray]:
    """Return measured minus simulated by kind, (W, S, 3) or (W, S, m) in SI units, nan where not measured."""
    windows, whole = matching.windows, matching.first.drift.reshape(*matching.windows.rows.shape, -1)
    parts = zip(windows.noise.items(), np.split(whole, np.cumsum(windows.widths)[:-1], axis=-1), strict=True)
    return {name: np.where(part == 0, np.nan, part * noise) for (name, noise), part in parts}


def _squares(parts: Mapping[str, np.ndarray], matching: Matching) -> float:
    """Return the sum of squares of residuals by kind over their noise, without outlying windows."""
    noise = matching.windows.noise
    return sum(float(np.nansum((part[matching.kept] / noise[name]) ** 2)) for name, part in parts.items())


def _of(kind: str, value: float) -> str:
    scale, unit = UNITS[kind]
    return quantity(scale * value, unit, 3)


def _value(name: str, value: Any) -> str:
    if name == "tilt":
        return quantity(float(np.degrees(np.linalg.norm(value))), "deg", 3)
    if name == "com":
        return f"({quantity_row(np.multiply(value, 1e3), digits=3)}) mm from the file's"
    if name == "anchors":
        largest = np.linalg.norm(np.reshape(value, (-1, 3)), axis=1)
        return f"up to {quantity(1e3 * largest.max(), 'mm', 3)} from the file's, of cables[{largest.argmax()}]"
    if name == "cable_friction":
        largest = int(np.argmax(np.abs(value)))
        return f"up to {quantity(value[largest], 'N', 3)}, of cables[{largest}]"
    if name == "load_cells":
        gains, zeros = np.reshape(value, (2, -1))
        worst = int(np.argmax(np.abs(gains) + np.abs(zeros)))
        rest = f"{'plus' if zeros[worst] >= 0 else 'minus'} {100 * abs(zeros[worst]):.2g} % of the median tension"
        return f"the cell of cables[{worst}] reads {1 + gains[worst]:.3g} times the tension {rest}"
    if name == "thrusts":
        each = np.atleast_1d(value)
        worst = int(np.argmax(np.abs(each)))
        return f"the thrust of carriers[{worst}] is recorded as {1 + each[worst]:.3g} times the thrust"
    if name in FACTORS:
        return f"{value:.4g} times the file's"
    return quantity(1e3 * value, "ms", 3) if name == "delay" else quantity(value, "N", 3)


def _words(name: str) -> str:
    return "CoM" if name == "com" else name.replace("_", " ")


def _share(one: Explanation) -> str:
    return "over 99 %" if one.explained > 0.99 else f"{100 * one.explained:.0f} %"
