"""The viewer and its page in headless Chromium: no errors, sliders and mouse move the platform, plans play.

Opening a page takes seconds of a processor, so one stays open on a desk and one on a phone, and shows one subject after
the other. Neither is resized then: viser's client may miss that while it replaces its panel. Screenshots are left in
pytest's temporary folder.
"""

import contextlib
import re
import threading
from http.server import ThreadingHTTPServer
from importlib.metadata import version
from urllib.parse import urlsplit

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from towline.figures.tension_colours import place, shades
from towline.models import Dynamics, load
from towline.ocp import plan
from towline.simulation import simulate
from towline.solvers import solve
from towline.statics.distribution import pose_problem
from towline.viewer import read, save_page
from towline.viewer.geometry import Geometry
from towline.viewer.posing import opening_pose
from towline.viewer.server import _viewing
from towline.viewer.snapshot import at_rest
from towline.workspace import StaticEquilibrium, sample, save

from .chromium import chromium, playwright, watched
from .viewer_pixels import Empty, cursor_column, dark_near, picture, pixels

# Software draws each frame, and would draw as many as it can on all processors.
SLOWLY = "{const next = requestAnimationFrame; window.requestAnimationFrame = f => setTimeout(() => next(f), 100)}"
DESK, PHONE = {"width": 1200, "height": 700}, {"width": 400, "height": 800}
FITS = """() => {
  const { width } = __viserMutable.canvas.style, box = document.querySelector("canvas").getBoundingClientRect();
  return Math.abs(parseFloat(width) - box.width) < 1;
}"""


@pytest.fixture(scope="module")
def browser():
    with chromium() as opened:
        yield opened


@contextlib.contextmanager
def opened(browser, url, size):
    """Open a page, which may ask this machine for something and no other; yield it, and what goes wrong in it."""
    with watched(browser, "file:", "data:", "blob:", "http://127.0.0.1:", "ws://127.0.0.1:") as (page, wrong):
        page.add_init_script(SLOWLY)
        page.set_viewport_size(size)
        page.goto(url)
        yield page, wrong


@contextlib.contextmanager
def viewing(browser, name, size):
    """Open a viewer; yield its page, and what shows another subject in it."""
    with _viewing(read(name), "127.0.0.1", 0) as (url, live), opened(browser, url, size) as (page, wrong):
        page.wait_for_selector(".towline-readout")
        page.get_by_role("alert").get_by_role("button").click()  # the hint that this machine draws in software

        def show(subject):
            page.evaluate("window.before = document.querySelector('.towline-readout')")
            live.replace(subject)
            page.wait_for_function("!before.isConnected && document.querySelector('.towline-readout')")
            return page

        yield page, show, wrong


@contextlib.contextmanager
def resized(page, width, height):
    """Give a page another size for a while."""
    before = page.viewport_size
    for size in ({"width": width, "height": height}, before):
        page.wait_for_timeout(500)
        page.set_viewport_size(size)
        page.wait_for_function(FITS)
        if size is not before:
            yield


@pytest.fixture(scope="module")
def kept_on_a_desk(browser):
    with viewing(browser, "planar-4", DESK) as kept:
        yield kept


@pytest.fixture(scope="module")
def kept_on_a_phone(browser, tmp_path_factory):
    """A phone that opens the page shows the robot at once."""
    with viewing(browser, "cogiro", PHONE) as kept:
        check_picture(kept[0], read("cogiro"), tmp_path_factory.mktemp("opened") / "phone.png")
        yield kept


@pytest.fixture
def shown(kept_on_a_desk):
    """Show a subject; the test fails if anything is wrong in the page, or if it asks another machine for something."""
    _, show, wrong = kept_on_a_desk
    yield show
    found, wrong[:] = wrong[:], []
    assert found == []


@pytest.fixture
def shown_on_a_phone(kept_on_a_phone):
    """Do so on a phone."""
    _, show, wrong = kept_on_a_phone
    yield show
    found, wrong[:] = wrong[:], []
    assert found == []


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two plans, a flight of one of them, a plan that cannot be, and a workspace."""
    place, robot = tmp_path_factory.mktemp("files"), load("wang-flying")
    line = {"kind": "line", "start": [0, 0, -1], "end": [0.05, 0, -0.9]}
    circle = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.5, "rate": 0.6}
    common = {"base": {"kind": "hold"}, "output_rate": 20}
    found = plan(robot, {"path": line, "duration": 4, **common})
    found.save(place / "line.nc")
    simulate(robot, found).save(place / "flight.nc")
    plan(robot, {"path": line | {"end": [-0.05, 0.02, -0.9]}, "duration": 3, **common}).save(place / "slow.nc")
    plan(robot, {"path": circle, **common}).save(place / "circle.nc")
    region = {"position": {"min": [-0.6, -0.6, -1.2], "max": [0.6, 0.6, 0]}}
    save(sample(robot, StaticEquilibrium(), region, samples=2000, keep="all"), place / "space.nc")
    return place


@pytest.fixture(scope="module")
def plan_file(folder):
    return folder / "line.nc"


def tensions(page):
    return [float(text.removesuffix(" N")) for text in page.locator(".towline-tension").all_inner_texts()]


def shown_time(page):
    return float(re.search(r"t = ([\d.]+) s", page.locator(".towline-readout").inner_text())[1])


def test_a_slider_moves_the_platform_and_its_tensions(shown, tmp_path):
    robot = load("wang-flying")
    page = shown(read("wang-flying"))
    at_home = solve(pose_problem(Dynamics(robot), robot.home)).tensions
    np.testing.assert_allclose(tensions(page), at_home, atol=0.0051)
    x = page.locator("input[type=text]").first  # of the first slider: the platform's x
    x.fill("0.05")
    x.press("Enter")
    playwright.expect(page.locator(".towline-readout")).to_contain_text("(0.050, 0.000, -1.000")
    moved = solve(pose_problem(Dynamics(robot), robot.home + np.array([0.05, 0, 0, 0, 0, 0]))).tensions
    np.testing.assert_allclose(tensions(page), moved, atol=0.0051)
    x.fill("0.5")
    x.press("Enter")
    playwright.expect(page.locator(".towline-readout")).to_contain_text("short by")
    page.get_by_role("button", name="Home").click()
    playwright.expect(page.locator(".towline-readout")).to_contain_text("optimal")
    np.testing.assert_allclose(tensions(page), at_home, atol=0.0051)
    page.screenshot(path=tmp_path / "robot.png")


LAID_OUT = """([height, least, below]) => {
  const [bar, panel] = ['.mantine-Slider-root', '.towline-readout'].map(
    (name) => document.querySelector(name)?.getBoundingClientRect());
  return bar && panel && bar.width > least && (bar.y > 0.9 * height || !below) && (bar.right < panel.x) === below;
}"""


def test_a_plan_plays_and_pauses(shown, plan_file, tmp_path):
    page = shown(read(str(plan_file)))
    assert shown_time(page) == 0
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("!document.querySelector('.towline-readout').innerText.includes('t = 0.00 s')")
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Play").wait_for()
    stopped = shown_time(page)
    assert 0 < stopped <= 4
    saved = xr.load_dataset(plan_file).sel(time=stopped, method="nearest")
    np.testing.assert_allclose(tensions(page), saved["tensions"], atol=0.0051)
    page.screenshot(path=tmp_path / "plan.png")
    with resized(page, 1600, 1000):
        page.wait_for_function(LAID_OUT, arg=[1000, 1000, True])


def test_on_a_phone_the_time_line_is_in_the_panel_which_scrolls(shown_on_a_phone, plan_file):
    shown_on_a_phone(read(str(plan_file))).wait_for_function(LAID_OUT, arg=[800, 60, False])


def test_a_picture_is_saved(shown, tmp_path):
    page = shown(read("caroca-pulleys"))
    pixels = np.zeros(0)
    with resized(page, 640, 480):
        for _ in range(20):  # what appears fades in: the red axis is pink at first
            with page.expect_download() as download:
                page.get_by_role("button", name="Save picture").click()
            assert download.value.suggested_filename == "caroca-pulleys.png"
            download.value.save_as(tmp_path / "saved.png")
            before, pixels = pixels, np.asarray(Image.open(tmp_path / "saved.png").convert("RGB"))
            if len(pixels) == 2 * 480 and np.array_equal(before, pixels) and (pixels.max(axis=2) < 100).sum() > 100:
                break
            if len(pixels) != 2 * 480:  # the page sends its size only with a change, which a busy browser may skip
                page.set_viewport_size({"width": 640, "height": 479})
            page.wait_for_timeout(250)
            page.set_viewport_size({"width": 640, "height": 480})
    assert pixels.shape[0] == 2 * 480
    # The handle's arrows are pink, green and light blue; edges of the red axis too, a little.
    red, green, blue = np.moveaxis(pixels.astype(int), 2, 0)
    assert ((red > 230) & (green < 170) & (blue > 120) & (blue < 200)).sum() < 30
    assert (pixels == 255).all(axis=2).mean() > 0.2  # white, not transparent, between what is drawn
    assert (pixels.max(axis=2) < 100).sum() > 100


def test_on_a_phone_the_panel_leaves_the_upper_half_free_and_folds(shown_on_a_phone, tmp_path):
    page = shown_on_a_phone(read("wang-ctmrts"))
    sheet = page.locator(".mantine-Paper-root:has(.towline-readout)").last
    box = sheet.bounding_box()
    assert box["y"] >= 0.54 * 800
    assert box["width"] >= 390
    page.get_by_text("wang-ctmrts", exact=True).first.click()
    page.wait_for_timeout(1000)
    assert sheet.bounding_box()["y"] > 700
    page.screenshot(path=tmp_path / "phone.png")
    page.get_by_text("wang-ctmrts", exact=True).first.click()
    page.wait_for_timeout(1000)
    assert sheet.bounding_box() == box


def test_the_page_opens_from_disk_and_plays(browser, plan_file, tmp_path):
    file = save_page(read(str(plan_file)), tmp_path / "line.html")
    saved = xr.load_dataset(plan_file)
    drawn = shades(place(saved["tensions"][40].to_numpy(), saved["t_min"].to_numpy(), saved["t_max"].to_numpy()))

    def cables_are_drawn(page):
        shot = picture(page, tmp_path / "page.png")
        return (np.abs(shot - drawn[0].astype(int)).max(axis=2) < 16).sum() > 200

    with opened(browser, file.as_uri(), {"width": 640, "height": 480}) as (page, wrong):
        clock = page.locator("input").first
        playwright.expect(clock).not_to_have_value("0.0")
        assert 0 < float(clock.input_value()) <= 4.1
        assert "t_max = 60 N" in page.locator(".towline-legend").inner_text()
        page.keyboard.press("Space")
        page.wait_for_timeout(500)  # the table follows the clock, which has tenths
        # Both of one moment: a busy machine may still be playing.
        time, *table = page.evaluate(
            "() => [...document.querySelectorAll('.towline-time, .towline-tension')].map((one) => one.innerText)"
        )
        listed = float(time.removeprefix("t = ").removesuffix(" s"))
        assert 0 < listed <= 4
        shown = [float(text.removesuffix(" N")) for text in table]
        np.testing.assert_allclose(shown, saved["tensions"].sel(time=listed, method="nearest"), atol=0.0051)
        for _ in range(60):  # what appears fades in
            if cables_are_drawn(page):
                break
            page.wait_for_timeout(250)
        else:
            pytest.fail(f"nothing in the picture has the colour of the first cable, {drawn[0]}")
        assert wrong == []


def check_picture(page, subject, file):
    """Check that at every corner of the platform a click would reach the scene, and that the whole robot is drawn."""
    robot = subject.robot
    pose = opening_pose(robot, Geometry(robot)) if subject.replay is None else subject.replay.at(0).pose
    points = at_rest(Dynamics(robot), Geometry(robot), pose, robot.carrier_home).points
    for _ in range(40):  # until the camera has turned, and the panel has moved
        page.wait_for_timeout(250)
        corners, anchors = (pixels(page, subject, ends) for ends in (points.attachments, points.anchors))
        drawn = dark_near(picture(page, file), anchors).mean() > 0.6  # names cover some
        at = "(corners) => corners.map(([x, y]) => document.elementFromPoint(x, y)?.tagName)"
        hit = set(page.evaluate(at, corners.tolist()))
        if drawn and hit == {"CANVAS"}:
            break
    assert drawn, f"the ends of the cables are elsewhere in {page.viewport_size}"
    assert hit == {"CANVAS"}
    assert np.ptp(anchors, axis=0).max() > 100


SUBJECTS = ["cogiro", "wang-ctmrts", "multi-quadrotor-4", "fast", "line.nc", "flight.nc", "space.nc"]


@pytest.mark.parametrize("name", SUBJECTS)
def test_the_platform_is_in_the_picture_and_not_covered(shown, folder, name, tmp_path):
    subject = read(str(folder / name) if name.endswith(".nc") else name)
    check_picture(shown(subject), subject, tmp_path / "desk.png")


@pytest.mark.parametrize("name", SUBJECTS)
def test_on_a_phone_the_platform_is_in_the_picture_and_not_covered(shown_on_a_phone, folder, name, tmp_path):
    subject = read(str(folder / name) if name.endswith(".nc") else name)
    check_picture(shown_on_a_phone(subject), subject, tmp_path / "phone.png")


def test_the_mouse_drags_the_platform_and_its_tensions_change(shown, tmp_path):
    subject = read("cogiro")
    robot = subject.robot
    page = shown(subject)
    before = tensions(page)
    page.wait_for_timeout(1500)  # what appears fades in
    reach = 0.13 * Geometry(robot).extent.size
    ends = robot.home[:3] + np.array([[0, 0, 0.9 * reach], [0, 0, 0.9 * reach + 0.8]])
    (x, y), (to_x, to_y) = pixels(page, subject, ends)
    page.mouse.move(x, y)
    page.wait_for_timeout(500)  # the handle notices the mouse when it draws
    page.mouse.down()
    page.mouse.move((x + to_x) / 2, (y + to_y) / 2, steps=4)
    page.mouse.move(to_x, to_y, steps=4)
    page.mouse.up()
    playwright.expect(page.locator(".towline-readout")).not_to_contain_text("(0.000, 0.000, 2.000")
    page.wait_for_timeout(1000)
    pose = re.search(r"\(([-\d., ]+)\) m, rad", page.locator(".towline-readout").inner_text())[1]
    moved = np.array([float(number) for number in pose.split(",")])
    np.testing.assert_allclose(np.delete(moved - robot.home, 2), 0, atol=1e-9)
    assert moved[2] == pytest.approx(robot.home[2] + 0.8, abs=0.1)
    held = solve(pose_problem(Dynamics(robot), moved)).tensions
    np.testing.assert_allclose(tensions(page), held, rtol=2e-3)  # the pose is shown in whole millimetres
    assert np.abs(np.array(tensions(page)) - before).min() > 1
    page.screenshot(path=tmp_path / "dragged.png")


def test_keys_step_and_play(shown, folder):
    page = shown(read(str(folder / "line.nc")))
    clock = page.locator(".towline-time")
    for key, at in (("l", 0.05), ("l", 0.1), ("j", 0.05), ("End", 4), ("l", 4), ("Home", 0), ("j", 0)):
        page.keyboard.press(key)
        playwright.expect(clock).to_have_text(f"t = {at:.2f} s")
    page.keyboard.press("k")
    playwright.expect(clock).not_to_have_text("t = 0.00 s")
    playwright.expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.keyboard.press("k")
    playwright.expect(page.get_by_role("button", name="Play")).to_be_visible()
    stopped = shown_time(page)
    page.wait_for_timeout(300)
    assert shown_time(page) == stopped


def test_the_time_cursor_moves_scene_and_chart_together(shown, folder, tmp_path):
    """By pixels: the platform is where the motion has it at the time of the line in the chart."""
    subject = read(str(folder / "circle.nc"))
    times = subject.replay.times
    ends = np.array([subject.replay.at(k, prove=False).points.attachments for k in range(len(times))])
    page = shown(subject)
    places = pixels(page, subject, ends.reshape(-1, 3)).reshape(*ends.shape[:2], 2)
    now, columns = page.locator("input[type=text]").first, []

    def agree(index):
        """Return whether of all instants this one fits the picture best."""
        shot = picture(page, tmp_path / "circle.png")
        share = dark_near(shot, places, 2).mean(axis=1)
        best = np.flatnonzero(share == share.max())
        if share.max() < 0.6 or np.abs(best - index).min() > 1:
            return False
        column = cursor_column(page, shot)
        if column in columns:  # the chart is drawn apart from the scene, and has not followed yet
            return False
        columns.append(column)
        return True

    instants = (0, 60, 120, 180)
    for index in instants:
        now.fill(f"{times[index]:.2f}")
        now.press("Enter")
        playwright.expect(page.locator(".towline-time")).to_have_text(f"t = {times[index]:.2f} s")
        for _ in range(40):
            if agree(index):
                break
            page.wait_for_timeout(150)
        else:
            pytest.fail(f"scene and chart do not show t = {times[index]:.2f} s")
    shares = (np.array(columns) - columns[0]) / (columns[-1] - columns[0])
    np.testing.assert_allclose(shares, np.array(instants) / instants[-1], atol=0.02)
    assert columns[-1] - columns[0] > 150


def test_two_plans_are_compared(shown, folder, tmp_path):
    page = shown(read(str(folder / "line.nc"), other=str(folder / "slow.nc")))
    page.keyboard.press("End")
    playwright.expect(page.locator(".towline-time")).to_have_text("t = 4.00 s")
    # The line with the time may be that of an instant whose table has not come yet.
    playwright.expect(page.locator(".towline-readout")).to_contain_text("platforms 0.102 m apart")
    last = xr.load_dataset(folder / "slow.nc")["tensions"][-1]
    beside = [float(text.removesuffix(" N")) for text in page.locator(".towline-other").all_inner_texts()]
    np.testing.assert_allclose(beside, last, atol=0.0051)
    page.screenshot(path=tmp_path / "compared.png")


@pytest.fixture
def foreign_page():
    """The address of an empty page that another server of this machine serves."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Empty)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


def test_a_page_of_another_site_cannot_open_the_socket(browser, shown, foreign_page):
    """The same words in the page of the viewer itself open it."""
    own = shown(read("planar-4"))
    script = f"""() => new Promise((done) => {{
        const socket = new WebSocket("ws://{urlsplit(own.url).netloc}", "viser-v{version("viser")}");
        socket.onopen = () => {{ socket.close(); done("open"); }};
        socket.onerror = () => done("refused");
    }})"""
    assert own.evaluate(script) == "open"
    other, messages = browser.new_page(), []
    other.on("console", lambda message: messages.append(message.text))
    other.goto(foreign_page)
    assert other.evaluate(script) == "refused"
    assert "403" in " ".join(messages)
    other.close()
