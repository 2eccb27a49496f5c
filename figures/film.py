"""Write films as GIF with Pillow or as MP4 with ffmpeg, as the suffix of the file states."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ..base.errors import InputError, TowlineError
from ..base.inputs import number, shown
from ..base.writing import whole_file

SUFFIXES = (".gif", ".mp4")
TICK = 0.01  # [s]: GIF counts its delays in hundredths
SHORTEST = 2  # ticks: browsers slow a GIF with shorter delays down
FASTEST = 120.0  # [1/s] of MP4: screens show no more
Draw = Callable[[int], np.ndarray]  # the k-th frame, (height, width, 3) of bytes


def frame_rate(path: Path, rate: float) -> float:
    """Return the frame rate [1/s] nearest to `rate` that the format of `path` supports.

    Raises `InputError` if the suffix is unknown, the rate is invalid, or ffmpeg is needed and missing.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"the film's file must end in {' or '.join(SUFFIXES)}, got {shown(path.name)}")
    fastest = 1 / (SHORTEST * TICK) if suffix == ".gif" else FASTEST
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
