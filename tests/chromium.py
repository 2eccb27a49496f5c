"""A headless Chromium that draws in software; tests that import this are skipped where there is none."""

import contextlib
import shutil

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
if CHROMIUM is None:
    pytest.skip("no browser is installed; to run these: apt-get install chromium", allow_module_level=True)
playwright = pytest.importorskip("playwright.sync_api", reason="to run these: pip install playwright")

PATIENCE = 30_000  # [ms] drawing is in software here
WEBGL = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
# SwiftShader draws the scene. Drawing the rest of a page with it too takes a third more of a processor.
PLAIN = ("--disable-gpu-compositing", "--disable-gpu-rasterization")
# So does drawing each pixel of the scene from four samples, which only smooths edges.
UNSMOOTHED = """{
  const { prototype } = HTMLCanvasElement, { getContext } = prototype;
  prototype.getContext = function (kind, asked) { return getContext.call(this, kind, { ...asked, antialias: false }); };
}"""


@contextlib.contextmanager
def chromium():
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=CHROMIUM, args=[*WEBGL, *PLAIN])
        yield opened
        opened.close()


@contextlib.contextmanager
def watched(browser, *own):
    """Open a page; yield it, and the list of its errors and of what it asks for that does not begin with one of `own`.

    A page costs its process half a second, so the tests of a module share one.
    """
    page, wrong = browser.new_page(viewport={"width": 960, "height": 540}), []  # what is drawn in software is slow
    page.add_init_script(UNSMOOTHED)
    page.set_default_timeout(PATIENCE)
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda asked: None if asked.url.startswith(own) else wrong.append(asked.url))
    yield page, wrong
    page.close()
