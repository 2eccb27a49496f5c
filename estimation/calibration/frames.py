"""`fitted_frames`: the rigid transforms between measured poses and those of the robot's file.

A motion capture measures the pose X of some body in some frame; the file's pose is T X B with the pose T of its frame
in {G} and the pose B of the platform frame in the body. Both are fitted to the cable lengths with the file's anchors
and attachments, up to the offsets of the readings, from all turns of the axes by right angles.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.text import quantity, quantity_row
from ...models import points
from ...models.robot import Robot
from .geometry import runs

FEW, MANY = 6, 60  # steps of a first and of a last descent
KEPT = 8  # starts that are worth a last descent
MOST_SAMPLES = 60
SIMPLER = 1.3  # times the size of the residuals that one transform instead of two may have
DAMPING = 1e-3


class Frames(NamedTuple):
    """Poses T of the measured frame in {G} and B of the platform frame in the measured body, and the error left [m]."""

    outer: tuple[np.ndarray, np.ndarray]  # (3,) [m], (3, 3)
    inner: tuple[np.ndarray, np.ndarray]
    size: float = np.inf

    def of(self, position: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the positions (N, 3) and rotations (N, 3, 3) of the platform frame in {G}."""
        (t, T), (b, B) = self.outer, self.inner
        return (position + rotation @ b) @ T.T + t, T @ rotation @ B

    def __str__(self) -> str:
        texts: list[str] = []
        for (shift, turn), what in (
            (self.outer, "the poses seem to be measured in a frame that is"),
            (self.inner, "the poses look like those of a body whose frame is, seen from the platform frame,"),
        ):
            angle = float(np.linalg.norm(Rotation.from_matrix(turn).as_rotvec()))
            if angle > 1e-9 or shift.any():
                # What stands there is how the measured frame lies in the file's: T, and the inverse of B.
                back = (shift, turn) if not texts and what.endswith("that is") else (-turn.T @ shift, turn.T)
                about = Rotation.from_matrix(back[1]).as_rotvec() / max(angle, 1e-12)
                texts.append(
                    f"{what} turned by {quantity(np.degrees(angle), 'deg', 3)} about "
                    f"({quantity_row(np.round(about, 3), digits=2)}) and displaced by "
                    f"({quantity_row(np.round(back[0], 4), digits=3)}) [m]"
                )
        return " and ".join(texts)


NONE = (np.zeros(3), np.eye(3))
BOTH = (True, True)


def fitted_frames(robot: Robot, table: np.ndarray, position: np.ndarray, rotation: np.ndarray, y: np.ndarray) -> Frames:
    """Return the frames that fit lengths best: one if it fits nearly as well as both.

    - `table`: `Parameters.table` of the robot.
    - `position`, `rotation`: measured positions (N, 3) [m] and rotations (N, 3, 3).
    - `y`: readings, (N, m) [m].
    """
    rows = np.unique(np.linspace(0, len(y) - 1, min(len(y), MOST_SAMPLES)).astype(int))
    few = position[rows], rotation[rows], y[rows]
    home = points.rotations(robot.home[3:])
    middle, mean = few[0].mean(axis=0), Rotation.from_matrix(few[1]).mean().as_matrix()
    right_angles = Rotation.create_group("O")
    turns = [*right_angles.as_matrix(), *(Rotation.from_euler("z", 45, degrees=True) * right_angles).as_matrix()]
    starts = [Frames(NONE, NONE)]
    for turn in turns:
        outer = (robot.home[:3] - turn @ middle, turn)
        starts += [Frames(outer, NONE), Frames(outer, (np.zeros(3), (turn @ mean).T @ home))]
    tried = [_descended(robot, table, *few, one, BOTH, FEW) for one in starts]
    tried = sorted(tried, key=lambda one: one.size)[:KEPT]
    both = min((_descended(robot, table, *few, one, BOTH, MANY) for one in tried), key=lambda one: one.size)
    return _simplest(robot, table, few, both)


def displaced_frames(
    robot: Robot,
    table: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    y: np.ndarray,
    least: float,
    noise: float,
) -> tuple[Frames, float] | None:
    """Return the frames near those of the file that fit lengths best, and what is left without them [m].

    None if that is not `least` times as much as with them, or as the noise.
    """
    rows = np.unique(np.linspace(0, len(y) - 1, min(len(y), MOST_SAMPLES)).astype(int))
    few = position[rows], rotation[rows], y[rows]
    before = _descended(robot, table, *few, Frames(NONE, NONE), BOTH, 0)
    both = _descended(robot, table, *few, before, BOTH, MANY)
    if before.size < least * max(both.size, noise):
        return None
    frames = _simplest(robot, table, few, both)
    return (frames, before.size) if before.size >= least * frames.size else None


def _simplest(robot: Robot, table: np.ndarray, few: tuple[np.ndarray, np.ndarray, np.ndarray], both: Frames) -> Frames:
    """Return frames of which one is none if that fits nearly as well."""
    outer = Frames((both.outer[0] + both.outer[1] @ few[1].mean(axis=0) @ both.inner[0], both.outer[1]), NONE)
    ones = [_descended(robot, table, *few, start, (True, False), MANY) for start in (outer, Frames(NONE, NONE))]
    inner = Frames(NONE, both.inner), Frames(NONE, NONE)
    ones += [_descended(robot, table, *few, start, (False, True), MANY) for start in inner]
    return min([both, *ones], key=lambda one: one.size * (SIMPLER if one is both else 1.0))


def _descended(
    robot: Robot,
    table: np.ndarray,
    position: np.ndarray,
    rotation: np.ndarray,
    y: np.ndarray,
    frames: Frames,
    which: tuple[bool, bool],
    steps: int,
) -> Frames:
    """Return frames after some Levenberg-Marquardt steps, with the median of the residuals' sizes as their size."""
    columns = np.repeat(which, 6)
    damping, now = DAMPING, _residuals(robot, table, position, rotation, y, frames)
    for _ in range(steps):
        e, J = now
        limit = max(3 * float(np.median(np.abs(e))), 1e-12)
        weights = np.minimum(1.0, limit / np.maximum(np.abs(e), 1e-300))
        J = J[:, columns]
        H = J.T @ (weights[:, None] * J)
        step = np.zeros(12)
        step[columns] = -np.linalg.lstsq(H + damping * np.diag(np.diag(H) + 1e-9), J.T @ (weights * e), rcond=None)[0]
        tried = _moved(frames, step)
        after = _residuals(robot, table, position, rotation, y, tried)
        if np.abs(after[0]).mean() < np.abs(e).mean():
            small = np.abs(step).max() < 1e-7
            frames, now, damping = tried, after, 0.2 * damping
            if small:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    return frames._replace(size=1.4826 * float(np.median(np.abs(now[0]))))


def _moved(frames: Frames, step: np.ndarray) -> Frames:
    parts = []
    for (shift, turn), by in zip(frames[:2], (step[:6], step[6:]), strict=True):
        extra = Rotation.from_rotvec(by[3:] if np.abs(by[3:]).max() < 1 else by[3:] / np.abs(by[3:]).max()).as_matrix()
        parts.append((shift + by[:3], extra @ turn))
    return Frames(parts[0], parts[1])


def _residuals(
    robot: Robot, table: np.ndarray, position: np.ndarray, rotation: np.ndarray, y: np.ndarray, frames: Frames
) -> tuple[np.ndarray, np.ndarray]:
    """Return lengths less readings up to offsets, (m N,) [m], and the derivatives by shifts and turns, (m N, 12)."""
    (_, T), (_, B) = frames.outer, frames.inner
    x, R = frames.of(position, rotation)
    run = runs(robot, table, x, R)
    u = run.directions  # (m, N, 3)
    placed = (position + rotation @ frames.inner[0]) @ T.T
    arms = np.einsum("nij,mj->mni", R, table[:, 3:6])
    whole = placed + arms  # of the attachments, about the origin of the measured frame
    before = T @ rotation  # (N, 3, 3)
    own = np.einsum("nji,mnj->mni", before, u)  # the directions in the body's frame
    inside = table[:, 3:6] @ B.T  # attachments in the body's axes
    J = np.concatenate([u, np.cross(whole, u), own, np.cross(inside[:, None], own)], axis=2)  # (m, N, 12)
    e = run.lengths - y.T
    e, J = np.where(np.isfinite(e), e, 1e3), np.where(np.isfinite(J), J, 0.0)
    e, J = e - np.median(e, axis=1, keepdims=True), J - J.mean(axis=1, keepdims=True)
    return e.ravel(), J.reshape(-1, 12)
