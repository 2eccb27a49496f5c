"""Draw the pictures of the reference (frames, Euler angles, every robot of the library) and the films of the gallery.

`make pictures` runs it after the examples, whose plans the films show.
"""

import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial.transform import Rotation

from towline import available
from towline.figures import animation, style
from towline.statics.scene import scene
from towline.viewer import read

PICTURES, GALLERY = Path(__file__).parent / "reference" / "pictures", Path(__file__).parent / "pictures"
# Plans that have a film, and its speed.
FILMS = {
    "flying_circle": 3,
    "three_robots_carry": 2,
    "four_quadrotors_slot": 2,
    "cogiro_pick_and_place": 2,
    "fast_tracks_a_source": 15,
}
RATE = 6  # [frames/s]
WIDTH, COLOURS = 560, 128  # of a small picture: pixels, and shades
ALMOST_WHITE = 247
DARK, PLATFORM = "#333333", style.COLOURS[0]
TURNS = (("yaw", 2, 0.6), ("pitch", 1, 0.5), ("roll", 0, 0.7))  # axis of the turn, and its angle [rad]


def main() -> None:
    """Draw all."""
    for name, canvas in (("frames", frames()), ("angles", angles())):
        shrink(style.save(canvas, PICTURES / f"{name}.png"), 1040)
    for name in available():
        small(name, PICTURES / "robots" / f"{name}.png")
    for name, speed in FILMS.items():
        film(GALLERY / f"{name}.nc", speed)


def frames() -> Figure:
    """Draw a platform under two carriers, with its frames, one anchor, one attachment and one cable, from the front."""
    canvas = style.figure(height=2.6)
    ax = canvas.add_subplot()
    platform, turn = np.array([2.6, 0.9]), 0.18
    _frame(ax, np.array([0.0, 0.0]), 0.0, "{G}", DARK)
    _frame(ax, platform, turn, "platform frame", PLATFORM, (0, -30))
    across = np.array([np.cos(turn), np.sin(turn)])
    up = np.array([-np.sin(turn), np.cos(turn)])
    corners = [platform + a * across + b * up for a, b in ((-0.7, -0.3), (0.7, -0.3), (0.7, 0.3), (-0.7, 0.3))]
    ax.fill(*np.transpose(corners), facecolor=PLATFORM, alpha=0.15, edgecolor=PLATFORM, linewidth=1.0)
    carrier, post = np.array([0.9, 2.7]), np.array([4.2, 2.7])
    _frame(ax, carrier, -0.12, "carrier frame", style.COLOURS[2], (-30, 4))
    anchor = carrier + np.array([0.25, -0.25])
    ends = [(anchor, corners[3]), (post, corners[2])]
    for start, end in ends:
        ax.plot(*np.transpose([start, end]), color=style.COLOURS[1], linewidth=1.2)
    middle, way = (anchor + corners[3]) / 2, (anchor - corners[3]) / np.linalg.norm(anchor - corners[3])
    _arrow(ax, corners[3], corners[3] + 0.55 * way, DARK)
    _note(ax, corners[3] + 0.5 * way, "$u_1$", (-10, -6))
    _note(ax, middle, "cable 1", (5, 4), style.COLOURS[1])
    _note(ax, anchor, "anchor $A_1$", (-4, -9), ha="right")
    _note(ax, corners[3], "attachment $B_1$", (-6, -8), ha="right")
    _note(ax, post, "anchor $A_2$", (0, 6), ha="center")
    _note(ax, (post + corners[2]) / 2, "cable 2", (6, 0), style.COLOURS[1])
    com = platform + 0.3 * across - 0.14 * up
    ax.plot(*com, marker="o", color=DARK, markersize=4)
    _note(ax, com, "CoM $c$", (5, -3))
    for point in (anchor, post, corners[3], corners[2]):
        ax.plot(*point, marker="o", color=style.COLOURS[1], markersize=3)
    ax.axhline(-0.02, color="#bbbbbb", linewidth=0.8, zorder=0)
    ax.set_xlim(-0.5, 5.0)
    ax.set_ylim(-0.35, 3.35)
    ax.set_aspect("equal")
    ax.axis("off")
    return canvas


def angles() -> Figure:
    """Draw a box that is turned by yaw, then by pitch about its new y axis, then by roll about its new x axis."""
    canvas = style.figure(height=1.4)
    R = np.eye(3)
    for index, (name, axis, angle) in enumerate(TURNS):
        before, unit = R, np.eye(3)[axis]
        R = R @ Rotation.from_rotvec(angle * unit).as_matrix()
        ax: Any = canvas.add_subplot(1, 3, index + 1, projection="3d")
        _box(ax, R)
        for column, letter in enumerate("xyz"):
            about = column == axis
            tip = R[:, column] * 1.25
            ax.plot(*np.transpose([np.zeros(3), tip]), color=style.COLOURS[1] if about else DARK, linewidth=1.4)
            ax.text(*(1.15 * tip), letter, fontsize=style.NOTE, color=style.COLOURS[1] if about else DARK)
        parts = np.linspace(0, angle, 30)[:, None] * unit
        arc = Rotation.from_rotvec(parts).apply(np.roll(unit, 1)) @ before.T  # from the axis after that of the turn
        ax.plot(*(1.05 * arc).T, color=style.COLOURS[1], linewidth=1.0)
        ax.set_title(f"{index + 1}. {name} about {'xyz'[axis]}", fontsize=style.NOTE, y=0.02)
        ax.set_box_aspect((1, 1, 1), zoom=1.15)
        for letter in "xyz":
            getattr(ax, f"set_{letter}lim")(-1, 1)
        ax.view_init(24, -30)
        ax.set_axis_off()
    return canvas


def small(name: str, file: Path) -> None:
    """Draw a robot as `towline robots NAME --figure` does, in a small file."""
    file.parent.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "towline.cli.entry", "robots", name, "--figure", str(file)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    shrink(file, WIDTH)


def film(plan: Path, speed: float) -> None:
    """Draw the film of a plan beside it, as `Plan.animate` does."""
    with xr.open_dataset(plan) as trajectory:
        path, times = plan.with_suffix(".gif"), trajectory["time"].values
        when = animation.timing(path, float(times[-1] - times[0]), speed, RATE)
        animation.draw(scene(read(plan).robot, trajectory, when.times), when, path)


def shrink(file: Path, width: int) -> None:
    """Make a picture so wide [pixels], with few shades, without the date of its making."""
    picture = Image.open(io.BytesIO(file.read_bytes())).convert("RGB")
    picture = picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)
    picture = picture.quantize(COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    shades = np.reshape(picture.getpalette(), (-1, 3))
    shades[(shades > ALMOST_WHITE).all(axis=1)] = 255  # the octree makes white a little grey
    picture.putpalette(shades.ravel().tolist())
    picture.save(file, optimize=True)


def _frame(
    ax: Axes, origin: np.ndarray, turn: float, name: str, colour: str, by: tuple[float, float] = (-4, -10)
) -> None:
    """Draw the x and z axes of a frame, and its name beside its origin."""
    for letter, angle in (("x", turn), ("z", turn + np.pi / 2)):
        tip = origin + 0.55 * np.array([np.cos(angle), np.sin(angle)])
        _arrow(ax, origin, tip, colour)
        _note(ax, tip, letter, (3, 2), colour)
    _note(ax, origin, name, by, colour, ha="center")


def _arrow(ax: Axes, start: np.ndarray, end: np.ndarray, colour: str) -> None:
    ax.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "shrinkA": 0, "shrinkB": 0})


def _note(ax: Axes, at: np.ndarray, text: str, by: tuple[float, float], colour: str = DARK, ha: str = "left") -> None:
    ax.annotate(text, at, by, textcoords="offset points", fontsize=style.NOTE, color=colour, ha=ha)


def _box(ax: Any, R: np.ndarray) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    half = np.array([0.7, 0.45, 0.2])
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half @ R.T
    faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    ax.add_collection3d(
        Poly3DCollection([corners[face] for face in faces], facecolor=PLATFORM, edgecolor=PLATFORM, alpha=0.15)
    )


if __name__ == "__main__":
    main()
