"""`towline reproduce flying`: its claims by second derivations, and its verdicts by their numbers."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from towline import studies
from towline.base.errors import SolverError
from towline.figures import style
from towline.figures.drawing import Drawing
from towline.models import Dynamics, load
from towline.studies.accounts.claim import Chapter, Paper, Statement, Verdict, gather, statements, value_text
from towline.studies.accounts.files import errata, page, write
from towline.studies.flying import (
    balance,
    cable,
    disturbance,
    element,
    helix,
    pairing,
    parameters,
    plans,
    procedure,
    radius,
    references,
    rotations,
    structure,
    vibration,
    wind,
)

from .warm import towline

CHEAP = [
    parameters,
    structure,
    pairing,
    rotations,
    cable,
    element,
    balance,
    references,
    procedure,
    wind,
    helix,
    disturbance,
]


@pytest.fixture(scope="module")
def chapters():
    return [part.chapter() for part in CHEAP]


@pytest.fixture(scope="module")
def claims(chapters):
    return {claim.id: claim for chapter in chapters for claim in chapter.claims}


def verdict(part, name):
    return next(claim for claim in part.chapter().claims if claim.id == name).verdict


# --- claims and accounts


def test_a_verdict_follows_from_the_numbers():
    words = {"agrees": "yes", "differs": "no", "works": "yes", "fails": "no"}
    statement = Statement("a", "Eq. 1", "x", printed=(1.0, 2.0), within=0.1, **words)
    near, far = (statement.compared((1.0, second)) for second in (2.05, 2.15))
    assert (near.verdict, near.why) == (Verdict.REPRODUCED, "yes")
    assert (far.verdict, far.why) == (Verdict.DIFFERS, "no")
    assert statement.compared(float("nan"), printed=1.0).verdict is Verdict.DIFFERS
    assert statement.stated("y", False, otherwise=Verdict.IMPOSSIBLE).verdict is Verdict.IMPOSSIBLE
    bare = replace(statement, printed=None)
    possible, not_found = (bare.repaired(1.0, holds) for holds in (True, False))
    assert (possible.verdict, possible.why, possible.printed) == (Verdict.REPAIRED, "yes", None)
    assert (not_found.verdict, not_found.why) == (Verdict.NOT_DETERMINED, "no")
    assert value_text((1.0, 2.5), "m") == "(1, 2.5) m"
    assert value_text(-0.0, "N") == "0 N"


def test_the_sentences_of_a_claim_have_its_values_and_its_frames():
    statement = Statement("a-{n}", "Eq. {n}", "In {G}, {x:.1f} {unit}.", unit="{unit}", missing="Of {what}.")
    claim = statement.undetermined(1.0, n=2, x=0.25, unit="m", what="{n}")
    assert (claim.id, claim.place, claim.statement, claim.unit) == ("a-2", "Eq. 2", "In {G}, 0.2 m.", "m")
    assert claim.why == "Of {n}."
    with pytest.raises(KeyError, match="what"):
        statement.undetermined(1.0, n=2, x=0.25, unit="m")


@pytest.mark.parametrize("paper", ["flying", "towing"])
def test_each_statement_is_computed(paper):
    folder = Path(studies.__file__).parent / paper
    sources = "".join(file.read_text() for file in folder.glob("*.py"))
    assert [name for name in statements(folder / "claims.yaml") if f'"{name}"' not in sources] == []


def example(name, **broken):
    """An account of two claims, one of them of text that would break a table or a page."""
    good = Statement("good", "Eq. 1", "says", printed=1.0, within=0.1, agrees="so", figure="plot").compared(1.0)
    nasty = Statement("bad", "Eq. 2", "a | b <script>", missing="<b>not</b> printed").undetermined("c\nd")
    canvas = style.figure()
    style.axes(canvas, "x [m]", "y [m]").plot([0, 1], [0, 1])
    drawings = {"plot": Drawing("A plot", canvas)}
    return gather(Paper(name, "A paper"), {"One": lambda: Chapter([good, nasty], drawings), **broken})


def test_an_account_is_written_from_the_same_claims(tmp_path):
    account = example("small")
    assert account.complete
    files = write(account, tmp_path)
    assert [file.relative_to(tmp_path).as_posix() for file in files] == [
        "small.html",
        "small-errata.md",
        "small.json",
        "figures/plot.png",
    ]
    report, errata, data = (file.read_text() for file in files[:3])
    assert "<td>good</td>" in report
    assert "good" not in errata
    entry = "- **Eq. 2** (`bad`): a | b &lt;script>\n\n    Computed: c d.\n\n    &lt;b>not&lt;/b> printed"
    assert entry in errata
    assert "text recognised from its pages" in errata
    assert "text recognised from its pages" in report
    assert "<script>" not in report
    assert "&lt;script&gt;" in report
    assert report.count("data:image/svg+xml;base64,") == 1
    assert not re.search(r'(src|href)="(?!data:|#claim-|#chapter-|#errata)', report)
    assert [claim["verdict"] for claim in json.loads(data)["claims"]] == ["reproduced", "not determined"]


def test_a_repair_is_no_claim_of_the_paper(tmp_path):
    other = Statement("other", "VI", "Not in the paper: x.", works="It works.").repaired(1.0, True)
    account = example("small", Two=lambda: Chapter([other]))
    assert account.summary() == ("2 claims: 1 reproduced, 1 not determined; 1 repaired, which are not in the paper")
    possible = errata(account).split("## What is possible instead")[1]
    assert "(`other`): Not in the paper: x." in possible
    assert "By the paper" not in possible
    assert "By the paper" in page(account)


def test_a_chapter_that_breaks_is_reported_and_stops_no_other():
    def breaks():
        raise SolverError("the solver fell over")

    calls = []
    whole = example("small", Two=breaks)
    assert not whole.complete
    assert len(whole.claims) == 2
    assert whole.broken == {"Two": "the solver fell over"}
    assert "the solver fell over" in page(whole)
    gather(Paper("p", "P"), {"One": lambda: Chapter([])}, lambda *call: calls.append(call))
    assert calls == [("One", 0, 1), ("done", 1, 1)]


# --- paper F


def test_every_claim_has_a_reason(chapters, claims):
    for claim in claims.values():
        assert claim.why.strip().endswith("."), claim.id
        assert claim.statement.strip(), claim.id
        assert re.fullmatch(r"[\w.-]+", claim.id), claim.id
        numbers = [value for value in (claim.printed, claim.computed) if isinstance(value, float | tuple)]
        assert all(np.isfinite(value).all() for value in numbers), claim.id
    for chapter in chapters:
        assert {claim.figure for claim in chapter.claims if claim.figure} <= set(chapter.drawings)


def test_known_errata_have_their_verdicts(claims):
    """Each row of the list of paper F's errors has its verdict, and so has what holds."""
    expected = {
        Verdict.DIFFERS: "eq-1 eq-2-height eq-15 eq-16 eq-22 eq-25-drag eq-26-frame eq-26-wind eq-31-32 eq-36-alpha "
        "eq-37-J step-7 step-8 table-1-gyration eq-5 eq-8 eq-17 eq-21 eq-12-13-sign eq-15-sign eq-14-size eq-20-size "
        "eq-21-size fig-3 eq-26 eq-33 eq-33-right eq-34 eq-34-dT section-V-references section-II-IV-references "
        "section-VI-references frames eq-3-alpha eq-9-small eq-23-cables eq-32-frame fig-7-tensions",
        Verdict.IMPOSSIBLE: "pairing step-7-inverse fig-7-positive",
        Verdict.REPRODUCED: "table-1-geometry table-1-cable table-1-mass table-1-air table-1-rigid eq-9 eq-19 eq-27-28 "
        "eq-30 eq-24 eq-36 eq-38 fig-6 VI.A-flight conclusion-mobility fig-1 fig-2 eq-3 eq-18-size eq-20 eq-29",
        Verdict.NOT_DETERMINED: "step-1 step-2 step-3 step-4 step-5 step-6 fig-5-peak fig-5-noise fig-5-shape "
        "eq-25-lift fig-7-lengths fig-12-13 fig-15",
    }
    for expected_verdict, names in expected.items():
        for name in names.split():
            assert claims[name].verdict is expected_verdict, name


def test_the_force_on_the_pulley_is_beside_that_of_eq_16(claims):
    """Printed is what the rule gives, nothing; computed the whole cable's spring, E A / l times the stretch."""
    stretch, length = 1e-5, np.linalg.norm(load("wang-flying").anchors[0] - load("wang-flying").home_attachments[0])
    assert claims["eq-16"].printed == 0
    assert claims["eq-16"].computed == pytest.approx(13000 / length * stretch, rel=1e-6)


def test_table_1_is_read_back_and_a_misprint_changes_the_verdict(monkeypatch):
    assert verdict(parameters, "table-1-mass") is Verdict.REPRODUCED
    monkeypatch.setitem(parameters.PRINTED, "m_B", 1.3)
    assert verdict(parameters, "table-1-mass") is Verdict.DIFFERS
    monkeypatch.setitem(parameters.PRINTED, "I_z", 0.07)
    assert verdict(parameters, "table-1-gyration") is Verdict.REPRODUCED
    monkeypatch.setitem(parameters.PRINTED, "I_z", 1.7)
    assert verdict(parameters, "table-1-rigid") is Verdict.DIFFERS
    monkeypatch.setattr(parameters, "CIRCLE", 101.0)
    assert verdict(parameters, "eq-2-height") is Verdict.REPRODUCED


def test_other_printed_values_change_the_verdict(monkeypatch):
    monkeypatch.setattr(pairing, "ROWS", 3)
    assert verdict(pairing, "pairing") is Verdict.REPRODUCED
    monkeypatch.setattr(helix, "RADIUS", 0.2)
    assert verdict(helix, "fig-7-positive") is Verdict.REPRODUCED
    # Beyond 0.234 m crossed pairs fail, but only from 0.8 m on does the bound exclude every pairing.
    monkeypatch.setattr(helix, "RADIUS", 0.3)
    assert verdict(helix, "fig-7-positive") is Verdict.NOT_DETERMINED
    monkeypatch.setattr(references, "TAGS", tuple(range(1, 40)))
    assert verdict(references, "section-V-references") is Verdict.REPRODUCED


def test_rates_and_accelerations_by_differences():
    """The derivatives that the equations are held against, by scipy's rotations at three instants."""
    samples = rotations.instants()
    step = 1e-4
    angles, rates, bends = (part[:, 3:] for part in samples.base)
    before, now, after = (
        Rotation.from_euler("ZYX", (angles + t * rates + t**2 / 2 * bends)[:, ::-1]) for t in (-step, 0, step)
    )
    np.testing.assert_allclose(samples.R_A.R, now.as_matrix(), atol=1e-14)
    forward, backward = (now.inv() * after).as_rotvec() / step, (before.inv() * now).as_rotvec() / step
    np.testing.assert_allclose(samples.R_A.rate, (forward + backward) / 2, atol=1e-7)
    # the turn of the second step is that of the first, carried on in the turned frame
    np.testing.assert_allclose(samples.R_A.acceleration, (forward - backward) / step, atol=1e-3)


def test_the_missing_newtons_of_the_helix(claims):
    """By scipy's non-negative least squares: the shortfall of pulling cables at the instant of the claim."""
    from scipy.optimize import nnls

    dynamics = Dynamics(load("wang-flying"))
    turn = plans.circle(1.0)
    tensions = plans.steady_tensions(dynamics, turn)
    row = tensions.min(axis=1).argmin()
    scale = np.r_[np.ones(3), np.full(3, 1 / dynamics.robot.length)]
    A = dynamics.relative.wrench_matrix(turn.pose[row]) * scale[:, None]
    w = dynamics.relative.required_wrench(*(part[row] for part in turn)) * scale
    _, shortfall = nnls(A, w)
    (reported,) = re.findall(r"give ([\d.]+) N too little", claims["fig-7-positive"].why)
    assert float(reported) == pytest.approx(shortfall, abs=0.01)


def test_largest_radius_by_the_tensions_themselves():
    """Six cables have one solution each: its smallest tension is zero at the radius that bisection found."""
    dynamics = Dynamics(load("wang-flying"))
    for floor in (0.0, 0.5):
        largest = radius.largest_radius(dynamics, floor)
        smallest = plans.steady_tensions(dynamics, plans.circle(largest)).min()
        assert smallest == pytest.approx(floor, abs=2e-3)
    assert radius.largest_radius(dynamics) == pytest.approx(0.234, abs=0.001)
    assert not radius.feasible(dynamics, 1.0, 0.0)


def test_the_printed_ratio_is_that_of_the_computed_amplitude():
    robot = load("wang-flying")
    amplitude = vibration.amplitude_of(robot, vibration.RATIO)
    shaken = vibration.forces(robot, amplitude)
    # T is what the platform needs less what the vibration adds
    steady = plans.steady_tensions(Dynamics(robot), plans.circle(plans.FEASIBLE))
    np.testing.assert_allclose(shaken.T + shaken.dT, steady, atol=1e-9)
    assert np.abs(shaken.dT[:, 0] / (steady - shaken.dT)[:, 0]).max() == pytest.approx(0.1247, rel=1e-3)
    assert amplitude == pytest.approx(1.9e-6, rel=0.05)


def test_a_pitching_quadrotor_by_newton_and_euler(claims):
    """Relative error of cable 1 again, from the form in {G}."""
    dynamics = Dynamics(load("wang-flying"))
    body, base = plans.circle(plans.FEASIBLE), disturbance.flown(plans.PITCH)
    world = dynamics.relative.motion_in_world(*body, *base)
    A = dynamics.wrench_matrix(world[0], base.pose[:, None])
    felt = np.linalg.solve(A, dynamics.required_wrench(*world)[..., None])[:, 0, 0]
    still = plans.steady_tensions(dynamics, body)[:, 0]
    worst = 100 * np.abs((still - felt) / felt).max()
    assert claims["fig-15"].computed == pytest.approx(worst, rel=1e-6)


# --- the command


def test_an_unknown_paper_is_one_line(tmp_path):
    done = towline("reproduce", "walking", cwd=tmp_path, code=2)
    assert done.stderr.startswith("towline: PAPER must be one of flying, ctmrts, got 'walking'")
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
