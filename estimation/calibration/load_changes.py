"""`load_changes`: where a log's platform has taken up or set down a load, so that it has no single mass."""

import numpy as np

from .model import Model, State

LEAST = 0.15  # of the mass, by which it changes; a step before and after a load in between may be half as large
SHORTEST = 0.05  # of the samples, for which a load lasts
APART = 0.1  # of a change, which friction does not explain
NOISE = 3 * 1.4826  # times the median size


def load_changes(model: Model, state: State) -> list[tuple[int, float]]:
    """Return the first sample of each part of a log with a mass of its own, and this mass [kg]; [] for one mass.

    Each part is split where a step explains most of its masses that friction does not (binary segmentation). The
    masses must differ by more than their noise.
    """
    if model.forces is None or model.measurements.tensions is None:
        return []
    of, x = model.parameters, state.x
    masses, friction = model.forces.masses(of, x, model.poses(state), float(x[of.clock]))
    least, mass = max(int(SHORTEST * len(masses)), 2), abs(float(x[of.clock + 1]))

    def parts(begin: int, end: int) -> list[int]:
        y, k = masses[begin:end], np.arange(least, end - begin - least)
        whole = np.column_stack([np.ones(len(y)), friction[begin:end]])
        basis, size, _ = np.linalg.svd(whole, full_matrices=False)
        basis = basis[:, size > 1e-6 * size[0]]
        left = y - basis @ (basis.T @ y)
        # For a step after k samples: its square, and its product with the masses, without what the basis explains.
        square = k - (np.cumsum(basis, axis=0)[k - 1] ** 2).sum(axis=1)
        k, square = (one[square > APART * k * (1 - k / len(y))] for one in (k, square))
        if k.size:
            steps = -np.cumsum(left)[k - 1] / square
            best = int(np.argmax(steps**2 * square))
            if abs(steps[best]) > 0.5 * LEAST * mass:
                cut = begin + int(k[best])
                return parts(begin, cut) + parts(cut, end)
        return [begin]

    begins = parts(0, len(masses))
    of_part = np.searchsorted(begins, np.arange(len(masses)), side="right")[:, None] == 1 + np.arange(len(begins))
    table = np.hstack([of_part, friction - friction.mean(axis=0)])
    found = np.linalg.lstsq(table, masses, rcond=None)[0]
    noise = NOISE * float(np.median(np.abs(masses - table @ found)))
    levels = found[: len(begins)]
    return list(zip(begins, levels.tolist(), strict=True)) if np.ptp(levels) > max(LEAST * mass, noise) else []
