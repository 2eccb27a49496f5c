"""Paper F's circle with its steady tensions, and three plans, one for each of the motions that section VI simulates.

The platform of the paper follows circles with r = 1 m, which cables that only pull cannot give under a quadrotor that
hovers or flies straight (`circle`). These plans replace them:

- VI.B, the circle in {G}, with the quadrotor free to move beside its hovering point;
- VI.A, the helix in {G}, with the quadrotor free to leave its straight line;
- figures 12 to 15, a circle of radius 0.15 m in {A}, with the quadrotor moving and pitching as assumed.

The recognised text of the paper has no section VI.C, only the captions of its figures 12 to 15: what is printed there
is not known here. Assumed: VI.A's line at its mean velocity, pitching by `PITCH` sin(0.2 pi t), and along x the
surge that a quadrotor has when its thrust pitches: ddx = g tan(pitch).
"""

from functools import cache
from typing import Literal

import numpy as np

from ...models import Dynamics, load
from ...ocp import Plan, Task, plan
from ...ocp.tasks.paths import CirclePath, LinePath, Motion, SamplePath
from ...ocp.tasks.task import GivenBase
from .circle import tasks

START, END, SECONDS = np.array([-20.0, -30.0, 40.0]), np.array([40.0, 20.0, 102.45]), 10.0  # VI.A [m], [s]
LINE = LinePath(kind="line", start=(*START, 0, 0, 0), end=(*END, 0, 0, 0), timing="uniform")  # of the quadrotor in VI.A
RATE = 0.2 * np.pi  # [rad/s]
BELOW = 1.0  # of the circle's centre under the quadrotor [m]
PITCH = 0.1  # [rad], assumed
NOT_READ = "The recognised text lacks the section of figures 12 to 15."
GRAVITY = 9.81
Name = Literal["circle", "helix", "pitching"]
RADIUS = 1.0  # of the circle in VI.A and VI.B [m]
FEASIBLE = 0.15  # [m], assumed where no tensions of the paper's own circle are inside their limits
TIMES = np.linspace(0.0, SECONDS, 1001)


def circle_task() -> Task:
    """Return VI.B: the circle about a hovering point, with the quadrotor free."""
    return tasks()[1]


def helix_task() -> Task:
    """Return VI.A: the helix about a straight flight, with the quadrotor free."""
    centre, drift = (START - [0, 0, BELOW]).tolist(), ((END - START) / SECONDS).tolist()
    path = {"kind": "circle", "centre": centre, "radius": 1.0, "rate": RATE, "drift": drift}
    base = {"kind": "free", "around": {"quad": LINE}, "acceleration_max": 3.0}
    return Task.model_validate({"name": "helix-free", "path": path, "base": base, "duration": SECONDS})


def pitching_task() -> Task:
    """Return the motion for figures 12 to 15: a small circle in the frame of a quadrotor that moves and pitches."""
    path = CirclePath(kind="circle", frame="quad", centre=(0, 0, -BELOW), radius=0.15, rate=RATE)
    return Task(name="circle-pitching", path=path, base=GivenBase(kind="given", paths={"quad": pitching_flight()}))


@cache
def planned(name: Name) -> Plan:
    """Return the plan of one of the three motions, computed once in a process."""
    return plan(load("wang-flying"), {"circle": circle_task, "helix": helix_task, "pitching": pitching_task}[name]())


def pitching_flight(largest: float = PITCH) -> SamplePath:
    """Return the assumed flight of figures 12 to 15, pitching by up to `largest` [rad], with its surge."""
    times = np.linspace(0.0, SECONDS, 101)
    pitch = largest * np.sin(RATE * times)
    flight = START + times[:, None] * (END - START) / SECONDS
    flight[:, 0] += surge(times, largest)
    still = np.zeros_like(times)
    poses = np.column_stack([flight, still, pitch, still])
    return SamplePath(kind="samples", times=tuple(times), poses=tuple(map(tuple, poses)))


def surge(times: np.ndarray, largest: float = PITCH) -> np.ndarray:
    """Return the deviation from the line along x [m] by ddx = g tan(pitch), to third order in pitch.

    With s = sin(RATE t) and P = `largest`, tan(P s) = P s + (P s)^3 / 3 and s^3 = (3 sin(RATE t) - sin(3 RATE t)) / 4.
    """
    first, third = largest + largest**3 / 4, -(largest**3) / 12
    return -GRAVITY / RATE**2 * (first * np.sin(RATE * times) + third / 9 * np.sin(3 * RATE * times))


def circle(radius: float, times: np.ndarray = TIMES, below: float = BELOW) -> Motion:
    """Return the circle in {A} about a point `below` [m] under the quadrotor, level; its three parts are (n, 6)."""
    return CirclePath(kind="circle", centre=(0.0, 0.0, -below), radius=radius, rate=RATE).at(times, SECONDS)


def steady_tensions(dynamics: Dynamics, motion: Motion, base: Motion | None = None) -> np.ndarray:
    """Return T = A^-1 w of a robot with six cables and one carrier, (n, 6) [N]: negative where a cable would push.

    The platform's motion is in {A}, the carrier's, `base`, in {G}; default: hovering, level.
    """
    w = dynamics.relative.required_wrench(*motion, *(base or ()))
    return solved(dynamics.relative.wrench_matrix(motion.pose), w)


def solved(A: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return A^-1 w of matrices (..., 6, 6) and wrenches (..., 6), (..., 6)."""
    return np.linalg.solve(A, w[..., None])[..., 0]
