"""Reports name how far a motion passes from its waypoints; here it is measured on the saved motion, densely."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import load, plan, time_along
from towline.figures.style import typeset

from .told import without_offers

COGIRO = load("cogiro")
LIFT = [[-1, 0, 2], [-1, 0, 2.5], [1, 0, 2.5], [1, 0, 2]]
TURNED = [[-1, 0, 2, 0, 0, 0], [-1, 0, 2.5, 0, 0, 0.1], [1, 0, 2.5, 0.1, 0, -0.1], [1, 0, 2, 0, 0, 0]]


def path(points=LIFT, **more):
    return {"kind": "waypoints", "points": points, **more}


def seen(found, point, low=-np.inf, high=np.inf):
    """Return the smallest distance of the saved motion from a point between two times [m]."""
    motion = found.trajectory.sel(time=slice(low, high)).pose.values
    return np.linalg.norm(motion[:, :3] - point, axis=1).min()


@pytest.mark.parametrize(
    ("points", "more"),
    [
        (TURNED, {}),
        (TURNED, {"blend": 0.001}),
        (TURNED, {"times": [0, 0.6, 1.4, 2.0]}),
        (LIFT, {"dwell": [0, 0.2, 0, 0]}),
    ],
)
def test_the_distance_of_legs_is_that_of_the_motion_not_the_option(points, more):
    rate = 20_000 if "blend" in more else 5_000  # [Hz]; what passes within a millimetre is looked at more closely
    found = without_offers(plan(COGIRO, {"path": path(points, **more), "duration": 2, "output_rate": rate}))
    poses = np.array([[*point, 0, 0, 0][:6] for point in points], dtype=float)
    # It passes no other waypoint nearer than its own.
    expected = np.array([seen(found, pose[:3]) for pose in poses])
    attitudes = Rotation.from_euler("ZYX", found.trajectory.pose.values[:, 5:2:-1])
    off = [(Rotation.from_euler("ZYX", pose[5:2:-1]).inv() * attitudes).magnitude().min() for pose in poses]
    said = found.to_dict()["waypoint_distance"]
    assert said["position"]["distance"] == pytest.approx(expected.max(), abs=2e-6)
    assert said["attitude"]["angle"] == pytest.approx(max(off), abs=2e-6)
    worst = int(said["position"]["point"].removeprefix("points[").removesuffix("]"))
    assert expected[worst] == pytest.approx(expected.max(), abs=2e-6)
    at = said["position"]["at_s"]
    near = seen(found, poses[worst, :3], at - 2 / rate, at + 2 / rate)
    assert near == pytest.approx(said["position"]["distance"], abs=2e-6)
    assert 2e-4 < said["position"]["distance"] < 0.03


def test_all_reports_name_the_waypoint(tmp_path):
    found = plan(COGIRO, {"path": path(), "duration": 8})
    cut = f"passed within {1e3 * found.waypoint_distance.position.distance:.4g} mm (farthest from points["
    page = found.save_report(tmp_path / "report.html").read_text()
    assert cut in found.report()
    assert typeset(cut) in page
    assert re.search(r"tracking error +0 mm from the path", found.report())
    timing = time_along(COGIRO, {"path": path()})
    cut = f"passed within {1e3 * timing.waypoint_distance.position.distance:.4g} mm (farthest from points["
    assert cut in timing.report()
    audited = plan(COGIRO, timing.scenario.task)
    assert audited.waypoint_distance.position.distance == pytest.approx(
        timing.to_dict()["waypoint_distance"]["position"]["distance"], abs=1e-7
    )


@pytest.mark.parametrize(
    "task",
    [
        {"path": path(blend=0)},
        {"path": path(shape="spline")},
        {"path": path(), "tube": {"position": 0.05, "waypoints": "exact"}},
    ],
)
def test_a_motion_through_its_waypoints_is_said_to_pass_them_exactly(task):
    found = plan(COGIRO, {"duration": 8, **task})
    assert found.feasible
    assert "passed exactly" in found.report()
    assert found.waypoint_distance.position.distance < 1e-5


def test_a_tube_counts_as_well_as_the_blend():
    """A free tube cuts the corner by more than its path does."""
    task = {"path": path(), "tube": {"position": 0.2}, "duration": 3, "objective": {"deviation": 1, "jerk": 1}}
    task |= {"output_rate": 5000}
    found = plan(COGIRO, task)
    distances = [seen(found, point) for point in LIFT]
    assert max(distances) > 0.005
    assert found.waypoint_distance.position.distance == pytest.approx(max(distances), abs=1e-5)
    assert found.waypoint_distance.position.point == f"points[{int(np.argmax(distances))}]"


def test_a_waypoint_that_the_motion_crosses_at_another_time_is_not_passed_then():
    """The last leg goes through the corner of the first two, which rounds it."""
    crossing = [[-1, 0, 2], [0, 0, 2], [0, 1, 2], [0.5, 1, 2], [-0.5, -1, 2]]
    found = plan(COGIRO, {"path": path(crossing, blend=0.02), "duration": 8, "output_rate": 10_000})
    corner = np.array([*crossing[1], 0, 0, 0], dtype=float)
    knots = found.scenario.path.knots(8.0)
    around = seen(found, corner[:3], knots[0], knots[2])
    assert seen(found, corner[:3]) < 1e-4 < around
    distances = [seen(found, p, *knots[[max(i - 1, 0), min(i + 1, 4)]]) for i, p in enumerate(crossing)]
    assert found.waypoint_distance.position.distance == pytest.approx(max(distances), abs=1e-5)


def test_paths_inside_others_name_their_waypoints():
    first, second = path(LIFT), path([[1, 0, 2], [0, 1, 2], [-1, 0, 2.5]], blend=0.05)
    parts = [{"path": first, "duration": 4}, {"path": second, "duration": 4}]
    sequence = plan(COGIRO, {"path": {"kind": "sequence", "parts": parts}})
    phases = plan(COGIRO, {"phases": [{"name": name, **part} for name, part in zip("ab", parts, strict=True)]})
    alone = [plan(COGIRO, {"path": part["path"], "duration": 4}).waypoint_distance.position for part in parts]
    worst = int(np.argmax([nearest.distance for nearest in alone]))
    for key, found in (("parts", sequence), ("phases", phases)):
        nearest = found.waypoint_distance.position
        assert nearest.distance == pytest.approx(alone[worst].distance, abs=1e-9)
        assert nearest.point == f"{key}[{worst}].path.{alone[worst].point}"
        assert nearest.time == pytest.approx(alone[worst].time + 4 * worst, abs=1e-3)
    flown = plan(
        load("wang-flying"),
        {
            "path": path([[0, 0, -1], [0.1, 0, -1], [0.1, 0.1, -1]], frame="quad"),
            "duration": 4,
            "base": {"kind": "free"},
        },
    )
    assert 1e-4 < flown.waypoint_distance.position.distance < 2e-3  # in the frame of the quadrotor, which moves
    assert plan(COGIRO, {"path": {"kind": "rest", "pose": [0, 0, 2]}, "duration": 1}).waypoint_distance is None
