"""Write the texts beside the scene: readouts of an instant and the legend as HTML, a caption as plain text.

Names come from files, so every text that is not a number passes `html.escape`.
"""

import math
from html import escape
from urllib.parse import urlencode

import numpy as np

from ..base.text import quantity, quantity_range
from ..figures import style
from ..figures.tension_colours import NO_TENSION, place, shades
from ..models import Robot
from ..models.part import COORDINATES
from .snapshot import Snapshot, arrow
from .subject import Subject

MUTED = "#595959"
GHOST = style.colour(2)  # the reference of a flight
OTHER = "#444444"  # of the plan or flight that is compared
PART, BLACK = "#969696", "#000000"  # of posts; of pulleys and rotors
STOPS = 9  # of the legend's gradient
COLUMNS = (("cable", "left", 0), ("tension", "right", 6), ("", "left", 0), ("limits [N]", "left", 6))
# On screens below 36 em, viser's panel is a sheet of 20 em that covers 60 % of the height.
SHEET = ".mantine-Paper-root:has(.towline-readout)"
NARROW = (
    "<style>@media (max-width:36em){"
    f"{SHEET}{{width:100%!important;max-height:45%!important}}"
    f"{SHEET} div[style*='width: 20em']{{width:100%!important}}"
    "}</style>"
)
SHEET_SHARE = 0.45  # of the height, see NARROW
BODY = "padding:4px 12px;font-size:13px;line-height:1.45;font-variant-numeric:tabular-nums"


def link(robot: Robot, pose: np.ndarray, carriers: np.ndarray) -> str:
    """Return HTML of a link that opens the view with these poses, (6,) and (c, 6)."""
    moved = [] if np.array_equal(carriers, robot.carrier_home) else carriers.ravel()
    numbers = ",".join(f"{value + 0.0:.6g}" for value in [*pose, *moved])
    address = escape(f"/?{urlencode({'robot': robot.name, 'pose': numbers}, safe=',')}")
    return f'<div style="{BODY}"><a class="towline-link" href="{address}">Link to this pose</a></div>'


def readout(instant: Snapshot, robot: Robot, other: Snapshot | None = None) -> str:
    """Return status, margins, the certificate if there are no tensions, and a row for each cable.

    `other` is the instant of a plan or a simulation to compare with: its distance and its tensions are added.
    """
    feasible = instant.certificate is None and np.isfinite(instant.tensions).all()
    colour = style.colour(0) if feasible else style.colour(1)
    facts = [f'<b class="towline-status" style="color:{colour}">{escape(instant.status)}</b>']
    if instant.time is not None:
        facts.append(f'<span class="towline-time">t = {instant.time:.2f} s</span>')
    facts += [f'<span class="towline-event">{escape(event)}</span>' for event in instant.events]
    facts += _tension_margin(instant)
    facts += [f"capacity margin {quantity(instant.reserve, 'N')}"] if np.isfinite(instant.reserve) else []
    if other is not None:
        apart = float(np.linalg.norm(instant.pose[:3] - other.pose[:3]))
        facts.append(f"platforms {quantity(apart, 'm')} apart, the other: {escape(other.status)}")
    lines = [f"<div>{fact}</div>" for fact in facts]
    if instant.certificate is not None:
        words = escape(instant.certificate.describe()).replace("\n", "<br>")
        lines.append(f'<div style="border-left:3px solid {colour};padding-left:8px;margin:6px 0">{words}</div>')
        if arrow(instant, 1.0, 1.0) is None:
            lines.append(f'<div style="color:{MUTED}">The direction has almost no force, so it has no arrow.</div>')
    pose = ", ".join(f"{value:.3f}" for value in np.round(instant.pose, 3) + 0.0)
    lines.append(f'<div style="color:{MUTED}">({", ".join(COORDINATES)}) = ({pose}) m, rad</div>')
    return f'<div class="towline-readout" style="{BODY}">{"".join(lines)}{table(instant, robot, other)}</div>'


def _tension_margin(instant: Snapshot) -> list[str]:
    """Return the tension margin in words; nothing if there is none."""
    known = np.isfinite(instant.margin)
    return [f"tension margin {quantity(instant.margin, 'N')} (cable {instant.nearest + 1})"] if known else []


def decimals(robot: Robot) -> int:
    """Return how many decimals tensions of a robot have [N]: two, and more for robots of less than a newton."""
    return max(2, 2 - math.floor(math.log10(robot.force_scale)))


def table(instant: Snapshot, robot: Robot, other: Snapshot | None = None) -> str:
    """Return a table of the cables: colour, tension, and its place between the limits."""
    places, digits = place(instant.tensions, robot.t_min, robot.t_max), decimals(robot)
    rows = []
    for index, (tension, at, shade) in enumerate(zip(instant.tensions, places, shades(places), strict=True)):
        there = bool(np.isfinite(tension))
        hue = f"rgb({', '.join(str(part) for part in shade)})"
        bar = (
            f'<div style="width:40px;height:8px;background:#e8e8e8">'
            f'<div class="towline-bar" style="width:{100 * at if there else 0:.0f}%;height:8px;background:{hue}">'
            "</div></div>"
        )
        shown = f"{tension:.{digits}f} N" if there else "none"
        shown = "cut" if instant.cut is not None and instant.cut[index] else shown
        if other is not None:
            at_other = other.tensions[index]
            beside = f"{at_other:.{digits}f} N" if np.isfinite(at_other) else "none"
            bar = f'<span class="towline-other" style="color:{OTHER}">{beside}</span>'
        limits = f"{robot.t_min[index]:g} to {robot.t_max[index]:g}"
        # The colour of the cable's curve, where there are curves.
        edge = "" if instant.time is None else f"border-left:4px solid {style.colour(index)};padding-left:6px"
        rows.append(
            f'<tr style="white-space:nowrap"><td style="{edge}">{index + 1}</td>'
            f'<td style="text-align:right;padding:0 6px" class="towline-tension">{shown}</td><td>{bar}</td>'
            f'<td style="color:{MUTED};padding-left:6px">{limits}</td></tr>'
        )
    heads = "".join(
        f'<th style="font-weight:600;text-align:{side};padding:0 {pad}px;white-space:nowrap">{name}</th>'
        for name, side, pad in (COLUMNS if other is None else (*COLUMNS[:2], ("other", "left", 0), COLUMNS[3]))
    )
    return f'<table style="border-collapse:collapse;margin-top:6px"><tr>{heads}</tr>{"".join(rows)}</table>'


def caption(instant: Snapshot) -> str:
    """Return time, status, margin or shortfall in two or three lines of plain text, for the scene."""
    lines = [instant.status if instant.time is None else f"t = {instant.time:.2f} s, {instant.status}"]
    lines += _tension_margin(instant)
    if instant.certificate is not None:
        lines.append(shortfall(instant))
    return "\n".join(lines)


def shortfall(instant: Snapshot) -> str:
    """Return the label of the certificate's arrow; empty if there is no certificate."""
    return "" if instant.certificate is None else f"short by {quantity(instant.certificate.shortfall, 'N')}"


def legend(subject: Subject, cell: float) -> str:
    """Return the meaning of colours and marks that can occur, as HTML; `cell` is the edge of the grid's cells [m]."""
    robot, shown = subject.robot, [motion for motion in (subject.replay, subject.other) if motion]
    missing = not shown or any(np.isnan(motion.tensions).any() for motion in shown)
    bar = _gradient(*(f"t_{end} = {quantity_range(getattr(robot, f't_{end}'), 'N', 6)}" for end in ("min", "max")))
    marks = [("platform", style.colour(4))]
    marks += [("no feasible tensions", NO_TENSION)] if missing else []
    marks += [("cable that has been cut", NO_TENSION)] if any("cut" in it.dataset for it in shown) else []
    marks += [("post below an anchor", PART)] if not all(carrier.moves for carrier in robot.carriers) else []
    marks += [("pulley (its sheave)", BLACK)] if robot.pulley_radii.any() else []
    marks += [("quadrotor (arms and rotors)", BLACK)] if any(c.drawing.rotors for c in robot.carriers) else []
    marks += [("path of the platform", style.colour(0))] if subject.replay else []
    marks += [("reference of the platform", GHOST)] if subject.kind == "simulation" else []
    marks += [("platform, cables and path of the other motion", OTHER)] if subject.other else []
    marks += [("keep out", style.colour(5))] if subject.replay and subject.replay.obstacles else []
    marks += [("reach of a carrier", style.colour(3))] if any(c.drawing.boxes for c in robot.carriers) else []
    marks += [("missing wrench: the direction of its force", style.colour(1))] if missing else []
    marks += subject.cloud.legend if subject.cloud else []
    rows = [f'<div><span style="color:{hue}">&#9632;</span> {escape(name)}</div>' for name, hue in marks]
    summary = f'<div style="color:{MUTED}">{escape(subject.cloud.summary)}</div>' if subject.cloud else ""
    return (
        f'<div class="towline-legend" style="{BODY}">'
        f"<div>cable tension between its limits, logarithmic</div>{bar}"
        f'{"".join(rows)}{summary}<div style="color:{MUTED}">cells of the grid: {cell:g} m</div></div>'
    )


def note(message: str) -> str:
    """Return a remark in the panel, as HTML."""
    return f'<div style="{BODY};color:{MUTED}">{escape(message)}</div>'


def margin_scale(largest: float) -> str:
    """Return the colours of capacity margins from zero to the largest [N] of a workspace, as HTML."""
    return (
        f'<div style="{BODY}"><div>surface coloured by capacity margin; attitude and carriers at home</div>'
        f"{_gradient('0', quantity(largest, 'N', 3))}</div>"
    )


def _gradient(low: str, high: str) -> str:
    """Return a bar with the colours of all places, and what its ends stand for."""
    stops = ", ".join(f"rgb({r},{g},{b})" for r, g, b in shades(np.linspace(0.0, 1.0, STOPS)))
    return (
        f'<div style="height:10px;background:linear-gradient(to right, {stops})"></div>'
        f'<div style="display:flex;justify-content:space-between"><span>{low}</span><span>{high}</span></div>'
    )


def refusal(message: str) -> str:
    """Return the reason why the pose of the sliders cannot be shown, as HTML."""
    return f'<div class="towline-readout" style="{BODY};color:{style.colour(1)}">{escape(message)}</div>'
