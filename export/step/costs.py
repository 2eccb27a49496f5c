"""Bounds of iterations and of floating-point operations of one control step, from the loops of the C code."""

from typing import NamedTuple

ROWS = 6


class Costs(NamedTuple):
    """Bounds of one step; operations are +, -, *, / and square roots."""

    exact: tuple[int, int]  # outer and inner iterations at full rank
    singular: tuple[int, int]  # the same where the rank is less
    soft: tuple[int, int]  # the same of a soft solution
    mechanics: int  # operations without sines and cosines
    sines: int  # and cosines
    free: int  # operations of a step whose tensions reach no limit, mechanics included
    soft_free: int  # operations of a step with a soft solution, not counting iterations
    outer: int  # operations of an outer iteration of an exact solution at full rank
    inner: int
    soft_outer: int
    soft_inner: int
    most: int  # operations of a step with all iterations that the bounds permit


def costs(m: int, rank: int, mechanics: int, sines: int) -> Costs:
    """Return the bounds for m cables that balance `rank` wrench rows.

    Args:
        m, rank: Cables, and degrees of freedom of the platform.
        mechanics, sines: Operations of the mechanics without sines and cosines, and how many of these.
    """
    exact, soft = _Solve(m, m - min(m, rank)), _Solve(m + ROWS, m)
    singular = _Solve(m, m)  # whatever the rank
    proof = ROWS * (6 * m + 12) + 12 * m
    certificate = 20 * (2 * ROWS**2 + 3 * ROWS) + 4 * ROWS**2 + ROWS * (2 * m + 10) + exact.start
    return Costs(
        exact=exact.iterations,
        singular=singular.iterations,
        soft=soft.iterations,
        mechanics=mechanics,
        sines=sines,
        free=mechanics + exact.start + proof,
        soft_free=mechanics + 2 * exact.start + soft.start + 2 * proof + 2 * certificate,
        outer=exact.outer,
        inner=exact.inner,
        soft_outer=soft.outer,
        soft_inner=soft.inner,
        most=mechanics + 2 * singular.total + soft.total + 2 * proof + 2 * certificate,
    )


class _Solve(NamedTuple):
    """The solve of a problem with some columns and a null space of k dimensions."""

    columns: int
    k: int

    @property
    def width(self) -> int:
        """Return the numbers in a row of a matrix, filled up to a multiple of four."""
        return (self.columns + 3) // 4 * 4

    @property
    def iterations(self) -> tuple[int, int]:
        """Return the most outer and inner iterations."""
        if self.k <= 2:
            return self.columns, self.columns * (self.columns - 1) // 2
        steps = 10 * self.columns + 20
        return steps, 2 * steps

    @property
    def start(self) -> int:
        """Return the operations of standard form, reduction, least norm and the basis of the null space."""
        W, n = self.width, ROWS
        reflection = 4 * W + 2
        form = n * (4 * self.columns + 3) + 8 * self.columns
        reduction = 2 * n * W + sum(2 * W + 6 + (n - 1 - j) * (reflection + 2) + 2 * (n - j) * W for j in range(n))
        return form + reduction + n * n + 3 * n + n * reflection + self.k * n * reflection

    @property
    def outer(self) -> int:
        """Return the operations of an outer iteration, not counting its inner ones."""
        scan = (6 if self.k <= 2 else 2) * self.columns
        return scan + 40 if self.k <= 2 else scan

    @property
    def inner(self) -> int:
        """Return the operations of an inner iteration: a cut, or a move and the rotations of a slab that leaves."""
        k, W = self.k, self.width
        if k <= 2:
            return 14
        rotations = 2 * k * (6 * W + 6)  # before the move, and for a slab that leaves
        return rotations + 2 * k * k + 6 * k + 2 * W + 4

    @property
    def total(self) -> int:
        """Return the operations of a solve with all its iterations, and of the proof that its result is the optimum."""
        outer, inner = self.iterations
        stationarity = self.k * (2 * self.width + 3 * self.columns)
        return self.start + outer * self.outer + inner * self.inner + stationarity


def lines_of(bounds: Costs) -> dict[str, list[str]]:
    """Return the lines on `iterations` and on `operations` that the header has."""
    rows = {
        "exact solution, full rank": bounds.exact,
        "exact solution, lower rank": bounds.singular,
        "soft solution": bounds.soft,
    }
    return {
        "iterations": [f"{name:26}{outer:4} outer, {inner:4} inner" for name, (outer, inner) in rows.items()],
        "operations": [
            f"mechanics                 {bounds.mechanics:7}, and {bounds.sines} sines and cosines",
            f"no tension at a limit     {bounds.free:7}, mechanics included",
            f"exact solution, each outer  {bounds.outer:7}, inner {bounds.inner:7}",
            f"soft solution, no iteration {bounds.soft_free:7}, mechanics and the attempt at an exact one included",
            f"soft solution, each outer   {bounds.soft_outer:7}, inner {bounds.soft_inner:7}",
            f"all iterations, at most   {bounds.most:7}",
        ],
    }
