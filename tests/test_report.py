"""What a plan shows a person: its report as text and HTML, its convergence, its film."""

import shutil
import time
from dataclasses import replace
from html.parser import HTMLParser
from io import StringIO

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_hex
from PIL import Image
from rich.console import Console

from towline.base.errors import InputError, TowlineError
from towline.cli.watching import watching
from towline.figures import animation, style
from towline.figures.plan import convergence, runs
from towline.figures.style import typeset
from towline.figures.views import views
from towline.models import Dynamics, load
from towline.ocp import MotionStatus, plan
from towline.ocp.audits.excess import Excess
from towline.ocp.reports.report import cables_table, headline, sections, spans_table, stages_table
from towline.ocp.reports.trajectory import outline
from towline.ocp.tasks.task_limits import Block, Capsule, Sphere
from towline.solvers import TensionProblem, certify
from towline.statics.scene import scene

CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.5, "rate": 0.2 * np.pi}
FREE = {"kind": "free", "acceleration_max": 3, "ends": "periodic"}
FAST = Excess("carrier_speed", "quad", 0.5, 3.0, 1.0, "m/s")
SIDEWAYS = {"kind": "line", "start": [0, 0, -1], "end": [0.8, 0, -1]}


@pytest.fixture(scope="module")
def free():
    rows = []
    found = plan(load("wang-flying"), {"name": "circle", "path": CIRCLE, "base": FREE}, lambda *row: rows.append(row))
    assert found.feasible
    return replace(found, iterates=tuple(rows))


@pytest.fixture
def undrawn(monkeypatch):
    """Leave pictures of pages empty; `test_plots_of_a_plan` draws them."""
    monkeypatch.setattr(style, "svg", lambda figure: "<svg/>")


@pytest.fixture(scope="module")
def impossible():
    found = plan(load("wang-flying"), {"name": "sideways", "path": SIDEWAYS, "duration": 1, "margin": 0.1})
    assert found.status is MotionStatus.INFEASIBLE
    return found


def facts(found):
    """Facts by section and name; a fact without a name goes on with the one before."""
    told = {}
    for title, rows in sections(found):
        name = ""
        for own_name, fact in rows:
            name = own_name or name
            told.setdefault((title, name), []).append(fact)
    return {key: "; ".join(values) for key, values in told.items()}


def number(text):
    return float(text.split()[0])


def test_report_of_a_feasible_plan_tells_what_the_audit_saw(free):
    told, seen, robot = facts(free), free.audit, free.scenario.robot
    assert headline(free).startswith("wang-flying, circle: FEASIBLE, ")
    assert free.report().splitlines()[0] == headline(free)
    for name, pick in (("smallest", np.argmin), ("largest", np.argmax)):
        row, cable = np.unravel_index(pick(seen.tensions), seen.tensions.shape)
        fact = told["Tensions", name]
        assert number(fact) == pytest.approx(seen.tensions[row, cable], rel=1e-3)
        assert f"in cable {cable + 1} at t = {seen.times[row]:.3f} s" in fact
    assert number(told["Tensions", "tension margin"]) == pytest.approx(free.margin, rel=1e-3)
    assert " N above t_min in cable " in told["Tensions", "tension margin"]
    assert told["Tensions", "limits"] == "0.5 N to 60 N"
    speed = np.linalg.norm(seen.carriers.velocity[:, 0, :3], axis=1).max()
    acceleration = np.linalg.norm(seen.carriers.acceleration[:, 0, :3], axis=1).max()
    assert f"{speed:.4g} m/s" in told["Carriers", "quad"]
    assert "(no limit)" in told["Carriers", "quad"]
    assert f"{acceleration:.4g} m/s^2" in told["Carriers", "quad"]
    assert "(limit 3 m/s^2)" in told["Carriers", "quad"]
    assert told["Audit", "instants"] == "10 001, one every 1 ms"
    assert seen.violation.max() < 1e-12
    assert told["Audit", "largest wrench error"] == "0 N (tolerance 1 uN)"
    assert number(told["Computation", "solving programs"]) == pytest.approx(free.solve_s, rel=1e-2)
    assert [(row[0], row[2]) for row in stages_table(free).rows] == [
        ("nonlinear program, 100 steps", f"solved in {free.iterations} iterations"),
        ("audit", "passed"),
    ]
    assert "Solve_Succeeded" not in free.report()
    assert "Why it is infeasible" not in free.report()
    for line in (robot.name, *(fact for _, rows in sections(free) for _, fact in rows)):
        assert line in free.report()


def test_report_of_an_infeasible_plan_tells_the_certificate(impossible):
    told, certificate = facts(impossible), impossible.certificate
    why = {name: fact for (title, name), fact in told.items() if title == "Why it is infeasible"}
    assert (
        f"INFEASIBLE, {certificate.shortfall:.4g} N short of the required wrench at t = {certificate.time:.3f} s"
        in headline(impossible)
    )
    assert why["time"] == f"t = {certificate.time:.3f} s of 1 s"
    assert number(why["needed"]) == pytest.approx(certificate.demand, rel=1e-3)
    assert number(why["available"].removeprefix("at most ")) == pytest.approx(certificate.support, rel=1e-3)
    assert number(why["short by"]) == pytest.approx(certificate.shortfall, rel=1e-3)
    for cable in certificate.binding:
        assert str(cable + 1) in why["limits"]
    assert "(0.6 N), with a margin of 0.1 N" in why["limits"]
    without = ~np.isfinite(impossible.audit.tensions).all(axis=1)
    missing = impossible.audit.times[without]
    fact = told["Tensions", "no feasible tensions"]
    assert f"first at {missing[0]:.3f} s, last at {missing[-1]:.3f} s" in fact
    assert number(fact.removeprefix("for ")) == pytest.approx(100 * without.mean(), rel=1e-2)
    # At the other instants tensions exist.
    smallest = np.nanmin(impossible.audit.tensions)
    assert number(told["Tensions", "smallest elsewhere"]) == pytest.approx(smallest, rel=1e-3)
    # Near singular poses the audit has the closest tensions, which are not feasible.
    closest = np.where(without[:, None], 1.0, impossible.audit.tensions)
    singular = replace(impossible, audit=replace(impossible.audit, tensions=closest))
    near = facts(singular)
    assert cables_table(singular) == cables_table(impossible)
    assert near["Tensions", "no feasible tensions"] == fact
    assert near["Tensions", "smallest elsewhere"] == told["Tensions", "smallest elsewhere"]
    assert told["Carriers", "quad"] == "at rest"
    assert "Computation" not in {title for title, _ in told}  # a fixed motion needs no solver
    assert "solver" not in impossible.report()


def test_report_of_a_plan_that_was_not_found_does_not_claim_a_proof(impossible):
    lost = replace(impossible, status=MotionStatus.NOT_FOUND)
    lost = replace(lost, audit=replace(lost.audit, excess=[FAST]))
    assert "NOT-FOUND" in headline(lost)
    assert "1 other limit exceeded" in headline(lost)
    assert "Why it is infeasible" not in lost.report()
    assert facts(lost)["What the closest motion violates", "limit exceeded"] == str(FAST)
    only = replace(lost, audit=replace(lost.audit, certificate=None))
    assert headline(only).endswith(f"NOT-FOUND, {FAST}")
    late = replace(only, reason="the time limit of 10 s is reached")
    assert headline(late).endswith(f"NOT-FOUND, the time limit of 10 s is reached; closest motion: {FAST}")


def test_soft_limits_that_are_passed_are_told_of_a_feasible_plan(free):
    passed = replace(free, audit=replace(free.audit, soft_excess=[FAST]))
    assert facts(passed)["Soft limits exceeded", "limit"] == str(FAST)
    assert "Soft limits exceeded" not in free.report()


def test_directions_in_words():
    robot = load("wang-flying")
    m, length = 6, robot.length

    def told(A, w):
        certificate = certify(TensionProblem(A, w, np.zeros(m), np.ones(m), length=length))
        return certificate.text(-np.array(robot.gravity)).along

    push = np.vstack([np.eye(6)])
    assert told(push, [0, 0, -5, 0, 0, 0]) == "force (0.00, 0.00, -1.00), down"
    assert told(push, [0, 0, 5, 0, 0, 0]) == "force (0.00, 0.00, 1.00), up"
    assert told(push, [-3, 0, 4 + 1, 0, 0, 0]) == "force (-0.60, 0.00, 0.80)"
    scaled = "; moments divided by the characteristic length, 0.2518 m"
    assert told(push, [0, 0, 0, 0, -1, 0]) == f"moment (0.00, -1.00, 0.00){scaled}"
    # With the moment divided by the length both parts are equal.
    assert told(push, [-1, 0, 0, 0, 0, -length]) == f"force (-0.71, 0.00, 0.00), moment (0.00, 0.00, -0.71){scaled}"


class Page(HTMLParser):
    """Checks that tags are closed in order, and keeps cells, tags, attributes and text."""

    OPEN = ("meta", "img", "br", "!doctype")

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.stack, self.tags, self.attributes, self.rows, self.text = [], [], [], [], ""
        self.feed(text)
        self.close()
        assert self.stack == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, *pair) for pair in attrs]
        if tag not in self.OPEN:
            self.stack.append(tag)
        if tag == "tr":
            self.rows.append(["", ""])

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag

    def handle_data(self, data):
        self.text += data
        cells = [tag for tag in self.stack if tag in ("th", "td")]  # which may have code inside
        if cells:
            self.rows[-1][cells[-1] == "td"] += data


def test_html_tells_the_same_facts_and_loads_nothing(free, impossible, undrawn, tmp_path):
    for found, pictures in ((free, 6), (impossible, 4)):
        file = found.save_report(tmp_path / "new" / "report.html")
        text = file.read_text()
        page = Page(text)
        # A table's row is one heading or one text here. The spans are below the reasons and what to try, other tables
        # below all sections; audit, computation and stages are folded at the end.
        first, *others = sections(found)
        try_it = [others.pop(0)] if others[0].title == "What you can try" else []
        ends = [section for section in others if section.title in ("Audit", "Computation")]
        others = [section for section in others if section not in ends]
        order = [first, *try_it, spans_table(found), *others, cables_table(found), *ends, stages_table(found)]
        told = []
        for part in filter(None, order):
            if hasattr(part, "facts"):
                told += [(name, typeset(fact).replace("`", "")) for name, fact in part.facts]  # code has a font instead
            else:
                rows = [("", "".join(typeset(cell) for cell in row)) for row in part.rows]
                told += [("".join(typeset(name) for name in part.columns), ""), *rows]
        assert [tuple(row) for row in page.rows] == told
        assert "viewport" in text
        assert found.status.value in page.text
        assert not {"script", "link", "iframe", "object", "a"} & set(page.tags)
        places = [value for tag, name, value in page.attributes if name in ("src", "href", "srcset", "data")]
        assert len(places) == pictures
        assert all(place.startswith("data:image/svg+xml;base64,") for place in places)
        assert "url(" not in text
        assert "@import" not in text
        alternatives = [value for tag, name, value in page.attributes if name == "alt"]
        assert ("Convergence of the solver" in alternatives) == (found is free)
        assert [path.name for path in file.parent.iterdir()] == ["report.html"]
    with pytest.raises(InputError, match="cannot be written"):
        free.save_report("/proc/nowhere/report.html")


def test_what_comes_from_files_is_escaped(impossible, undrawn, tmp_path):
    evil = '<script>alert("1")</script>&amp;'
    robot = load("wang-flying").model_copy(update={"name": evil, "source": evil})
    task = impossible.scenario.task.model_copy(update={"name": evil})
    audit = replace(impossible.audit, excess=[replace(FAST, about=evil)])
    found = replace(impossible, scenario=replace(impossible.scenario, robot=robot, task=task), audit=audit)
    found = replace(found, message=evil, deviation=found.deviation)
    text = found.save_report(tmp_path / "evil.html").read_text()
    assert "<script" not in text.lower()
    page = Page(text)
    assert "script" not in page.tags
    assert page.text.count(evil) >= 5  # title, heading, limit exceeded, both files


def test_convergence_shows_every_run():
    first = [(0, 5.0, 1.0), (1, 3.0, 1e-3), (2, 2.5, 0.0)]
    second = [(0, 2.6, 1e-2), (1, 2.4, 1e-9)]
    assert [len(run) for run in runs([*first, *second])] == [3, 2]
    above, below = convergence([*first, *second]).axes
    curves = [line for line in above.get_lines() if str(line.get_label()).startswith("run")]
    assert [list(line.get_xdata()) for line in curves] == [[0, 1, 2], [3, 4]]
    assert len({to_hex(line.get_color()) for line in curves}) == 2
    assert (above.get_yscale(), below.get_yscale()) == ("log", "log")
    assert min(curves[0].get_ydata()) > 0  # or the point would not be drawn
    np.testing.assert_array_equal(below.get_lines()[0].get_ydata(), [5.0, 3.0, 2.5])
    assert convergence([(0, -1.0, 1.0), (1, 2.0, 0.1)]).axes[1].get_yscale() == "symlog"
    for rows in ([], [(0, 0.0, 0.0)], [(0, float("nan"), float("inf")), (1, 1.0, 1.0)]):
        convergence(rows).canvas.draw()


def test_plots_of_a_plan(free, impossible, tmp_path, monkeypatch):
    monkeypatch.setattr(style, "DPI", 20)
    drawn = [path.name for path in free.plot(tmp_path)]
    assert drawn == ["views.png", "tensions.png", "path.png", "base.png", "limits.png", "convergence.png"]
    assert [path.name for path in impossible.plot(tmp_path)] == ["views.png", "tensions.png", "path.png", "base.png"]


def test_views_mark_where_no_tensions_exist(impossible):
    """Where the trajectory has none, and nowhere else."""
    saved = impossible.trajectory
    shown = scene(impossible.scenario.robot, saved, np.array([0.0, 1.0]))
    missing = np.isnan(saved["tensions"].to_numpy()).any(axis=1)
    assert missing.any()
    assert not missing.all()
    np.testing.assert_array_equal(shown.path_missing, missing)
    marked = views(shown).axes[0].lines
    (line,) = (line for line in marked if line.get_label() == "no tensions inside the limits")
    np.testing.assert_array_equal(np.isfinite(line.get_xdata()), missing)


@pytest.mark.parametrize("name", ["wang-flying", "ipanema-1", "wang-ctmrts"])
def test_scene_has_the_cables_where_the_dynamics_has_them(name):
    robot = load(name)
    there = robot.home[:3]
    path = {"kind": "line", "start": list(there), "end": list(there + 0.1)}
    found = plan(robot, {"path": path, "duration": 1})
    times = np.array([0.0, 0.25, 1.0])
    shown = scene(found.scenario.robot, found.trajectory, times)
    rows = [0, 250, 1000]
    lengths = Dynamics(robot).cable_lengths(found.audit.motion.pose[rows], found.audit.carriers.pose[rows])
    np.testing.assert_allclose(np.linalg.norm(shown.anchors - shown.attachments, axis=2), lengths, rtol=1e-12)
    np.testing.assert_array_equal(shown.tensions, found.audit.tensions[rows])
    assert shown.names == [carrier.name for carrier in robot.carriers if carrier.kind != "ground"]


def test_places_to_keep_out_of_are_outlined_on_their_surface():
    ball = Sphere(kind="sphere", centre=(1, 2, 3), radius=0.5)
    for line in outline(ball):
        np.testing.assert_allclose(np.linalg.norm(line - [1, 2, 3], axis=1), 0.5)
    block = Block(kind="box", min=(0, 0, 0), max=(1, 2, 3))
    assert len(outline(block)) == 12
    np.testing.assert_array_equal(np.vstack(outline(block)).max(axis=0), [1, 2, 3])
    for end in ((1, 1, 2), (0, 0, 0)):  # a capsule may be a ball
        pipe = Capsule(kind="capsule", start=(0, 0, 0), end=end, radius=0.2)
        points = np.vstack(outline(pipe))
        share = np.clip(points @ end / max(np.dot(end, end), 1), 0, 1)
        away = np.linalg.norm(points - share[:, None] * np.array(end), axis=1)
        assert away.max() == pytest.approx(0.2)


def test_carriers_that_tilt_tell_so_and_obstacles_are_in_the_film(tmp_path):
    post = {"name": "<b>$post", "kind": "box", "min": [0.7, 0.7, -9], "max": [1.2, 1.2, 9]}
    base = {**FREE, "tilt_max": 0.3, "turn_acceleration_max": 5}
    path = {**CIRCLE, "rate": 3}
    found = plan(load("wang-flying"), {"path": path, "base": base, "steps": 20, "limits": {"keep_out": [post]}})
    tilt = facts(found)["Carriers", "quad"].split("; ")[2]
    pose = found.audit.carriers.pose[:, 0]
    largest = np.degrees(np.arccos((np.cos(pose[:, 3]) * np.cos(pose[:, 4])).min()))
    assert number(tilt.removeprefix("up to ")) == pytest.approx(largest, rel=1e-3)
    assert tilt.endswith("(limit 17.19 degrees)")
    assert [len(lines) for lines in scene(found.scenario.robot, found.trajectory, np.zeros(1)).obstacles] == [12]
    with Image.open(found.animate(tmp_path / "post.gif", fps=5)) as picture:
        assert picture.n_frames == 11


def test_gif_has_the_frames_that_were_asked_for(free, tmp_path):
    start = time.process_time()
    file = free.animate(tmp_path / "circle.gif", speed=4)
    assert time.process_time() - start < 30
    with Image.open(file) as picture:
        assert picture.n_frames == 51  # 10 s at 20 frames a second and four times the speed, both ends
        assert picture.info["duration"] == 50
        assert picture.size == (700, 520)
        frames = []
        for k in (0, 12, 25):
            picture.seek(k)
            frames.append(np.asarray(picture.convert("RGB")))
    assert (frames[0] != frames[1]).any()
    assert (frames[1] != frames[2]).any()
    assert (frames[0][0, 0] == 255).all()
    assert [path.name for path in tmp_path.iterdir()] == ["circle.gif"]


def test_gif_keeps_the_speed_though_it_counts_in_hundredths(impossible, tmp_path):
    """At 30 frames a second a delay would be 3.33 hundredths: frames come 3 apart, and the motion is looked at then."""
    when = animation.timing(tmp_path / "x.gif", 1.0, speed=0.5, fps=30)
    assert when.rate == pytest.approx(100 / 3)
    np.testing.assert_allclose(np.diff(when.times), 0.015)
    with Image.open(impossible.animate(tmp_path / "x.gif", speed=2, fps=30)) as picture:
        assert picture.n_frames == 17
        assert picture.info["duration"] == 30


def test_mp4_by_ffmpeg_or_a_line_that_names_gif(impossible, tmp_path, monkeypatch):
    file = tmp_path / "film.mp4"
    if shutil.which("ffmpeg"):
        impossible.animate(file, fps=25)
        assert file.read_bytes()[4:8] == b"ftyp"
    monkeypatch.setitem(mpl.rcParams, "animation.ffmpeg_path", "/nowhere/ffmpeg")
    with pytest.raises(InputError, match=r"ffmpeg, which is not installed; without it use \.gif"):
        impossible.animate(tmp_path / "other.mp4")
    assert not (tmp_path / "other.mp4").exists()


def test_a_broken_ffmpeg_is_one_line_and_leaves_no_file(tmp_path, monkeypatch):
    broken = tmp_path / "ffmpeg"
    broken.write_text("#!/bin/sh\necho first >&2\necho 'no such codec' >&2\nexit 3\n")
    broken.chmod(0o755)
    monkeypatch.setitem(mpl.rcParams, "animation.ffmpeg_path", str(broken))
    with pytest.raises(TowlineError, match=r"ffmpeg: stopped with exit code 3 \(no such codec\)"):
        animation.write(tmp_path / "film.mp4", lambda k: np.zeros((520, 700, 3), np.uint8), 50, 25)
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


@pytest.mark.parametrize(
    ("file", "options", "message"),
    [
        ("film.avi", {}, "must end in .gif or .mp4, got 'film.avi'"),
        ("film", {}, "must end in .gif or .mp4, got 'film'"),
        ("film.gif", {"fps": 80}, "fps must be a number from 0.1 to 50 for .gif, got 80"),
        ("film.gif", {"fps": float("nan")}, "fps must be a number"),
        ("film.gif", {"speed": 0}, "speed must be a number from 1e-06"),
        ("film.gif", {"speed": 1e-4}, "must have at most 3000 frames"),
    ],
)
def test_films_that_cannot_be_are_refused_in_one_line(impossible, file, options, message, tmp_path):
    with pytest.raises(InputError) as refused:
        impossible.animate(tmp_path / file, **options)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)
    assert list(tmp_path.iterdir()) == []


def test_watching_shows_and_keeps_what_the_solver_tells():
    """On 80 columns nothing is cut."""
    screen = Console(file=StringIO(), force_terminal=True, width=80)
    with watching("planning circle", console=screen) as watch:
        for row in ((0, 5.0, 1.0), (1, 3.25, 1e-3), (0, 3.5, 2e-2)):
            watch(*row)
    assert watch.rows == [(0, 5.0, 1.0), (1, 3.25, 1e-3), (0, 3.5, 2e-2)]
    assert watch.attempt == 2
    shown = screen.file.getvalue()
    for part in ("planning circle", "attempt 2", "iteration 0", "objective 3.5", "infeasibility 2.0e-02"):
        assert part in shown
    for options in ({"quiet": True, "console": Console(file=(silent := StringIO()), force_terminal=True)}, {}):
        with watching("planning", **({"console": Console(file=silent)} | options)) as watch:
            watch(0, 1.0, 1.0)
        assert silent.getvalue() == ""
        assert len(watch.rows) == 1


def test_the_table_of_cables_says_what_each_winch_must_do():
    """By the trajectory: lengths, their largest rate, and tensions, to the digits of the table."""
    found = plan(load("cogiro"), {"path": {"kind": "line", "start": [0, 0, 1], "end": [2, 1, 2]}, "duration": 3})
    saved = found.trajectory
    lengths, times = saved["cable_lengths"].to_numpy(), saved["time"].to_numpy()
    rate = np.abs(np.diff(lengths, axis=0) / np.diff(times)[:, None]).max(axis=0)
    tensions = saved["tensions"].to_numpy()
    wanted = [lengths[0], lengths[-1], lengths.min(axis=0), lengths.max(axis=0), rate]
    wanted += [tensions.min(axis=0), tensions.max(axis=0)]
    shown = np.array([[float(cell.replace(" ", "")) for cell in row[1:]] for row in cables_table(found).rows]).T
    for got, expected in zip(shown, wanted, strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-3)


def test_the_cause_names_the_cables_of_the_certificate(impossible):
    """Any of those that it binds: the smallest and the largest tension are the robot's, less the task's margin."""
    cause = dict(sections(impossible)[0].facts)["cause"]
    proof, robot = impossible.certificate, impossible.scenario.robot
    for cables, way in ((proof.at_min, "below"), (proof.at_max, "above")):
        assert (f"would have to go {way}" in cause) == bool(len(cables))
        numbers = [str(k + 1) for k in cables]
        named = f"one of cables {', '.join(numbers)}" if len(numbers) > 2 else f"cable {' or '.join(numbers)}"
        named = "one of the cables" if len(numbers) == robot.m else named
        assert not numbers or f" {named} would have to go {way} " in cause
    margin = impossible.scenario.task.margin
    assert len(proof.at_min) == 0 or f"below {robot.t_min[0] + margin:g} N" in cause
    assert len(proof.at_max) == 0 or f"above {robot.t_max[0] - margin:g} N" in cause
