"""Where things are in pictures of the viewer: by a pinhole camera, and by the colours of pixels."""

import io
from http.server import BaseHTTPRequestHandler

import numpy as np
from PIL import Image
from scipy.ndimage import maximum_filter

from towline.viewer.geometry import Geometry

FREE = 0.55  # of the height of a phone, above the panel
CHART_ROWS = slice(640, 690)  # of 700, which are inside the chart of tensions however long the text above it is


def pixels(page, subject, points, free=None):
    """Return where the initial camera shows points (k, 3) in the picture, (k, 2), by a pinhole camera.

    `free` is the share of the height that the panel leaves free in a picture that is higher than wide.
    """
    extent = subject.replay.extent if subject.replay else Geometry(subject.robot).extent
    box = page.locator("canvas").first.bounding_box()
    aspect, fov, centre = box["width"] / box["height"], 0.75, (extent.low + extent.high) / 2
    free = 1.0 if aspect > 1 else FREE if free is None else free
    along = np.array([0.45, -1.0, 0.45]) / np.linalg.norm([0.45, -1.0, 0.45])
    away = 0.62 * extent.size / np.sin(fov / 2) / min(aspect, free, 1.0)
    ahead = -along
    right = np.cross(ahead, [0, 0, 1]) / np.linalg.norm(np.cross(ahead, [0, 0, 1]))
    down = np.cross(ahead, right)
    eye = centre + away * along + (1 - free) * away * np.tan(fov / 2) * down
    rays = points - eye
    flat = rays @ np.stack([right, down]).T / (rays @ ahead)[:, None]
    middle = [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2]
    return middle + flat * box["height"] / 2 / np.tan(fov / 2)


def picture(page, file=None):
    """Return the pixels of a page, and let viser draw again: a busy machine may stop while something still fades in."""
    page.evaluate("__viserMutable.requestRender()")
    return np.asarray(Image.open(io.BytesIO(page.screenshot(path=file))).convert("RGB")).astype(int)


def dark_near(shot, spots, reach=4):
    """Return for each of some pixels (..., 2) whether black dots, such as the ends of cables, are within reach."""
    dark = maximum_filter(shot.max(axis=2) < 60, 2 * reach + 1)
    columns, rows = np.moveaxis(np.round(spots).astype(int), -1, 0)
    inside = (columns >= 0) & (columns < dark.shape[1]) & (rows >= 0) & (rows < dark.shape[0])
    return inside & dark[np.where(inside, rows, 0), np.where(inside, columns, 0)]


def cursor_column(page, shot):
    """Return the column of the line that marks now in the chart of tensions, by its pixels."""
    box = page.locator(".u-over").first.bounding_box()
    left, right = int(box["x"]) - 2, int(box["x"] + box["width"]) + 3
    rows = shot[CHART_ROWS, left:right].max(axis=2).mean(axis=0)
    darkest = int(rows.argmin())
    near = np.arange(max(darkest - 2, 0), min(darkest + 3, len(rows)))
    return left + np.average(near, weights=np.clip(200 - rows[near], 0, None) + 1e-9)


class Empty(BaseHTTPRequestHandler):
    """Answer every request with an empty page."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<html></html>")

    def log_message(self, *_):
        """Print nothing."""
