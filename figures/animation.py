"""Draw a film of a robot in 3-D: cables coloured by tension, platform, carriers and the trail of the platform.

Fixed parts are drawn once; each frame is a copy of them with the moving parts added. A new drawing for each frame would
take ten times as long.
"""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import InputError, TowlineError
from ..base.inputs import number, shown
from ..base.writing import whole_file
from . import style
from .perspective import Perspective
from .robot import BODY, POST, box_edges, drawn_ends
from .scene import Scene, faces
from .tension_colours import mark, place, scale, shades

SIZE = (7.0, 5.2)  # [inches]
AIR = 0.03  # share of the picture around the robot
DPI = 100  # an even number of pixels in each direction, which MP4 requires
MOST_FRAMES = 3000
TORN = 0.6  # the grey of a cable that has been cut
SLOWEST, FASTEST = 1e-6, 1e6  # seconds of the motion in one of the film
SUFFIXES = (".gif", ".mp4")
TICK = 0.01  # [s]: GIF counts its delays in hundredths
SHORTEST = 2  # ticks: browsers slow a GIF with shorter delays down
MOST_RATE = 120.0  # [1/s] of MP4: screens show no more
Draw = Callable[[int], np.ndarray]  # the k-th frame, (height, width, 3) of bytes


class Timing(NamedTuple):
    """The times of the frames."""

    times: np.ndarray  # times of the motion, one for each frame, (k,) [s]
    rate: float  # frames per second of the film
    speed: float  # seconds of the motion per second of the film


def check_film(path: Path, speed: float, fps: float) -> float:
    """Return the frame rate [1/s] of a film at `path`; call this before computing the motion.

    Raises `InputError` if the suffix, the speed or the frame rate is invalid.
    """
    number("speed", speed, SLOWEST, FASTEST)
    return frame_rate(path, fps)


def timing(path: Path, duration: float, speed: float, fps: float) -> Timing:
    """Return the times of the frames for a motion of `duration` [s] and a film at `path`.

    Raises `InputError` if `check_film` raises it, or the film would be too long.
    """
    rate = check_film(path, speed, fps)
    count = duration * rate / speed + 1
    if count > MOST_FRAMES:
        raise InputError(
            f"{path} must have at most {MOST_FRAMES} frames, got {count:.0f}; "
            f"lower fps from {fps:g} or raise speed from {speed:g}"
        )
    return Timing(np.arange(int(count + 1e-9)) * speed / rate, rate, speed)


def draw(scene: Scene, when: Timing, path: Path) -> Path:
    """Write a film of a scene."""
    stage = _Stage(scene, when)
    return write(path, stage.frame, len(when.times), when.rate)


class _Stage:
    """The fixed parts, drawn once, and the artists that move."""

    def __init__(self, scene: Scene, when: Timing):
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self._scene, self._when = scene, when
        self._figure = style.figure(*SIZE)
        self._figure.set_dpi(DPI)
        self._canvas = FigureCanvasAgg(self._figure)
        self._seen = Perspective(scene.points, standing=not scene.names)
        self._ax = style.axes(self._figure, "x [m]", "z [m]") if self._seen.flat else self._figure.add_subplot()
        self._draw_surroundings()
        self._make_actors()
        self._canvas.draw()
        self._still: Any = self._canvas.copy_from_bbox(self._figure.bbox)

    def frame(self, k: int) -> np.ndarray:
        """Return the k-th frame, (height, width, 3) of bytes."""
        scene, seen = self._scene, self._seen
        self._canvas.restore_region(self._still)
        self._trail.set_data(*seen(scene.path[scene.path_times <= self._when.times[k] + 1e-9]).T)
        bodies = [(scene.platform[k], style.colour(4)), *((scene.anchors[k, cables], BODY) for cables in scene.bodies)]
        pairs = zip(bodies, self._faces, strict=True)
        sides = [(corners[face], colour) for (corners, colour), found in pairs for face in found]
        sides.sort(key=lambda side: -seen.depth(side[0]))  # nearer ones cover farther ones
        self._bodies.set_verts([seen(corners) for corners, _ in sides])
        self._bodies.set_facecolor([colour for _, colour in sides])
        for label, at in zip(self._labels, scene.carriers[k], strict=True):
            label.set_position(tuple(seen(at)))
        self._rotors.set_segments(list(seen(scene.rotors[min(k, len(scene.rotors) - 1)])))
        gone = None if scene.cut is None else scene.cut[k]
        ends = seen(drawn_ends(scene.anchors[k], scene.attachments[k], gone))
        self._cables.set_segments(list(np.stack([seen(scene.anchors[k]), ends], axis=1)))
        there = np.isfinite(scene.tensions[k]).all()
        tensions = scene.tensions[k] if there else np.full_like(scene.tensions[k], np.nan)
        colours = shades(place(tensions, scene.t_min, scene.t_max)) / 255.0
        self._cables.set_color(colours if gone is None else np.where(gone[:, None], TORN, colours))
        self._cables.set_linestyle("-" if there else "--")
        self._dots.set_data(*np.vstack([seen(scene.anchors[k]), ends]).T)
        self._clock.set_text(f"t = {self._when.times[k]:.2f} s" + ("" if there else "\nno tensions\ninside the limits"))
        for artist in (self._trail, self._bodies, self._rotors, self._cables, self._dots, *self._labels):
            self._ax.draw_artist(artist)
        self._figure.draw_artist(self._clock)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()

    def _draw_surroundings(self) -> None:
        """Draw floor, posts, paths of platform and carriers, boxes, and the colour bar with the limits."""
        from matplotlib.collections import LineCollection

        scene, ax, seen = self._scene, self._ax, self._seen
        seen.fit(ax, AIR)
        (path,) = ax.plot(*seen(scene.path).T, color="#bbbbbb", linewidth=1.2, label="platform's path, blue so far")
        named: list[Any] = [path]
        for index in range(len(scene.names)):
            (dotted,) = ax.plot(*seen(scene.carriers[:, index]).T, color="#999999", linewidth=0.8, linestyle=":")
            dotted.set_label("path of a carrier")
            if len(named) == 1 and np.ptp(scene.carriers[:, index], axis=0).max() > 1e-9:
                named.append(dotted)
        for anchor in scene.anchors[0, scene.standing]:
            if anchor[2] > seen.floor:
                ax.plot(*seen(np.array([anchor, [*anchor[:2], seen.floor]])).T, color=POST, linewidth=1.0)
        edges = [edge for low, high in scene.boxes for edge in box_edges(low, high)]
        outlines = _inside(scene.obstacles, np.array([seen.low, seen.high]))
        for lines, hue, width, label in ((edges, 3, 0.6, "reach of a carrier"), (outlines, 1, 0.8, "keep out")):
            if lines:
                drawn = LineCollection(list(map(seen, lines)), colors=style.colour(hue), linewidths=width, label=label)
                named.append(ax.add_collection(drawn, autolim=False))
        self._figure.legend(handles=named, fontsize="x-small", loc="outside lower left", ncols=4, frameon=False)
        speed = "real time" if self._when.speed == 1 else f"{self._when.speed:g} x real time"
        ax.set_title(f"{scene.title} ({speed})", fontsize=10)
        bar = self._figure.colorbar(scale(), ax=ax, shrink=0.7, pad=0.04, label="tension [N] from t_min to t_max")
        mark(bar, scene.t_min, scene.t_max, 8)

    def _make_actors(self) -> None:
        from matplotlib.collections import LineCollection, PolyCollection

        scene, ax = self._scene, self._ax
        (self._trail,) = ax.plot([], [], color=style.colour(0), linewidth=1.8, animated=True)
        (self._dots,) = ax.plot([], [], "o", color="#000000", markersize=2.5, animated=True)
        self._faces = [faces(scene.platform[0]), *(faces(scene.anchors[0, cables]) for cables in scene.bodies)]
        self._bodies: Any = PolyCollection([], edgecolor="#444444", linewidths=0.6, alpha=0.85, animated=True)
        self._rotors: Any = LineCollection([], colors="#000000", linewidths=0.9, animated=True)
        self._cables: Any = LineCollection([], linewidths=2.2, animated=True)
        for moving in (self._bodies, self._rotors, self._cables):
            ax.add_collection(moving, autolim=False)
        self._labels = [ax.text(0.0, 0.0, f" {name}", fontsize=8, animated=True) for name in scene.names]
        self._clock = self._figure.text(0.98, 0.03, "", fontsize=10, ha="right", animated=True)


def _inside(places: list[list[np.ndarray]], corners: np.ndarray) -> list[np.ndarray]:
    """Return the outlines inside two corners (2, 3), because a wall may be much larger than the robot."""
    low, high = corners
    inside = []
    for lines in places:
        points = np.vstack(lines)
        if (points.max(axis=0) > low).all() and (points.min(axis=0) < high).all():
            inside += [np.clip(line, low, high) for line in lines]
    return inside


def frame_rate(path: Path, rate: float) -> float:
    """Return the frame rate [1/s] nearest to `rate` that the format of `path` supports.

    Raises `InputError` if the suffix is unknown, the rate is invalid, or ffmpeg is needed and missing.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"the film's file must end in {' or '.join(SUFFIXES)}, got {shown(path.name)}")
    fastest = 1 / (SHORTEST * TICK) if suffix == ".gif" else MOST_RATE
    rate = number("fps", rate, 0.1, fastest, also=f" for {suffix}")
    if suffix == ".gif":
        return 1 / (TICK * round(1 / (TICK * rate)))
    ffmpeg(path)
    return rate


def ffmpeg(path: Path) -> str:
    """Return the path of ffmpeg, from the setting `animation.ffmpeg_path` of matplotlib.

    Raises `InputError` if ffmpeg is not installed.
    """
    from matplotlib import rcParams

    program = shutil.which(rcParams["animation.ffmpeg_path"])
    if program is None:
        raise InputError(f"{path} needs the program ffmpeg, which is not installed; without it use .gif")
    return program


def write(path: Path, draw: Draw, count: int, rate: float) -> Path:
    """Write `count` frames at `rate` (from `frame_rate`); a failure leaves no partial file.

    Raises `InputError` if the file cannot be written; `TowlineError` if ffmpeg fails; the message has its last
    line.
    """
    with whole_file(path) as temporary:
        if path.suffix.lower() == ".gif":
            _write_gif(temporary, draw, count, rate)
        else:
            _write_mp4(temporary, draw, count, rate, ffmpeg(path))
    return path


def _write_gif(path: Path, draw: Draw, count: int, rate: float) -> None:
    """Write a GIF with one palette for all frames, which is faster and avoids flicker."""
    from PIL import Image

    shown = np.vstack([draw(k) for k in sorted({0, count // 2, count - 1})])
    colours = np.array(Image.fromarray(shown).quantize(256).getpalette()).reshape(-1, 3)
    colours[colours.min(axis=1) >= 248] = 255  # Pillow looks colours up in steps of 8: the paper would turn grey
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())

    def frames() -> Iterator[Image.Image]:
        for k in range(count):
            yield Image.fromarray(draw(k)).quantize(palette=palette, dither=Image.Dither.NONE)

    drawn = frames()
    delay = round(1000 / rate)  # [ms]
    next(drawn).save(path, format="GIF", save_all=True, append_images=drawn, duration=delay, loop=0)


def _write_mp4(path: Path, draw: Draw, count: int, rate: float, program: str) -> None:
    """Pipe raw frames into ffmpeg: H.264 with the pixel format that every browser and phone plays."""
    from matplotlib import rcParams

    height, width, _ = draw(0).shape
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{rate:.6f}", "-i", "-"]
    coded = ["-an", "-vcodec", rcParams["animation.codec"], "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = [program, "-loglevel", "error", "-y", *raw, *coded, "-f", "mp4", str(path)]
    with tempfile.TemporaryFile() as messages:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=messages) as process:
            try:
                assert process.stdin is not None
                for k in range(count):
                    process.stdin.write(np.ascontiguousarray(draw(k)).data)
                process.stdin.close()
            except BrokenPipeError:
                pass  # its exit code and its last line give the reason
            except BaseException:
                process.kill()
                raise
        if process.returncode:
            messages.seek(0)
            lines = messages.read().decode(errors="replace").strip().splitlines() or ["no message"]
            raise TowlineError(f"ffmpeg: stopped with exit code {process.returncode} ({lines[-1]})")
