"""What a plan limits beside the tensions, as curves over time with their bounds: `limited`."""

from __future__ import annotations

import numpy as np

from ...figures.limits import Limited
from ..tasks.limits import limits
from .finding import Finding

__all__ = ["limited"]


def limited(found: Finding, rows: np.ndarray) -> list[Limited]:
    """All limits of task, robot and carriers at the audit's instants `rows`; those of one name and bound together."""
    return [*_of_carriers(found, rows), *_of_tensions(found, rows), *_of_limits(found, rows)]


def _of_carriers(found: Finding, rows: np.ndarray) -> list[Limited]:
    """Speed, acceleration and tilt of the carriers that move and have such a limit."""
    seen, carriers = found.audit.carriers, found.scenario.robot.carriers
    gathered: dict[tuple[str, str, float], tuple[list[str], list[np.ndarray]]] = {}
    for index, limit in found.scenario.limits.items():
        pose, velocity, acceleration = (part[rows, index] for part in seen)
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


def _of_tensions(found: Finding, rows: np.ndarray) -> list[Limited]:
    most, seen = found.scenario.task.limits.tension_rate, found.audit
    if most is None:
        return []
    rates = np.diff(seen.tensions, axis=0) / np.diff(seen.times)[:, None]
    labels = [f"cable {i + 1}" for i in range(found.scenario.robot.m)]
    return [Limited("tension_rate", "N/s", labels, rates[np.minimum(rows, len(rates) - 1)], -most, most)]


def _of_limits(found: Finding, rows: np.ndarray) -> list[Limited]:
    every, seen = limits(found.scenario), found.audit
    if not every.all:
        return []
    bodies = [seen.motion, *(tuple(part[:, i] for part in seen.carriers) for i in range(seen.carriers.pose.shape[1]))]
    columns = [np.hstack([part[rows] for part in body]).T for body in bodies]
    values = every.function.map(len(rows))(*columns, seen.tensions[rows].T).full().T
    gathered: dict[tuple[str, str, float, float], tuple[list[str], list[np.ndarray]]] = {}
    at = 0
    for limit in every.all:
        curves = values[:, at : at + len(limit.labels)]
        at += len(limit.labels)
        low, high, unit = limit.low, limit.high, limit.unit
        if limit.cosine:
            curves, low, high = np.arccos(np.clip(curves, -1, 1)), -np.inf, float(np.arccos(limit.low))
        if low == 0.0 and limit.labels == ["platform"]:
            low = -np.inf  # of a length, which is none to speak of
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
