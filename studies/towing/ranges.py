"""Paper C's figures 2 to 6: the workspaces of the three system types, their ranges, shapes, volumes and inclusion."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull

from ...figures import workspace as figures
from ...figures.drawing import Drawing
from ...statics.equilibria import equilibria
from ...workspace import ExistsPlacement, ForceBalance, Places
from ..accounts.account import Chapter
from ..accounts.claim import Claim, Verdict, stated, undetermined, value_text
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
    claims = [_boxes(samples["both"])]
    claims += [claim for drive in DRIVES for claim in _ranges(drive, samples[drive])]
    claims += [
        _least_height(),
        _greatest_height(),
        *_sections(samples["fixed-length"]),
        _prism(samples["variable-length"]),
    ]
    claims += [_volumes(), _inside_both(samples), _fixed_inside_variable(), _repeated(samples)]
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
    drawings["figure-2"] = _drawn_boxes(samples["both"])
    return Chapter(claims, drawings)


def _boxes(both: Loops) -> Claim:
    low, high = reach(both.robot)
    half = (high - low).max(axis=0) / 2
    return undetermined(
        "figure-2",
        "figure 2",
        "The boxes of the robot-ends are drawn without numbers (half-widths along x and y).",
        None,
        (float(half[0]), float(half[1])),
        missing="Centres and heights are printed, widths are not. With the computed ones, in steps of 0.01 m, Eq. 15 "
        "permits the ranges of section 5.3. As the load can be outside its robot-ends, narrower boxes may do so too.",
        unit="m",
        figure="figure-2",
    )


def _drawn_boxes(both: Loops) -> Drawing:
    rng = np.random.default_rng(0)
    low, high = reach(both.robot)
    points = {f"robot-end {i + 1}": rng.uniform(low[i], high[i], (3000, 3)) for i in range(len(low))}
    return Drawing("Inferred boxes of the robot-ends", figures.projections(points, both.robot.home_anchors))


def _ranges(drive: Drive, samples: Loops) -> list[Claim]:
    """Compare the ranges; those of W3 along x and y gave the widths of the boxes, so they cannot confirm themselves.

    Where they differ, the paper contradicts itself only if it does with robot-ends at the printed x and y too, which
    all boxes contain; otherwise the widths, which are not printed, may be others.
    """
    narrow = samples.ranges if drive == "variable-length" else loops(drive, widths=False).ranges  # W2 has no boxes
    claims = []
    for axis, printed, computed, least in zip("xyz", PRINTED[drive], samples.ranges, narrow, strict=True):
        name, place = f"range-{NAMES[drive]}-{axis}", f"section 5, {FIGURES[drive].replace('-', ' ')}"
        statement, own = f"Range of {axis} of {NAMES[drive]}.", drive == "both" and axis != "z"
        differs = not own and bool(least[0] < printed[0] - DIGIT or least[1] > printed[1] + DIGIT)
        not_printed = "The widths of the boxes are not printed, and those of this run are inferred from "
        if own:
            why = f"{not_printed}this very range."
        elif differs:
            inferred = value_text(_pair(computed), "m")
            why = (
                "With robot-ends at the printed x and y and heights, which are inside any boxes, the range is already "
            )
            why += f"{_beside(least, printed)}; with inferred boxes it is {inferred}."
        else:
            why = f"{not_printed}section 5.3. With these the range is {_beside(computed, printed)}."
        claims.append(
            stated(
                name,
                place,
                statement,
                printed,
                _pair(least if differs else computed),
                holds=not own and bool((np.abs(computed - printed) <= READ).all()),
                otherwise=Verdict.DIFFERS if differs else Verdict.NOT_DETERMINED,
                agrees=f"They agree to {READ:g} m, the precision of the boxes and of 60 000 points.",
                differs=why,
                unit="m",
                figure=FIGURES[drive],
            )
        )
    return claims


def _pair(values: np.ndarray) -> tuple[float, float]:
    low, high = (float(value) for value in values)
    return low, high


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
    return stated(
        "range-W1-least-height",
        "section 5.1",
        "No load on cables of 1.2 m is lower than the lowest z of W1.",
        printed,
        float(rest),
        holds=bool(rest >= printed - 0.01),
        agrees="With the robot-ends at the lowest printed height it is not lower.",
        differs=f"With the robot-ends at the printed x and y and at z = {least.min():g} m, the lowest printed height, "
        "the "
        "load is at the computed height, for any widths of the boxes.",
        unit="m",
    )


def _greatest_height() -> Claim:
    """Bound the height of a load on cables of 1.2 m by the vertical forces.

    sum of T_i (z of robot-end i - z of attachment i) = L M g, and T_i is at most T_fmax. The mean height of the
    attachments is that of the load.
    """
    system = robot("wang-ctmrts", "fixed-length")
    highest, pull = float(reach(system)[1][:, 2].max()), float(system.t_max.sum())
    bound = highest - FIXED * system.weight / pull
    printed = PRINTED["fixed-length"][2][1]
    return stated(
        "range-W1-greatest-height",
        "section 5.1",
        "Three cables of 1.2 m with up to 500 N hold the load at the highest z of W1.",
        printed,
        bound,
        holds=bound >= printed,
        otherwise=Verdict.IMPOSSIBLE,
        agrees="The vertical forces permit it.",
        differs=f"Robot-ends are not above {highest:g} m, and cables that are nearly level carry little: 3 x 500 N "
        f"carry {system.weight:.1f} N only if the attachments are, on average, {highest - bound:.4f} m lower, with any "
        "boxes and any posture. The triangle is about P, the mass centre; for the printed height its centroid would "
        f"have to be {printed - bound:.3f} m below P.",
        unit="m",
    )


def _sections(fixed: Loops) -> list[Claim]:
    cuts = [fixed.points[np.abs(fixed.points[:, 2] - height) <= THICKNESS / 2][:, :2] for height in SECTIONS]
    shares = [share_of_rectangle(points) for points in cuts]
    areas = [float(ConvexHull(points).volume) for points in cuts]
    not_printed = "The widths of the boxes are not printed. With those of this run"
    claims = []
    for height, filled, shape, ideal in (
        (SECTIONS[0], shares[0], "a triangle", TRIANGLE),
        (SECTIONS[-1], shares[-1], "a rectangle", RECTANGLE),
    ):
        claims.append(
            stated(
                f"figure-4-{height:g}",
                "figure 4",
                f"The section at z = {height:g} m is approximately {shape} (its share of the smallest enclosing "
                "rectangle).",
                ideal,
                filled,
                holds=abs(filled - ideal) < abs(filled - (TRIANGLE + RECTANGLE - ideal)),
                otherwise=Verdict.NOT_DETERMINED,
                agrees=f"The share is nearer to that of {shape} than to that of the other shape.",
                differs=f"{not_printed} the share is nearer to that of the other shape.",
                figure="figure-4",
            )
        )
    rising = all(lower < upper for lower, upper in pairwise(shares))
    order = stated(
        "figure-4-order",
        "section 5.1, figure 4",
        f"The higher the section, the closer it is to a rectangle (shares at {', '.join(map(str, SECTIONS))} m).",
        "rising",
        tuple(shares),
        holds=rising,
        otherwise=Verdict.NOT_DETERMINED,
        agrees="The shares rise.",
        differs=f"{not_printed} the shares do not rise.",
        figure="figure-4",
    )
    shape_of_all = undetermined(
        "figure-3-shape",
        "section 5.1, figure 3",
        "The lower half of W1 is approximately an upside-down cone, the upper half a rectangular prism (areas of the "
        f"sections at {', '.join(map(str, SECTIONS))} m).",
        None,
        tuple(areas),
        missing=f"{not_printed} W1 has another height, so that its halves are others than the printed ones; a prism "
        "would have equal areas.",
        unit="m^2",
        figure="figure-4",
    )
    return [*claims, order, shape_of_all]


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


def _prism(variable: Loops) -> Claim:
    inside = float(in_prism(variable.robot, variable.points).mean())
    arm = float(np.linalg.norm(variable.robot.attachments, axis=1).max())
    return stated(
        "section-5-prism",
        "sections 5, 5.2",
        "The load must be in the triangular prism below the robot-ends (share of W2 inside it).",
        1.0,
        inside,
        holds=inside == 1.0,
        agrees="Every point of W2 is inside.",
        differs=f"Attachments are {arm:.3f} m from the centre of the load, so it can be outside by as much.",
        figure="figure-5",
    )


def _volumes() -> Claim:
    sizes = [volume_of(drive, samples=8000) for drive in DRIVES]
    volumes = "; ".join(f"{NAMES[drive]} {size} m^3" for drive, size in zip(DRIVES, sizes, strict=True))
    return stated(
        "volumes",
        "sections 5, 6",
        "The volumes grow from W1 to W2 to W3.",
        "W1 < W2 < W3",
        tuple(size.value for size in sizes),
        holds=sizes[0].high < sizes[1].low and sizes[1].high < sizes[2].low,
        agrees=f"With intervals, and boxes inferred from section 5.3: {volumes}. A search samples each workspace and "
        "can miss poses, most of all in W1.",
        differs=f"They do not, with intervals: {volumes}.",
        unit="m^3",
    )


def _inside_both(samples: Mapping[str, Loops]) -> Claim:
    shares = []
    for drive in ("fixed-length", "variable-length"):
        places = samples[drive].places.only(samples[drive].held)
        shares.append(float(placed_as_both(places).mean()))
    return stated(
        "inclusion-W3",
        "section 5.3",
        "W1 and W2 lie inside W3 (shares of their points inside W3).",
        (1.0, 1.0),
        tuple(shares),
        holds=min(shares) == 1.0,
        agrees="Every point of both passes the test of W3, whatever the boxes: W3 moves what W1 and W2 move.",
        differs="Not every point passes the test of W3.",
    )


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
    return stated(
        "inclusion-W1-W2",
        "sections 5, 6",
        "W1 lies inside W2 (share in W2 of the poses of W1 above the robot-ends of W2).",
        1.0,
        float(also.mean()) if held.any() else 1.0,
        holds=bool(also.all()),
        otherwise=Verdict.IMPOSSIBLE,
        agrees="No sampled pose of W1 lies outside W2.",
        differs=f"{held.sum()} sampled poses of W1 are above z = {highest:.3f} m, where all three cables of W2 would "
        "pull down, with boxes inferred from section 5.3. With any boxes the printed ranges contradict the statement: "
        f"z up to {PRINTED['fixed-length'][2][1]:g} m in W1, {PRINTED['variable-length'][2][1]:g} m in W2.",
    )


def _repeated(samples: Mapping[str, Loops]) -> Claim:
    """Compare the ends of the ranges from either half of the loops."""
    apart = []
    for system in samples.values():
        half = len(system.held) // 2
        parts = [system.places.pose[rows, :3][system.held[rows]] for rows in (slice(None, half), slice(half, None))]
        low, high = (np.abs(np.subtract(*(edge(part, axis=0) for part in parts))).max() for edge in (np.min, np.max))
        apart.append(float(max(low, high)))
    return stated(
        "step-g",
        "step (g), section 5",
        "60 000 loops determine the ranges to 0.01 m, the last printed digit (largest difference of an end of a range "
        "between the first and the second half of the loops, W1, W2, W3).",
        (DIGIT,) * len(apart),
        tuple(apart),
        holds=max(apart) <= DIGIT,
        agrees="They do.",
        differs="The ends of the ranges are corners of the workspaces, to which few loops come close; with more loops "
        "the ranges still grow.",
        unit="m",
    )
