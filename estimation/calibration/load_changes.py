"""`load_changes`: where a log's platform has taken up or set down a load, so that it has no single mass."""

import numpy as np

from .model import Model, State

LEAST = 0.15  # of the mass, by which it changes; friction that changes sign may seem to change it by 0.1
SHORTEST = 0.05  # of the samples, for which a load lasts
NOISE = 1.4826  # times the median size


def load_changes(model: Model, state: State) -> list[tuple[int, float]]:
    """Return the first sample of each part of a log with a mass of its own, and this mass [kg]; [] for one mass.

    Each part is split where the mean masses before and after differ most (binary segmentation), if they differ by more
    than their noise.
    """
    if model.forces is None or model.measurements.tensions is None:
        return []
    of, x = model.parameters, state.x
    masses = model.forces.masses(of, x, model.poses(state), float(x[of.clock]))
    least = max(int(SHORTEST * len(masses)), 2)

    def parts(begin: int, end: int) -> list[tuple[int, float]]:
        k = np.arange(least, end - begin - least)
        if k.size:
            sums = np.cumsum(masses[begin:end])
            apart = sums[k - 1] / k - (sums[-1] - sums[k - 1]) / (end - begin - k)
            cut = begin + int(k[np.argmax(apart**2 * k * (end - begin - k))])
            sides = [masses[begin:cut], masses[cut:end]]
            middles = [float(np.median(side)) for side in sides]
            noise = NOISE * max(float(np.median(np.abs(one - own))) for one, own in zip(sides, middles, strict=True))
            if abs(middles[1] - middles[0]) > max(LEAST * abs(float(x[of.clock + 1])), noise):
                return parts(begin, cut) + parts(cut, end)
        return [(begin, float(np.median(masses[begin:end])))]

    found = parts(0, len(masses))
    return found if len(found) > 1 else []
