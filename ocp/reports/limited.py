"""`limited`: what a plan limits beside the tensions, as curves over time with their bounds."""

from __future__ import annotations

import numpy as np

from ...figures.limits import Limited
from ..result import Plan
from ..tasks.named_limits import named_limits

__all__ = ["limited"]


def limited(plan: Plan, rows: np.ndarray) -> list[Limited]:
    """Return the limits of task, robot and carriers at the audit's `rows`, those of one name and bound together."""
    return [*_of_carriers(plan, rows), *_of_tensions(plan, rows), *_of_limits(plan, rows)]


def _of_carriers(plan: Plan, rows: np.ndarray) -> list[Limited]:
    """Return speed, acceleration and tilt of the carriers that move and have such a limit."""
    audit, carriers = plan.audit.carriers, plan.scenario.robot.carriers
    gathered: dict[tuple[str, str, float], tuple[list[str], list[np.ndarray]]] = {}
    for index, limit in plan.scenario.limits.items():
        pose, velocity, acceleration = (part[rows, index] for part in audit)
        tilt = np.arccos(np.clip(np.cos(pose[:, 3]) * np.cos(pose[:, 4]), -1, 1))
        for name, unit, bound, values in (
            ("carrier speed", "m/s", limit.speed, np.linalg.norm(velocity[:, :3], axis=1)),
            ("carrier acceleration", "m/s^2", limit.acceleration, np.linalg.norm(acceleration[:, :3], axis=1)),
            ("carrier tilt", "rad", limit.tilt, tilt),
        ):
            if bound is not None:
                labels, curves = gathered.setdefault((name, unit, bound), ([], []))
                labels.append(carriers[index].name)
                curves.append(values)
    return [
        Limited(name, unit, labels, np.stack(curves, axis=1), -np.inf, bound)
        for (name, unit, bound), (labels, curves) in sorted(gathered.items())
    ]


def _of_tensions(plan: Plan, rows: np.ndarray) -> list[Limited]:
    limit, audit = plan.scenario.task.limits.tension_rate, plan.audit
    if limit is None:
        return []
    rates = np.diff(audit.tensions, axis=0) / np.diff(audit.times)[:, None]
    labels = [f"cable {i + 1}" for i in range(plan.scenario.robot.m)]
    return [Limited("tension_rate", "N/s", labels, rates[np.minimum(rows, len(rates) - 1)], -limit, limit)]


def _of_limits(plan: Plan, rows: np.ndarray) -> list[Limited]:
    named, audit = named_limits(plan.scenario), plan.audit
    if not named.all:
        return []
    bodies = [
        audit.motion,
        *(tuple(part[:, i] for part in audit.carriers) for i in range(audit.carriers.pose.shape[1])),
    ]
    columns = [np.hstack([part[rows] for part in body]).T for body in bodies]
    values = named.function.map(len(rows))(*columns, audit.tensions[rows].T).full().T
    gathered: dict[tuple[str, str, float, float], tuple[list[str], list[np.ndarray]]] = {}
    at = 0
    for limit in named.all:
        curves = values[:, at : at + len(limit.labels)]
        at += len(limit.labels)
        low, high, unit = limit.low, limit.high, limit.unit
        if limit.cosine:
            curves, low, high = np.arccos(np.clip(curves, -1, 1)), -np.inf, float(np.arccos(limit.low))
        if low == 0.0 and limit.labels == ["platform"]:
            low = -np.inf  # of a norm, which is never below
        for label, curve in zip(limit.labels, curves.T, strict=True):
            body, _, place = label.partition(" outside ")
            name = f"{limit.name}, {place}" if place else limit.name
            labels, mine = gathered.setdefault((name, unit, low, high), ([], []))
            labels.append(body)
            mine.append(curve)
    return [
        Limited(name, unit, labels, np.stack(mine, axis=1), low, high)
        for (name, unit, low, high), (labels, mine) in gathered.items()
    ]
