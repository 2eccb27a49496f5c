"""`interpretations`: ways to read a log in which units, signs, axes or conventions of angles are mistaken."""

from collections.abc import Callable, Iterator
from itertools import permutations
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ...models import points
from ..logs.carrier_poses import FROM_FRD, FROM_NED

FACTORS = {
    1e-3: "millimetres read as metres",
    1e-2: "centimetres read as metres",
    0.0254: "inches read as metres",
    1e3: "metres read as millimetres",
    1e2: "metres read as centimetres",
}
ANGLES = ("roll", "pitch", "yaw")
Turned = Callable[[np.ndarray, np.ndarray], np.ndarray]


class Interpretation(NamedTuple):
    """A way to read a log, and the error that it corrects."""

    text: str  # the error, "" if there is none
    placed: Callable[[np.ndarray], np.ndarray] = lambda position: position  # function of the positions (N, 3) [m]
    # function of the rotations (N, 3, 3) and the angles (N, 3) as they were logged [rad]; None if they are right
    turned: Turned | None = None
    factor: float = 1.0  # factor of the readings

    @property
    def of_readings(self) -> bool:
        """Return whether poses are as they were logged."""
        return self.placed is Interpretation("").placed and self.turned is None


_MIRROR = np.diag([1, -1.0, 1])
LEFT_HANDED = Interpretation(
    "the axes look left-handed, with y the other way", lambda x: x @ _MIRROR, lambda R, _: _MIRROR @ R @ _MIRROR
)


def interpretations(turns: bool) -> list[Interpretation]:
    """Return the ways to read a log, the given one first; those of orientations if the platform `turns`."""
    result = [Interpretation("")]
    for factor, unit in FACTORS.items():
        result += [
            Interpretation(f"the lengths look like {unit}", factor=factor),
            Interpretation(f"the positions look like {unit}", _times(factor)),
            Interpretation(f"lengths and positions look like {unit}", _times(factor), factor=factor),
        ]
    for i, axis in enumerate("xyz"):
        result.append(
            Interpretation(f"{axis} of the positions seems to have the wrong sign", _times(1 - 2 * np.eye(3)[i]))
        )
    for order in ((1, 0, 2), (2, 1, 0), (0, 2, 1)):
        named = " and ".join("xyz"[i] for i in range(3) if order[i] != i)
        result.append(Interpretation(f"{named} of the positions look exchanged", lambda x, order=order: x[:, order]))
    for axis, turn in FROM_NED.items():
        text = f"the positions look like north, east, down, with x of {{G}} to the {axis}"
        result.append(Interpretation(text, lambda x, turn=turn: x @ turn.T))
    if not turns:
        return result
    conventions: dict[str, Turned] = {
        "the angles look like degrees read as radians": lambda R, angles: points.rotations(np.radians(angles)),
        "the angles look like radians read as degrees": lambda R, angles: points.rotations(np.degrees(angles)),
        "the orientations look inverted, from {G} to the platform": lambda R, angles: np.swapaxes(R, 1, 2),
        "the quaternions look like (w, x, y, z) read as (x, y, z, w)": lambda R, angles: _quaternion(R, [1, 2, 3, 0]),
        "the quaternions look like (x, y, z, w) read as (w, x, y, z)": lambda R, angles: _quaternion(R, [3, 0, 1, 2]),
        "the angles look like a rotation vector": lambda R, angles: Rotation.from_rotvec(angles).as_matrix(),
    }
    for axes in permutations("xyz"):
        for columns in map(list, permutations(range(3))):  # the column of the log for each angle
            if axes == ("x", "y", "z") and columns == [0, 1, 2]:
                continue  # as they are read
            text = ", ".join(ANGLES[i] for i in columns)
            conventions[f"the angles look like {text} about {', '.join(axes)} of {{G}}, one after the other"] = (
                lambda R, angles, axes=axes, columns=columns: _euler(angles[:, columns], axes)
            )
    result += [Interpretation(text, turned=turned) for text, turned in conventions.items()]
    for text, turn, body in _framed():
        result += [
            Interpretation(
                f"the poses seem to be measured {text}",
                lambda x, turn=turn: x @ turn.T,
                lambda R, _, turn=turn, body=body: turn @ R @ body,
            ),
            Interpretation(
                f"the angles look like degrees read as radians, {text}",
                lambda x, turn=turn: x @ turn.T,
                lambda _, angles, turn=turn, body=body: turn @ points.rotations(np.radians(angles)) @ body,
            ),
        ]
    return result


def _framed() -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield usual frames of world and body by their names, and the rotations from both to those with z up."""
    for axis, turn in FROM_NED.items():
        named = f"in axes north, east, down (of the body: forward, right, down), with x of {{G}} to the {axis}"
        yield named, turn, FROM_FRD
    up = np.array([[1, 0, 0], [0, 0, -1.0], [0, 1, 0]])  # of many motion capture systems
    for quarters in range(4):
        about = np.rint(Rotation.from_euler("z", 90 * quarters, degrees=True).as_matrix())
        along = ("x", "y", "-x", "-y")[quarters]
        named = f"with their x along {along} of {{G}}"
        yield f"in axes of which y points up, {named}", about @ up, (about @ up).T
        mirrors = {"z points up": _MIRROR, "y points up": np.eye(3)[[0, 2, 1]], "z points down": np.diag([1, 1, -1.0])}
        for height, mirror in mirrors.items():  # as of game engines
            yield f"in left-handed axes of which {height}, {named}", about @ mirror, (about @ mirror).T


def _times(factor: float | np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    return lambda position: factor * position


def _quaternion(rotation: np.ndarray, order: list[int]) -> np.ndarray:
    return Rotation.from_quat(Rotation.from_matrix(rotation).as_quat()[:, order]).as_matrix()


def _euler(about: np.ndarray, axes: tuple[str, ...]) -> np.ndarray:
    """Return the rotations (N, 3, 3) by angles (N, 3) about x, y, z, one axis after the other."""
    return Rotation.from_euler("".join(axes), about[:, ["xyz".index(axis) for axis in axes]]).as_matrix()
