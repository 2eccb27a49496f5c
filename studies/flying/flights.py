"""Paper F's three motions, flown: the library's robot with its elastic cables, in the wind of figure 5.

The plans are made by `plans`, without air. Each is simulated three times: by the lengths of Eq. 5 without control
(`wind_up`), by computed torque under a quadrotor that stays on its plan, and by computed torque under one that gives
way to the wind by up to 0.5 m. The last two also fly the circle of radius 0.15 m under a hovering quadrotor. Where
there is no wind the air rests, so a platform that flies straight at 10 m/s has drag without any.

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
from ..accounts.claim import Chapter, Claim
from .claims import claim
from .plans import BELOW, FEASIBLE, NOT_READ, RATE, SECONDS, TIMES, Name, planned, solved
from .repair import ON_CIRCLE
from .shaken import FLIGHT, Wound, wind_up
from .wind import NOISE, PEAK

MOTIONS: tuple[Name, ...] = get_args(Name)
PLACES = {"circle": "VI.B, figure 8", "helix": "VI.A, figure 6", "pitching": "figures 12 and 13"}
WHAT = {
    "circle": "the circle of 1 m under a free quadrotor",
    "helix": "the helix of 1 m under a free quadrotor",
    "pitching": "a circle of 0.15 m in {A} under the moving and pitching quadrotor",
}
STAYS, GIVES = "quadrotor on its plan", "quadrotor gives way"
AWAY = 0.5  # of a quadrotor that gives way, at most [m]
STEP = 2e-3  # [s] of the controllers; with half of it distances change by less than 3 %
SHOWN = slice(None, None, 10)  # of the rows, in figures


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
    pitching, least = flown["pitching"], [part.gives.record.tensions.min() for part in flown.values()]
    windy = np.stack([part.windy.tensions for part in flown.values()])
    slack = (windy <= 0).any(axis=-1).mean(axis=-1).max()
    claims = [
        _lengths(flown),
        _followed("VI.B-flown", "circle", flown),
        _followed("VI.A-flown", "helix", flown),
        claim("VI.C-flown").undetermined(
            pitching.gives.error.max(),
            place=PLACES["pitching"],
            what=WHAT["pitching"],
            not_read=NOT_READ,
            time=pitching.gives.times[pitching.gives.error.argmax()],
            short=np.nanmax(pitching.gives.record.shortfall, initial=0.0),
            stays=100 * pitching.stays.error.max(),
        ),
        claim("flown-positive").repaired(
            f"{', '.join(f'{value:.2f}' for value in least)} N", min(least) > 0, slack=slack, most=windy.max()
        ),
        _wind(robot, flown["circle"]),
        _own_drag(robot, flown["helix"]),
        _stability(*hovering),
    ]
    drawings = {f"flown-{name}": _drawing(WHAT[name], part.stays, part.gives) for name, part in flown.items()}
    small = f"the circle of radius {FEASIBLE:g} m under a hovering quadrotor"
    return Chapter(claims, drawings | {"flown-hovering": _drawing(small, *hovering)})


def gust(times: np.ndarray, seed: int) -> np.ndarray:
    """Return the wind of figure 5 as chapter `wind` draws it, linear between its samples, (n, 3) [m/s]."""
    drawn = trapezoid(TIMES, PEAK, noise=NOISE, seed=seed)
    return np.stack([np.interp(times, TIMES, drawn[:, axis]) for axis in range(3)], axis=1)


def fly(robot: Robot, name: Name) -> Flown:
    """Fly one of the three plans in each manner."""
    plan = planned(name)
    body, carriers = (Motion(*parts) for parts in read_trajectory(robot, plan, None).at(FLIGHT))
    calm, windy = (wind_up(robot, body, carriers, wind=wind) for wind in (None, gust(FLIGHT[:-1], 0)))
    pilots = None, ComputedTorque(robot, reach=(AWAY, 0.0))
    stays, gives = (simulate(robot, plan, pilot, period=STEP, wind=gust) for pilot in pilots)
    return Flown(stays, gives, calm, windy, body, carriers)


def small_circle(robot: Robot, away: float) -> Simulation:
    """Fly the circle of `FEASIBLE` radius under a quadrotor that hovers and gives way by up to `away` [m]."""
    path = CirclePath(kind="circle", centre=(0.0, 0.0, -BELOW), radius=FEASIBLE, rate=RATE)
    return simulate(robot, path, ComputedTorque(robot, reach=(away, 0.0)), period=STEP, wind=gust, duration=SECONDS)


def required(robot: Robot, flown: Flown, wind: np.ndarray | None = None) -> np.ndarray:
    """Return the steady tensions of a plan in a wind, T of Eq. 38 without dT, (n, 6) [N]; default: no air."""
    dynamics = Dynamics(robot)
    A = dynamics.wrench_matrix(flown.body.pose, flown.carriers.pose)
    return solved(A, dynamics.required_wrench(*flown.body, *flown.carriers, wind=wind))


def moved(flight: Simulation) -> float:
    """Return how far the quadrotor was from its plan at most [m]."""
    off = flight.trajectory["carrier_pose"].values - flight.trajectory["carrier_reference"].values
    return float(np.linalg.norm(off[..., :3], axis=-1).max())


def accelerated(flight: Simulation) -> float:
    """Return the largest horizontal acceleration of the quadrotor [m/s^2], over steps of 10 ms."""
    steps = slice(None, None, 5)
    velocity, times = flight.trajectory["carrier_velocity"].values[steps, 0, :2], flight.times[steps]
    return float(np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() / (times[1] - times[0]))


def _lengths(flown: dict[Name, Flown]) -> Claim:
    off = [np.linalg.norm((part.calm.states.pose - part.body.pose)[:, :3], axis=-1).max() for part in flown.values()]
    return claim("eq-6-flown").compared(off, printed=0.0, within=ON_CIRCLE, near=1000.0 * ON_CIRCLE)


def _followed(id: str, name: Name, flown: dict[Name, Flown]) -> Claim:
    stays, gives = flown[name].stays, flown[name].gives
    most, tensions, floor = gives.error.max(), gives.record.tensions, gives.robot.t_min.max()
    return claim("flown-free").repaired(
        most,
        gives.lasted == len(gives.references) and most <= ON_CIRCLE,
        id=id,
        place=PLACES[name],
        what=WHAT[name],
        name=name,
        acceleration=accelerated(gives),
        moved=100 * moved(gives),
        low=tensions.min(),
        high=tensions.max(),
        below=(tensions.min(axis=1) < floor).mean(),
        floor=floor,
        stays=100 * stays.error.max(),
        near=1000.0 * ON_CIRCLE,
    )


def _wind(robot: Robot, part: Flown) -> Claim:
    without, windy = required(robot, part), required(robot, part, gust(FLIGHT, 0))
    change, pushing = 100 * np.abs((windy - without) / without).max(), ""
    if windy.min() < 0:
        pushing = (
            f" Along the circle the wind would make cables push, with {windy.min():.1f} N, if the quadrotor stayed on "
            "its plan."
        )
    return claim("conclusion-wind").stated(f"{change:.0f} %", change > 1.0, pushing=pushing)


def _own_drag(robot: Robot, part: Flown) -> Claim:
    """Compare the drag in still air with the drag of Eq. 25, where V_w is the wind over the ground."""
    dynamics = Dynamics(robot)
    drag = dynamics.aerodynamic_wrench(part.body.pose, part.body.velocity, np.zeros(3))[:, :2]
    strongest = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), np.array(PEAK))[:2]
    along = (part.carriers.pose[-1, 0, :3] - part.carriers.pose[0, 0, :3]) / SECONDS
    return claim("eq-25-flight").compared(
        np.linalg.norm(drag, axis=1).max(),
        speed=np.linalg.norm(along),
        horizontal=np.linalg.norm(along[:2]),
        strongest=np.linalg.norm(strongest),
    )


def _stability(stays: Simulation, gives: Simulation) -> Claim:
    unanswered = 1 - stays.answered["as planned"] / len(stays.references)
    return claim("conclusion-stability").undetermined(
        f"{1e3 * stays.error.max():.0f} mm hovering, {1e3 * gives.error.max():.1f} mm giving way",
        feasible=FEASIBLE,
        unanswered=unanswered,
        moved=100 * moved(gives),
        answered=gives.answered["as planned"] / len(gives.references),
    )


def _drawing(what: str, stays: Simulation, gives: Simulation) -> Drawing:
    flights, t_min = {STAYS: stays, GIVES: gives}, float(stays.robot.t_min.min())
    errors = {label: 1e3 * flight.error[SHOWN] for label, flight in flights.items()}
    panels = [Panel("error [mm]", errors, logarithmic=True)]
    for label, flight in flights.items():
        tensions = flight.record.tensions[SHOWN]
        panels.append(Panel.of_cables(f"tension [N],\n{label}", tensions, {"t_min": t_min}))
    about = f"Flights in the wind of figure 5, {what}: errors and tensions"
    return Drawing(about, curves(stays.times[SHOWN], "time [s]", panels))
