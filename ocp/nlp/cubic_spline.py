"""Cubic splines through guesses, and their smoothing, for plans that need nothing else of SciPy.

Importing its modules for that took 0.3 s, longer than most plans. Source: de Boor, A Practical Guide to Splines,
chapter IV.
"""

import numpy as np

FAR = 4.0  # standard deviations of a Gaussian to each side: what is farther away counts for nothing


def spline_derivatives(nodes: np.ndarray, values: np.ndarray, clamped: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return first and second derivatives at the nodes of the cubic splines through values (n, k), n > 3, (n, k) each.

    The ends are `clamped`, without slope, or else the first two pieces are one cubic, and so are the last two.
    """
    h = np.diff(nodes)[:, None]
    secants = np.diff(values, axis=0) / h
    # Slopes s: lower s[k-1] + diagonal s[k] + upper s[k+1] = right.
    lower, diagonal, upper = np.zeros((3, len(nodes), 1))
    lower[1:-1], diagonal[1:-1], upper[1:-1] = h[1:], 2 * (h[1:] + h[:-1]), h[:-1]
    right = np.zeros(values.shape)
    right[1:-1] = 3 * (h[1:] * secants[:-1] + h[:-1] * secants[1:])
    if clamped:
        diagonal[[0, -1]] = 1.0
    else:
        for end, inner, neighbour in ((0, 1, upper), (-1, -2, lower)):
            both = h[end] + h[inner]
            diagonal[end], neighbour[end] = h[inner], both
            right[end] = ((h[end] + 2 * both) * h[inner] * secants[end] + h[end] ** 2 * secants[inner]) / both
    for k in range(1, len(nodes)):
        factor = lower[k] / diagonal[k - 1]
        diagonal[k] -= factor * upper[k - 1]
        right[k] -= factor * right[k - 1]
    slopes = right / diagonal
    for k in range(len(nodes) - 2, -1, -1):
        slopes[k] -= upper[k] / diagonal[k] * slopes[k + 1]
    bends = (6 * secants - 4 * slopes[:-1] - 2 * slopes[1:]) / h
    last = (2 * slopes[-2] + 4 * slopes[-1] - 6 * secants[-1]) / h[-1]
    return slopes, np.vstack([bends, last])


def smoothed(values: np.ndarray, sigma: float) -> np.ndarray:
    """Return values (n, k) averaged by a Gaussian of `sigma` places; those at the ends go on beyond them."""
    reach = int(FAR * sigma + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    return np.stack([np.convolve(column, weights / weights.sum(), mode="valid") for column in padded.T], axis=1)
