"""Paper F's circle (section VI.B): impossible under a hovering quadrotor, possible when the quadrotor moves too.

The platform follows a horizontal circle of r = 1 m, 1 m below the point [50, 50, 100] m, at 0.2 pi rad/s. All anchors
lie within 0.52 m of the quadrotor's axis, so the CoM cannot be 1 m beside it: with the paper's own parameters cables
would have to push. With the quadrotor free (acceleration up to 3 m/s^2) the platform follows the same circle with every
cable taut.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...figures import plan as figures, style
from ...models import load
from ...ocp import Plan, Task, plan
from ...ocp.nlp.solver import Progress
from ...ocp.tasks.paths import AnyPath, CirclePath, RestPath
from ...ocp.tasks.task import FreeBase, HoldBase
from ...simulation import Simulation, simulate

HOVER = (50.0, 50.0, 100.0, 0.0, 0.0, 0.0)  # paper F, section VI.B [m, rad]
WIND, GUSTS = (3.0, 2.0, 0.5), 0.5  # [m/s], the mean and the intensity of turbulence about it
CIRCLE = CirclePath(kind="circle", centre=(50.0, 50.0, 99.0), radius=1.0, rate=0.2 * np.pi)


@dataclass(frozen=True)
class FlyingCircle:
    """Both halves of the study and the files they were written to."""

    hovering: Plan
    free: Plan
    pictures: list[Path]
    files: list[Path]

    @property
    def as_expected(self) -> bool:
        """Return whether the first half is proven impossible and the second has an audited plan."""
        proven = self.hovering.certificate is not None and self.hovering.certificate.shortfall > 0
        return proven and self.free.feasible and self.free.tracking_error_max < 0.01


def tasks() -> tuple[Task, Task]:
    """Return the task with the quadrotor hovering, and the task with the quadrotor free."""
    hovering = Task(name="circle-hovering", path=CIRCLE, base=HoldBase(kind="hold", poses={"quad": HOVER}))
    around: dict[str, AnyPath] = {"quad": RestPath(kind="rest", pose=HOVER)}
    moving = FreeBase(kind="free", around=around, acceleration_max=3.0, ends="periodic")
    return hovering, Task(name="circle-free", path=CIRCLE, base=moving)


def run(folder: Path, progress: Progress | None = None, form: str = "png") -> FlyingCircle:
    """Plan both tasks, and write two NetCDF files and three pictures of the format `form` into `folder`."""
    robot = load("wang-flying")
    hovering_task, free_task = tasks()
    hovering, free = plan(robot, hovering_task), plan(robot, free_task, progress)
    files = [p.save(folder / f"{p.scenario.task.name}.nc") for p in (hovering, free)]
    both = {"quadrotor hovering: infeasible": hovering.trajectory, "quadrotor free to move: feasible": free.trajectory}
    drawings = {
        "path": figures.path(free.trajectory),
        "tensions": figures.tensions_side_by_side(both),
        "base": figures.base_offset(free.trajectory),
    }
    pictures = [style.save(drawing, folder / f"{name}.{form}") for name, drawing in drawings.items()]
    return FlyingCircle(hovering, free, pictures, files)


def fly(folder: Path, planned: Plan, form: str = "png") -> tuple[Simulation, list[Path]]:
    """Fly a plan in gusts; return the flight, and the NetCDF file and the picture written into `folder`."""
    flight = simulate(planned.scenario.robot, planned, wind=WIND, gusts=GUSTS)
    file = flight.save(folder / "circle-simulation.nc")
    return flight, [file, style.save(flight.figures()["simulation"], folder / f"simulation.{form}")]
