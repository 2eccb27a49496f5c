"""Let two successive legs overlap as far as the corner allows: `largest_left`, and in time: `shares_of_time`."""

from __future__ import annotations

import numpy as np

from .rest_to_rest import inverse, rest_to_rest

__all__ = ["MOST", "largest_left", "shares_of_time"]

MOST = 0.5  # of the shorter of two legs
PARTS = 12  # of that, which are compared
LOOKS = 16  # at the acceleration of two legs together
TOGETHER = 1.1  # of the larger peak of one leg alone: the acceleration of two together
PEAK = 16.8 / np.sqrt(5.0)  # of the second derivative of the law from rest to rest
BACK = 1e-3  # of the sum of the unit vectors of two legs: the path turns back, and rests there
HALVINGS = 60


def largest_left(steps: np.ndarray, last: np.ndarray, most: np.ndarray, blend: float) -> np.ndarray:
    """Return what the leg before each inner point has left where the next one has done as much, (n - 2,) [m].

    It is as large as the blend, the longest permitted overlap and the accelerations of both legs together permit, and
    zero where the path turns back.

    Parameters
    ----------
    steps
        The legs, (n - 1, 6).
    last
        How long each moves, (n - 1,).
    most
        The longest permitted overlap at each inner point, (n - 2,).
    blend
        The largest distance from the point [m].
    """
    lengths = np.linalg.norm(steps, axis=1)
    along = steps / np.where(lengths > 0, lengths, 1.0)[:, None]
    turn = np.linalg.norm(np.diff(along, axis=0), axis=1)
    back = np.linalg.norm(along[1:] + along[:-1], axis=1) <= BACK
    straight = _left_at(_gentle(steps, last, most), last, lengths)
    left = np.minimum(straight, blend / np.maximum(turn, np.finfo(float).tiny)) if blend > 0 else np.zeros_like(turn)
    return np.where(back | (lengths[1:] == 0) | (lengths[:-1] == 0), 0.0, left)


def shares_of_time(left: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how early each leg starts before its first point and how late it ends after its last, (n - 1,) each.

    In shares of the leg's time, from what is left at the inner points, (n - 2,) [m].
    """
    early, late = np.zeros(len(lengths)), np.zeros(len(lengths))
    some = np.flatnonzero(left > 0)
    early[some + 1] = inverse(left[some] / lengths[some + 1])
    late[some] = inverse(left[some] / lengths[some])
    return early, late


def _gentle(steps: np.ndarray, last: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Return the longest overlap, up to `most`, in which two legs together accelerate little more than one alone."""
    before, after = steps[:-1, None], steps[1:, None]
    last_before, last_after = last[:-1, None], last[1:, None]
    alone = PEAK * np.linalg.norm(steps, axis=1) / last**2
    bound = TOGETHER * np.maximum(alone[1:], alone[:-1])
    best = np.zeros_like(most)
    for part in np.arange(1, PARTS + 1) / PARTS:
        since = part * most[:, None] * np.arange(LOOKS + 1) / LOOKS
        slower = rest_to_rest((since[:, -1:] - since) / last_before)[2] / last_before**2
        faster = rest_to_rest(since / last_after)[2] / last_after**2
        acceleration = faster[..., None] * after - slower[..., None] * before
        best = np.where(np.linalg.norm(acceleration, axis=2).max(axis=1) <= bound, part * most, best)
    return best


def _left_at(overlap: np.ndarray, last: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return what one leg has left and the next has done where these are equal, of legs that overlap for so long."""
    low, high = np.zeros_like(overlap), overlap

    def left(since: np.ndarray) -> np.ndarray:
        return lengths[:-1] * rest_to_rest((overlap - since) / last[:-1])[0]

    def done(since: np.ndarray) -> np.ndarray:
        return lengths[1:] * rest_to_rest(since / last[1:])[0]

    for _ in range(HALVINGS):
        middle = (low + high) / 2
        early = done(middle) < left(middle)
        low, high = np.where(early, middle, low), np.where(early, high, middle)
    return np.minimum(done(low), left(high))
