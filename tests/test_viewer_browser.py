"""The viewer and its page in headless Chromium: no errors, sliders move the platform, plans play.

Screenshots are left in pytest's temporary folder.
"""

import io
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from towline.distribution import pose_problem
from towline.models import Dynamics, load
from towline.ocp import plan
from towline.solvers import solve
from towline.viewer import read, save_page, serve
from towline.viewer.colours import place, shades

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
if CHROMIUM is None:
    pytest.skip("no browser is installed; to run these: apt-get install chromium", allow_module_level=True)
playwright = pytest.importorskip("playwright.sync_api", reason="to run these: pip install playwright")

PATIENCE = 30_000  # [ms] drawing is in software here
WEBGL = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=CHROMIUM, args=list(WEBGL))
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser):
    """A page that fails the test if anything is wrong in it, or if it asks another machine for something."""
    opened = browser.new_page(viewport={"width": 640, "height": 480})
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
def plan_file(tmp_path_factory):
    file = tmp_path_factory.mktemp("plan") / "line.nc"
    line = {"kind": "line", "start": [0, 0, -1], "end": [0.05, 0, -0.9]}
    task = {"path": line, "duration": 4, "base": {"kind": "hold"}, "output_rate": 20}
    return plan(load("wang-flying"), task).save(file)


def tensions(page):
    return [float(text.removesuffix(" N")) for text in page.locator(".towline-tension").all_inner_texts()]


def shown_time(page):
    return float(re.search(r"t = ([\d.]+) s", page.locator(".towline-readout").inner_text())[1])


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


def test_a_picture_is_saved(page, tmp_path):
    with serve(read("caroca-pulleys"), port=0) as url:
        page.goto(url)
        page.wait_for_selector(".towline-readout")
        with page.expect_download() as download:
            page.get_by_role("button", name="Save picture").click()
        assert download.value.suggested_filename == "caroca-pulleys.png"
        download.value.save_as(tmp_path / "saved.png")
    pixels = np.asarray(Image.open(tmp_path / "saved.png").convert("RGB"))
    assert pixels.shape[0] == 480
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
        pixels = np.asarray(Image.open(io.BytesIO(page.screenshot(path=tmp_path / "page.png"))).convert("RGB"))
        return (np.abs(pixels.astype(int) - drawn[0].astype(int)).max(axis=2) < 16).sum() > 200

    for _ in range(60):  # what appears fades in
        if cables_are_drawn():
            return
        page.wait_for_timeout(250)
    pytest.fail(f"nothing in the picture has the colour of the first cable, {drawn[0]}")
