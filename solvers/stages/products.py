"""Kernel: products of small matrices in one array, in tiles that stay in registers."""

from .layout import TILE
from .vectors import fused, load8, splat8, store8, total8


def multiply(work, out, out_step, init, init_step, sign, x, x_step, y, y_step, rows, columns, count, upper):
    """Write init + sign X' Y, in tiles of six rows and eight columns; beyond `rows` and `columns` it writes nonsense.

    X has `count` rows from place `x` on, `x_step` numbers apart; so have Y, init (none if negative) and the result.
    If `upper`, columns left of the diagonal stay or become nonsense.
    """
    row = 0
    while True:
        column = row if upper else 0
        while column < columns:
            a = b = c = d = e = f = splat8(0.0)
            at, to = x + row, y + column
            for _ in range(count):
                v = load8(work, to)
                a = fused(work[at], v, a)
                b = fused(work[at + 1], v, b)
                c = fused(work[at + 2], v, c)
                d = fused(work[at + 3], v, d)
                e = fused(work[at + 4], v, e)
                f = fused(work[at + 5], v, f)
                at += x_step
                to += y_step
            to = out + row * out_step + column
            if init >= 0:
                at = init + row * init_step + column
                a = fused(sign, a, load8(work, at))
                b = fused(sign, b, load8(work, at + init_step))
                c = fused(sign, c, load8(work, at + 2 * init_step))
                d = fused(sign, d, load8(work, at + 3 * init_step))
                e = fused(sign, e, load8(work, at + 4 * init_step))
                f = fused(sign, f, load8(work, at + 5 * init_step))
            store8(work, to, a)
            store8(work, to + out_step, b)
            store8(work, to + 2 * out_step, c)
            store8(work, to + 3 * out_step, d)
            store8(work, to + 4 * out_step, e)
            store8(work, to + 5 * out_step, f)
            column += 8
        if row + TILE >= rows:
            break
        row = min(row + TILE, rows - TILE)  # the last tile overlaps the one before


def add_columns(work, out, x, x_step, v, count, columns):
    """Add X' v to a vector; X has `count` rows of `columns` numbers, v as many numbers."""
    for column in range(0, columns, 8):
        sums, more, at = load8(work, out + column), splat8(0.0), x + column
        for i in range(0, count - 1, 2):
            sums = fused(work[v + i], load8(work, at), sums)
            more = fused(work[v + i + 1], load8(work, at + x_step), more)
            at += 2 * x_step
        if count % 2 == 1:
            sums = fused(work[v + count - 1], load8(work, at), sums)
        store8(work, out + column, sums + more)


def add_rows(work, out, x, x_step, v, count, columns):
    """Add X v to a vector; X has `count` rows, and v `columns` numbers and zeros up to a multiple of eight."""
    for i in range(count):
        at = x + i * x_step
        sums = splat8(0.0)
        for column in range(0, columns, 8):
            sums = fused(load8(work, at + column), load8(work, v + column), sums)
        work[out + i] += total8(sums)
