"""Turned boxes and convex meshes: distances by enumeration, files of all kinds, and a planner that goes around."""

import struct
from itertools import combinations

import casadi as ca
import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from towline.base.errors import InputError
from towline.models import load
from towline.models.parsing import to_yaml
from towline.ocp import plan, read_task
from towline.ocp.audits.audit import audit
from towline.ocp.limits.clearance import cable_outside, point_outside
from towline.ocp.reports.trajectory import outline
from towline.ocp.tasks.lay_out import lay_out
from towline.ocp.tasks.task_limits import Block, ConvexMesh

from .told import told

CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
places = arrays(np.float64, (2, 3), elements=st.floats(-3, 3).map(lambda x: round(x, 3)))


@st.composite
def bodies(draw):
    """Random hulls, of coordinates so coarse that no two of their planes are nearly the same one."""
    count = draw(st.integers(4, 30))
    points = draw(arrays(np.int64, (count, 3), elements=st.integers(-9, 9)))
    assume(np.linalg.matrix_rank(points - points[0]) == 3)
    return ConvexMesh(kind="mesh", vertices=points.tolist(), scale=0.1)


def triangles_of(points):
    return points[ConvexHull(points).simplices]


def from_triangles(triangles):
    """The least distance of the origin from triangles (n, 3, 3): from their planes where it is above them, or edges."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    least = np.full(len(a), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        share = np.clip(-(start * edge).sum(1) / (edge**2).sum(1), 0, 1)[:, None]
        least = np.minimum(least, np.linalg.norm(start + share * edge, axis=1))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = (a * normal).sum(1)
    foot = height[:, None] * normal
    same_side = [(np.cross(end - start, foot - start) * normal).sum(1) >= 0 for start, end in ((a, b), (b, c), (c, a))]
    above = np.logical_and.reduce(same_side)
    return np.where(above, np.minimum(np.abs(height), least), least).min()


def heights(points, p):
    """Return how far p is beyond the plane of each face of a hull, (n,)."""
    equations = ConvexHull(points).equations
    return equations[:, :3] @ p + equations[:, 3]


def truth(points, p, p_end):
    """The distance of a segment: that of the origin from all differences; of one that enters, by its deepest point."""
    if not np.array_equal(p, p_end):
        lines = list(zip(heights(points, p), heights(points, p_end) - heights(points, p), strict=True))
        shares = [(a - b) / (d - c) for (a, c), (b, d) in combinations(lines, 2) if abs(d - c) > 1e-12]
        shares = np.clip([0.0, 1.0, *shares], 0, 1)
        at, slope = np.array(lines).T
        deepest = (at + shares[:, None] * slope).max(axis=1).min()
    else:
        deepest = heights(points, p).max()
    if deepest <= 0:
        return deepest
    return from_triangles(triangles_of(np.vstack([points - p, points - p_end])))


@settings(max_examples=12, deadline=None)
@given(body=bodies(), ends=places)
def test_distances_from_a_mesh_are_those_of_its_triangles(body, ends):
    p, p_end = ends
    points = 0.1 * np.array(body.vertices)
    size = np.linalg.norm(np.ptp(points, axis=0)) + np.abs(ends).max()
    exact = {"abs": 1e-9 * size, "rel": 0}
    assert float(point_outside(body, ca.DM(p))) == pytest.approx(truth(points, p, p), **exact)
    assume(np.linalg.norm(p_end - p) > 0.01)
    assert float(cable_outside(body, ca.DM(p), ca.DM(p_end))) == pytest.approx(truth(points, p, p_end), **exact)


@settings(max_examples=8, deadline=None)
@given(body=bodies(), ends=places)
def test_a_program_can_follow_the_distance_from_a_mesh(body, ends):
    """Along each direction its derivative is that of differences, or lies between those on both sides of a corner."""
    x = ca.SX.sym("x", 6)
    for distance in (cable_outside(body, x[:3], x[3:]), point_outside(body, x[:3])):
        value = ca.Function("value", [x], [distance])
        derivatives = ca.Function("slope", [x], [ca.gradient(distance, x), ca.hessian(distance, x)[0]])
        at, size = ends.ravel(), 1e-6
        assume(np.linalg.norm(at[3:] - at[:3]) > 0.1)
        assume(abs(float(value(at))) > 0.02)
        slope, bend = (each.full() for each in derivatives(at))
        assert np.isfinite(bend).all()
        here = float(value(at))
        ahead = np.array([(float(value(at + h)) - here) / size for h in size * np.eye(6)])
        behind = np.array([(here - float(value(at - h))) / size for h in size * np.eye(6)])
        assert (np.minimum(ahead, behind) - 1e-3 <= slope.ravel()).all()
        assert (slope.ravel() <= np.maximum(ahead, behind) + 1e-3).all()


@settings(max_examples=10, deadline=None)
@given(ends=places, angles=arrays(np.float64, 3, elements=st.floats(-3, 3)))
def test_a_turned_box_is_the_box_of_turned_points(ends, angles):
    """And the mesh of its corners, in another pose and unit, is the same body."""
    low, high = np.array([-0.3, -0.2, -0.1]), np.array([0.5, 0.4, 0.9])
    centre, turn = (low + high) / 2, Rotation.from_euler("ZYX", angles[::-1]).as_matrix()
    turned = Block(kind="box", min=low.tolist(), max=high.tolist(), attitude=angles.tolist())
    plain = Block(kind="box", min=low.tolist(), max=high.tolist())
    mesh = ConvexMesh(
        kind="mesh", vertices=(1000 * (CUBE - 0.5) * (high - low)).tolist(), scale=1e-3, pose=[*centre, *angles]
    )
    before = [ca.DM(centre + turn.T @ (end - centre)) for end in ends]
    after = [ca.DM(end) for end in ends]
    expected = float(point_outside(plain, before[0]))
    assert float(point_outside(turned, after[0])) == pytest.approx(expected, abs=1e-9)
    assert float(point_outside(mesh, after[0])) == pytest.approx(
        expected, abs=2e-6
    )  # a box is rounded where it touches
    assume(np.linalg.norm(ends[1] - ends[0]) > 0.01)
    expected = float(cable_outside(plain, *before))
    assert float(cable_outside(turned, *after)) == pytest.approx(expected, abs=1e-9)
    assert float(cable_outside(mesh, *after)) == pytest.approx(expected, abs=2e-6)
    lines = np.vstack(outline(turned))
    np.testing.assert_allclose([float(point_outside(mesh, ca.DM(point))) for point in lines], 0.0, atol=1e-9)
    assert len(outline(mesh)) == len(outline(turned)) == 12


def binary_stl(triangles, name=b"part"):
    records = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])
    records["corners"] = np.reshape(triangles, (-1, 9))
    return name.ljust(80, b"\0") + struct.pack("<I", len(triangles)) + records.tobytes()


def text_stl(triangles):
    lines = ["solid part"]
    for corners in triangles:
        lines += ["facet normal 0 0 0", " outer loop", *(" vertex {} {} {}".format(*c) for c in corners)]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, "endsolid part"]).encode()


PRISM = np.array([[x, y, z] for x, y in ((0, 0), (600, 0), (0, 400)) for z in (0, 250)], dtype=float)  # [mm]
RAMP = {"kind": "mesh", "name": "ramp", "scale": 0.001, "pose": [0.2, 0.3, 0.1, 0.0, 0.0, 0.4]}
TASK = """
path: {kind: rest, pose: [0, 0, 1]}
limits:
  keep_out:
    - {kind: mesh, name: ramp, file: parts/ramp.stl, scale: 0.001, pose: [0.2, 0.3, 0.1, 0, 0, 0.4]}
"""


def l_shape():
    """An L, whose corners all lie on the faces of its hull, though it is not convex."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    low, high = (np.column_stack([outline, np.full(6, z)]) for z in (0.0, 1.0))
    sides = []
    for i in range(6):
        j = (i + 1) % 6
        sides += [[low[i], low[j], high[j]], [low[i], high[j], high[i]]]
    flat = [(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)]
    return np.array(sides + [level[list(corners)] for level in (low, high) for corners in flat])


def shouted_stl(triangles):
    """Text in capitals, behind a byte order mark and an empty line, as some programs write it."""
    return b"\xef\xbb\xbf\r\n" + text_stl(triangles).upper().replace(b"\n", b"\r\n")


@pytest.mark.parametrize("written", [binary_stl, text_stl, shouted_stl, lambda t: binary_stl(t, b"solid but binary")])
def test_a_mesh_of_a_file_is_that_of_its_corners(tmp_path, written):
    """And a saved task does not need the file any more."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "ramp.stl").write_bytes(written(triangles_of(PRISM)))
    (tmp_path / "task.yaml").write_text(TASK)
    task = read_task(tmp_path / "task.yaml")
    (ramp,) = task.limits.keep_out
    assert ramp.body.normals.shape == (5, 3)
    inline = ConvexMesh.model_validate({**RAMP, "vertices": PRISM.tolist()})
    for point in ([0, 0, 0], [0.35, 0.5, 0.2], [1, 1, 1]):
        assert float(point_outside(ramp, ca.DM(point))) == pytest.approx(float(point_outside(inline, ca.DM(point))))
    for file in (tmp_path / "parts" / "ramp.stl", tmp_path / "parts"):
        file.rmdir() if file.is_dir() else file.unlink()
    (tmp_path / "saved.yaml").write_text(to_yaml(task))
    assert read_task(tmp_path / "saved.yaml") == task
    assert read_task(task.model_dump(mode="json")) == task


SIGNALLING = struct.pack("<I", 0x7F800001)  # a float that is no number, and warns when it is converted


def wrong(content, message, **fields):
    return pytest.param(content, fields, message, id=message)


@pytest.mark.parametrize(
    ("content", "fields", "message"),
    [
        wrong(b"", "keep_out[0].file part.stl must be an STL file, got 0 bytes"),
        wrong(b"\x89PNG" * 10, "must be an STL file"),
        wrong(b"\x89PNG" * 100, "must be an STL file, got other content"),
        wrong(binary_stl(l_shape()), "hull of the file 'part.stl' must be true or false, got 'no'", hull="no"),
        wrong(binary_stl(triangles_of(PRISM))[:-7], "must have the 8 triangles that its header states"),
        wrong(bytes(80) + b"\xff\xff\xff\xff", "must be an STL file, got other content"),
        wrong(bytes(84), "must have triangles, got none"),
        wrong(binary_stl(np.full((4, 3, 3), np.nan)), "finite coordinates up to 1e+09, got others in triangle 1"),
        wrong(binary_stl(CUBE[[[0, 1, 2]]])[:96] + SIGNALLING * 9 + bytes(2), "got others in triangle 1"),
        wrong(text_stl(triangles_of(PRISM))[:300], "text that is cut off"),
        wrong(text_stl(triangles_of(PRISM)).replace(b"600", b"six"), "must have numbers as coordinates"),
        wrong(b"solid\nendsolid", "must have triangles, got none"),
        wrong(binary_stl(triangles_of(CUBE)), "scale must be given with the file 'part.stl'", scale=None),
        wrong(binary_stl(triangles_of(CUBE)), "vertices must be left out", vertices=CUBE.tolist()),
        wrong(binary_stl(CUBE[[[0, 1, 2], [1, 2, 3]]]), "file 'part.stl' must span a body, got 4 different points"),
        wrong(binary_stl(l_shape()), "must be convex, got a surface up to 0.000707 m inside its convex hull"),
        wrong(binary_stl(np.zeros((250_001, 3, 3))), "must have at most 250000 triangles, got 250001"),
        wrong(b"solid\n" + b"vertex 1 2 3\n" * 750_003 + b"endsolid", "at most 250000 triangles, got 250001"),
        wrong(None, "part.stl: no such file"),
        wrong(None, "keep_out[0].file"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_wrong_files_are_one_line(tmp_path, content, fields, message):
    if content is not None:
        (tmp_path / "part.stl").write_bytes(content)
    given = {"kind": "mesh", "file": "part.stl", "scale": 0.001, **fields}
    given = {name: value for name, value in given.items() if value is not None}
    words = ", ".join(f"{name}: {value}" for name, value in given.items())
    file = tmp_path / "task.yaml"
    file.write_text(f"path: {{kind: rest, pose: [0, 0, 1]}}\nlimits: {{keep_out: [{{{words}}}]}}")
    with pytest.raises(InputError) as refused:
        read_task(file)
    assert message in str(refused.value)
    assert "part.stl" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_the_hull_of_a_surface_that_is_not_convex_has_to_be_requested(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.stl").write_bytes(binary_stl(l_shape()))
    hull = ConvexMesh(kind="mesh", file="part.stl", scale=1.0, hull=True)
    assert float(point_outside(hull, ca.DM([1.25, 1.25, 0.5]))) == pytest.approx(
        -(0.5**0.5) / 2
    )  # in the corner of the L


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({}, "vertices must be four points or more, or file the name of an STL file"),
        ({"vertices": CUBE[:4].tolist()}, "vertices must span a body, got 4 different points"),
        ({"vertices": CUBE[:3].tolist()}, "vertices must span a body, got 3 different points"),
        (
            {"vertices": [[float(np.cos(a)), float(np.sin(a)), z] for a in range(300) for z in (0, 1)]},
            "at most 200 faces",
        ),
        ({"vertices": CUBE.tolist(), "scale": 0}, "scale"),
        ({"vertices": CUBE.tolist(), "verices": 0}, "verices"),
    ],
)
def test_wrong_meshes_are_one_line(fields, message):
    limits = {"keep_out": [{"kind": "mesh", **fields}]}
    with pytest.raises(InputError) as refused:
        read_task({"path": {"kind": "rest", "pose": [0, 0, 1]}, "limits": limits})
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


LINE = {
    "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.4, 1.3]},
    "duration": 1.5,
    "steps": 40,
    "tube": {"position": "free", "ends": "exact"},
    "objective": {"deviation": 1.0},
}


@pytest.mark.parametrize("kind", ["box", "mesh"])
def test_the_planner_goes_around_what_is_in_its_way(kind, tmp_path):
    """Cables and platform stay outside, by points along them; where they end inside it is proven impossible."""
    robot = load("ipanema-1")
    straight = plan(robot, LINE).audit.motion.pose[:, :3]
    turn, half, centre = [0.3, 0.2, 0.5], np.array([0.1, 0.12, 0.08]), straight[len(straight) // 2]
    shapes = {
        "box": {"min": (centre - half).tolist(), "max": (centre + half).tolist(), "attitude": turn},
        "mesh": {"vertices": ((2 * CUBE - 1) * half).tolist(), "pose": [*centre, *turn]},
    }
    place = {"kind": kind, "name": "part", **shapes[kind], "cables": None}
    R = Rotation.from_euler("ZYX", turn[::-1]).as_matrix()

    def outside(points):
        beyond = np.abs((points - centre) @ R) - half
        return np.where((beyond > 0).any(axis=-1), np.linalg.norm(np.maximum(beyond, 0), axis=-1), beyond.max(axis=-1))

    assert outside(straight).min() < -0.05
    around = plan(robot, LINE | {"limits": {"keep_out": [place]}})
    assert around.feasible, around.report()
    assert outside(around.audit.motion.pose[:, :3]).min() >= -1e-5
    around.save(tmp_path / "plan.nc")
    assert around.trajectory.attrs["task"].count("part") == 1
    at_end = LINE | {"path": LINE["path"] | {"end": centre.tolist()}, "limits": {"keep_out": [place]}}
    blocked = plan(robot, at_end)
    assert blocked.status.value == "infeasible"
    assert "inside the keep-out region 'part'" in told(blocked).splitlines()[0]


@settings(max_examples=3, deadline=None)
@given(share=st.floats(0.4, 0.6), thin=st.sampled_from([1e-4, 1e-3]))
def test_the_audit_is_not_jumped_over(share, thin):
    """At 5 m/s platform and cables pass a sheet and a wire between two of its instants: both are reported."""
    line = {"kind": "line", "start": [0, -0.3, 1], "end": [0.6, 0.3, 1.1]}
    robot, x = load("ipanema-1"), 0.6 * share
    nobody = {"platform": None, "carriers": None, "cables": None}
    sheet = {"kind": "box", "name": "sheet", "min": [x, -2, 0], "max": [x + thin, 2, 3], **nobody, "platform": 0.0}
    slower = read_task({"path": line, "duration": 0.3})
    anchors, ends = lay_out(robot, slower).dynamics.points(np.array([x, 0.6 * share - 0.3, 1 + 0.1 * share, 0, 0, 0]))
    middle = (anchors[0] + ends[0]) / 2
    across = np.cross(anchors[0] - ends[0], [0.6, 0.6, 0.1])
    across *= 0.1 / np.linalg.norm(across)
    tips = {"start": (middle - across).tolist(), "end": (middle + across).tolist(), "radius": thin / 2}
    wire = {"kind": "capsule", "name": "wire", **tips, **nobody, "cables": 0.0}
    audited = audit(
        lay_out(robot, read_task({"path": line, "duration": 0.3, "limits": {"keep_out": [sheet, wire]}})), None
    )
    about = [excess.about.split(" outside ") for excess in audited.excess if excess.limit == "keep_out"]
    assert ["platform", "sheet"] in about
    assert ["cable 1", "wire"] in about
    slow = audit(lay_out(robot, read_task({"path": line, "duration": 12, "limits": {"keep_out": [sheet, wire]}})), None)
    assert {excess.about for excess in slow.excess} >= {"platform outside sheet", "cable 1 outside wire"}


@pytest.mark.parametrize("kind", ["box", "mesh", "capsule", "sphere"])
def test_what_a_motion_passes_by_is_not_reported(kind):
    """Neither by the audit nor by its closer look, however thin it is."""
    shape = {
        "box": {"min": [0, -0.3, 1.01], "max": [0.6, 0.3, 1.0101]},
        "mesh": {"vertices": (CUBE * [0.6, 0.6, 1e-4] + [0, -0.3, 1.01]).tolist()},
        "capsule": {"start": [0, -0.3, 1.01], "end": [0.6, 0.3, 1.01], "radius": 1e-4},
        "sphere": {"centre": [0.3, 0, 1.01], "radius": 1e-4},
    }
    place = {"kind": kind, **shape[kind], "cables": None}
    robot = load("point-mass-3")
    low, high = robot.home[:3] * [1, 1, 0] + [0, -0.3, 1], robot.home[:3] * [1, 1, 0] + [0.6, 0.3, 1]
    task = {"path": {"kind": "line", "start": low.tolist(), "end": high.tolist()}, "duration": 0.3}
    scenario = lay_out(robot, read_task(task | {"limits": {"keep_out": [place]}}))
    assert [excess for excess in audit(scenario, None).excess if excess.limit == "keep_out"] == []


def test_the_planner_does_not_jump_over_a_thin_wall():
    """It starts on the side of a sheet of a millimetre and stays there, on a mesh that would step over it."""
    low, high = np.array([0.2995, -0.3, 0.0]), np.array([0.3005, 0.3, 1.6])
    wall = {"kind": "mesh", "name": "wall", "vertices": (low + CUBE * (high - low)).tolist(), "cables": None}
    task = {
        "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.1, 1.1]},
        "duration": 3,
        "steps": 24,
        "tube": {"position": "free"},
        "limits": {"keep_out": [wall]},
    }
    around = {"kind": "waypoints", "points": [[0, 0, 1], [0.3, 0.45, 1.05], [0.6, 0.1, 1.1]]}
    robot = load("ipanema-1")
    found = plan(robot, task, start=around)
    assert found.feasible, found.report()
    assert sum(stage.name.startswith("nonlinear program") for stage in found.stages) <= 2
    places = found.scenario.dynamics.points(found.audit.motion.pose)[1]
    before, after = places[:-1], places[1:]
    crossing = (before[..., 0] - 0.3) * (after[..., 0] - 0.3) <= 0
    assert crossing.any()
    for place in before[crossing]:
        assert not (low[1:] < place[1:] - 1e-4).all() or not (place[1:] + 1e-4 < high[1:]).all()


def test_a_corner_that_is_cut_between_nodes_is_kept_clear_by_the_next_program():
    """Twice the nodes alone cut it again, by a quarter as much."""
    wall = {"kind": "box", "name": "wall", "min": [0.25, -0.3, 0], "max": [0.35, 0.3, 1.6], "cables": None}
    task = {
        "path": {"kind": "line", "start": [0, 0, 1], "end": [0.6, 0.1, 1.1]},
        "duration": 1,
        "tube": {"position": "free"},
        "limits": {"keep_out": [wall]},
    }
    around = {"kind": "waypoints", "points": [[0, 0, 1], [0.3, 0.45, 1.05], [0.6, 0.1, 1.1]]}
    found = plan(load("ipanema-1"), task, start=around)
    assert found.feasible, found.report()
    audits = [stage.message for stage in found.stages if stage.name == "audit"]
    assert audits == ["1 limit exceeded", "passed"]


@pytest.mark.parametrize(
    "place",
    [
        {"kind": "sphere", "centre": [0, 0, 1], "radius": 1e-6},
        {"kind": "box", "min": [0, 0, 0], "max": [1, 1, 2e-6]},
        {"kind": "mesh", "vertices": CUBE.tolist(), "scale": 1e-300},
    ],
)
def test_what_is_thinner_than_the_rounding_of_distances_is_refused(place):
    """A platform that passed through it was feasible, since its distance was rounded to zero, or a division failed."""
    with pytest.raises(InputError, match=r"limits.keep_out\[0\] must be at least 1e-05 m thick, got "):
        read_task({"path": {"kind": "rest", "pose": [0, 0, 1]}, "limits": {"keep_out": [place]}})
