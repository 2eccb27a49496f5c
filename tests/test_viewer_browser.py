"""The viewer and its page in headless Chromium: no errors, sliders and mouse move the platform, plans play.

Screenshots are left in pytest's temporary folder.
"""

import re
import threading
from http.server import ThreadingHTTPServer
from importlib.metadata import version
from pathlib import Path
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
from towline.viewer import read, save_page, serve
from towline.viewer.geometry import Geometry
from towline.viewer.posing import opening_pose
from towline.viewer.snapshot import at_rest
from towline.workspace import StaticEquilibrium, sample, save

from .chromium import PATIENCE, chromium, playwright
from .viewer_pixels import Empty, cursor_column, dark_near, picture, pixels

# Software draws each frame, and would draw as many as it can on all processors.
SLOWLY = "{const next = requestAnimationFrame; window.requestAnimationFrame = f => setTimeout(() => next(f), 50)}"


@pytest.fixture(scope="module")
def browser():
    with chromium() as opened:
        yield opened


@pytest.fixture
def page(browser):
    """A page that fails the test if anything is wrong in it, or if it asks another machine for something."""
    opened = browser.new_page(viewport={"width": 640, "height": 480})
    opened.add_init_script(SLOWLY)
    wrong = []
    opened.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    local = ("file:", "data:", "blob:", "http://127.0.0.1:", "ws://127.0.0.1:")
    opened.on("request", lambda asked: None if asked.url.startswith(local) else wrong.append(asked.url))
    opened.set_default_timeout(PATIENCE)
    yield opened
    opened.close()
    assert wrong == []


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


def open_viewer(page, url, width, height):
    """Open a viewer, and close its hint that this machine draws in software."""
    page.set_viewport_size({"width": width, "height": height})
    page.goto(url)
    page.wait_for_selector(".towline-readout")
    page.get_by_role("alert").get_by_role("button").click()


def test_a_slider_moves_the_platform_and_its_tensions(page, tmp_path):
    robot = load("wang-flying")
    with serve(read("wang-flying"), port=0) as url:
        page.goto(url)
        page.wait_for_selector(".towline-readout")
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


def test_a_plan_plays_and_pauses(page, plan_file, tmp_path):
    with serve(read(str(plan_file)), port=0) as url:
        page.goto(url)
        page.wait_for_selector(".towline-readout")
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
        for width, height, least in ((1600, 1000, 1000), (400, 800, 60)):  # on a phone in the panel, which scrolls
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_function(LAID_OUT, arg=[height, least, width > 1000])


def test_a_picture_is_saved(page, tmp_path):
    with serve(read("caroca-pulleys"), port=0) as url:
        page.goto(url)
        page.wait_for_selector(".towline-readout")
        for _ in range(20):  # what appears fades in
            with page.expect_download() as download:
                page.get_by_role("button", name="Save picture").click()
            assert download.value.suggested_filename == "caroca-pulleys.png"
            download.value.save_as(tmp_path / "saved.png")
            pixels = np.asarray(Image.open(tmp_path / "saved.png").convert("RGB"))
            if (pixels.max(axis=2) < 100).sum() > 100:
                break
            page.wait_for_timeout(250)
    assert pixels.shape[0] == 2 * 480
    # The handle's arrows are pink, green and light blue; edges of the red axis too, a little.
    red, green, blue = np.moveaxis(pixels.astype(int), 2, 0)
    assert ((red > 230) & (green < 170) & (blue > 120) & (blue < 200)).sum() < 30
    assert (pixels == 255).all(axis=2).mean() > 0.2  # white, not transparent, between what is drawn
    assert (pixels.max(axis=2) < 100).sum() > 100


def test_on_a_phone_the_panel_leaves_the_upper_half_free_and_folds(page, tmp_path):
    page.set_viewport_size({"width": 400, "height": 800})
    with serve(read("wang-ctmrts"), port=0) as url:
        page.goto(url)
        page.wait_for_selector(".towline-readout")
        sheet = page.locator(".mantine-Paper-root:has(.towline-readout)").last
        box = sheet.bounding_box()
        assert box["y"] >= 0.54 * 800
        assert box["width"] >= 390
        page.get_by_text("wang-ctmrts", exact=True).first.click()
        page.wait_for_timeout(1000)
        assert sheet.bounding_box()["y"] > 700
        page.screenshot(path=tmp_path / "phone.png")


def test_the_page_opens_from_disk_and_plays(page, plan_file, tmp_path):
    file = save_page(read(str(plan_file)), tmp_path / "line.html")
    page.goto(Path(file).as_uri())
    clock = page.locator("input").first
    playwright.expect(clock).not_to_have_value("0.0")
    assert 0 < float(clock.input_value()) <= 4.1
    assert "t_max = 60 N" in page.locator(".towline-legend").inner_text()
    page.keyboard.press("Space")
    page.wait_for_timeout(200)  # the table follows the clock, which has tenths
    saved = xr.load_dataset(plan_file)
    listed = float(page.locator(".towline-time").inner_text().removeprefix("t = ").removesuffix(" s"))
    assert 0 < listed <= 4
    np.testing.assert_allclose(tensions(page), saved["tensions"].sel(time=listed, method="nearest"), atol=0.0051)
    drawn = shades(place(saved["tensions"][40].to_numpy(), saved["t_min"].to_numpy(), saved["t_max"].to_numpy()))

    def cables_are_drawn():
        shot = picture(page, tmp_path / "page.png")
        return (np.abs(shot - drawn[0].astype(int)).max(axis=2) < 16).sum() > 200

    for _ in range(60):  # what appears fades in
        if cables_are_drawn():
            return
        page.wait_for_timeout(250)
    pytest.fail(f"nothing in the picture has the colour of the first cable, {drawn[0]}")


@pytest.mark.parametrize(
    "name", ["cogiro", "wang-ctmrts", "multi-quadrotor-4", "fast", "line.nc", "flight.nc", "space.nc"]
)
def test_the_platform_is_in_the_picture_and_not_covered(page, folder, name, tmp_path):
    """On a desk and on a phone: at every corner of the platform a click would reach the scene."""
    subject = read(str(folder / name) if name.endswith(".nc") else name)
    robot = subject.robot
    with serve(subject, port=0) as url:
        open_viewer(page, url, 1200, 750)
        pose = opening_pose(robot, Geometry(robot)) if subject.replay is None else subject.replay.at(0).pose
        points = at_rest(Dynamics(robot), Geometry(robot), pose, robot.carrier_home).points
        for width, height in ((1200, 750), (400, 800)):
            page.set_viewport_size({"width": width, "height": height})
            for _ in range(40):  # until the camera has turned, and the panel has moved
                page.wait_for_timeout(250)
                corners, anchors = (pixels(page, subject, ends) for ends in (points.attachments, points.anchors))
                shot = picture(page, tmp_path / f"{width}.png")
                drawn = dark_near(shot, anchors).mean() > 0.6  # names cover some
                at = "([x, y]) => document.elementFromPoint(x, y)?.tagName"
                hit = [page.evaluate(at, corner) for corner in corners.tolist()]
                if drawn and set(hit) == {"CANVAS"}:
                    break
            assert drawn, f"the ends of the cables are elsewhere in {width} x {height}"
            assert set(hit) == {"CANVAS"}
            assert np.ptp(anchors, axis=0).max() > 100


def test_the_mouse_drags_the_platform_and_its_tensions_change(page, tmp_path):
    subject = read("cogiro")
    robot = subject.robot
    with serve(subject, port=0) as url:
        open_viewer(page, url, 1200, 700)
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


def test_keys_step_and_play(page, folder):
    with serve(read(str(folder / "line.nc")), port=0) as url:
        open_viewer(page, url, 640, 480)
        clock = page.locator(".towline-time")
        for key, shown in (("l", 0.05), ("l", 0.1), ("j", 0.05), ("End", 4), ("l", 4), ("Home", 0), ("j", 0)):
            page.keyboard.press(key)
            playwright.expect(clock).to_have_text(f"t = {shown:.2f} s")
        page.keyboard.press("k")
        playwright.expect(clock).not_to_have_text("t = 0.00 s")
        playwright.expect(page.get_by_role("button", name="Pause")).to_be_visible()
        page.keyboard.press("k")
        playwright.expect(page.get_by_role("button", name="Play")).to_be_visible()
        stopped = shown_time(page)
        page.wait_for_timeout(300)
        assert shown_time(page) == stopped


def test_the_time_cursor_moves_scene_and_chart_together(page, folder, tmp_path):
    """By pixels: the platform is where the motion has it at the time of the line in the chart."""
    subject = read(str(folder / "circle.nc"))
    times = subject.replay.times
    ends = np.array([subject.replay.at(k, prove=False).points.attachments for k in range(len(times))])
    with serve(subject, port=0) as url:
        open_viewer(page, url, 1200, 700)
        places = pixels(page, subject, ends.reshape(-1, 3)).reshape(*ends.shape[:2], 2)
        now, columns = page.locator("input[type=text]").first, []

        def agree(index):
            """Return whether of all instants this one fits the picture best."""
            shot = picture(page, tmp_path / "circle.png")
            share = dark_near(shot, places, 2).mean(axis=1)
            best = np.flatnonzero(share == share.max())
            if share.max() < 0.6 or np.abs(best - index).min() > 1:
                return False
            columns.append(cursor_column(page, shot))
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
                pytest.fail(f"the scene does not show t = {times[index]:.2f} s")
        shares = (np.array(columns) - columns[0]) / (columns[-1] - columns[0])
        np.testing.assert_allclose(shares, np.array(instants) / instants[-1], atol=0.02)
        assert columns[-1] - columns[0] > 150


def test_two_plans_are_compared(page, folder, tmp_path):
    with serve(read(str(folder / "line.nc"), other=str(folder / "slow.nc")), port=0) as url:
        open_viewer(page, url, 1200, 700)
        page.keyboard.press("End")
        playwright.expect(page.locator(".towline-time")).to_have_text("t = 4.00 s")
        last = xr.load_dataset(folder / "slow.nc")["tensions"][-1]
        beside = [float(text.removesuffix(" N")) for text in page.locator(".towline-other").all_inner_texts()]
        np.testing.assert_allclose(beside, last, atol=0.0051)
        playwright.expect(page.locator(".towline-readout")).to_contain_text("platforms 0.102 m apart")
        page.screenshot(path=tmp_path / "compared.png")


@pytest.fixture
def foreign_page():
    """The address of an empty page that another server of this machine serves."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), Empty)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


def test_a_page_of_another_site_cannot_open_the_socket(browser, foreign_page):
    """The same words in the page of the viewer itself open it."""
    with serve(read("planar-4"), port=0) as url:
        socket = f"ws://{urlsplit(url).netloc}"
        script = f"""() => new Promise((done) => {{
            const socket = new WebSocket("{socket}", "viser-v{version("viser")}");
            socket.onopen = () => done("open");
            socket.onerror = () => done("refused");
        }})"""
        told = {}
        for name, address in (("own", url), ("other", foreign_page)):
            page, messages = browser.new_page(), []
            page.on("console", lambda message, to=messages: to.append(message.text))
            page.goto(address)
            told[name] = page.evaluate(script), " ".join(messages)
            page.close()
        assert told["own"][0] == "open"
        assert told["other"][0] == "refused"
        assert "403" in told["other"][1]
