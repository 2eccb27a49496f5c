"""`leaves_its_points`: whether a path leaves the box of its points, as splines do."""

from ...base.text import quantity
from ..tasks.paths import PathBase, WaypointPath

LEAST = 1e-6  # [m]


def leaves_its_points(path: PathBase) -> list[str]:
    """Return a sentence if a path through waypoints leaves the box of its points."""
    if not isinstance(path, WaypointPath):
        return []
    far = path.outside()
    worst = int(far.argmax())
    if far[worst] < LEAST:
        return []
    text = f"the path leaves the box of its points by up to {quantity(far[worst], 'm')} along {'xyz'[worst]}"
    return [f"{text}; the shape legs stays inside"]
