"""Prove that an end of a motion collides with an obstacle at every attitude that the tube permits: `no_attitude`.

Where the tube leaves a platform its attitude, but the task fixes the position where it rests, the attitudes are a box
of angles. A distance changes by at most what points of the platform move, so one value proves all of a small box. Boxes
that it does not prove are halved along each angle, until all are proven or an attitude keeps all distances.
"""

import numpy as np

from ..audits.excess import Excess
from ..tasks.scenario import ATTITUDE, Scenario

MOST = 30_000  # boxes
CERTAIN = 1e-5  # [m], of distances, whose formulas are rounded where things touch


def no_attitude(
    scenario: Scenario, time: float, angles: list[int], platform: np.ndarray, carriers: np.ndarray, usable: np.ndarray
) -> list[Excess]:
    """Return the largest violation at the reference attitude if there is one at every attitude, else nothing.

    - `time`: when the platform is there [s].
    - `angles`: the coordinates of the attitude that the tube leaves free, of 3 to 5.
    - `platform`, `carriers`: their poses there, (6,) and (c, 6).
    - `usable`: which of the values of all limits depend on the platform's pose alone, (k,).
    """
    robot, turn = scenario.robot, scenario.task.tube.turn
    points = np.vstack([robot.attachments, robot.platform.com, scenario.body_corners])
    arm = float(np.linalg.norm(points, axis=1).max())
    limits = [
        (k, limit)
        for k, (limit, place) in enumerate(zip(scenario.limits, scenario.limits.places, strict=True))
        if limit.soft is None
        and np.isfinite(limit.per_metre)
        and usable[place].all()
        and scenario.in_force(limit, np.array([time])).all()
    ]
    if not limits or not set(angles) <= set(ATTITUDE) or not np.isfinite(turn):
        return []

    def exceeded(offsets: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Return by how many metres of movement limits are exceeded (n, limits), and all values."""
        pose = np.repeat(platform[None], len(offsets), axis=0)
        pose[:, angles] += offsets
        values = scenario.limits.at_rest(pose, np.repeat(carriers[None], len(offsets), axis=0))
        over = [np.maximum(limit.low - values[k], values[k] - limit.high).max(axis=1) for k, limit in limits]
        rates = [limit.per_metre for _, limit in limits]
        return np.stack(over, axis=1) / rates, values

    middle, values = exceeded(np.zeros((1, len(angles))))
    if middle.max() <= CERTAIN:
        return []
    centres, half, count = np.zeros((1, len(angles))), turn, 0
    corners = np.stack(np.meshgrid(*[[-0.5, 0.5]] * len(angles)), axis=-1).reshape(-1, len(angles))
    while len(centres):
        count += len(centres)
        worst = exceeded(centres)[0].max(axis=1)
        if count > MOST or (worst <= CERTAIN).any():
            return []
        unproven = centres[worst <= arm * half * len(angles) + CERTAIN]
        centres = (unproven[:, None] + half * corners).reshape(-1, len(angles))
        half /= 2
    k, limit = limits[int(middle[0].argmax())]
    which = int(np.maximum(limit.low - values[k][0], values[k][0] - limit.high).argmax())
    return [Excess.of(limit, which, time, values[k][0, which], "no attitude in the tube keeps all distances")]
