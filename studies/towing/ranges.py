"""Paper C's figures 2 to 6: the workspaces of the three system types, their ranges, shapes, volumes and inclusion."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial import ConvexHull

from ...figures import workspace as figures
from ...figures.drawing import Drawing
from ...statics.equilibria import equilibria
from ...workspace import ExistsPlacement, ForceBalance, Places
from ..accounts.claim import Chapter, Claim, Verdict, value_text
from .claims import claim
from .plans import DRIVES, FIXED, Drive, robot
from .workspace import PRINTED, SECTIONS, Loops, in_prism, loops, placed_as_both, reach, volume_of

DIGIT = 0.01  # the last one of the printed ranges [m]
THICKNESS = 0.02  # of a section [m]
READ = 0.08  # [m], distance of 60 000 random points from the ends of ranges, which are corners of the workspaces
FIGURES = {"fixed-length": "figure-3", "variable-length": "figure-5", "both": "figure-6"}
NAMES = {"fixed-length": "W1", "variable-length": "W2", "both": "W3"}
TRIANGLE, RECTANGLE = 0.5, 1.0  # share of the smallest rectangle about it that a shape fills


def chapter() -> Chapter:
    """Check ranges, sections and inclusion with 60 000 loops of each type, and volumes."""
    samples = {drive: loops(drive) for drive in DRIVES}
    both, variable = samples["both"].robot, samples["variable-length"]
    low, high = reach(both)
    inside = in_prism(variable.robot, variable.points).mean()
    sizes = [volume_of(drive, samples=8000) for drive in DRIVES]
    volumes = "; ".join(f"{NAMES[drive]} {size} m^3" for drive, size in zip(DRIVES, sizes, strict=True))
    rising = sizes[0].high < sizes[1].low and sizes[1].high < sizes[2].low
    others = [samples[drive] for drive in ("fixed-length", "variable-length")]
    shares = [placed_as_both(system.places.only(system.held)).mean() for system in others]
    claims = [
        claim("figure-2").undetermined((high - low).max(axis=0)[:2] / 2),
        *(claim for drive in DRIVES for claim in _ranges(drive, samples[drive])),
        _least_height(),
        _greatest_height(),
        *_sections(samples["fixed-length"]),
        claim("section-5-prism").stated(
            inside, inside == 1.0, arm=np.linalg.norm(variable.robot.attachments, axis=1).max()
        ),
        claim("volumes").stated([size.value for size in sizes], rising, volumes=volumes),
        claim("inclusion-W3").stated(shares, min(shares) == 1.0),
        _fixed_inside_variable(),
        _repeated(samples),
    ]
    drawings = {
        FIGURES[drive]: Drawing(
            f"{NAMES[drive]}, {drive}: poses of 60 000 loops where forces balance, from above and from the sides",
            figures.projections({NAMES[drive]: system.points}, system.robot.home_anchors),
        )
        for drive, system in samples.items()
    }
    drawings["figure-4"] = Drawing(
        "Cross sections of W1", figures.cross_sections(samples["fixed-length"].points, SECTIONS, THICKNESS)
    )
    rng = np.random.default_rng(0)
    points = {f"robot-end {i + 1}": rng.uniform(low[i], high[i], (3000, 3)) for i in range(len(low))}
    boxes = figures.projections(points, both.home_anchors)
    return Chapter(claims, drawings | {"figure-2": Drawing("Inferred boxes of the robot-ends", boxes)})


def _ranges(drive: Drive, samples: Loops) -> list[Claim]:
    """Compare the ranges; those of W3 along x and y gave the widths of the boxes, so they cannot confirm themselves.

    Where they differ, the paper contradicts itself only if it does with robot-ends at the printed x and y too, which
    all boxes contain; otherwise the widths, which are not printed, may be others.
    """
    narrow = samples.ranges if drive == "variable-length" else loops(drive, widths=False).ranges  # W2 has no boxes
    claims = []
    for axis, printed, computed, least in zip("xyz", PRINTED[drive], samples.ranges, narrow, strict=True):
        own = drive == "both" and axis != "z"
        differs = not own and bool(least[0] < printed[0] - DIGIT or least[1] > printed[1] + DIGIT)
        not_printed = "The widths of the boxes are not printed but inferred from "
        if own:
            why = f"{not_printed}this very range."
        elif differs:
            inferred = value_text(tuple(computed.tolist()), "m")
            why = (
                "With robot-ends at the printed x, y and heights, which every possible box contains, the range is "
                f"already {_beside(least, printed)}; with inferred boxes it is {inferred}."
            )
        else:
            why = f"{not_printed}section 5.3. With these the range is {_beside(computed, printed)}."
        claims.append(
            claim("range").stated(
                least if differs else computed,
                not own and (np.abs(computed - printed) <= READ).all(),
                printed=printed,
                otherwise=Verdict.DIFFERS if differs else Verdict.NOT_DETERMINED,
                motion=NAMES[drive],
                axis=axis,
                figure=FIGURES[drive],
                place=FIGURES[drive].replace("-", " "),
                read=READ,
                why=why,
            )
        )
    return claims


def _beside(computed: np.ndarray, printed: tuple[float, float]) -> str:
    """Return how a range (2,) differs from the printed one."""
    below, above = computed[0] < printed[0], computed[1] > printed[1]
    if below == above:
        return "wider than printed" if below else "narrower than printed"
    return "lower than printed" if below else "higher than printed"


def _least_height() -> Claim:
    """Check the lowest load with the robot-ends at the printed x and y and at the lowest printed height."""
    system = robot("wang-ctmrts", "fixed-length")
    lowest, least = system.carrier_home.copy(), reach(system)[0][:, 2]
    lowest[:, 2] = least
    rest = equilibria(system, np.full(3, FIXED), lowest)[0].pose[2]
    printed = PRINTED["fixed-length"][2][0]
    return claim("range-W1-least-height").stated(rest, rest >= printed - DIGIT, printed=printed, least=least.min())


def _greatest_height() -> Claim:
    """Bound the height of a load on cables of 1.2 m by the vertical forces.

    sum of T_i (z of robot-end i - z of attachment i) = L M g, and T_i is at most T_fmax. The mean height of the
    attachments is that of the load.
    """
    system = robot("wang-ctmrts", "fixed-length")
    highest, pull = reach(system)[1][:, 2].max(), system.t_max.sum()
    bound = highest - FIXED * system.weight / pull
    printed = PRINTED["fixed-length"][2][1]
    return claim("range-W1-greatest-height").stated(
        bound,
        bound >= printed,
        printed=printed,
        otherwise=Verdict.IMPOSSIBLE,
        highest=highest,
        weight=system.weight,
        gap=highest - bound,
        excess=printed - bound,
    )


def _sections(fixed: Loops) -> list[Claim]:
    cuts = [fixed.points[np.abs(fixed.points[:, 2] - height) <= THICKNESS / 2][:, :2] for height in SECTIONS]
    shares = [share_of_rectangle(points) for points in cuts]
    areas = [ConvexHull(points).volume for points in cuts]
    not_printed, unknown = "With the inferred widths of the boxes", Verdict.NOT_DETERMINED
    fields = {"heights": ", ".join(map(str, SECTIONS)), "not_printed": not_printed}
    claims = []
    ideals = {"triangle": TRIANGLE, "rectangle": RECTANGLE}
    for row, shape, other in ((0, "triangle", "rectangle"), (-1, "rectangle", "triangle")):
        share, ideal = shares[row], ideals[shape]
        nearer, section = abs(share - ideal) < abs(share - ideals[other]), claim("figure-4-{height:g}")
        said = {"height": SECTIONS[row], "shape": shape, "other": other, **fields}
        claims.append(section.stated(share, nearer, ideal, unknown, **said))
    order = claim("figure-4-order").stated(shares, (np.diff(shares) > 0).all(), otherwise=unknown, **fields)
    return [*claims, order, claim("figure-3-shape").undetermined(areas, **fields)]


def share_of_rectangle(points: np.ndarray) -> float:
    """Return the area of the convex hull of points (n, 2) over that of its smallest enclosing rectangle.

    One side of the smallest rectangle lies along a side of the hull. For a triangle the share is 1/2.
    """
    hull = ConvexHull(points)
    corners = points[hull.vertices]
    sides = np.roll(corners, -1, axis=0) - corners
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    areas = []
    for angle in angles:
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        areas.append(np.prod(np.ptp(corners @ turn.T, axis=0)))
    return float(hull.volume / min(areas))


def _fixed_inside_variable() -> Claim:
    """Check poses above the robot-ends of W2, where cables from 1.2 m cannot pull up, for both types."""
    fixed, variable = robot("wang-ctmrts", "fixed-length"), robot("wang-ctmrts", "variable-length")
    arm = float(np.linalg.norm(variable.attachments, axis=1).max())
    highest = float(variable.carrier_home[:, 2].max()) + arm
    rng = np.random.default_rng(0)
    poses = np.zeros((2000, 6))
    poses[:, :3] = rng.uniform([1.1, 0.8, highest + 1e-3], [1.4, 1.1, highest + 0.06], (2000, 3))
    held = ExistsPlacement(condition=ForceBalance(), tries=64, turn=0.1).holds(fixed, Places.at_home(fixed, poses))
    there = ExistsPlacement(condition=ForceBalance(), tries=64, turn=1.0)
    also = there.holds(variable, Places.at_home(variable, poses[held]))
    return claim("inclusion-W1-W2").stated(
        also.mean() if held.any() else 1.0,
        also.all(),
        otherwise=Verdict.IMPOSSIBLE,
        held=held.sum(),
        highest=highest,
        fixed=PRINTED["fixed-length"][2][1],
        variable=PRINTED["variable-length"][2][1],
    )


def _repeated(samples: Mapping[Drive, Loops]) -> Claim:
    """Compare the ends of the ranges from either half of the loops."""
    apart = []
    for system in samples.values():
        half = len(system.held) // 2
        parts = [system.places.pose[rows, :3][system.held[rows]] for rows in (slice(None, half), slice(half, None))]
        first, second = (np.stack([part.min(axis=0), part.max(axis=0)]) for part in parts)
        apart.append(np.abs(first - second).max())
    return claim("step-g").stated(apart, max(apart) <= DIGIT, printed=[DIGIT] * len(apart))
