"""`shortest_order`: the order of points in which the path through them is shortest, from the first to the last."""

from itertools import combinations, pairwise

import numpy as np

MOST = 12  # inner points, for which all subsets are 4096
SAME = 1e-9  # relative: of two orders with so little between them the given one stays


def shortest_order(points: np.ndarray) -> list[int]:
    """Return the indices of points (n, 6) [m, rad] in the order of the shortest path; the first and the last one stay.

    1 rad counts as 1 m, and angles turn the shortest way. Source: M. Held, R. M. Karp, "A dynamic programming approach
    to sequencing problems", 1962.
    """
    apart = points[:, None] - points
    apart[..., 3:] -= 2 * np.pi * np.round(apart[..., 3:] / (2 * np.pi))
    distance = np.linalg.norm(apart, axis=2).tolist()
    last, inner = len(points) - 1, range(1, len(points) - 1)
    # By the points that are visited, as a set, and the last one of them: the shortest path so far, and the one before.
    best = {(frozenset([k]), k): (distance[0][k], 0) for k in inner}
    for size in range(2, len(points) - 1):
        for visited in map(frozenset, combinations(inner, size)):
            for k in visited:
                others = visited - {k}
                best[visited, k] = min((best[others, j][0] + distance[j][k], j) for j in others)
    order, visited = [last], frozenset(inner)
    if visited:
        order.append(min(visited, key=lambda k: best[visited, k][0] + distance[k][last]))
    while len(visited) > 1:
        k = order[-1]
        order.append(best[visited, k][1])
        visited -= {k}
    order = [0, *reversed(order)]
    as_given, sorted_ones = (sum(distance[j][k] for j, k in pairwise(each)) for each in (range(last + 1), order))
    return order if sorted_ones < (1 - SAME) * as_given else list(range(last + 1))
