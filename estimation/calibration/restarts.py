"""`restarts`: jumps of readings although the platform does not jump, as when the controller of a winch starts again.

They may be as large as the cable is long. A robust fit cannot begin across them, so they are slips from the start.
"""

import numpy as np

from .model import Model

FAR = 50.0  # usual steps of the differences between lengths and readings
SMALLEST = 0.01  # of the robot's length; fits find smaller slips
WINDOW, LASTS = 25, 0.5  # samples on each side over which a jump must be visible, and the share of it that must be
SHORTEST = 5  # samples on each side
FASTER = 5.0  # times the usual speed: the platform, or the frame of its poses, jumps
MOST = 4  # for each cable; more are no restarts


def restarts(model: Model, length: float) -> dict[tuple[int, int], float]:
    """Return the sizes [m] of jumps, by which cables are longer than their readings, by cable and first sample after.

    The parameters of the file suffice to see them. `length` is the length of the cables [m].
    """
    given, begin = model.measurements, model.begin()
    known = ~np.isinf(model.pose_sigmas).any(axis=1) & model.inside(begin)
    if model.robot.fixed_lengths is not None or known.sum() < 2 * SHORTEST:
        return {}
    table = model.parameters.table(begin.x)
    errors = model.residuals(begin).readings * given.sigma.lengths  # (m, N)
    times = np.arange(len(given), dtype=float) if given.times is None else given.times
    speeds = np.linalg.norm(np.diff(model.poses(begin)[0], axis=0), axis=1) / np.diff(times)
    smooth = np.append(speeds <= FASTER * np.median(speeds), True)
    found: dict[tuple[int, int], float] = {}
    for i, of_cable in enumerate(errors):
        rows = np.flatnonzero(known & model.weights[i])
        e, y = of_cable[rows], table[i, 7] * given.lengths[rows, i]
        steps, read = np.diff(e), np.abs(np.diff(y))
        least = max(FAR * float(np.median(np.abs(steps))), SMALLEST * length) if len(steps) else np.inf
        jumps = (np.abs(steps) > least) & (read > LASTS * np.abs(steps)) & smooth[rows[:-1]]
        for k in np.flatnonzero(jumps) + 1:
            lasting = np.median(e[k : k + WINDOW]) - np.median(e[max(k - WINDOW, 0) : k])
            if SHORTEST <= k <= len(e) - SHORTEST and abs(lasting - steps[k - 1]) < LASTS * abs(steps[k - 1]):
                found[i, int(rows[k - 1]) + 1] = float(lasting)
    return found if len(found) <= MOST * len(errors) else {}
