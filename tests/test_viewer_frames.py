"""While a plan plays, each frame has scene, table and clock of one instant, on a busy machine too.

`TOWLINE_FRAMES=50` looks at more frames, with processors kept busy.

What the scene shows is read when WebGL has drawn it: the place of the platform, which is moved, and the end of a cable,
which gets new points. What the page shows is read after its layout, the last step before a frame is painted.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

from towline.models import load
from towline.ocp import plan
from towline.viewer import read, save_page, serve

from .chromium import PATIENCE, UNSMOOTHED, chromium

FRAMES = int(os.environ.get("TOWLINE_FRAMES", "8"))
LOAD = 2 if "TOWLINE_FRAMES" in os.environ else 0  # processes that keep processors busy

WATCH = """async (count) => {
  let left = [document.getElementById("root")], viewer = null;
  left = [left[0][Object.keys(left[0]).find((name) => name.startsWith("__reactContainer"))].stateNode.current];
  while (!viewer && left.length) {
    const fiber = left.shift(), found = fiber.memoizedProps?.value?.mutable?.current;
    if (found?.scene) viewer = found;
    left.push(...[fiber.child, fiber.sibling].filter((next) => next));
  }
  let drawn = null;
  viewer.scene.onAfterRender = () => {
    let cable = null;
    viewer.nodeRefFromName["/cables/1"].traverse((part) => {
      const points = part.geometry?.attributes?.instanceEnd?.data?.array;
      if (points) cable = [...points].slice(-3);
    });
    drawn = { platform: viewer.nodeRefFromName["/platform"].matrix.elements.slice(12, 15), cable };
  };
  const text = (name) => document.querySelector(name)?.innerText, frames = [];
  const until = performance.now() + 15000 * count;
  const probe = document.body.appendChild(document.createElement("div"));
  probe.style = "position:fixed;height:1px;width:1px";
  await new Promise((done) => {
    const look = new ResizeObserver(() => {
      const frame = JSON.stringify({
        drawn, time: text(".towline-time"), clock: document.querySelector("input[type=text]").value,
        tensions: [...document.querySelectorAll(".towline-tension")].map((cell) => parseFloat(cell.innerText)),
      });
      if (drawn && frame !== frames.at(-1)) frames.push(frame);
      if (frames.length < count && performance.now() < until) return;
      look.disconnect();
      done();
    });
    look.observe(probe);
    const next = () => {  // each frame has a new layout
      probe.style.width = probe.style.width === "1px" ? "2px" : "1px";
      if (probe.isConnected) nativeFrame(next);
    };
    next();
  });
  probe.remove();
  return frames.map((frame) => JSON.parse(frame));
}"""


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    """A circle of which each instant is elsewhere, and has other tensions."""
    file = tmp_path_factory.mktemp("plans") / "circle.nc"
    circle = {"kind": "circle", "centre": [0, 0, 2], "radius": 2, "rate": 0.6}
    found = plan(load("cogiro"), {"path": circle, "output_rate": 25})
    assert found.feasible
    found.save(file)
    return read(str(file))


@pytest.fixture(scope="module")
def page():
    """A page of a browser, on a busy machine if many frames are looked at."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(LOAD)]
    try:
        with chromium() as browser:
            opened = browser.new_page(viewport={"width": 400, "height": 240})
            opened.set_default_timeout(max(2 * PATIENCE, 16_000 * FRAMES))
            opened.add_init_script(UNSMOOTHED)
            opened.add_init_script("window.nativeFrame = requestAnimationFrame.bind(window)")
            yield opened
    finally:
        for process in busy:
            process.kill()
            process.wait()


def check(subject, frames, late):
    """Check that all of each frame is of one instant.

    The clock goes on until the next instant, by at most `late` [s] with its rounding, and starts again with the motion.
    """
    replay = subject.replay
    times = replay.times
    instants = [replay.at(index, prove=False) for index in range(len(times))]
    places = np.array([instant.pose[:3] for instant in instants])
    ends = np.array([instant.points.attachments[0] for instant in instants])
    assert len(frames) == FRAMES
    apart = []
    for frame in frames:
        at = float(frame["time"].removeprefix("t = ").removesuffix(" s"))
        listed = int(np.abs(times - at).argmin())
        platform, cable = (
            times[np.linalg.norm(found - np.array(frame["drawn"][part]), axis=1).argmin()]
            for found, part in ((places, "platform"), (ends, "cable"))
        )
        apart.append((platform - times[listed], cable - times[listed], float(frame["clock"]) - times[listed]))
        np.testing.assert_allclose(frame["tensions"], instants[listed].tensions, atol=0.0051)
    platform, cable, clock = np.array(apart).T
    length = times[-1] - times[0]
    for part in (platform, cable):  # a circle ends where it begins
        assert (np.minimum(np.abs(part), np.abs(np.abs(part) - length)) < 1e-9).all()
    clock = np.where(clock < -length / 2, clock + length, clock)
    assert (clock > -0.051).all()
    assert (clock < late).all(), [frame for frame, ahead in zip(frames, clock, strict=True) if ahead >= late]


def test_frames_of_a_playing_view_are_of_one_instant(subject, page):
    with serve(subject, port=0) as url:
        page.goto(url)
        page.get_by_role("button", name="Play").click()
        frames = page.evaluate(WATCH, FRAMES)
    check(subject, frames, 0.05)


def test_frames_of_a_playing_page_are_of_one_instant(subject, page, tmp_path):
    page.goto(save_page(subject, tmp_path / "circle.html").as_uri())
    page.wait_for_function("parseFloat(document.querySelector('input')?.value) > 0.5")
    frames = page.evaluate(WATCH, FRAMES)
    check(subject, frames, np.diff(subject.replay.times).max() + 0.051)
