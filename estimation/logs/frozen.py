"""`seen`: poses without those that a motion capture writes while it does not see the platform."""

import numpy as np

from ...base.text import quantity
from .recording import Samples

AROUND = 3  # rows before and after a spike
UNUSUAL = 20.0  # times the usual distance from the rows around
RETURNS = 0.35  # of the size of a spike, by which the platform moves before, meanwhile and after
SHORT = 0.1  # from 1, of a quaternion's length
LONGEST_HELD = 5  # equal rows in a row that a slower sensor may repeat
JUMP = 5.0  # times the usual step: where the platform is seen again, it is far from where it seemed to stand


def seen(
    position: Samples | None, orientation: Samples | None, together: bool
) -> tuple[Samples | None, Samples | None, list[str]]:
    """Return positions and orientations with nan where the platform was not seen, and notes.

    A motion capture then repeats the last pose, or writes zeros or -9999, which are no quaternions of length 1. If most
    are not, they are left as they are. `together` states that both have the same samples, so both are lost.
    """
    notes: list[str] = []
    if orientation is not None and orientation.values.shape[1] == 4:
        lengths = np.linalg.norm(orientation.values, axis=1)
        lost = np.abs(lengths - 1) >= SHORT  # not of nan
        if 0 < 2 * lost.sum() < np.isfinite(lengths).sum():
            notes.append(f"poses skipped because their quaternions are not of length 1: {quantity(int(lost.sum()))}")
            orientation = _without(orientation, lost)
            position = _without(position, lost) if together and position is not None else position
    wrong = {
        "positions skipped because they repeat the previous one until the platform jumps: {}": frozen,
        "positions skipped because they are far from those before and after: {}": spikes,
    }
    for note, found in wrong.items():
        lost = np.zeros(0, dtype=bool) if position is None else found(position.values)
        if position is not None and lost.any():
            notes.append(note.format(quantity(int(lost.sum()))))
            position = _without(position, lost)
            orientation = _without(orientation, lost) if together and orientation is not None else orientation
    return position, orientation, notes


def _without(samples: Samples, lost: np.ndarray) -> Samples:
    return Samples(samples.times, np.where(lost[:, None], np.nan, samples.values))


def frozen(values: np.ndarray) -> np.ndarray:
    """Return which rows of recorded poses (N, k) repeat one before, though the platform moved on, (N,) of bool.

    A platform at rest does not jump at the end.
    """
    result = np.zeros(len(values), dtype=bool)
    steps = np.linalg.norm(np.diff(np.nan_to_num(values), axis=0), axis=1)
    moves = np.flatnonzero(steps > 0)
    if not moves.size:
        return result
    usual = float(np.median(steps[moves]))
    edges = np.concatenate([[-1], moves, [len(steps)]])  # rows edges[i] + 1 to edges[i + 1] are equal
    for begin, end in zip(edges[:-1] + 1, edges[1:] + 1, strict=True):
        zeros = not values[begin].any()  # which are no pose at all
        if (zeros or end - begin > LONGEST_HELD) and end < len(values) and steps[end - 1] > JUMP * usual:
            result[begin + (not zeros) : end] = True
    return np.asarray(result & np.isfinite(values).all(axis=1))


def spikes(values: np.ndarray) -> np.ndarray:
    """Return which rows of recorded positions (N, k) are far from where the platform is before and after, (N,) of bool.

    Far is what twenty times the usual distance from the median of five rows, and five usual steps, do not explain. Of
    positions measured one by one no distance is unusual.
    """
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    result = np.zeros(len(values), dtype=bool)
    if len(known) < 2 * AROUND:
        return result
    rows = values[known]
    near = np.lib.stride_tricks.sliding_window_view(np.pad(rows, ((2, 2), (0, 0)), "edge"), 5, axis=0)
    apart = np.linalg.norm(rows - np.median(near, axis=2), axis=1)
    usual = UNUSUAL * np.median(apart) + JUMP * np.median(np.linalg.norm(np.diff(rows, axis=0), axis=1))
    for k in AROUND + np.flatnonzero(apart[AROUND:-AROUND] > usual):
        around = rows[k - AROUND : k], rows[k + 1 : k + 1 + AROUND]
        middles = [np.median(part, axis=0) for part in around]
        moved = [np.linalg.norm(middles[-1] - middles[0])]
        moved += [np.median(np.linalg.norm(part - one, axis=1)) for part, one in zip(around, middles, strict=True)]
        result[known[k]] = max(moved) < RETURNS * apart[k]
    return result
