"""Paper F's three motions, flown: the library's robot with its elastic cables, in the wind of figure 5.

The plans are those of `plans`, which know no air. Each is flown three times: by the lengths of Eq. 5 without control
(`wound`), by computed torque under a quadrotor that stays on its plan, and by computed torque under one that gives way
to the wind by up to 0.5 m. The last two also fly the circle of radius 0.15 m under a hovering quadrotor. Where there is
no wind the air rests, so a platform that flies straight at 10 m/s has drag without any.

The quadrotor of the paper hovers or flies straight, so these flights reproduce nothing of VI.A and VI.B: they are
repairs. Its motion is prescribed, level whatever its acceleration, and no cable pulls it off.
"""

from typing import NamedTuple, get_args

import numpy as np

from ...control import ComputedTorque
from ...control.trajectory import read_trajectory
from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, Robot, load
from ...models.air import trapezoid
from ...ocp.tasks.paths import CirclePath, Motion
from ...simulation import Simulation, simulate
from ..accounts.account import Chapter
from ..accounts.claim import Claim
from .claims import claim
from .motion import FEASIBLE, TIMES, solved
from .plans import BELOW, NOT_READ, RATE, SECONDS, Name, planned
from .repair import ON_CIRCLE
from .wind import NOISE, PEAK
from .wound import FLIGHT, Wound, wind_up

MOTIONS: tuple[Name, ...] = get_args(Name)
PLACES = {"circle": "VI.B, figure 8", "helix": "VI.A, figure 6", "pitching": "figures 12 and 13"}
WHAT = {
    "circle": "the circle of 1 m under a free quadrotor",
    "helix": "the helix of 1 m under a free quadrotor",
    "pitching": "a circle of 0.15 m in {A} under the moving and pitching quadrotor",
}
STAYS, GIVES = "quadrotor on its plan", "quadrotor gives way"
AWAY = 0.5  # of a quadrotor that gives way, at most [m]
SHOWN = slice(None, None, 20)  # of the rows, in figures


class Flown(NamedTuple):
    """A motion: its flights with computed torque, and driven by lengths, in still vacuum and in the wind."""

    stays: Simulation
    gives: Simulation
    calm: Wound
    windy: Wound
    body: Motion
    carriers: Motion


def chapter() -> Chapter:
    """Fly the three motions, and a circle under a hovering quadrotor."""
    robot = load("wang-flying")
    flown: dict[Name, Flown] = {name: fly(robot, name) for name in MOTIONS}
    hovering = small_circle(robot, 0.0), small_circle(robot, AWAY)
    claims = [
        _lengths(flown),
        _followed("VI.B-flown", "circle", flown),
        _followed("VI.A-flown", "helix", flown),
        _pitching(flown["pitching"]),
        _positive(flown),
        _wind(robot, flown["circle"]),
        _own_drag(robot, flown["helix"]),
        _stability(*hovering),
    ]
    drawings = {f"flown-{name}": _drawing(name, part.stays, part.gives) for name, part in flown.items()}
    drawings["flown-hovering"] = _drawing("hovering", *hovering)
    return Chapter(claims, drawings)


def gust(times: np.ndarray, seed: int) -> np.ndarray:
    """Return the wind of figure 5 as chapter `wind` draws it, linear between its samples, (n, 3) [m/s]."""
    drawn = trapezoid(TIMES, PEAK, noise=NOISE, seed=seed)
    return np.stack([np.interp(times, TIMES, drawn[:, axis]) for axis in range(3)], axis=1)


def fly(robot: Robot, name: Name) -> Flown:
    """Fly one of the three plans in each manner."""
    plan = planned(name)
    body, carriers = (Motion(*parts) for parts in read_trajectory(robot, plan, None).at(FLIGHT))
    windy = wind_up(robot, body, carriers, wind=gust(FLIGHT[:-1], 0))
    pilot = ComputedTorque(robot, reach=(AWAY, 0.0))
    return Flown(
        simulate(robot, plan, wind=gust),
        simulate(robot, plan, pilot, wind=gust),
        wind_up(robot, body, carriers),
        windy,
        body,
        carriers,
    )


def small_circle(robot: Robot, away: float) -> Simulation:
    """Fly the circle of `FEASIBLE` radius under a quadrotor that hovers and gives way by up to `away` [m]."""
    path = CirclePath(kind="circle", centre=(0.0, 0.0, -BELOW), radius=FEASIBLE, rate=RATE)
    return simulate(robot, path, ComputedTorque(robot, reach=(away, 0.0)), wind=gust, duration=SECONDS)


def required(robot: Robot, flown: Flown, wind: np.ndarray | None = None) -> np.ndarray:
    """Return the steady tensions of a plan in a wind, T of Eq. 38 without dT, (n, 6) [N]; default: no air."""
    dynamics = Dynamics(robot)
    A = dynamics.wrench_matrix(flown.body.pose, flown.carriers.pose)
    return solved(A, dynamics.required_wrench(*flown.body, *flown.carriers, wind=wind))


def moved(flight: Simulation) -> float:
    """Return how far the quadrotor was from its plan at most [m]."""
    motion, plan = flight.trajectory["carrier_pose"].values, flight.trajectory["carrier_reference"].values
    return float(np.linalg.norm((motion - plan)[..., :3], axis=-1).max())


def accelerated(flight: Simulation) -> float:
    """Return the largest horizontal acceleration of the quadrotor [m/s^2], over steps of 10 ms."""
    steps = slice(None, None, 10)
    velocity, times = flight.trajectory["carrier_velocity"].values[steps, 0, :2], flight.times[steps]
    return float(np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() / (times[1] - times[0]))


def _off(flown: Flown, run: Wound) -> float:
    return float(np.linalg.norm((run.states.pose - flown.body.pose)[:, :3], axis=1).max())


def _lengths(flown: dict[Name, Flown]) -> Claim:
    off = tuple(_off(part, part.calm) for part in flown.values())
    return claim("eq-6-flown").compared(off, printed=(0.0,) * len(off), within=ON_CIRCLE, near=1000.0 * ON_CIRCLE)


def _followed(id: str, name: Name, flown: dict[Name, Flown]) -> Claim:
    part = flown[name]
    most = float(part.gives.error.max())
    low, high = (float(edge) for edge in (part.gives.record.tensions.min(), part.gives.record.tensions.max()))
    floor = float(part.gives.robot.t_min.max())
    below = float((part.gives.record.tensions.min(axis=1) < floor).mean())
    return claim("flown-free").repaired(
        most,
        part.gives.lasted == len(part.gives.references) and most <= ON_CIRCLE,
        id=id,
        place=PLACES[name],
        what=WHAT[name],
        name=name,
        acceleration=accelerated(part.gives),
        moved=100 * moved(part.gives),
        low=low,
        high=high,
        below=below,
        floor=floor,
        stays=100 * float(part.stays.error.max()),
        near=1000.0 * ON_CIRCLE,
    )


def _pitching(part: Flown) -> Claim:
    worst = int(part.gives.error.argmax())
    short = float(np.nanmax(part.gives.record.shortfall, initial=0.0))
    return claim("VI.C-flown").undetermined(
        float(part.gives.error.max()),
        place=PLACES["pitching"],
        what=WHAT["pitching"],
        not_read=NOT_READ,
        time=part.gives.times[worst],
        short=short,
        stays=100 * float(part.stays.error.max()),
    )


def _positive(flown: dict[Name, Flown]) -> Claim:
    least = tuple(float(part.gives.record.tensions.min()) for part in flown.values())
    slack = max(float((part.windy.tensions <= 0).any(axis=1).mean()) for part in flown.values())
    most = max(float(part.windy.tensions.max()) for part in flown.values())
    return claim("flown-positive").repaired(
        f"{', '.join(f'{value:.2f}' for value in least)} N", min(least) > 0, slack=slack, most=most
    )


def _wind(robot: Robot, part: Flown) -> Claim:
    without, windy = required(robot, part), required(robot, part, gust(FLIGHT, 0))
    change = float(100 * np.abs((windy - without) / without).max())
    return claim("conclusion-wind").stated(
        f"{change:.0f} %",
        change > 1.0,
        pushing=f" Along the circle the wind would make cables push, with {windy.min():.1f} N, if the quadrotor stayed "
        "on its plan."
        if windy.min() < 0
        else "",
    )


def _own_drag(robot: Robot, part: Flown) -> Claim:
    """Compare the drag in still air with that of Eq. 25, where V_w is the wind over the ground."""
    dynamics = Dynamics(robot)
    drag = dynamics.aerodynamic_wrench(part.body.pose, part.body.velocity, np.zeros(3))[:, :2]
    strongest = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), np.array(PEAK))[:2]
    along = (part.carriers.pose[-1, 0, :3] - part.carriers.pose[0, 0, :3]) / SECONDS
    return claim("eq-25-flight").compared(
        float(np.linalg.norm(drag, axis=1).max()),
        speed=np.linalg.norm(along),
        horizontal=np.linalg.norm(along[:2]),
        strongest=np.linalg.norm(strongest),
    )


def _stability(stays: Simulation, gives: Simulation) -> Claim:
    unanswered = 1 - stays.answered["as planned"] / len(stays.references)
    off = tuple(float(flight.error.max()) for flight in (stays, gives))
    return claim("conclusion-stability").undetermined(
        f"{1e3 * off[0]:.0f} mm hovering, {1e3 * off[1]:.1f} mm giving way",
        feasible=FEASIBLE,
        unanswered=unanswered,
        moved=100 * moved(gives),
        answered=gives.answered["as planned"] / len(gives.references),
    )


def _drawing(name: str, stays: Simulation, gives: Simulation) -> Drawing:
    robot = stays.robot
    errors = {STAYS: 1e3 * stays.error[SHOWN], GIVES: 1e3 * gives.error[SHOWN]}
    panels = [Panel("error [mm]", errors, logarithmic=True)]
    for label, flight in ((STAYS, stays), (GIVES, gives)):
        tensions = flight.record.tensions[SHOWN]
        lines = {f"cable {index + 1}": tensions[:, index] for index in range(robot.m)}
        panels.append(Panel(f"tension [N],\n{label}", lines, {"t_min": float(robot.t_min.min())}))
    what = WHAT.get(name, f"the circle of radius {FEASIBLE:g} m under a hovering quadrotor")
    return Drawing(
        f"Flights in the wind of figure 5, {what}: errors and tensions", curves(stays.times[SHOWN], "time [s]", panels)
    )
