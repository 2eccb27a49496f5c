"""Bodies of platforms and loads: distances by their surfaces, floors and rooms, plans around what stands between points.

What is expected comes from least squares over the corners of both bodies (`scipy.optimize.nnls`) at many instants.
"""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar, nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from towline import load
from towline.models import Robot
from towline.ocp.audits.audit import audit
from towline.ocp.planner import Planner

SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
HEAVY = 1e4  # of the rows that make shares of corners add up to one


def with_body(body, name="cogiro", **keys):
    data = load(name).model_dump()
    return Robot.model_validate(data | {"platform": data["platform"] | {"body": body}} | keys)


def random_shape(rng, size, kind, at=(0.0, 0.0, 0.0)):
    """Return a shape as a file has it, its corners and its radius."""
    at = np.array(at)
    if kind == "sphere":
        radius = size * rng.uniform(0.1, 0.5)
        return {"kind": kind, "centre": at.tolist(), "radius": radius}, at[None], radius
    if kind == "capsule":
        ends, radius = at + size * rng.uniform(-0.5, 0.5, (2, 3)), size * rng.uniform(0.02, 0.2)
        return {"kind": kind, "start": ends[0].tolist(), "end": ends[1].tolist(), "radius": radius}, ends, radius
    if kind == "box":
        half, attitude = size * rng.uniform(0.03, 0.5, 3), rng.uniform(-1.5, 1.5, 3)
        corners = at + Rotation.from_euler("xyz", attitude).apply(SIGNS * half)
        low, high = (at - half).tolist(), (at + half).tolist()
        return {"kind": kind, "min": low, "max": high, "attitude": attitude.tolist()}, corners, 0.0
    points = at + size * rng.uniform(-0.5, 0.5, (7, 3))
    return {"kind": kind, "vertices": points.tolist()}, points, 0.0


def between_hulls(first, second):
    """Return the distance of the hulls of points (k, 3) and (j, 3), and the way from the first to the second."""
    rows = np.block([[first.T, -second.T], [HEAVY * np.ones(len(first)), np.zeros(len(second))],
                     [np.zeros(len(first)), HEAVY * np.ones(len(second))]])  # fmt: skip
    shares, _ = nnls(rows, np.array([0, 0, 0, HEAVY, HEAVY]))
    mine, its = shares[: len(first)], shares[len(first) :]
    way = its @ second / its.sum() - mine @ first / mine.sum()
    return float(np.linalg.norm(way)), way


class Scene:
    """A body that moves past a place, and how near it comes, by dense evaluation."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        kinds = ("sphere", "capsule", "box", "mesh")
        fast = seed % 3 == 0  # through more than the place's size from one sample of the audit to the next
        size = rng.uniform(0.02, 0.05) if fast else rng.uniform(0.3, 1.5)
        self.body, self.corners, self.radius = random_shape(
            rng, size, kinds[seed % 4], size * rng.uniform(-0.5, 0.5, 3)
        )
        if self.body["kind"] == "mesh":
            self.radius = self.body["radius"] = size * rng.uniform(0.0, 0.1)
        ends = np.concatenate([rng.uniform(-2, 2, (2, 3)) + [0, 0, 2], rng.uniform(-0.6, 0.6, (2, 3))], axis=1)
        self.path = {"kind": "line", "start": ends[0].tolist(), "end": ends[1].tolist()}
        self.duration = rng.uniform(0.1, 0.2) if fast else rng.uniform(1.0, 3.0)
        middle = Planner(with_body(self.body), self.task([])).scenario.path
        self.at = lambda time: middle.at(np.array([time]), self.duration).pose[0]
        about = self.at(self.duration * rng.uniform(0.2, 0.8))
        beside = rng.normal(size=3)
        beside *= size * rng.uniform(0.2, 1.2) / np.linalg.norm(beside)
        centre = Rotation.from_euler("xyz", about[3:]).apply(self.corners.mean(axis=0)) + about[:3] + beside
        self.place, self.others, its = random_shape(rng, rng.uniform(0.3, 1.0) * size, kinds[(seed // 4) % 4], centre)
        self.radius += its

    def task(self, places):
        limits = {"keep_out": [{"name": "place", "cables": None} | place for place in places]}
        return {"path": self.path, "duration": self.duration, "limits": limits}

    def distance(self, time, shift=(0.0, 0.0, 0.0)):
        pose = self.at(time)
        corners = Rotation.from_euler("xyz", pose[3:]).apply(self.corners) + pose[:3]
        return between_hulls(corners, self.others + np.array(shift))

    def nearest(self, samples):
        """Return when the bodies are nearest, and their distance there, negative if they overlap at all."""
        times = np.linspace(0.0, self.duration, samples)
        values = np.array([self.distance(time)[0] for time in times])
        best = (times[values.argmin()], values.min())
        for k in np.argsort(values)[:3]:
            ends = times[max(k - 1, 0)], times[min(k + 1, samples - 1)]
            found = minimize_scalar(
                lambda time: self.distance(time)[0], bounds=ends, method="bounded", options={"xatol": 1e-12}
            )
            best = min(best, (found.x, found.fun), key=lambda pair: pair[1])
        return best[0], best[1] - self.radius

    def verdict(self, least, shift=(0.0, 0.0, 0.0)):
        """Return what the audit reports of the place, moved by a shift, with a required distance."""
        moved = {key: (np.array(self.place[key]) + shift).tolist() for key in ("centre", "start", "end", "min", "max")
                 if key in self.place}  # fmt: skip
        if "vertices" in self.place:
            moved["pose"] = [*shift, 0.0, 0.0, 0.0]
        scenario = Planner(with_body(self.body), self.task([self.place | moved | {"platform": least}])).scenario
        return [each for each in audit(scenario, None).excess if each.about == "platform's body outside place"]


def check(seed, samples=1500, near=5e-6):
    """Check the audit of a scene against the nearest approach: with a required distance just below it, and above."""
    scene = Scene(seed)
    time, apart = scene.nearest(samples)
    if apart < 2e-5:
        assert apart > -near or scene.verdict(0.0)
        return "inside"
    assert not scene.verdict(apart - near)
    found = scene.verdict(apart + near)
    assert len(found) == 1
    assert found[0].value == pytest.approx(apart, abs=near)
    # Moved to it, by a tenth of a millimetre too far, it overlaps; by as much too little it does not.
    _, way = scene.distance(time)
    direction = way / np.linalg.norm(way)
    touching = scene.verdict(0.0, -(apart + 1e-4) * direction)
    assert len(touching) == 1
    assert touching[0].value < 0
    return "outside"


@pytest.mark.parametrize("seed", range(16))
def test_no_wrong_verdict_where_a_body_touches_or_misses(seed):
    check(seed)
