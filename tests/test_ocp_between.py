"""What the audit finds between its instants: distances and peaks by formulas and by dense sampling of their own."""

import numpy as np
import pytest

from towline.models import Robot, load
from towline.ocp.audits.audit import audit
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.scenario import MOST_SAMPLES
from towline.ocp.tasks.task import read_task

from .soak.recheck import cable_distance, least_along, point_distance

START, WAY = np.array([0.1, -0.4, 1.0]), np.array([0.5, 0.8, 0.1])
MIDDLE = START + 0.53 * WAY
TURN = [0.2, -0.3, 0.7]


def near(off):
    return (MIDDLE + np.array(off)).tolist()


SHAPES = {
    "sphere": {"centre": near([0.2, 0, 0.1]), "radius": 0.02},
    "capsule": {"start": near([0.2, 0, 0]), "end": near([0.3, 0.1, 0.4]), "radius": 0.01},
    "box": {"min": near([0.1, -0.2, 0.1]), "max": near([0.3, 0.2, 0.2]), "attitude": TURN},
}
FAST, SLOW = 0.2, 8.0  # [s]: at up to 10 m/s, or 0.2 m/s


def excesses(robot, duration, limits):
    line = {"kind": "line", "start": START.tolist(), "end": (START + WAY).tolist()}
    scenario = lay_out(robot, read_task({"path": line, "duration": duration, "limits": limits}))
    return [excess for excess in audit(scenario, None).excess if excess.limit in limits]


def least(distance):
    """The smallest value of a function of the share of the way, by sampling about it ever more finely."""
    low, high = 0.0, 1.0
    for _ in range(6):
        shares = np.linspace(low, high, 201)
        values = distance(shares)
        at = shares[values.argmin()]
        low, high = (float(np.clip(at + side * (high - low) / 100, 0, 1)) for side in (-1, 1))
    return float(values.min())


@pytest.mark.parametrize("duration", [FAST, SLOW])
@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("name", ["point-mass-3", "ipanema-1"])
def test_a_distance_that_is_a_little_too_small_between_instants_is_found(name, kind, duration):
    """By 3 um, three times the tolerance, of platform and cables; and what is as near as it may be is no excess.

    The platform does not turn, so each of its points moves on a line, on which the distance is convex.
    """
    robot, place = load(name), {"kind": kind, "name": "part", **SHAPES[kind]}
    points = np.vstack([robot.attachments, robot.platform.com])
    nearest = cable_distance(place, START + points, START + WAY + points).min()
    ends, anchors = START + robot.attachments, robot.home_anchors

    def of_cables(shares):
        at = ends + shares[:, None, None] * WAY
        return cable_distance(place, at, np.broadcast_to(anchors, at.shape)).min(axis=1)

    apart = {"platform": nearest, "cables": least(of_cables)}
    for about, distance in apart.items():
        for off, found in ((3e-6, 1), (-1e-9, 0)):
            kept = {"platform": None, "cables": None, about: max(distance + off, 0.0)}
            if distance + off > 0:
                reported = excesses(robot, duration, {"keep_out": [{**place, **kept}]})
                assert len(reported) == found
                assert all(abs(excess.value - distance) < 1e-7 for excess in reported)


def test_cables_that_come_a_little_too_near_to_each_other_are_found():
    robot = load("caroca")
    pairs = [(i, j) for i in range(robot.m) for j in range(i)]
    pairs = [
        (i, j)
        for i, j in pairs
        if not np.array_equal(robot.attachments[i], robot.attachments[j])
        and not np.array_equal(robot.home_anchors[i], robot.home_anchors[j])
    ]

    def apart(shares):
        ends, values = START + robot.attachments + shares[:, None, None] * WAY, []
        for i, j in pairs:
            along = robot.home_anchors[i] - ends[:, i]

            def from_first(points, at=ends[:, i], along=along):
                share = (((points - at) * along).sum(-1) / (along**2).sum(-1)).clip(0, 1)
                return np.linalg.norm(points - at - share[:, None] * along, axis=-1)

            values.append(least_along(from_first, ends[:, j], np.broadcast_to(robot.home_anchors[j], ends[:, j].shape)))
        return np.min(values, axis=0)

    nearest = least(apart)
    assert len(excesses(robot, FAST, {"cable_clearance": nearest + 3e-6})) == 1
    assert excesses(robot, FAST, {"cable_clearance": nearest - 1e-9}) == []


SHAKEN = {"kind": "circle", "centre": [0, 0, 1], "radius": 0.004, "rate": 31.0, "phase": 0.123}


def shaken(robot, times, load=0.0, drag=0.0, wind=0.0):
    """The rates of the cables and the tensions of a point mass on a circle, by its formula.

    With a load [kg], and in wind along x [m/s] which pushes with `drag` times its square [N s^2/m^2].
    """
    angle = SHAKEN["phase"] + SHAKEN["rate"] * times
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * SHAKEN["radius"]
    velocity = SHAKEN["rate"] * np.stack([-ring[:, 1], ring[:, 0], ring[:, 2]], axis=1)
    along = robot.home_anchors - (ring + SHAKEN["centre"])[:, None]
    u = along / np.linalg.norm(along, axis=-1, keepdims=True)
    force = (robot.platform.mass + load) * (-(SHAKEN["rate"] ** 2) * ring - np.array(robot.gravity))
    air = np.array([wind, 0.0, 0.0]) - velocity
    force[:, :2] -= drag * (air * np.abs(air))[:, :2]
    return np.abs(np.einsum("nki,ni->nk", u, velocity)), np.linalg.solve(u.swapaxes(1, 2), force[..., None])[..., 0]


@pytest.mark.parametrize(("seconds", "most"), [(0.2003, MOST_SAMPLES), (0.3337, MOST_SAMPLES), (0.3337, 33)])
def test_a_peak_between_instants_is_found(seconds, most, monkeypatch):
    """A bound that all instants of the audit keep, but not the peak between them: of a rate and of a tension.

    The last are as far apart as those of a motion of hours.
    """
    monkeypatch.setattr("towline.ocp.audits.audit.MOST_SAMPLES", most)
    robot, task = load("point-mass-3"), {"path": SHAKEN, "duration": seconds}
    instants = audit(lay_out(robot, read_task(task)), None).times
    peaks = [values.max() for values in shaken(robot, np.linspace(0, seconds, 200_001))]
    seen = [values.max() for values in shaken(robot, instants)]
    for share, found in ((0.8, True), (-0.01, False)):  # of the way from the true peak to the one at an instant
        fastest, tightest = (float(peak - share * (peak - lower)) for peak, lower in zip(peaks, seen, strict=True))
        assert not found or min(peaks[0] / fastest - 1, peaks[1] - tightest) > 2e-6
        limited = {**task, "limits": {"cable_speed": fastest}}
        assert bool(audit(lay_out(robot, read_task(limited)), None).excess) == found
        cables = [{**cable.model_dump(), "t_max": tightest} for cable in robot.cables]
        weaker = Robot.model_validate({**robot.model_dump(), "cables": cables})
        judged = audit(lay_out(weaker, read_task(task)), None)
        assert judged.passed != found
        assert (judged.certificate is not None) == found


@pytest.mark.parametrize("about", ["load", "wind"])
def test_a_peak_between_instants_with_another_load_or_wind_is_found(about):
    """As above for the heaviest load within its tolerance and the strongest wind, which the plan's tensions are not."""
    bare, seconds = load("point-mass-3"), 0.2003
    mass, aero = bare.platform.mass, {"air_density": 1.2, "drag": 1.0, "lift": 0.0, "area": 0.5}
    if about == "load":
        carried = {"mass": mass, "mass_tolerance": 0.1}
        task = {"phases": [{"name": "carry", "path": SHAKEN, "duration": seconds, "load": carried}]}
        worst = {"load": 1.1 * mass}
    else:
        task = {"path": SHAKEN, "duration": seconds, "wind": {"min": [-1.0, 0, 0], "max": [2.0, 0, 0]}}
        worst = {"drag": 0.3, "wind": 2.0}

    def weaker(tightest):
        cables = [{**cable.model_dump(), "t_max": tightest} for cable in bare.cables]
        platform = {**bare.platform.model_dump(), "aero": aero}
        robot = Robot.model_validate({**bare.model_dump(), "platform": platform, "cables": cables})
        return audit(lay_out(robot, read_task(task)), None)

    peak = shaken(bare, np.linspace(0, seconds, 200_001), **worst)[1].max()
    seen = shaken(bare, weaker(1e3).times, **worst)[1].max()
    assert peak - seen > 1e-5
    assert not weaker(peak - 0.8 * (peak - seen)).passed
    assert weaker(peak + 0.01 * (peak - seen)).passed


def test_a_dip_of_a_slow_motion_is_found(monkeypatch):
    """The required wrench is nearly constant, but cables turn, so that one tension is least between instants."""
    monkeypatch.setattr("towline.ocp.audits.audit.MOST_SAMPLES", 10)
    robot, start, way = load("point-mass-3"), np.array([-0.9, 0.35, 1.3]), np.array([1.7, 0, 0])
    line = {"kind": "line", "start": start.tolist(), "end": (start + way).tolist()}
    task = read_task({"path": line, "duration": 200, "output_rate": 0.05})
    u = robot.home_anchors - (start + np.linspace(0, 1, 20_001)[:, None] * way)[:, None]
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    weight = -robot.platform.mass * np.array(robot.gravity)
    dip = float(np.linalg.solve(u.swapaxes(1, 2), weight[:, None])[:, 0, 0].min())
    seen = float(audit(lay_out(robot, task), None).tensions[:, 0].min())
    assert seen - dip > 5e-3
    for least, passes in ((dip + 0.5 * (seen - dip), False), (dip - 1e-4, True)):
        cables = [cable.model_dump() for cable in robot.cables]
        cables[0]["t_min"] = least
        tighter = Robot.model_validate({**robot.model_dump(), "cables": cables})
        assert audit(lay_out(tighter, task), None).passed == passes


def test_a_distance_by_golden_section_is_that_of_samples():
    """The recheck's own geometry: balls, capsules and turned boxes, from points and cables."""
    rng = np.random.default_rng(3)
    shares = np.linspace(0, 1, 4001)[:, None]
    for kind, shape in SHAPES.items():
        place = {"kind": kind, **shape}
        for p, q in rng.uniform(-0.5, 1.5, (20, 2, 3)):
            sampled = point_distance(place, p + shares * (q - p)).min()
            assert sampled - 1e-3 <= cable_distance(place, p, q) <= sampled + 1e-12


def test_a_short_piece_of_a_long_motion_is_not_missed():
    """A jolt of 8 ms, from one instant of the audit to the next: only inside does it accelerate much."""
    begin = 100 + 0.01 / 3  # [s], of 250 s, of which 100 instants a second are looked at
    times = np.array([0, 50, *(begin + 0.002 * np.arange(5)), 150, 250])
    points = START + np.array([0, 0.1, 0.2, 0.2, 0.2 + 2e-5, 0.2, 0.2, 0.3, 0.4])[:, None] * [1, 0, 0]
    path = {"kind": "waypoints", "points": points.tolist(), "times": times.tolist()}
    task = {"path": path, "limits": {"platform_acceleration": 5}, "output_rate": 1}
    scenario = lay_out(load("point-mass-3"), read_task(task))
    found = [each for each in audit(scenario, None).excess if each.limit == "platform_acceleration"]
    inside = scenario.path.at(np.linspace(begin, begin + 0.008, 4001), 250.0).acceleration[:, :3]
    largest = np.linalg.norm(inside, axis=1).max()
    assert largest > 5
    assert found
    assert found[0].value > 0.9 * largest
