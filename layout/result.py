"""`Design`: the robot that a design found, how good it is, and why it is not better."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ..base.display import Displayed, Fact
from ..base.text import numbered, quantity, quantity_range, quantity_row
from ..figures.drawing import Drawing, Drawn
from ..figures.report import Part, Report, Reported, Section, Table
from ..figures.robot import draw
from ..models import Robot
from ..models.dynamics import dynamics_of
from ..models.parsing import to_yaml
from ..ocp.plan import Plan
from ..solvers import Certificate, solve
from ..statics.distribution import wrench_problem
from ..statics.scene import scene_at
from .impossibility import Impossibility
from .judgement import Binding, Judgement, Reasons
from .requirements import Requirements
from .room import room_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Status = Literal["feasible", "infeasible", "not-found"]
MOST_LISTED = 8


@dataclass(frozen=True, eq=False, repr=False)
class Design(Drawn, Reported, Displayed):
    """The result of `design`.

    - `robot`: the best robot found; the initial one, `before`, if the requirements are impossible.
    - `requirements`: the requirements of the design.
    - `status`: feasible if `robot` meets the requirements at the poses of the grid and of an audit, and tasks have
      plans; infeasible if `impossibility` proves that no layout inside the boxes meets the requirements; otherwise
      not-found, which proves nothing.
    - `margin`, `margin_before`: smallest capacity margin of both robots at the same poses, with moments divided by
      `before.length` [N].
    - `clearance`: smallest distance between two cables [m]; infinite for one cable.
    - `judgement`, `judgement_before`: lengths and heights of cables, distances from regions, and lowest natural
      frequency of both robots at the required and at audited poses; None if the requirements are impossible.
    - `reasons`: active constraints and the gain from relaxing them; None if the requirements are impossible.
    - `poses`, `audited`: number of pairs of pose and wrench in the requirements, and of random ones in the last audit.
    - `starts`: number of initial layouts, or of compared pairings. `stopped`: whether the search was interrupted.
    - `plans`: a plan of each task of the requirements; empty if the margin or the clearance is not as required.
    - `size`, `size_before`: with `maximise: volume`, the factor by which all edges of the given boxes can be multiplied
      so that `robot`, or `before`, still meets the requirements: 2 is 8 times the volume. `requirements` then has the
      larger boxes.
    """

    robot: Robot
    before: Robot
    requirements: Requirements
    status: Status
    margin: float
    margin_before: float
    clearance: float
    judgement: Judgement | None
    judgement_before: Judgement | None
    reasons: Reasons | None
    impossibility: Impossibility | None
    poses: int
    audited: int
    starts: int
    stopped: bool
    plans: tuple[Plan, ...] = ()
    size: float = 1.0
    size_before: float | None = None

    @property
    def feasible(self) -> bool:
        """Return whether the robot meets the requirements."""
        return self.status == "feasible"

    @property
    def certificate(self) -> Certificate | None:
        """Return the certificate that no layout meets the requirements, or None."""
        return None if self.impossibility is None else self.impossibility.certificate

    @property
    def lengths(self) -> tuple[float, float] | None:
        """Return the shortest and the longest length of a cable [m], or None if the requirements are impossible."""
        return None if self.judgement is None else self.judgement.lengths

    @property
    def cost(self) -> float | None:
        """Return the cost of cables and winches, or None without prices."""
        return self._cost_of(self.robot, self.judgement)

    @property
    def cost_before(self) -> float | None:
        """Return the cost of the initial robot's cables and winches, or None without prices."""
        return self._cost_of(self.before, self.judgement_before)

    def _cost_of(self, robot: Robot, judgement: Judgement | None) -> float | None:
        prices = self.requirements.prices
        return None if prices is None or judgement is None else prices.cost(robot, judgement.cable)

    def _summary(self) -> str:
        if self.impossibility is not None:
            return "no layout inside the boxes meets the requirements"
        where = " in these" * (self.size_before is not None)
        text = f"capacity margin{where} {quantity(self.margin, 'N')} (before {quantity(self.margin_before, 'N')})"
        if self.cost is not None and self.cost_before is not None:
            text = f"cost {quantity(self.cost)} (before {quantity(self.cost_before)}), {text}"
        if self.requirements.minimise == "t_max":
            mean, before = (quantity(robot.t_max.mean(), "N") for robot in (self.robot, self.before))
            text = f"mean t_max {mean} (before {before}), {text}"
        values = [None if found is None else found.frequency for found in (self.judgement, self.judgement_before)]
        now, before = ("" if value is None else quantity(value, "Hz") for value in values)
        frequency = f"lowest natural frequency {now} (before {before})" if now else ""
        if self.size_before is not None:
            size, before = (f"{one:.2f} times" for one in (self.size, self.size_before))
            text = f"boxes {size} as long, wide and high as required (before {before}), {text}"
        if self.requirements.maximise == "natural_frequency":
            text, frequency = f"{frequency}, {text}", ""
        text += f", {frequency}" * bool(frequency)
        if self.requirements.clearance > 0.0:
            text += f", cables {quantity(self.clearance, 'm')} apart"
        if self.requirements.cable_length is not None and self.lengths is not None:
            text += f", cable lengths {quantity_range(self.lengths, 'm')}"
        if self.judgement is not None:
            text += "".join(
                f", cables {quantity(distance, 'm')} from {name}" for name, distance in self.judgement.distances
            )
            if self.requirements.cable_floor_clearance is not None:
                text += f", no cable below z = {quantity(self.judgement.height, 'm')}"
        return text

    def _facts(self) -> list[Fact]:
        return [("poses", quantity(self.poses)), ("audited", quantity(self.audited)), ("starts", str(self.starts))]

    def _up(self) -> np.ndarray:
        return -np.array(self.before.gravity)

    def _report(self) -> Report:
        about = f"{self.before.name}, {self.requirements.name}"
        parts: list[Part] = []
        if self.impossibility is not None:
            parts += self._why_not(self.impossibility)
            return Report(about, self.status, self._summary(), parts, drawings=self._drawings)
        pairing = self.requirements.free[0].pairing
        searched = quantity(self.starts) + (" pairings" if pairing else f" start{'s' * (self.starts != 1)}")
        searched += f", {quantity(self.poses)} pair{'s' * (self.poses != 1)} of pose and wrench"
        facts = [
            ("searched", f"{searched}, audited at {quantity(self.audited)} random pair{'s' * (self.audited != 1)}")
        ]
        if self.size_before is not None:
            boxes = [each.box for each in self.requirements.require if each.box is not None]
            facts += [("box", f"from {quantity_row(box.min)} to {quantity_row(box.max)} [m]") for box in boxes]
        if self.stopped:
            unplanned = "; its tasks were not planned" * (len(self.plans) < len(self.requirements.tasks))
            facts.append(("", f"INTERRUPTED: this is the best layout so far{unplanned}"))
        facts += [("task", each.report().splitlines()[0]) for each in self.plans]
        if self.status == "not-found":
            wanted = [f"margin of {quantity(self.requirements.margin, 'N')}"]
            wanted += room_of(self.before, self.requirements).describe()
            wanted += ["feasible plan of each task"] * bool(self.requirements.tasks)
            listed, them = ", ".join(f"a {each}" for each in wanted), "it" if len(wanted) == 1 else "all of these"
            facts.append(("wanted", f"{listed}; the search does not prove that no layout has {them}"))
        if self.judgement and self.judgement.closest and self.clearance < self.requirements.clearance:
            pair, pose = self.judgement.closest
            facts.append(("too close", f"{numbered('cable', pair)} at the pose ({quantity_row(pose)}) [m, rad]"))
        why = [] if self.reasons is None else self._why(self.reasons)
        files = [("The robot's file", lambda: to_yaml(self.robot))]
        if (found := self.reasons) is not None:  # whether the layout can be improved
            state = "a local optimum: no small change improves it" if found.local_optimum else "not yet a local optimum"
            count, several = found.at_bounds or "no", found.at_bounds > 1
            bounds = (
                f"{count} free number{'s are at bounds of their ranges' if several else ' is at a bound of its range'}"
            )
            if pairing:
                state, bounds = "the best of all pairings at the poses of the grid", "all points are given"
            facts.append(("layout", f"{state}; {bounds}"))
        parts += [Section("", facts), *why]
        return Report(about, self.status, self._summary(), parts, files=files, drawings=self._drawings)

    def _why_not(self, proof: Impossibility) -> list[Part]:
        certificate = proof.certificate
        text = certificate.text(self._up())
        facts = [
            ("pose", f"({quantity_row(proof.pose)}) [m, rad]"),
            ("required wrench", f"({quantity_row(proof.wrench)}) [N, N m]"),
            ("direction", text.along),
            ("needed", text.needed),
            ("available", f"{text.available}, in the best layout inside the boxes"),
            ("short by", text.short_by),
        ]
        if certificate.at_max.size:
            cables = numbered("cable", certificate.at_max)
            idea = ("stronger cables", f"a higher t_max of {cables}, a smaller wrench, or larger boxes")
        else:
            idea = ("another pose", "or boxes of anchors farther along the direction; stronger cables do not help")
        return [Section("Why it is infeasible", facts), Section("What you can try", [idea])]

    def figures(self) -> dict[str, Figure]:
        """Draw the robot `before` and `after` the design, by these names.

        Both are at the pose that limits the margin most, or at home if there is none. If the requirements are
        impossible, only `before` is drawn, at the impossible pose.
        """
        one, still = self._limiting, np.zeros(6)
        drawn = {}
        for name, robot in {"before": self.before, "after": self.robot}.items():
            if name == "before" or not self.impossibility:
                dynamics = dynamics_of(robot)
                pose = robot.home if one is None else np.asarray(one.pose)
                wrench = dynamics.required_wrench(pose, still, still) if one is None else one.wrench
                problem = wrench_problem(robot, dynamics.wrench_matrix(pose), wrench)
                shown = scene_at(robot, pose, solve(problem).tensions, f"{self.before.name}, {name}")
                drawn[name] = draw(shown)
        return drawn

    @property
    def _limiting(self) -> Impossibility | Binding | None:
        """Return what has the pose that is impossible, or that limits the margin most."""
        return self.impossibility or next(iter(self.reasons.binding if self.reasons else ()), None)

    def _drawings(self) -> list[Drawing]:
        limiting = "at the pose that limits the margin most" if self._limiting else "at home"
        where = "at the impossible pose" if self.impossibility else limiting
        figures = reversed(self.figures().items())  # what was found comes first
        return [Drawing(f"The robot {name} the design, {where}", figure) for name, figure in figures]

    def _why(self, found: Reasons) -> list[Part]:
        falls = {"t_max": "mean t_max -", "cost": "cost -"}
        grows = "natural frequency +" if self.requirements.maximise == "natural_frequency" else "margin +"
        gain = "margin +" if found.of_margin else falls.get(str(self.requirements.minimise), grows)
        gains = [
            (one.change, f"{gain}{quantity(one.gain, one.unit, digits=3)}" if one.gain > 1e-6 else "no effect")
            for one in found.advice
        ]
        rows = [self._binding_row(one) for one in found.binding[:MOST_LISTED]]
        columns = ("share", "pose [m, rad]", "required wrench [N, N m]", "least reserve along", "limits")
        more = len(found.binding) - len(rows)
        table = Table("What binds", columns, rows, (0,))
        changes = Table("What a change would gain", ("change", "gain"), gains)
        return [changes, *[table] * bool(rows), *([f"and {more} more"] if more > 0 else [])]

    def _binding_row(self, one: Binding) -> list[str]:
        limits = [
            f"{name} of {numbered('cable', cables)}"
            for name, cables in (("t_max", one.at_max), ("t_min", one.at_min))
            if cables
        ]
        none = np.zeros(0, dtype=int)
        direction = Certificate(one.direction, 0.0, 0.0, 0.0, none, none, np.zeros(self.before.m), self.before.length)
        along = direction.text(self._up()).along.partition(";")[0]  # as certificates describe theirs
        return [f"{one.weight:.2f}", quantity_row(one.pose), quantity_row(one.wrench), along, "; ".join(limits)]

    def to_dict(self) -> dict[str, Any]:
        """Return plain lists and numbers, ready for JSON."""
        found, judged, proof = self.reasons, self.judgement, self.impossibility
        values = ("status", "feasible", "margin", "margin_before", "size", "size_before", "cost", "cost_before")
        binding = [] if found is None else [one._asdict() for one in found.binding]
        certificate = None
        if proof is not None:
            where = {"pose": proof.pose.tolist(), "wrench": proof.wrench.tolist()}
            certificate = where | proof.certificate.to_dict()
        return {
            **{name: getattr(self, name) for name in values},
            "t_max": self.robot.t_max.tolist(),
            "clearance": self.clearance,
            "cable_lengths": None if self.lengths is None else list(self.lengths),
            "cable_distances": [] if judged is None else [list(one) for one in judged.distances],
            "cable_height": None if judged is None else judged.height,
            "natural_frequency": None if judged is None else judged.frequency,
            "length": self.before.length,
            **{name: getattr(self, name) for name in ("poses", "audited", "starts", "stopped")},
            "tasks": [{"task": each.scenario.task.name, "status": each.status} for each in self.plans],
            "local_optimum": None if found is None else found.local_optimum,
            "binding": [{name: np.asarray(value).tolist() for name, value in one.items()} for one in binding],
            "advice": [] if found is None else [one._asdict() for one in found.advice],
            "certificate": certificate,
        }
