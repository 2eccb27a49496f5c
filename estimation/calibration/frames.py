"""`fitted_frames`: the rigid transforms between measured poses and those of the robot's file.

A motion capture measures the pose X of some body in some frame; the file's pose is T X B with the pose T of its frame
in {G} and the pose B of the platform frame in the body. Both are fitted to the cable lengths with the file's anchors
and attachments, up to the offsets of the readings (and scales of counts), from all turns of the axes by right angles.
Coordinates that a robot cannot change are as at home, so a planar robot's poses are in its plane.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...base.text import quantity, quantity_row
from ...models import points
from ...models.robot import Robot
from .differences import AS_GIVEN, LogPart
from .geometry import length_of, runs
from .interpretations import LEFT_HANDED, Interpretation, interpretations

FEW, MANY = 6, 60  # steps of a first and of a last descent
KEPT = 8  # starts that are worth a last descent
MOST_SAMPLES = 60
SIMPLER = 1.3  # times the size of the residuals that one transform instead of two may have
AS_WELL = 1.25  # times the size of the residuals before
MUCH_BETTER = 2.0  # times smaller residuals, in another convention of angles
DAMPING, ROUNDING = 1e-3, 1e-14


class Frames(NamedTuple):
    """Poses T of the measured frame in {G} and B of the platform frame in the measured body, and the error left [m]."""

    outer: tuple[np.ndarray, np.ndarray]  # (3,) [m], (3, 3)
    inner: tuple[np.ndarray, np.ndarray]
    size: float = np.inf

    def of(self, position: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the positions (N, 3) and rotations (N, 3, 3) of the platform frame in {G}."""
        return _placed((*self.outer, *self.inner), position, rotation)

    @property
    def found(self) -> tuple[str, ...]:
        """Return the parameters of a calibration that are the errors of these frames: "frame", "body", or both."""
        parts = (("frame", self.outer), ("body", self.inner))
        return tuple(name for name, (shift, turn) in parts if shift.any() or (turn != np.eye(3)).any())

    def __str__(self) -> str:
        texts: list[str] = []
        for (shift, turn), what in (
            (self.outer, "the poses seem to be measured in a frame that is"),
            (self.inner, "the poses seem to belong to a body whose frame is, seen from the platform frame,"),
        ):
            angle = float(np.linalg.norm(Rotation.from_matrix(turn).as_rotvec()))
            if angle > 1e-9 or shift.any():
                # The pose of the measured frame in the file's: T, and the inverse of B.
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


def fitted_frames(log: LogPart, near: Frames | None = None, noise: float = 0.0) -> Frames:
    """Return the frames that fit the lengths of a log best: one if it fits nearly as well as both.

    Only those near some others are looked for if they fit about as well as these did, or up to the noise [m].
    """
    few = _few(log)
    if near is not None:
        found = _simplest(few, _descended(few, [near], BOTH, MANY)[0])
        if found.size <= max(AS_WELL * near.size, noise):
            return found
    tried = sorted(_descended(few, _starts(few), BOTH, FEW), key=lambda one: one.size)[:KEPT]
    return _simplest(few, min(_descended(few, tried, BOTH, MANY), key=lambda one: one.size))


def fitted_orders(log: LogPart) -> list[np.ndarray]:
    """Return orders of the readings (m,) with which frames fit a log best, up to scales and signs.

    A symmetric robot looks like itself in several orders: those in which the simplest frames fit nearly as well.
    """
    from scipy.optimize import linear_sum_assignment

    few = _few(log)
    y = (few.y - few.y.mean(axis=0)).T
    y /= np.maximum(np.linalg.norm(y, axis=1, keepdims=True), 1e-300)
    found = _starts(few)
    orders: list[tuple[int, ...]] = []
    for steps in (FEW, MANY):
        parts = [np.stack(part) for part in zip(*((*one.outer, *one.inner) for one in found), strict=True)]
        lengths = _residuals(few._replace(y=0 * few.y), parts)[0][:, : few.y.size].reshape(len(found), log.robot.m, -1)
        lengths -= lengths.mean(axis=2, keepdims=True)
        left = (lengths**2).sum(axis=2)[..., None] - (lengths @ y.T) ** 2  # of cable i by the reading of cable j
        ways = [linear_sum_assignment(one)[1] for one in left]
        sizes = [float(one[range(len(way)), way].sum()) for one, way in zip(left, ways, strict=True)]
        first: dict[tuple[int, ...], Frames] = {}
        for k in np.argsort(sizes):
            first.setdefault(tuple(ways[k].tolist()), found[k])
        orders = list(first)[:KEPT]
        found = [
            _descended(few._replace(y=few.y[:, order], counted=True), [first[order]], BOTH, steps)[0]
            for order in orders
        ]
    least = SIMPLER * min(one.size for one in found)
    parts = (
        (one, few._replace(y=few.y[:, order], counted=True), order) for one, order in zip(found, orders, strict=True)
    )
    simple = [(_simplest(part, one), order) for one, part, order in parts if one.size < least]
    counts = [len(one.found) for one, _ in simple]
    return [np.array(order) for (_, order), count in zip(simple, counts, strict=True) if count == min(counts)]


def _starts(few: LogPart) -> list[Frames]:
    """Return frames as in the file, and those turned by right angles, with the mean pose at home."""
    home = points.rotations(few.robot.home[3:])
    middle, mean = few.position.mean(axis=0), Rotation.from_matrix(few.rotation).mean().as_matrix()
    right_angles = Rotation.create_group("O")
    turns = [*right_angles.as_matrix(), *(Rotation.from_euler("z", 45, degrees=True) * right_angles).as_matrix()]
    starts = [Frames(NONE, NONE)]
    for turn in turns:
        outer = (few.robot.home[:3] - turn @ middle, turn)
        starts += [Frames(outer, NONE), Frames(outer, (np.zeros(3), (turn @ mean).T @ home))]
    return starts


def in_convention(log: LogPart, frames: Frames) -> tuple[Frames, Interpretation]:
    """Return frames with the convention in which they fit a log much better, or these if there is none.

    It is one of angles, or left-handed axes, which no turn makes right-handed.
    """
    few, home = _few(log), points.rotations(log.robot.home[3:])
    ways = [way for way in interpretations(True) if way.turned is not None and way.placed is AS_GIVEN.placed]
    rotations = np.stack([few.at(way)[1] for way in ways])
    means = [Rotation.from_matrix(rotation).mean().as_matrix() for rotation in rotations]
    starts = [Frames(frames.outer, (np.zeros(3), (frames.outer[1] @ mean).T @ home)) for mean in means]
    tried = _descended(few._replace(rotation=rotations), starts, BOTH, FEW)
    way = min(zip(tried, ways, strict=True), key=lambda one: one[0].size)[1]
    for one in (way, LEFT_HANDED):
        found = fitted_frames(log.read_in(one))
        if MUCH_BETTER * found.size < frames.size:
            return found, one
    return frames, AS_GIVEN


def displaced_frames(log: LogPart, least: float, noise: float) -> tuple[Frames, float] | None:
    """Return the frames near the file's that fit lengths best, and the residuals without them [m].

    None if that is not `least` times as much as with them, or as the noise.
    """
    few = _few(log)
    (before,) = _descended(few, [Frames(NONE, NONE)], BOTH, 0)
    (both,) = _descended(few, [before], BOTH, MANY)
    if before.size < least * max(both.size, noise):
        return None
    frames = _simplest(few, both)
    return (frames, before.size) if before.size >= least * frames.size else None


def _few(log: LogPart) -> LogPart:
    omitted = np.ones(len(log.y), dtype=bool)
    omitted[np.linspace(0, len(log.y) - 1, min(len(log.y), MOST_SAMPLES)).astype(int)] = False
    return log.without(omitted)


def _simplest(log: LogPart, both: Frames) -> Frames:
    """Return frames of which one is none if that fits nearly as well."""
    outer = Frames((both.outer[0] + both.outer[1] @ log.rotation.mean(axis=0) @ both.inner[0], both.outer[1]), NONE)
    ones = _descended(log, [outer, Frames(NONE, NONE)], (True, False), MANY)
    ones += _descended(log, [Frames(NONE, both.inner), Frames(NONE, NONE)], (False, True), MANY)
    return min([both, *ones], key=lambda one: one.size * (SIMPLER if one is both else 1.0))


def _descended(log: LogPart, starts: Sequence[Frames], which: tuple[bool, bool], steps: int) -> list[Frames]:
    """Return frames after some Levenberg-Marquardt steps from S starts, all at once.

    Their size is the median of the residuals' sizes. The log's rotations may be others for each start, (S, N, 3, 3).
    """
    rotations = np.broadcast_to(log.rotation, (len(starts), *log.rotation.shape[-3:]))
    columns, damping = slice(6 * (not which[0]), 12 - 6 * (not which[1])), np.full(len(starts), DAMPING)
    frames = [np.stack(part) for part in zip(*((*one.outer, *one.inner) for one in starts), strict=True)]
    now, going = _residuals(log, frames), np.arange(len(starts))
    for _ in range(steps):
        e, J = now[0][going], now[1][going][..., columns]
        limit = np.maximum(3 * np.median(np.abs(e), axis=1, keepdims=True), 1e-12)
        weighted = np.minimum(1.0, limit / np.maximum(np.abs(e), 1e-300))[..., None] * J
        H = J.swapaxes(1, 2) @ weighted
        H += damping[going, None, None] * np.eye(H.shape[1]) * (H + 1e-9)
        step = np.zeros((len(going), 12))
        inverse = np.linalg.pinv(H, ROUNDING, hermitian=True)  # no step where a robot cannot move
        step[:, columns] = -(inverse @ (e[:, None] @ weighted).swapaxes(1, 2))[..., 0]
        tried = _moved([part[going] for part in frames], step)
        after = _residuals(log._replace(rotation=rotations[going]), tried)
        better = np.abs(after[0]).mean(axis=1) < np.abs(e).mean(axis=1)
        for kept, new in zip((*frames, *now), (*tried, *after), strict=True):
            kept[going[better]] = new[better]
        damping[going] *= np.where(better, 0.2, 10.0)
        going = going[np.where(better, np.abs(step).max(axis=1) >= 1e-7, damping[going] <= 1e6)]
        if not going.size:
            break
    sizes = 1.4826 * np.median(np.abs(now[0][:, : log.y.size]), axis=1)
    return [Frames((t, T), (b, B), float(size)) for t, T, b, B, size in zip(*frames, sizes, strict=True)]


def _moved(frames: Sequence[np.ndarray], step: np.ndarray) -> list[np.ndarray]:
    """Return S frames t (S, 3), T (S, 3, 3), b and B, moved by steps (S, 12), whose turns are at most one radian."""
    parts: list[np.ndarray] = []
    for shift, turn, by in zip(frames[::2], frames[1::2], (step[:, :6], step[:, 6:]), strict=True):
        about = by[:, 3:] / np.maximum(np.abs(by[:, 3:]).max(axis=1, keepdims=True), 1.0)
        parts += [shift + by[:, :3], Rotation.from_rotvec(about).as_matrix() @ turn]
    return parts


def _placed(frames: Sequence[np.ndarray], position: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the positions (..., N, 3) and rotations (..., N, 3, 3) of the platform frame for frames (t, T, b, B)."""
    t, T, b, B = frames
    inside = position + (rotation @ b[..., None, :, None])[..., 0]
    return inside @ T.swapaxes(-1, -2) + t[..., None, :], T[..., None, :, :] @ rotation @ B[..., None, :, :]


def _residuals(log: LogPart, frames: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return lengths minus readings up to offsets, and scales if `log.counted`, (S, k N) [m], k = m with all freedoms.

    Of robots with locked coordinates, their values less those at home follow. The second result has the derivatives by
    shifts and turns, (S, k N, 12).

    - `frames`: t (S, 3), T (S, 3, 3), b and B.
    """
    t, T = frames[:2]
    x, R = _placed(frames, log.position, log.rotation)  # (S, N, 3), (S, N, 3, 3)
    run = runs(log.robot, log.table, x.reshape(-1, 3), R.reshape(-1, 3, 3))
    shape = (log.robot.m, *x.shape[:2])
    locked, by_locked = _locked(log.robot, x, R)
    by_pose = run.by_pose.reshape(*shape, 2, 3).swapaxes(0, 1)  # by shift and turn of the platform, (S, m, N, 2, 3)
    by_pose = np.concatenate([by_pose, by_locked], axis=1)  # (S, k, N, 2, 3)
    own = by_pose @ (T[:, None] @ log.rotation)[:, None]  # likewise in the body's axes
    m = log.robot.m
    # A turn of the measured frame is about its origin.
    about_frame = by_pose[..., 1, :] + points.cross((x - t[:, None])[:, None], by_pose[..., 0, :])
    J = np.concatenate([by_pose[..., 0, :], about_frame, own.reshape(*own.shape[:3], 6)], axis=3)  # (S, k, N, 12)
    J, J_locked = J[:, :m], J[:, m:]
    e = run.lengths.reshape(shape).swapaxes(0, 1) - (0.0 if log.counted else log.y.T)
    unknown = ~np.isfinite(e + J.sum(axis=3))
    e[unknown], J[unknown] = 1e3, 0.0
    J -= J.mean(axis=2, keepdims=True)
    if log.counted:
        y = log.y - log.y.mean(axis=0)
        y /= np.maximum(np.linalg.norm(y, axis=0), 1e-300)
        e -= np.einsum("smn,nm->sm", e, y)[..., None] * y.T
        J -= np.einsum("smnk,nm->smk", J, y)[:, :, None] * y.T[..., None]
    e -= np.median(e, axis=2, keepdims=True)
    e, J = np.concatenate([e, locked], axis=1), np.concatenate([J, J_locked], axis=1)
    return e.reshape(len(t), -1), J.reshape(len(t), -1, 12)


def _locked(robot: Robot, x: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return locked coordinates of poses less their values at home, (S, c, N) [m], with turns as lengths.

    The second result has the derivatives by shift and turn of the platform, (S, c, N, 2, 3).

    - `x`, `R`: positions (S, N, 3) and rotations (S, N, 3, 3).
    """
    moves = robot.dof_mask > 0
    if moves[:3].all() and np.count_nonzero(moves[3:]) >= 2:
        return np.zeros((len(x), 0, x.shape[1])), np.zeros((len(x), 0, x.shape[1], 2, 3))
    axes, length = np.eye(3), length_of(robot)
    apart = R @ points.rotations(robot.home[3:]).T  # turns from home
    values, derivatives = [], []
    for axis in np.flatnonzero(~moves[:3]):
        values.append(x[..., axis] - robot.home[axis])
        derivatives.append(np.broadcast_to([axes[axis], np.zeros(3)], (*x.shape[:2], 2, 3)))
    free = np.flatnonzero(moves[3:])
    turned = [(i, free[0]) for i in range(3) if i != free[0]] if len(free) == 1 else [(1, 0), (2, 0), (2, 1)]
    for i, axis in turned if len(free) < 2 else ():
        values.append(length * apart[..., i, axis])
        by_turn = length * points.cross(apart[..., axis], axes[i])
        derivatives.append(np.stack([np.zeros_like(by_turn), by_turn], axis=2))
    return np.stack(values, axis=1), np.stack(derivatives, axis=1)
