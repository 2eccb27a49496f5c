"""The page that computes, in headless Chromium: what it shows is what Python computes, wherever it is dragged."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from towline.errors import InputError
from towline.figures.tension_colours import shades
from towline.models import Dynamics, load
from towline.solvers import capacity_margin, solve
from towline.statics.distribution import pose_problem
from towline.viewer import read, save_page
from towline.viewer.posing import at_rest_with
from towline.viewer.subject import Subject

from .chromium import chromium, watched

ROOT = Path(__file__).parents[1]
ROBOTS = [
    "cogiro",
    "planar-4",
    "ipanema-1",
    "caroca-pulleys",
    "wang-flying-quadrotor",
    "wang-ctmrts",
    "multi-quadrotor-4",
]
SIZES = {"desk": (1600, 1000), "phone": (400, 800)}


@pytest.fixture(scope="module")
def kept_open():
    with chromium() as browser, watched(browser, "file:", "data:") as (page, wrong):
        yield page, wrong


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    return {name: save_page(read(name), folder / f"{name}.html") for name in ROBOTS}


@pytest.fixture
def opened(kept_open, files):
    """Open the page of a robot, or a file, and fail if anything is wrong in it or it asks for anything but itself."""
    page, wrong = kept_open

    def load_page(name, size="desk", after=""):
        width, height = SIZES[size]
        page.goto("about:blank")  # an address that differs only after a # would not be loaded
        page.set_viewport_size({"width": width, "height": height})
        page.goto(files.get(name, name).as_uri() + after)
        page.wait_for_function("window.towline")
        return page

    yield load_page
    found, wrong[:] = wrong[:], []
    assert found == []


def poses(robot, count, seed):
    rng = np.random.default_rng(seed)
    spread = robot.dof_mask * np.repeat([0.1 * np.linalg.norm(np.ptp(robot.home_anchors, axis=0)), 0.5], 3)
    return robot.home + spread * rng.normal(size=(count, 6))


STATUSES = {
    "cogiro": {"optimal", "infeasible"},
    "planar-4": {"optimal", "infeasible"},
    "wang-ctmrts": {"singular"},
    "multi-quadrotor-4": {"singular"},
}


@pytest.mark.parametrize("name", ROBOTS)
def test_tensions_margin_and_certificate_are_those_of_python(opened, name):
    page, robot = opened(name), load(name)
    dynamics, seen, many = Dynamics(robot), set(), poses(robot, 40, seed=5)
    shown = page.evaluate(
        "([many, carriers]) => many.map((pose) => towline.at(pose, carriers))",
        [many.tolist(), robot.carrier_home.tolist()],
    )
    for pose, got in zip(many, shown, strict=True):
        try:
            problem = pose_problem(dynamics, pose)
        except InputError:
            assert got is None
            continue
        wanted = solve(problem)
        assert got["status"] == wanted.status.value
        seen.add(got["status"])
        if wanted.tensions is not None:
            np.testing.assert_allclose(got["tensions"], wanted.tensions, rtol=1e-12, atol=1e-12 * robot.force_scale)
            margin = capacity_margin(problem).value
            if got["margin"] is not None and np.isfinite(got["margin"]):
                assert got["margin"] == pytest.approx(margin, rel=1e-9, abs=1e-9 * robot.force_scale)
        else:
            proof, expected = got["certificate"], wanted.certificate
            np.testing.assert_allclose(proof["direction"], expected.direction, atol=1e-9)
            assert proof["shortfall"] == pytest.approx(expected.shortfall, rel=1e-9)
            assert proof["demand"] - proof["support"] == pytest.approx(proof["shortfall"], rel=1e-9)
            assert proof["atMax"] == [int(i) + 1 for i in expected.at_max]
            assert proof["atMin"] == [int(i) + 1 for i in expected.at_min]
    assert seen >= STATUSES.get(name, set())


@pytest.mark.parametrize("name", ["wang-ctmrts", "multi-quadrotor-4"])
def test_the_platform_hangs_where_python_says(opened, name):
    page, robot = opened(name), load(name)
    lengths = Dynamics(robot).cable_lengths(robot.home)
    for pose in poses(robot, 8, seed=2):
        start = 0.8 * robot.home + 0.2 * pose
        got = page.evaluate(
            "([pose, carriers, lengths]) => towline.rest(pose, carriers, lengths)",
            [start.tolist(), robot.carrier_home.tolist(), lengths.tolist()],
        )
        expected = at_rest_with(robot, lengths, start, robot.carrier_home)
        np.testing.assert_allclose(got, expected, atol=1e-6 * robot.length)


@pytest.mark.parametrize("size", SIZES)
def test_a_drag_moves_the_platform_and_what_is_shown_is_its_pose(opened, size):
    page, robot = opened("cogiro", size), load("cogiro")
    assert page.evaluate("document.documentElement.scrollWidth") == SIZES[size][0]
    box = page.locator("canvas").bounding_box()
    before = page.evaluate("towline.state.pose")
    # The whole robot is in the picture.
    for point in [*robot.home_anchors.tolist(), *robot.home_attachments.tolist()]:
        spot = np.array(page.evaluate("(point) => towline.seen(point)", point))
        assert (spot > 0).all()
        assert (spot < [box["width"], box["height"]]).all()
    x, y = page.evaluate("towline.seen(towline.state.pose.slice(0, 3))")
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.down()
    page.mouse.move(box["x"] + x + 25, box["y"] + y - 10, steps=5)
    page.mouse.up()
    pose = np.array(page.evaluate("towline.state.pose"))
    assert np.linalg.norm(pose[:3] - before[:3]) > 0.1
    np.testing.assert_array_equal(pose[3:], before[3:])
    # The platform is under the pointer.
    np.testing.assert_allclose(page.evaluate("towline.seen(towline.state.pose.slice(0, 3))"), [x + 25, y - 10], atol=2)
    tensions = solve(pose_problem(Dynamics(robot), pose)).tensions
    assert [cell.split()[0] for cell in page.locator("#cables td:nth-child(2)").all_inner_texts()] == [
        f"{t:.2f}" for t in tensions
    ]
    # A link keeps the pose, to the digits it has.
    again = opened("cogiro", size, "#" + page.url.split("#")[1])
    np.testing.assert_allclose(again.evaluate("towline.state.pose"), pose, atol=1e-5)


def test_a_pose_without_tensions_says_why(opened):
    page, robot = opened("cogiro"), load("cogiro")
    pose = [robot.home[0] + 9.0, *robot.home[1:]]
    page.evaluate("([pose, carriers]) => towline.go(pose, carriers)", [pose, robot.carrier_home.tolist()])
    proof = solve(pose_problem(Dynamics(robot), pose)).certificate
    assert "No tensions inside the limits hold the platform here: short by" in page.inner_text("#verdict")
    shown = page.inner_text("#proof")
    assert all(str(int(i) + 1) in shown for i in proof.binding)
    assert page.locator("#cables td:nth-child(2)").all_inner_texts() == ["none"] * robot.m
    page.click("#home")
    assert page.inner_text("#verdict") == "Tensions inside the limits hold the platform here."


def test_a_saved_picture_is_twice_as_fine_with_verdict_and_scale(opened, tmp_path):
    page = opened("cogiro")
    with page.expect_download() as download:
        page.click("#save")
    download.value.save_as(tmp_path / "cogiro.png")
    picture, box = Image.open(tmp_path / "cogiro.png").convert("RGB"), page.locator("canvas").bounding_box()
    assert picture.size == (2 * box["width"], 2 * box["height"])
    darkest = picture.getpixel((2 * (12 + 3 * 64 + 1), picture.height - 2 * 29))
    assert darkest == pytest.approx(shades(np.array(1.0)), abs=5)
    above = np.asarray(picture)[: 2 * 24, : 2 * 300]
    assert (above.min(axis=2) < 100).sum() > 200  # the verdict


def test_cables_without_a_tension_are_grey_whatever_their_limits(opened):
    page = opened("planar-4")
    assert page.evaluate(
        "[[5, 200], [50, 50]].map(([low, high]) => shade(place(NaN, low, high)) === DATA.noTension)"
    ) == [True, True]


def test_an_instant_takes_less_than_a_frame(opened):
    page, robot = opened("cogiro"), load("cogiro")
    many = [pose.tolist() for pose in poses(robot, 200, seed=1)]
    spent = page.evaluate(
        "([many, carriers]) => { const start = performance.now(); many.forEach((pose) => towline.at(pose, carriers));"
        " return (performance.now() - start) / many.length }",
        [many, robot.carrier_home.tolist()],
    )
    assert spent < 20  # [ms], on a loaded machine; some 0.05 on a quiet one


@pytest.mark.parametrize("after", ["#nan", "#1,2,3", "#" + ",".join(["1e400"] * 6), "#</script>"])
def test_a_link_with_another_pose_opens_at_home(opened, after):
    page, robot = opened("planar-4", after=after), load("planar-4")
    assert page.evaluate("towline.state.pose") == robot.home.tolist()


@pytest.mark.parametrize(
    ("size", "force", "limits", "z"), [(1e-3, 1e-5, "mN", "0.00075 m"), (100, 1e6, "MN", "75.000 m")]
)
def test_robots_of_other_sizes_have_numbers_that_can_be_read(opened, tmp_path, size, force, limits, z):
    robot = load("planar-4")
    data = robot.model_dump(mode="json")
    data["platform"] |= {
        "mass": force * robot.platform.mass,
        "inertia": [force * size**2 * one for one in data["platform"]["inertia"]],
        "home": [size * one for one in robot.home[:3]] + [0, 0, 0],
    }
    for cable in data["cables"]:
        cable |= {name: [size * one for one in cable[name]] for name in ("anchor", "attachment")}
        cable |= {name: force * cable[name] for name in ("t_min", "t_max")}
    page = opened(save_page(Subject("sized", type(robot).model_validate(data)), tmp_path / "sized.html"))
    prefix, wanted = limits[0], solve(pose_problem(Dynamics(robot), robot.home)).tensions
    unit = {"m": 1e-3, "M": 1e6}[prefix]
    assert page.locator("#cables td:nth-child(2)").all_inner_texts() == [
        f"{force / unit * t:.2f} {limits}" for t in wanted
    ]
    assert page.inner_text("#limits") == f"limits [{limits}]"
    assert page.locator("#cables td:last-child").first.inner_text() == f"{5 * force / unit:g} to {200 * force / unit:g}"
    assert z in page.locator("output").all_inner_texts()


def test_names_from_files_stay_text(tmp_path):
    robot = load("planar-4").model_copy(update={"name": "</script><b>"})
    page = save_page(Subject("</script><b>&", robot), tmp_path / "page.html").read_text()
    assert "</script><b>" not in page
    assert "&lt;/script&gt;&lt;b&gt;&amp;" in page
    data = json.loads(page.split("const DATA = ")[1].split(";\n")[0])
    assert data["name"] == "</script><b>"


def test_the_compiled_core_is_that_of_its_sources():
    folders = ("available_wrench", "distribution", "mechanics", "numbers")
    files = [path for name in folders for path in (ROOT / "core" / name).glob("*.[ch]")]
    files += [*(ROOT / "core").glob("*.h"), ROOT / "viewer/live/robot_at_rest.c"]
    names = sorted((path.relative_to(ROOT).as_posix() for path in files), key=lambda name: (name[0] != "v", name))
    sources = hashlib.sha256(b"".join((ROOT / name).read_bytes() for name in names)).digest()
    assert sources in (ROOT / "viewer/live/robot_at_rest.wasm").read_bytes(), "run: make live"
