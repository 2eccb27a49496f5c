"""`carrier_paths`: the paths that a task gives to carriers, checked, by the index of the carrier."""

from ...base.errors import InputError
from ...models import Robot
from .paths import AnyPath, RestPath
from .task import GivenBase, HoldBase, Task


def carrier_paths(robot: Robot, task: Task) -> dict[int, AnyPath]:
    """Return the carriers' reference paths by the index of the carrier; the others stay at home.

    Raises `InputError` if a name is unknown or that of a carrier that never moves, or if a path is not given in
    {G}.
    """
    base = task.base
    if isinstance(base, HoldBase):
        paths: dict[str, AnyPath] = {name: RestPath(kind="rest", pose=pose) for name, pose in base.poses.items()}
        key = "poses"
    elif isinstance(base, GivenBase):
        paths, key = base.paths, "paths"
    else:
        paths, key = base.around, "around"
    field, names = f"task {task.name!r}: base.{key}", [carrier.name for carrier in robot.carriers]
    paths_by_index = {}
    for name, path in paths.items():
        if name not in names:
            raise InputError(f"{field} must name carriers of the robot ({', '.join(names)}), got {name!r}")
        carrier = robot.carriers[names.index(name)]
        if not carrier.moves:
            raise InputError(f"{field} must name carriers that move, got {name!r}, which is of kind {carrier.kind}")
        if path.frame != "world":
            raise InputError(f"{field}.{name}.frame must be world, got {path.frame!r}")
        paths_by_index[names.index(name)] = path
    return paths_by_index
