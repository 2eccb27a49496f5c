"""`Surroundings`: a tube and keep-out bodies for the platform."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..base.inputs import InputError, number, shown
from ..models.parsing import validate
from ..models.part import Part
from ..models.points import placed
from ..models.robot import Robot
from ..models.shapes import Block, Capsule, Shape, Sphere

STEP = 1e-6  # [rad], of a difference quotient
FAR = 4.0  # of the robot's length: a row whose limit is further away is left out, one that is exceeded never
NOT_THERE = 1e-3  # [m]: a point that is nearer to the middle of a body is pushed up


class _Bodies(Part):
    keep_out: tuple[Annotated[Shape, Field(discriminator="kind")], ...]


class Surroundings:
    """Write soft constraints for the platform's position at the end of each stage.

    One row keeps the frame inside the tube. One row for each body keeps the closest of the platform's points (frame and
    attachments) outside. Each uses a plane that touches the tube or the body at the point closest to the guess.

    Raises `InputError` if an argument has a wrong value.
    """

    def __init__(self, robot: Robot, tube: float | None, keep_out: Sequence[Shape | dict[str, Any]]):
        self._tube = None if tube is None else number("tube", tube, 1e-6, 1e6)
        if not isinstance(keep_out, Sequence) or isinstance(keep_out, str):
            raise InputError(f"keep_out must be a list of bodies, got {shown(keep_out)}")
        self._bodies = validate({"keep_out": list(keep_out)}, _Bodies, "Predictive").keep_out
        self._points = np.vstack([np.zeros(3), robot.attachments])
        self._scale = max(robot.length, 1e-3)
        self.rows = len(self._bodies) + (self._tube is not None)  # number of rows in each stage

    def write(self, horizon: Any, states: np.ndarray, wanted: np.ndarray, penalty: float) -> None:
        """Write the rows about guessed states, with the cost per metre of violation [1/m]; both states (N + 1, n)."""
        poses = states[1:, :6]
        if self._tube is not None:
            off = poses[:, :3] - wanted[1:, :3]
            size = np.linalg.norm(off, axis=1, keepdims=True)
            normals = np.where(size > 1e-9, off / np.maximum(size, 1e-9), [0.0, 0.0, 1.0])
            gradients = np.concatenate([normals, np.zeros_like(normals)], axis=1)
            limit = self._tube + np.einsum("ki,ki->k", normals, wanted[1:, :3])
            self._put(horizon, 0, gradients, limit, self._tube - size[:, 0], penalty)
        if not self._bodies:
            return
        points = placed(poses, self._points)  # (N, p, 3)
        turned = [placed(poses + STEP * unit, self._points) for unit in np.eye(6)[3:]]
        every = np.arange(len(poses))
        for index, body in enumerate(self._bodies, self._tube is not None):
            distance, normals = _distance(body, points)
            nearest = distance.argmin(axis=1)
            distance, normals, point = distance[every, nearest], normals[every, nearest], points[every, nearest]
            moves = np.stack([(each[every, nearest] - point) / STEP for each in turned], axis=1)  # (N, 3, 3)
            gradients = -np.concatenate([normals, np.einsum("kai,ki->ka", moves, normals)], axis=1)
            # -n (p + dp) <= distance - n p
            limit = distance + np.einsum("ki,ki->k", gradients, poses)
            self._put(horizon, index, gradients, limit, distance, penalty)

    def _put(
        self, h: Any, index: int, gradients: np.ndarray, limit: np.ndarray, room: np.ndarray, penalty: float
    ) -> None:
        """Write a row of each stage: gradient of the pose times the next state at most the limit."""
        near = (room < FAR * self._scale)[:, None]
        h.C[:, index] = np.where(near, np.einsum("ki,kij->kj", gradients, h.A[:, :6]), 0.0)
        h.D[:, index] = np.where(near, np.einsum("ki,kij->kj", gradients, h.B[:, :6]), 0.0)
        h.d[:, index] = np.where(near[:, 0], limit - np.einsum("ki,ki->k", gradients, h.c[:, :6]), self._scale)
        h.penalty[:, index] = penalty


def _distance(body: Shape, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distances of points (..., 3) from the surface of a body, negative inside, and the normals there."""
    if isinstance(body, Sphere):
        return _from_centre(points - np.array(body.centre), body.radius)
    if isinstance(body, Capsule):
        start, along = np.array(body.start), np.array(body.end) - np.array(body.start)
        share = np.clip((points - start) @ along / max(along @ along, 1e-300), 0.0, 1.0)
        return _from_centre(points - start - share[..., None] * along, body.radius)
    if isinstance(body, Block):
        own = (points - body.centre) @ body.axes
        beyond = np.abs(own) - body.half
        outside = np.maximum(beyond, 0.0)
        size = np.linalg.norm(outside, axis=-1)
        face = np.eye(3)[beyond.argmax(axis=-1)]
        out = size[..., None] > 1e-9
        normals = np.where(out, outside / np.maximum(size, 1e-300)[..., None], face)
        normals = np.where(own < 0, -normals, normals)
        return np.where(out[..., 0], size, beyond.max(axis=-1)), normals @ body.axes.T
    faces = body.body
    beyond = faces.beyond(points)
    return beyond.max(axis=-1), faces.normals[beyond.argmax(axis=-1)]


def _from_centre(off: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    size = np.linalg.norm(off, axis=-1)
    normals = np.where(size[..., None] > NOT_THERE, off / np.maximum(size, NOT_THERE)[..., None], [0.0, 0.0, 1.0])
    return size - radius, normals
