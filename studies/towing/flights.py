"""Paper C's load, towed: the plans of all drives and of three to six robots, flown by computed torque.

The plant moves the load forward in time, on cables that only pull and do not stretch. Where a drive fixes the lengths,
the plant keeps them and the robot-ends alone move the load; otherwise the winches give the commanded tensions.
"""

from ...figures.curves import Panel, curves
from ...figures.drawing import Drawing
from ...simulation import Simulation, simulate
from ..accounts.claim import Chapter, Claim
from .claims import claim
from .equations import SIZES
from .modes import CHANGES, SECTIONS
from .plans import DRIVES, SECONDS, Drive, planned, robot
from .workspace import reach

ARRIVED = 0.005  # [m], allowed distance of the load from its plan
EDGE = 1e-3  # [m], of the boxes of the robot-ends
PAPERS = 3  # robots in section 5
SHOWN = slice(None, None, 5)  # of the rows, in figures


def chapter() -> Chapter:
    """Fly every drive and every m."""
    flights: dict[Drive, dict[int, Simulation]] = {drive: {m: fly(drive, m) for m in SIZES} for drive in DRIVES}
    claims = [
        claim("towed-{drive}").stated(
            max(flight.error.max() for flight in by_m.values()),
            all(flight.passed and in_boxes(flight) for flight in by_m.values()),
            drive=drive,
            section=SECTIONS[drive],
            changes=CHANGES[drive],
            flights=len(by_m),
            left=1000.0 * max(flight.error[-1] for flight in by_m.values()),
            arrived=1000.0 * ARRIVED,
        )
        for drive, by_m in flights.items()
    ]
    drawings = {f"towed-{drive}": _drawing(drive, by_m[PAPERS]) for drive, by_m in flights.items()}
    return Chapter([*claims, _positive(flights)], drawings)


def fly(drive: Drive, m: int) -> Simulation:
    """Fly the plan with least effort of `m` robots."""
    return simulate(robot(SIZES[m], drive), planned(SIZES[m], drive), duration=SECONDS, tolerance=ARRIVED)


def in_boxes(flight: Simulation) -> bool:
    """Return whether the robot-ends were in the boxes of their reach all the time."""
    low, high = reach(flight.robot)
    places = flight.record.motions[:, 1:, :3]
    return bool(((places >= low - EDGE) & (places <= high + EDGE)).all())


def _positive(flights: dict[Drive, dict[int, Simulation]]) -> Claim:
    tensions = {drive: by_m[PAPERS].record.tensions for drive, by_m in flights.items()}
    others = min(f.record.tensions.min() for by_m in flights.values() for m, f in by_m.items() if m != PAPERS)
    limit = flights["both"][PAPERS].robot.t_max.max()
    return claim("towed-tensions").stated(
        "; ".join(f"{T.min():.1f} N to {T.max():.1f} N, {drive}" for drive, T in tensions.items()),
        all(T.min() > 0 and T.max() < limit for T in tensions.values()),
        printed=f"0 N to {limit:g} N",
        limit=limit,
        others="they do too" if others > 0 else "some cables are slack at times, because the others can carry the load",
    )


def _drawing(drive: Drive, flight: Simulation) -> Drawing:
    error = Panel("error [mm]", {"": 1e3 * flight.error[SHOWN]})
    tensions = Panel.of_cables("tension [N]", flight.record.tensions[SHOWN])
    return Drawing(
        f"Three robots tow 10 kg in a simulation of {SECONDS:g} s, drive {drive}: distance of the load from its "
        "plan, tensions",
        curves(flight.times[SHOWN], "time [s]", [error, tensions]),
    )
