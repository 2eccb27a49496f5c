"""Halton's sequence with scrambled digits, from any index on at the same cost (scipy's advances point by point).

    x_j(i) = sum_k pi_jk(digit k of i in base p_j) / p_j^(k + 1)        p_j the j-th prime, pi_jk a random permutation

Source: A. Owen, "A randomized Halton algorithm in R", 2017. Several digits are looked up at a time.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

LARGEST_TABLE = 4096  # entries: what stays in the fastest cache
BELOW_ONE = float(np.nextafter(1.0, 0.0))


def halton(start: int, count: int, dimension: int, seed: int) -> np.ndarray:
    """Return points start to start + count of the sequence, (count, dimension), each below 1."""
    points = np.empty((count, dimension))
    for axis, tables in enumerate(_tables(dimension, seed)):
        index = np.arange(start, start + count)
        value = np.zeros(count)
        for table in tables:
            if index[-1] == 0:  # and so are all
                value += table[0]
            else:
                index, digits = np.divmod(index, len(table))
                value += table[digits]
        points[:, axis] = np.minimum(value, BELOW_ONE)
    return points


@lru_cache(maxsize=4)
def _tables(dimension: int, seed: int) -> list[list[np.ndarray]]:
    """Return for each axis what each group of digits adds."""
    stream = np.random.Generator(np.random.Philox(key=np.array([seed, 0], dtype=np.uint64)))
    every = []
    for base in _primes(dimension):
        together = max(1, int(np.log(LARGEST_TABLE) / np.log(base) + 1e-9))
        groups = -(-int(np.ceil(53 / np.log2(base))) // together)
        weight, tables = 1.0, []
        for _ in range(groups):
            table = np.zeros(1)
            for _ in range(together):
                weight /= base
                # The next digit counts the whole of the table so far.
                table = (table[None, :] + weight * stream.permutation(base)[:, None]).ravel()
            tables.append(table)
        every.append(tables)
    return every


def _primes(count: int) -> list[int]:
    primes: list[int] = []
    candidate = 2
    while len(primes) < count:
        if all(candidate % prime for prime in primes):
            primes.append(candidate)
        candidate += 1
    return primes
