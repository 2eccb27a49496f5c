"""Paper F's section V and the elastic plant: the same vibration, the tensions of a simulation and the procedure's.

The platform moves on the circle of radius 0.15 m under a hovering quadrotor, by commanded lengths (`wind_up`), once
still and once shaken by a small force along each axis, at 5, 6 and 7 Hz as in `vibration`. What the force adds to the
pose is the vibration that the procedure receives; what it adds to the tensions is what the procedure should give.

Its dT has two parts. Both take the displacement of the platform from its steady motion, and the damping divides it by
the time step, which is no part of the vibration. If the displacement is instead the change in one time step, the
damping is right and the elasticity is not.
"""

from typing import NamedTuple

import numpy as np

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...models import Dynamics, Robot, load
from ...models.air import trapezoid
from ...models.cables.driving_force import DrivingForce, driving_force
from ...models.part import COORDINATES
from ...ocp.tasks.paths import Motion
from ...plant import Plant
from ...plant.reading import Reading
from ..accounts.claim import Chapter, Claim
from .cable import constants
from .claims import claim
from .plans import FEASIBLE, circle, solved
from .vibration import ELEMENTS, HERTZ, PHASES, RATIO
from .wind import NOISE, PEAK

PERIOD = 1e-3  # of the commanded lengths [s]
FLIGHT = PERIOD * np.arange(10_001)  # [s]
FORCE = 0.1  # amplitude along each axis [N]: it takes no tension below zero
SHAKEN = FLIGHT[:3001]  # instants of the vibration [s]
BEGUN = slice(1000, -200)  # its rows without its begin and its end
STEPS = (1, 10, 100)  # time steps of the procedure, in periods
USED = STEPS[1]  # the time step of `vibration`
SHOWN = slice(2000, 2801)  # the rows of the figure
SAME = 0.01  # of what is compared
RELEASED = np.diag([1e-4] * 6)  # velocities of the platform in the beginning [m/s, rad/s], one coordinate in each row
LASTS = 2.0  # of a free vibration [s]
TENTH, SLOW = 0.1, 10.0  # what is left of a vibration, and how many of its periods that takes if it decays slowly
HOLDS = (10, 100)  # periods between two samples of the wind's noise


class Wound(NamedTuple):
    """A run, or a batch of them: what the plant's states are, and the tensions (..., n, m) [N]."""

    states: Reading
    tensions: np.ndarray


def wind_up(
    robot: Robot,
    body: Motion,
    carriers: Motion | None = None,
    wind: np.ndarray | None = None,
    wrench: np.ndarray | None = None,
    lengths: np.ndarray | None = None,
) -> Wound:
    """Command lengths every `PERIOD` and let the plant move from the first pose and velocity of a motion on.

    The cables are elastic. Motions of platform and carriers are in {G}, (n, 6) and (n, c, 6) each; default: carriers at
    home. The wind is the velocity of the air in {G} [m/s], (..., n - 1, 3); default: no air. The wrench [N, N m] acts
    on the platform, (..., n - 1, 6); default: none. Lengths are unstrained [m], (n, m); default: the distances from
    anchor to attachment, the paper's Eq. 5.
    """
    plant, dynamics = Plant(robot), Dynamics(robot)
    count = len(body.pose)
    still = np.zeros((count, len(robot.carriers), 6))
    bases = Motion(still + robot.carrier_home, still, still) if carriers is None else carriers
    wound = dynamics.cable_lengths(body.pose, bases.pose) if lengths is None else lengths
    start = plant.start(
        body.pose[0], body.velocity[0], carrier_pose=bases.pose[0], carrier_velocity=bases.velocity[0], lengths=wound[0]
    )
    commands = plant.command(
        wound[1:],
        carrier_pose=bases.pose[:-1],
        carrier_velocity=bases.velocity[:-1],
        carrier_acceleration=bases.acceleration[:-1],
        wind=wind,
        wrench=wrench,
    )
    run = plant.run(start, commands, PERIOD)
    return Wound(plant.read(run.states), run.tensions)


def unstrained(robot: Robot, body: Motion) -> np.ndarray:
    """Return the lengths that have the steady tensions of a motion under a resting carrier, (n, m) [m]."""
    dynamics = Dynamics(robot)
    T = solved(dynamics.wrench_matrix(body.pose), dynamics.required_wrench(*body))
    return dynamics.cable_lengths(body.pose) / (1 + T / constants(robot)[0])


class Shaken(NamedTuple):
    """Vibration of cable 1 at the instants `SHAKEN`, (n,) each; `dT` is what it adds to the tension [N]."""

    vibration: np.ndarray  # of the platform's pose, (n, 6) [m, rad]
    added: np.ndarray  # what it adds to the distance from anchor to attachment [m]
    dT: np.ndarray  # noqa: N815
    elastic: np.ndarray  # E A / l times `added` [N]
    damping: np.ndarray  # C times the rate of `added` [N]


def chapter() -> Chapter:
    """Shake, release and blow at the platform."""
    robot = load("wang-flying")
    seen = shake(robot)
    displaced = {step: procedure(robot, seen.vibration, step) for step in STEPS}
    free, (strongest, ratios) = release(robot), blow(robot)
    left = seen.dT - seen.damping
    off = np.abs(left - seen.elastic)[BEGUN].max()
    paper = driving_force(robot, *circle(FEASIBLE, SHAKEN), seen.vibration, USED * PERIOD, ELEMENTS)
    slack = claim("eq-16-plant").compared(
        left[BEGUN].min(), paper.dT_K[BEGUN, 0].min(), within=SAME * np.abs(seen.elastic[BEGUN]).max()
    )
    noise = ", ".join(f"{values[0]:.1%} with {name}" for name, values in strongest.items())
    others = max(values.max() for values in strongest.values())
    claims = [
        claim("eq-7-plant").compared(off / np.abs(seen.dT)[BEGUN].max()),
        claim("eq-21-plant").compared(_rms(displaced[USED].dT_K[:, 0]) / _rms(left)),
        slack,
        *_by_step(robot, seen, displaced),
        _slow(free),
        claim("fig-11-wind").undetermined(noise, printed=f"{RATIO:.2%}", others=others),
    ]
    shown = slice(0, round(0.8 / PERIOD))
    lines: dict[str, np.ndarray] = dict(zip(COORDINATES, free[:, shown], strict=True))
    drawings = {
        "shaken": _shaken(seen, displaced[USED]),
        "released": Drawing(
            "The elastic plant after a push along each coordinate, over the largest value",
            curves(PERIOD * np.arange(shown.stop), "time [s]", [Panel("displacement [-]", lines)]),
        ),
        "blown": Drawing(
            "Cable 1 in the wind of figure 5, platform at rest 1 m below a hovering quadrotor: dT by the noise over T",
            curves(FLIGHT[::10], "time [s]", [Panel("dT / T [%]", ratios, {"12.47 %": 100 * RATIO})]),
        ),
    }
    return Chapter(claims, drawings)


def shake(robot: Robot) -> Shaken:
    """Run the plant still and shaken, and take the difference."""
    force = FORCE * np.sin(2 * np.pi * np.outer(SHAKEN[:-1], HERTZ) + PHASES)
    wrench = np.stack([np.zeros((len(force), 6)), np.hstack([force, np.zeros_like(force)])])
    body, dynamics, (stiffness, damping) = circle(FEASIBLE, SHAKEN), Dynamics(robot), constants(robot)
    run = wind_up(robot, body, wrench=wrench, lengths=unstrained(robot, body))
    still, shaken = run.states.pose
    lengths = dynamics.cable_lengths(still)[:, 0]
    added = dynamics.cable_lengths(shaken)[:, 0] - lengths
    dT = (run.tensions[1] - run.tensions[0])[:, 0]
    return Shaken(shaken - still, added, dT, stiffness / lengths * added, damping * np.gradient(added, PERIOD))


def procedure(robot: Robot, vibration: np.ndarray, step: int) -> DrivingForce:
    """Return the paper's driving forces for a vibration (n, 6), with a time step of `step` periods, taut cables."""
    motion = circle(FEASIBLE, SHAKEN)
    return driving_force(robot, *motion, vibration, step * PERIOD, ELEMENTS, pretension=np.inf)


def release(robot: Robot) -> np.ndarray:
    """Return what is left of each coordinate over its largest value after a push along it, (6, n)."""
    plant = Plant(robot)
    steady = np.linalg.solve(Dynamics(robot).wrench_matrix(robot.home), [0, 0, robot.weight, 0, 0, 0])
    start = plant.start(robot.home, RELEASED, tensions=steady)
    commands = np.tile(plant.command(plant.read(start).lengths[0]), (round(LASTS / PERIOD), 1))
    poses = plant.read(plant.run(start, commands, PERIOD).states).pose - robot.home
    own = np.stack([poses[row, :, row] for row in range(6)])
    return own / np.abs(own).max(axis=1, keepdims=True)


def blow(robot: Robot) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the largest dT / T of each cable by the wind's noise, (m,), and the ratio of cable 1 over time in [%].

    Both by the time between two samples of the noise.
    """
    body, names = circle(0.0, FLIGHT), [f"a sample every {hold * PERIOD * 1e3:g} ms" for hold in HOLDS]
    winds = []
    for hold in HOLDS:
        times = hold * PERIOD * np.arange(-(-(len(FLIGHT) - 1) // hold))
        winds += [np.repeat(trapezoid(times, PEAK, noise=noise), hold, axis=0) for noise in (0.0, NOISE)]
    wind = np.stack(winds)[:, : len(FLIGHT) - 1]
    T = wind_up(robot, body, wind=wind, lengths=unstrained(robot, body)).tensions
    ratios = dict(zip(names, (T[1::2] - T[::2]) / T[::2], strict=True))
    largest = {name: np.abs(ratio).max(axis=0) for name, ratio in ratios.items()}
    return largest, {name: 100 * ratio[::10, 0] for name, ratio in ratios.items()}


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values[BEGUN] ** 2)))


def _by_step(robot: Robot, seen: Shaken, displaced: dict[int, DrivingForce]) -> list[Claim]:
    """Compare increments with those of the plant for each time step of the procedure.

    The procedure receives the displacement itself, or what each time step adds to it.
    """
    by_displacement = [_rms(given.dT_C[:, 0]) / _rms(seen.damping) for given in displaced.values()]
    damping, elastic = [], []
    for step in STEPS:
        change = np.zeros_like(seen.vibration)
        change[step:] = seen.vibration[step:] - seen.vibration[:-step]
        given = procedure(robot, change, step)
        damping.append(f"{_rms(given.dT_C[:, 0]) / _rms(seen.damping):.2f}")
        elastic.append(_rms(given.dT_K[:, 0]) / _rms(seen.elastic))
    milliseconds = ", ".join(f"{step * PERIOD * 1e3:g}" for step in STEPS)
    return [
        claim("eq-11-plant").compared(by_displacement, printed=1.0, milliseconds=milliseconds),
        claim("eq-10-plant").compared(elastic, printed=1.0, milliseconds=milliseconds, damping=", ".join(damping)),
    ]


def _slow(free: np.ndarray) -> Claim:
    times = PERIOD * np.arange(free.shape[1])
    left = np.array([times[np.flatnonzero(np.abs(row) > TENTH)[-1]] for row in free])
    waves = [PERIOD * 2 * np.diff(np.flatnonzero(np.diff(np.sign(row)))[:3]) for row in free]
    periods = np.array([float(wave[-1]) if len(wave) else np.inf for wave in waves])
    slowest = int(left.argmax())
    taken = float((left / periods)[slowest])
    return claim("section-III-vibration").stated(
        f"{', '.join(f'{value:.2f}' for value in left)} s",
        taken > SLOW,
        slow=SLOW,
        taken=taken,
        slowest=1 / periods[slowest],
    )


def _shaken(seen: Shaken, given: DrivingForce) -> Drawing:
    dots = np.where(np.arange(len(SHAKEN)) % 20 == 0, seen.elastic + seen.damping, np.nan)
    panels = [
        Panel("added length [um]", {"plant": 1e6 * seen.added[SHOWN]}),
        Panel("elastic [N]", {"plant": (seen.dT - seen.damping)[SHOWN], "procedure": given.dT_K[SHOWN, 0]}),
        Panel("damping [N]", {"plant": seen.damping[SHOWN], "procedure": given.dT_C[SHOWN, 0]}),
        Panel("dT [N]", {"plant": seen.dT[SHOWN], "procedure": given.dT[SHOWN, 0]}, dots={"linear": dots[SHOWN]}),
    ]
    return Drawing(
        "Cable 1 while the platform vibrates: elastic plant, E A dl / l + C d(dl)/dt (linear), and section V with "
        f"dt = {USED * PERIOD * 1e3:g} ms",
        curves(SHAKEN[SHOWN], "time [s]", panels),
    )
