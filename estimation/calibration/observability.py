"""`Observability`: the observable directions of the parameters, and the names of the unobservable ones.

A direction of the parameters is unobservable if poses can move along without any length changing (a gauge, such as the
choice of {G} if no pose was measured), or if the measured poses differ too little. Gauges have known generators. Each
is tested on the normal equations, because pulleys with given axes, locked coordinates and fixed parameters exclude
some. Other directions are named by the parameters that they change most.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.display import Displayed
from .fit import unobservable_below
from .model import State
from .parameters import OF_CABLE, OF_ROBOT, WORDS, Parameters

INSIDE = 0.999  # of a generator's length that must lie in the open directions
NOISE = 0.75  # share of a direction's information that seems to be noise of unknown poses: the rest decides nothing
MOST_NOISE = 0.9  # share of a direction's information that seems to be noise of unknown poses; more is not certain
SAME = 1e-6  # of a direction's length, left after others are taken away: it is one of theirs
OPEN = 1e-4  # of the square of a parameter's unit vector that lies in open directions: it is not determined
NOTABLE = 0.3  # of the largest change along a direction: such parameters name it
MOST_NAMED = 4
AXES = "xyz"


@dataclass(frozen=True, eq=False)
class Observability(Displayed):
    """Observable and unobservable directions of the parameters."""

    # pseudo-inverse of the normal matrix of the free parameters, in metres, (p, p); zero along unobservable directions
    inverse: np.ndarray
    covariance: np.ndarray  # their covariance, (p, p), like `inverse`, and larger where unknown poses have noise
    information: np.ndarray  # pseudo-inverse of the covariance, (p, p) [1/m^2]
    noise: np.ndarray  # directions of which little more than the noise of unknown poses tells, orthonormal, (p, d)
    rank: int  # number of observable directions
    determined: np.ndarray  # True for parameters without a part in an unobservable direction, (p,)
    open: tuple[str, ...]  # names of the unobservable directions


def observability(
    S: np.ndarray,
    B: np.ndarray,
    parameters: Parameters,
    state: State,
    scale: np.ndarray,
    length: float,
    kept: np.ndarray,
) -> Observability:
    """Return the observability of normal equations.

    - `S`: matrix of the free parameters, in metres, (p, p) [1/m^2].
    - `B`: part of it that comes from the noise of unknown poses, `seeming_information`.
    - `scale`: factors that convert parameters to lengths, (P,).
    - `length`: length of the cables [m].
    - `kept`: rows of all parameters along which the file's values were kept, (d, P).
    """
    held = (kept / scale)[:, parameters.varies]
    across = np.eye(len(S)) - np.linalg.pinv(held, rcond=SAME) @ held
    S, B = across @ S @ across, across @ B @ across
    values, vectors = np.linalg.eigh(S)
    fixed = values > unobservable_below(values, length)
    N, V, roots = vectors[:, ~fixed], vectors[:, fixed], np.sqrt(values[fixed])
    shares, turn = np.linalg.eigh((V / roots).T @ B @ (V / roots))
    left = 1 - np.clip(shares, 0.0, MOST_NOISE)  # noise of poses never adds information
    inverse, covariance = (V / values[fixed]) @ V.T, ((V / roots) @ turn / left**2) @ ((V / roots) @ turn).T
    information = ((V * roots) @ turn * left**2) @ ((V * roots) @ turn).T
    true, axes = np.linalg.eigh(S - B)
    seeming = ((S @ axes) * axes).sum(axis=0)
    noise = axes[:, (seeming > unobservable_below(values, length)) & (true < (1 - NOISE) * seeming)]
    names = _names(N, parameters, state, scale)
    return Observability(inverse, covariance, information, noise, V.shape[1], (N**2).sum(axis=1) < OPEN, names)


def _names(N: np.ndarray, parameters: Parameters, state: State, scale: np.ndarray) -> tuple[str, ...]:
    """Return a name for each column of N, (p, d), gauges first."""
    from scipy.linalg import null_space

    names: list[str] = []
    rest = N
    varies = parameters.varies
    for words, generator in generators(parameters, state):
        if not rest.shape[1]:
            break
        own = generator * scale
        size = np.linalg.norm(own)
        if not size > 0 or np.linalg.norm(own[~varies]) > SAME * size:
            continue
        direction = own[varies] / size
        within = N.T @ direction
        left = rest.T @ direction  # what no generator before it accounts for
        if np.linalg.norm(within) < INSIDE or np.linalg.norm(left) < SAME**0.5:
            continue
        names.append(words)
        # The open directions that are left: those across this one.
        rest = rest @ null_space(left[None])
    return (*names, *_by_parameters(rest, parameters, state))


def generators(parameters: Parameters, state: State) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the possible gauges: name, and changes of all parameters, (P,)."""
    table = parameters.table(state.x)
    turned, placed = parameters.carriers
    anchors = placed + np.einsum("mij,mj->mi", turned, table[:, :3])
    middle, attachments, still = anchors.mean(axis=0), table[:, 3:6], np.zeros_like(anchors)

    def change(d_anchors: np.ndarray, d_attachments: np.ndarray) -> np.ndarray:
        result = np.zeros(parameters.count)
        rows = parameters.table(result)
        rows[:, :3], rows[:, 3:6] = np.einsum("mji,mj->mi", turned, d_anchors), d_attachments
        return result

    bodies = (("anchors", "{G}", anchors - middle), ("attachments", "the platform", attachments - attachments.mean(0)))
    for what, frame, arms in bodies:
        for word in ("along", "about"):
            for axis, unit in zip(AXES, np.eye(3), strict=True):
                moved = np.tile(unit, (len(arms), 1)) if word == "along" else np.cross(unit, arms)
                both = (moved, still) if what == "anchors" else (still, moved)
                yield f"all {what} together {word} {axis} of {frame}", change(*both)
    size, of_tensions = state.x.copy(), parameters.table(state.x)[:, 10:]
    size[parameters.clock : parameters.clock + 2] = 0.0
    size[parameters.clock + 2 : parameters.clock + 5] *= "com" in parameters.groups
    size[parameters.clock + 5 : parameters.clock + OF_ROBOT] = 0.0
    parameters.table(size)[:, :3] = np.einsum("mji,mj->mi", turned, anchors - middle)
    parameters.table(size)[:, 10:] = 0.0
    yield "the overall scale: no length is known for certain", size
    force = np.zeros(parameters.count)
    force[parameters.clock + 1] = state.x[parameters.clock + 1]
    parameters.table(force)[:, 10:] = of_tensions * [-1.0, 0.0, 1.0, 1.0, 0.0]
    yield "mass and gains together: no force is known for certain", force
    for i in range(len(anchors)):
        for axis, unit in zip(AXES, np.eye(3), strict=True):
            rows = np.zeros_like(anchors)
            rows[i] = unit
            yield f"cables[{i}].anchor and cables[{i}].attachment together along {axis}", change(rows, rows)


def _by_parameters(rest: np.ndarray, parameters: Parameters, state: State) -> list[str]:
    """Return a name for each direction, from the few parameters that it changes most."""
    if not rest.shape[1]:
        return []
    from scipy.linalg import qr

    factors: Any = qr(rest.T, mode="r", pivoting=True)
    pivots = factors[1][: rest.shape[1]]
    sparse = np.linalg.solve(rest[pivots].T, rest.T).T  # 1 at its own pivot, 0 at the others'
    where = np.flatnonzero(parameters.varies)
    toward = _along_cables(parameters, state)
    return [_one(column, where, parameters, toward) for column in sparse.T]


def _along_cables(parameters: Parameters, state: State) -> np.ndarray:
    """Return the unit vectors of the cables at home in the frames of their carriers, (m, 3)."""
    robot, table = parameters.robot, parameters.table(state.x)
    turned, placed = parameters.carriers
    lines = np.einsum("mji,mj->mi", turned, robot.home_attachments - placed) - table[:, :3]
    return lines / np.maximum(np.linalg.norm(lines, axis=1, keepdims=True), 1e-12)


def _one(column: np.ndarray, where: np.ndarray, parameters: Parameters, toward: np.ndarray) -> str:
    changes = np.zeros(parameters.count)
    changes[where] = column
    table = parameters.table(changes)
    parts: list[tuple[float, str]] = []
    for i, row in enumerate(table):
        for word, part in (("anchor", row[:3]), ("attachment", row[3:6])):
            size = float(np.linalg.norm(part))
            if size > 0:
                parts.append(
                    (size, f"cables[{i}].{word} {_direction(part / size, toward[i] if word == 'anchor' else None)}")
                )
        parts += [(abs(row[k]), f"cables[{i}].{WORDS[k]}") for k in range(6, OF_CABLE)]
    rest = slice(parameters.clock, None)
    parts += [(abs(value), name) for value, name in zip(changes[rest], parameters.names[rest], strict=True)]
    parts.sort(key=lambda part: -part[0])
    named = [text for size, text in parts if size >= NOTABLE * parts[0][0]][:MOST_NAMED]
    return ", ".join(named) + " together" * (len(named) > 1)


def _direction(unit: np.ndarray, cable: np.ndarray | None) -> str:
    if cable is not None and abs(unit @ cable) > 0.9:
        return "along its cable"
    largest = int(np.argmax(np.abs(unit)))
    if abs(unit[largest]) > 0.9:
        return f"along {AXES[largest]}"
    unit = unit * np.sign(unit[largest])
    return f"along ({', '.join(f'{value:.2f}' for value in unit + 0.0)})"
