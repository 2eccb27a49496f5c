"""Paper F's three motions, flown: the library's robot with its elastic cables, in the wind of figure 5.

The plans are those of `plans`, which know no air. Each is flown three times: by the lengths of Eq. 5 without control
(`wound`), by computed torque under a quadrotor that stays on its plan, and by computed torque under one that gives way
to the wind by up to 0.5 m. The last two also fly the circle of radius 0.15 m under a hovering quadrotor. Where there is
no wind the air rests, so a platform that flies straight at 10 m/s has drag without any.

The quadrotor of the paper hovers or flies straight, so these flights reproduce nothing of VI.A and VI.B: they are
repairs. Its motion is prescribed, level whatever its acceleration, and no cable pulls it off.
"""

from __future__ import annotations

from typing import NamedTuple, get_args

import numpy as np

from ...control import ComputedTorque
from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, Robot, load
from ...models.air import trapezoid
from ...ocp.tasks.paths import CirclePath, Motion
from ...simulation import Simulation, simulate
from ...simulation.trajectory import read_trajectory
from ..accounts.account import Chapter
from ..accounts.claim import Claim, compared, repaired, stated, undetermined
from .motion import FEASIBLE, TIMES
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
    w = dynamics.required_wrench(*flown.body, *flown.carriers, wind=wind)
    return np.linalg.solve(A, w[..., None])[..., 0]


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
    return compared(
        "eq-6-flown",
        "section II.B, Eqs. 5, 6",
        "The lengths of Eq. 5, without elongation, give the motion (largest distances, of a platform on the elastic "
        "cables of Table 1 with these lengths commanded and no air, from the plans with a free quadrotor for VI.B and "
        "VI.A, and from that assumed for figures 12 to 15).",
        (0.0,) * len(off),
        off,
        within=ON_CIRCLE,
        agrees="The platform sags by about a millimetre.",
        differs=f"The platform sags by more than {1e3 * ON_CIRCLE:g} mm.",
        unit="m",
    )


def _followed(claim: str, name: Name, flown: dict[Name, Flown]) -> Claim:
    part = flown[name]
    most = float(part.gives.error.max())
    low, high = (float(edge) for edge in (part.gives.record.tensions.min(), part.gives.record.tensions.max()))
    floor = float(part.gives.robot.t_min.max())
    below = float((part.gives.record.tensions.min(axis=1) < floor).mean())
    return repaired(
        claim,
        PLACES[name],
        f"Not in the paper: the platform follows {WHAT[name]} that gives way to the wind (largest distance in a "
        "simulation on elastic cables, in the wind of figure 5).",
        most,
        holds=part.gives.lasted == len(part.gives.references) and most <= ON_CIRCLE,
        works=f"The quadrotor, prescribed and level at up to {accelerated(part.gives):.1f} m/s^2 across, gives way by "
        f"up to {100 * moved(part.gives):.0f} cm. Tensions are from {low:.2f} N to {high:.2f} N, {below:.1%} of the "
        f"time below the assumed t_min = {floor:g} N. Under a quadrotor that stays on the plan, which knows no air, "
        f"the distance is up to {100 * float(part.stays.error.max()):.0f} cm.",
        fails=f"The distance is more than {1e3 * ON_CIRCLE:g} mm, which is no proof that no other control is nearer.",
        unit="m",
        figure=f"flown-{name}",
    )


def _pitching(part: Flown) -> Claim:
    worst = int(part.gives.error.argmax())
    short = float(np.nanmax(part.gives.record.shortfall, initial=0.0))
    return undetermined(
        "VI.C-flown",
        PLACES["pitching"],
        f"The platform follows {WHAT['pitching']} (largest distance in a simulation on elastic cables, in the wind of "
        "figure 5).",
        None,
        float(part.gives.error.max()),
        missing=f"{NOT_READ} With the assumed flight and pitch the distance is largest at "
        f"{part.gives.times[worst]:.1f} s: the drag sets in before a quadrotor that gives way has left "
        f"its plan, and tensions inside the limits are short by up to {short:.1f} N. Under one that stays on the plan "
        f"it is {100 * float(part.stays.error.max()):.0f} cm.",
        unit="m",
        figure="flown-pitching",
    )


def _positive(flown: dict[Name, Flown]) -> Claim:
    least = tuple(float(part.gives.record.tensions.min()) for part in flown.values())
    slack = max(float((part.windy.tensions <= 0).any(axis=1).mean()) for part in flown.values())
    most = max(float(part.windy.tensions.max()) for part in flown.values())
    return repaired(
        "flown-positive",
        "sections II.B, VI",
        "Not in the paper: cables pull, F > 0, under a quadrotor that is free and gives way to the wind of figure 5 "
        "(smallest tensions in the flights in the place of VI.B and VI.A, and in that assumed for figures 12 to 15).",
        f"{', '.join(f'{value:.2f}' for value in least)} N",
        holds=min(least) > 0,
        works="All cables are taut. Without control, with the lengths of Eq. 5 "
        f"commanded under a quadrotor on its plan, cables are slack for up to {slack:.0%} of the time, and pull with "
        f"up to {most:.0f} N.",
        fails="Some cable gets slack.",
        figure="flown-circle",
    )


def _wind(robot: Robot, part: Flown) -> Claim:
    without, windy = required(robot, part), required(robot, part, gust(FLIGHT, 0))
    change = float(100 * np.abs((windy - without) / without).max())
    return stated(
        "conclusion-wind",
        "sections I, VI, conclusion 1",
        "The wind is a disturbance of the tensions (largest change of the tensions that the circle of 1 m requires).",
        "a disturbance",
        f"{change:.0f} %",
        holds=change > 1.0,
        agrees="It is more than 1 %. Along the circle the wind would make cables push, with "
        f"{windy.min():.1f} N, if the quadrotor stayed on its plan."
        if windy.min() < 0
        else "It is more than 1 %.",
        differs="It is less than 1 %.",
        figure="flown-circle",
    )


def _own_drag(robot: Robot, part: Flown) -> Claim:
    """Compare the drag in still air with that of Eq. 25, where V_w is the wind over the ground."""
    dynamics = Dynamics(robot)
    drag = dynamics.aerodynamic_wrench(part.body.pose, part.body.velocity, np.zeros(3))[:, :2]
    strongest = dynamics.aerodynamic_wrench(np.zeros(6), np.zeros(6), np.array(PEAK))[:2]
    along = (part.carriers.pose[-1, 0, :3] - part.carriers.pose[0, 0, :3]) / SECONDS
    return compared(
        "eq-25-flight",
        "Eq. 25, VI.A",
        "F_e depends on the velocity of the wind alone: no wind, no force (largest horizontal force along the helix, "
        "in still air).",
        0.0,
        float(np.linalg.norm(drag, axis=1).max()),
        within=1e-9,
        agrees="There is no force.",
        differs=f"The platform flies at {np.linalg.norm(along):.1f} m/s, {np.linalg.norm(along[:2]):.1f} m/s of it "
        "horizontally, through air at rest. For comparison: the strongest wind of figure 5 gives "
        f"{np.linalg.norm(strongest):.1f} N on a platform at rest.",
        unit="N",
    )


def _stability(stays: Simulation, gives: Simulation) -> Claim:
    unanswered = 1 - stays.answered["as planned"] / len(stays.references)
    off = tuple(float(flight.error.max()) for flight in (stays, gives))
    return undetermined(
        "conclusion-stability",
        "conclusion 3",
        "To keep the tensions in their range, the quadrotor should be as stable as possible (largest error on a circle "
        f"of radius {FEASIBLE:g} m in the wind of figure 5, under a quadrotor that hovers, and under one that gives "
        "way).",
        None,
        f"{1e3 * off[0]:.0f} mm hovering, {1e3 * off[1]:.1f} mm giving way",
        missing="The paper does not define stable. If it means little motion of its own, see the sentence before it, "
        "which holds. If it means not to yield to the wind: under a quadrotor that hovers, no tensions in their range "
        f"give the wrench in {unanswered:.0%} of the steps, and one that moves with the wind by up to "
        f"{100 * moved(gives):.0f} cm relieves the cables, with tensions in their range in "
        f"{gives.answered['as planned'] / len(gives.references):.0%} of the steps.",
        figure="flown-hovering",
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
