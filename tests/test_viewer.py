"""What the viewer shows, without a browser: geometry, tensions, certificates, colours, plans, workspaces, the page."""

import ast
import json
import re
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import msgspec
import numpy as np
import pytest
import viser
import xarray as xr
from scipy.spatial.transform import Rotation
from websockets.datastructures import Headers

from towline.base.errors import InputError
from towline.figures.tension_colours import place, rgb, shades
from towline.models import Dynamics, load
from towline.ocp import plan
from towline.viewer import read, save_page, serve
from towline.viewer.access import refusal
from towline.viewer.geometry import Geometry, posts, sheaves
from towline.viewer.labels import readout
from towline.viewer.sliders import sliders
from towline.viewer.snapshot import arrow, at_rest
from towline.viewer.subject import cloud
from towline.workspace import StaticEquilibrium, sample, save

from .viewer_wire import Wire
from .warm import towline

CIRCLE = {"kind": "circle", "centre": [0, 0, -1], "radius": 0.5, "rate": 0.6}


def rest(robot, pose=None, carriers=None):
    pose = robot.home if pose is None else np.asarray(pose, dtype=float)
    carriers = robot.carrier_home if carriers is None else carriers
    return at_rest(Dynamics(robot), Geometry(robot), pose, carriers)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A plan that cannot be, one that can, and a workspace."""
    place = tmp_path_factory.mktemp("viewer")
    robot = load("wang-flying")
    hover = plan(robot, {"path": CIRCLE, "base": {"kind": "hold"}, "output_rate": 20})
    hover.save(place / "hover.nc")
    line = {"kind": "line", "start": [0, 0, -1], "end": [0.05, 0, -0.9]}
    found = plan(robot, {"path": line, "duration": 2, "base": {"kind": "hold"}, "output_rate": 20})
    assert found.feasible
    found.save(place / "line.nc")
    region = {"position": {"min": [-0.6, -0.6, -1.2], "max": [0.6, 0.6, 0]}}
    for keep in ("accepted", "all", "none"):
        save(sample(robot, StaticEquilibrium(), region, samples=3000, keep=keep), place / f"{keep}.nc")
    return place


@pytest.mark.parametrize("name", ["wang-flying", "caroca-pulleys", "planar-4", "cogiro"])
def test_cables_are_drawn_along_the_pull_of_the_wrench_matrix(name):
    robot = load(name)
    pose = robot.home + robot.dof_mask * [0.05, -0.04, 0.03, 0.1, -0.05, 0.2]
    carriers = robot.carrier_home + np.array([0.02, 0.01, 0, 0, 0.03, 0])
    points = Geometry(robot)(pose, carriers)
    along = points.exits - points.attachments
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    np.testing.assert_allclose(along.T, Dynamics(robot).wrench_matrix(pose, carriers)[:3], atol=1e-9)
    turned = Rotation.from_euler("ZYX", pose[:2:-1])
    np.testing.assert_allclose(points.attachments, turned.apply(robot.attachments) + pose[:3], atol=1e-12)
    np.testing.assert_allclose(points.com, turned.apply(robot.platform.com) + pose[:3], atol=1e-12)


@pytest.mark.parametrize("name", ["wang-flying", "cogiro", "flycrane", "caroca-pulleys"])
def test_what_is_shown_at_rest_carries_the_weight(name):
    """By the points and tensions of the picture alone: forces and moments about the CoM balance."""
    robot = load(name)
    seen = rest(robot)
    assert seen.status == "optimal"
    pull = seen.points.exits - seen.points.attachments
    pull *= (seen.tensions / np.linalg.norm(pull, axis=1))[:, None]
    np.testing.assert_allclose(pull.sum(axis=0), [0, 0, robot.weight], atol=1e-6 * robot.weight)
    moments = np.cross(seen.points.attachments - seen.points.com, pull).sum(axis=0)
    np.testing.assert_allclose(moments, 0, atol=1e-6 * robot.weight * robot.length)
    slack = min((seen.tensions - robot.t_min).min(), (robot.t_max - seen.tensions).min())
    assert seen.margin == slack > 0
    assert seen.reserve > 0
    assert seen.certificate is None
    assert arrow(seen, 1.0, 1.0) is None


def test_above_its_anchors_a_load_lacks_a_force_upwards():
    """Cables only pull: up there they pull down, so all of the weight is missing, and more."""
    robot = load("point-mass-3")
    above = np.array([*robot.home_anchors.mean(axis=0)[:2], robot.home_anchors[:, 2].max() + 1, 0, 0, 0])
    seen = rest(robot, above)
    assert seen.status == "infeasible"
    assert np.isnan(seen.tensions).all()
    start, tip = arrow(seen, 10.0, robot.weight)
    np.testing.assert_allclose(start, seen.points.com)
    np.testing.assert_allclose((tip - start) / np.linalg.norm(tip - start), [0, 0, 1], atol=1e-6)
    assert seen.certificate.shortfall > robot.weight
    assert -seen.reserve == pytest.approx(seen.certificate.shortfall)
    told = readout(seen, robot)
    assert f"short by {seen.certificate.shortfall:.4g} N" in told
    assert told.count("none") == robot.m


def test_a_missing_moment_alone_is_no_arrow():
    """The arrow is as long as the share of force in the direction, and is left out where there is none."""
    robot = load("wang-flying")
    seen = rest(robot, robot.home + np.array([0.4, 0, 0, 0, 0, 0]))
    force, shortfall = np.linalg.norm(seen.certificate.direction[:3]), seen.certificate.shortfall
    # Half of what grows where the shortfall is the typical force, and less than 0.3 of the size however large it is.
    assert np.linalg.norm(arrow(seen, 1.0, shortfall)[1] - seen.points.com) == pytest.approx(0.3 * 0.625 * force)
    lengths = [np.linalg.norm(np.diff(arrow(seen, 1.0, shortfall / times), axis=0)) for times in (0.1, 1, 10, 1e9)]
    assert (np.diff(lengths) > 0).all()
    assert lengths[-1] == pytest.approx(0.3 * force)
    seen.certificate.direction[:3] = 0
    assert arrow(seen, 1.0, 1.0) is None


@pytest.mark.parametrize("name", ["caroca-pulleys", "ipanema-2"])
def test_sheaves_touch_the_anchor_and_the_cable(name):
    robot = load(name)
    points = Geometry(robot)(robot.home + robot.dof_mask * [0.1, -0.2, 0.1, 0, 0, 0.1], robot.carrier_home)
    turning = np.flatnonzero(robot.pulley_radii)
    rings = sheaves(robot, points)
    assert len(turning) == 0 or len(rings) % len(turning) == 0
    for index, ring in zip(turning, np.split(rings[:, 0], max(len(turning), 1)), strict=False):
        centre, radius = ring.mean(axis=0), robot.pulley_radii[index]
        for at in (points.anchors[index], points.exits[index]):
            assert np.linalg.norm(at - centre) == pytest.approx(radius, rel=1e-6)
        spoke = points.exits[index] - centre
        assert abs(spoke @ (points.attachments[index] - points.exits[index])) < 1e-9 * radius
    assert len(posts(robot, -1.0)) == robot.m


def test_colours_are_ordered_between_the_limits_and_tell_none_apart():
    t_min, t_max = np.array([0.5, 0.0, 5.0]), np.array([60.0, 100.0, 5.0])
    np.testing.assert_allclose(place(t_min, t_min, t_max), [0, 0, 1])
    np.testing.assert_allclose(place(t_max, t_min, t_max), [1, 1, 1])
    np.testing.assert_allclose(place(np.array([-1.0, 200.0, np.nan]), t_min, t_max), [0, 1, np.nan])
    places = place(np.linspace(0.5, 60, 50)[:, None], t_min[:1], t_max[:1])[:, 0]
    assert (np.diff(places) > 0).all()
    # By lightness alone, so that any kind of colour vision sees it; and against white.
    light = (shades(np.linspace(0, 1, 50)) / 255) ** 2.2 @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light) < 0).all()
    assert light[0] < 0.8
    assert len(set(shades(np.array([np.nan]))[0])) == 1  # grey
    assert rgb("#0072B2") == (0, 114, 178)


def test_a_plan_is_shown_as_it_was_saved(folder):
    subject = read(str(folder / "line.nc"))
    saved, replay = xr.load_dataset(folder / "line.nc"), subject.replay
    assert subject.kind == "plan"
    dynamics = Dynamics(subject.robot)
    for index in (0, 7, len(replay.times) - 1):
        seen, row = replay.at(index), saved.isel(time=index)
        assert seen.time == float(row["time"])
        A = dynamics.wrench_matrix(seen.pose, seen.carriers)
        w = dynamics.required_wrench(*(row[name].to_numpy() for name in ("pose", "velocity", "acceleration")))
        np.testing.assert_allclose(A @ seen.tensions, w, atol=1e-5)
        assert seen.status == "feasible"
    assert replay.index_at(replay.times[5] + 0.4 * (replay.times[6] - replay.times[5])) == 5
    frames = replay.frames(5.0)
    assert (frames[0], frames[-1]) == (0, len(replay.times) - 1)
    assert np.diff(replay.times[frames]).max() == pytest.approx(0.2, abs=0.051)
    recorded = (len(replay.times) - 1.5) / replay.duration  # [1/s]: one instant too few if it were rounded down
    np.testing.assert_array_equal(replay.frames(recorded), np.arange(len(replay.times)))
    for points in (replay.path, seen.points.anchors):
        assert (points > replay.extent.low - 0.2).all()
        assert (points < replay.extent.high + 0.2).all()


def test_where_a_plan_has_no_tensions_its_audit_and_the_certificate_agree(folder):
    saved = xr.load_dataset(folder / "hover.nc")
    replay = read(str(folder / "hover.nc")).replay
    for index in (0, 50, 111):
        seen = replay.at(index)
        assert seen.status == "infeasible"
        assert seen.certificate.shortfall == pytest.approx(float(saved["violation"][index]), rel=1e-6)


def test_sliders_stay_where_the_robot_can_be_put():
    robot = load("wang-ctmrts")
    found = sliders(robot, Geometry(robot))
    assert [s.coordinate for s in found if s.carrier is None] == list(range(6))
    for slider in found:
        home = robot.home if slider.carrier is None else robot.carrier_home[slider.carrier]
        assert slider.low <= home[slider.coordinate] <= slider.high
        if slider.carrier is not None:
            reach = robot.carriers[slider.carrier].reach
            assert reach.min[slider.coordinate] <= slider.low
            assert slider.high <= reach.max[slider.coordinate]
    planar = load("planar-4")
    assert [s.label for s in sliders(planar, Geometry(planar))] == ["x [m]", "z [m]", "pitch [rad]"]
    kept = robot.model_copy(update={"drive": "variable-length"})
    assert all(slider.carrier is None for slider in sliders(kept, Geometry(kept)))


def test_a_workspace_is_points_or_cells(folder):
    whole, accepted, none = (
        cloud(xr.load_dataset(folder / f"{keep}.nc"), keep) for keep in ("all", "accepted", "none")
    )
    assert len(whole.positions) == 3000
    green = (whole.colours == rgb(whole.legend[0][1])).all(axis=1)
    assert green.sum() == len(accepted.positions) > 0
    np.testing.assert_array_equal(whole.positions[green], accepted.positions)
    # Each accepted point lies in a cell that is shown; cells are a 32nd of the box.
    near = np.abs(accepted.positions[:, None] - none.positions[None]) <= np.array([1.2, 1.2, 1.2]) / 64 + 1e-9
    assert near.all(axis=2).any(axis=1).all()
    subject = read(str(folder / "all.nc"))
    assert (subject.kind, subject.robot.name) == ("workspace", "wang-flying")


def test_what_cannot_be_shown_is_one_line(folder):
    saved = xr.load_dataset(folder / "line.nc")
    (folder / "text.nc").write_text("no file of numbers")
    (folder / "cut.nc").write_bytes((folder / "line.nc").read_bytes()[:5000])
    saved.drop_vars("tensions").to_netcdf(folder / "half.nc", engine="h5netcdf")
    saved.isel(cable=slice(3)).to_netcdf(folder / "few.nc", engine="h5netcdf")
    saved[["status"] if "status" in saved else ["t_min"]].to_netcdf(folder / "other.nc", engine="h5netcdf")
    times = saved["time"].to_numpy().copy()
    times[-1] = times[-2]
    saved.assign_coords(time=times).to_netcdf(folder / "twice.nc", engine="h5netcdf")
    hostile = xr.load_dataset(folder / "none.nc")
    hostile.attrs["robot"] = "mine"
    (folder / "folder.nc").mkdir()
    other = load("wang-flying").model_dump(mode="json") | {"name": "mine"}
    (folder / "mine.yaml").write_text(json.dumps(other))
    hostile.to_netcdf(folder / "mine.nc", engine="h5netcdf")
    wanted = {
        "text.nc": "cannot be read",
        "cut.nc": "cannot be read",
        "gone.nc": "does not exist",
        "folder.nc": "got a folder",
        "half.nc": "without 'tensions'",
        "few.nc": "tensions must have the shape",
        "twice.nc": "time must have increasing values",
        "other.nc": "neither a plan nor a workspace",
        "mine.nc": "--robot",
    }
    for name, words in wanted.items():
        with pytest.raises(InputError, match=words) as error:
            read(str(folder / name))
        assert "\n" not in str(error.value)
    assert read(str(folder / "mine.nc"), robot=str(folder / "mine.yaml")).kind == "workspace"
    with pytest.raises(InputError, match=r"must be the file of 'mine', .* got 'cogiro'"):
        read(str(folder / "mine.nc"), robot="cogiro")
    for target in ("wang-flying", str(folder / "line.nc")):
        with pytest.raises(InputError, match="--robot"):
            read(target, robot="cogiro")
    with pytest.raises(InputError, match="did you mean 'cogiro'"):
        read("cogir")
    for host, port, words in (
        ("127.0.0.1", 70000, "--port"),
        ("192.0.2.1", 0, "--host"),
        ("no.such.host.", 0, "--host"),
        (b"bytes\0", 0, "--host"),
        (["127.0.0.1"], 0, "--host"),
        ("127.0.0.1", "8080", "--port"),
        ("127.0.0.1", True, "--port"),
    ):
        with pytest.raises(InputError, match=words), serve(read("planar-4"), host, port):
            pass


def test_an_address_of_ipv6_is_one_that_a_browser_takes():
    try:
        with socket.socket(socket.AF_INET6) as trial:
            trial.bind(("::1", 0))
    except OSError:
        pytest.skip("this machine has no IPv6")
    with serve(read("planar-4"), "::1", 0) as url:
        told = urlsplit(url)
        assert told.hostname == "::1"
        with socket.create_connection((told.hostname, told.port), timeout=10):
            pass


def test_nobody_can_have_it_open_a_tunnel():
    from towline.viewer import server

    with server._started("127.0.0.1", 0) as started:
        assert started.request_share_url() is None


def answer(url, upgrade=True, **changed):
    """Return the status with which a server answers a request, and its other headers."""
    told = urlsplit(url)
    headers = {"Host": told.netloc, "Origin": url} | changed
    if upgrade:
        headers |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        headers |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Protocol": "viser-v0"}
    lines = ["GET / HTTP/1.1", *(f"{name}: {value}" for name, value in headers.items() if value is not None), "", ""]
    with socket.create_connection((told.hostname, told.port), timeout=10) as line:
        line.sendall("\r\n".join(lines).encode())
        stream = line.makefile("rb")
        head = [text.decode().strip() for text in iter(stream.readline, b"\r\n")]
    return int(head[0].split()[1]), head[1:]


def test_only_the_page_of_the_viewer_opens_a_socket():
    with serve(read("planar-4"), port=0) as url:
        port = urlsplit(url).port
        assert answer(url)[0] == 101
        renamed = f"localhost:{port}"
        assert answer(url, Host=renamed, Origin=f"http://{renamed}")[0] == 101
        for origin in (
            "http://evil.example",
            f"http://127.0.0.1:{port + 1}",
            f"https://127.0.0.1:{port}",
            "null",
            None,
        ):
            assert answer(url, Origin=origin)[0] == 403, origin
        # A foreign name that leads here: the browser then sends it as Host and as Origin.
        for host in (f"evil.example:{port}", f"192.0.2.1:{port}", "", f"localhost@evil.example:{port}", "[::1", None):
            assert answer(url, Host=host, Origin=f"http://{host}")[0] == 403, host
            assert answer(url, upgrade=False, Host=host, Origin=None)[0] == 403, host
        assert answer(url, Upgrade="WebSocket", Origin="http://evil.example")[0] == 403
        status, headers = answer(url, upgrade=False, Origin=None)
        assert status == 200
        assert "Content-Security-Policy: frame-ancestors 'self'" in headers


@pytest.mark.parametrize(
    ("listening", "own", "foreign"),
    [
        ("0.0.0.0", "192.168.1.7:9000", "evil.example"),
        ("::", "[fe80::1]:9000", "evil.example:9000"),
        ("crane.local", "Crane.local:9000", "crane.local.evil.example"),
        ("0.0.0.0", socket.gethostname(), f"{socket.gethostname()}.evil.example"),
        ("127.0.0.1", "[::1]:8080", "192.168.1.7:8080"),
    ],
)
def test_the_names_under_which_a_server_answers(listening, own, foreign):
    def headers(host, origin):
        return Headers([("Host", host), ("Upgrade", "websocket"), ("Origin", origin)])

    assert refusal(headers(own, f"http://{own}"), listening) is None
    assert "Host" in refusal(headers(foreign, f"http://{foreign}"), listening)
    assert "Origin" in refusal(headers(own, f"http://{foreign}"), listening)
    twice = headers(own, f"http://{own}")
    twice["Host"] = own
    assert "Host" in refusal(twice, listening)


@pytest.mark.parametrize(
    ("name", "number"), [("pose", 1e300), ("carrier_pose", -np.inf), ("time", 1e300), ("tensions", 1e300)]
)
def test_numbers_that_no_picture_can_show_are_refused(folder, tmp_path, name, number):
    saved = xr.load_dataset(folder / "line.nc").copy(deep=True)
    values = saved[name].to_numpy().copy()
    values[-1 if number > 0 else 0] = number
    saved[name] = (saved[name].dims, values)
    saved.to_netcdf(tmp_path / "absurd.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=f"absurd.nc: {name} must have numbers up to"):
        read(str(tmp_path / "absurd.nc"))


def test_robots_that_no_picture_can_show_are_refused():
    robot = load("planar-4")
    wide = [carrier.model_copy(update={"home": (1e100, 0, 0, 0, 0, 0)}) for carrier in robot.carriers]
    with pytest.raises(InputError, match="planar-4 must have a size of at least"):
        Geometry(robot.model_copy(update={"carriers": wide}))


def test_a_workspace_cannot_name_a_file_to_read(folder, tmp_path):
    hostile = xr.load_dataset(folder / "all.nc")
    (tmp_path / "secret.yaml").write_text("password")
    hostile.attrs |= {"robot": str(tmp_path / "secret.yaml"), "accepted": "\x1b[2J", "samples": [1, 2]}
    hostile.to_netcdf(tmp_path / "named.nc", engine="h5netcdf")
    with pytest.raises(InputError, match="--robot must be the file of") as error:
        read(str(tmp_path / "named.nc"))
    assert "password" not in str(error.value)
    assert cloud(hostile, "named.nc").summary.startswith("? of ? samples")
    hostile["position"][3] = 1e300
    with pytest.raises(InputError, match="positions must be within"):
        cloud(hostile, "named.nc")


def test_texts_from_files_do_not_reach_the_terminal_as_commands(folder, tmp_path):
    saved = xr.load_dataset(folder / "line.nc").isel(time=slice(3))
    saved.attrs["status"] = "\x1b]0;gone\x07\x1b[2J\nfeasible" + 5000 * "x"
    saved.to_netcdf(tmp_path / "hostile.nc", engine="h5netcdf")
    title = read(str(tmp_path / "hostile.nc")).title
    assert title.isprintable()
    assert len(title) < 300


def test_names_from_files_cannot_be_code(folder, tmp_path):
    saved = xr.load_dataset(folder / "line.nc").isel(time=slice(3))
    saved.attrs["title"] = "</title><script>alert(1)</script>"
    saved.to_netcdf(tmp_path / "hostile.nc", engine="h5netcdf")
    page = save_page(read(str(tmp_path / "hostile.nc")), tmp_path / "page.html").read_text()
    assert "alert(1)" in page
    assert "<script>alert(1)" not in page


def test_the_page_lists_the_tensions_of_each_instant(folder, tmp_path):
    saved = xr.load_dataset(folder / "line.nc")
    page = save_page(read(str(folder / "line.nc")), tmp_path / "line.html").read_text()
    frames = json.loads(re.search(r"const FRAMES = (\{.*?\});\n", page)[1])
    assert frames["clocks"] == [f"t = {time:.2f} s" for time in saved["time"]]
    np.testing.assert_allclose(frames["tensions"], saved["tensions"], atol=0.0051)
    assert page.count('class="towline-tension"') == 6
    infeasible = save_page(read(str(folder / "hover.nc")), tmp_path / "hover.html").read_text()
    frames = json.loads(re.search(r"const FRAMES = (\{.*?\});\n", infeasible)[1])
    assert {tension for row in frames["tensions"] for tension in row} == {None}


def test_the_command_writes_a_page_and_nothing_else(folder, tmp_path):
    done = towline("view", folder / "hover.nc", "--html", "page.html", "--json", cwd=tmp_path)
    assert json.loads(done.stdout) == {"kind": "plan", "robot": "wang-flying", "file": "page.html"}
    page = (tmp_path / "page.html").read_text()
    assert not re.search(r"""(src|href)\s*=\s*["']https?:""", page)
    assert "t_max = 60 N" in page
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    done = towline("view", "wang-flyin", "--html", "other.html", cwd=tmp_path, code=2)
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "other.html").exists()


def test_viser_is_imported_in_one_place_and_when_it_is_used():
    extent = Path(__file__).parent.parent / "viewer"
    importing = []
    for file in extent.glob("*.py"):
        tree = ast.parse(file.read_text())
        typing_only = {
            id(node)
            for block in ast.walk(tree)
            if isinstance(block, ast.If) and getattr(block.test, "id", "") == "TYPE_CHECKING"
            for node in ast.walk(block)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Import) and id(node) not in typing_only:
                importing += [file.name for alias in node.names if alias.name.split(".")[0] == "viser"]
    assert importing == ["server.py"]
    code = "import sys, towline.viewer; print('viser' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"


@pytest.mark.filterwarnings("ignore:.*does not match annotation")  # of viser, for a message that is none
def test_connections_that_break_off_and_messages_that_are_none_make_no_noise(capfd):
    with serve(read("planar-4"), port=0) as url:
        host, port = url.removeprefix("http://").split(":")
        opening = f"GET / HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: {url}\r\nUpgrade: websocket\r\n"
        opening += "Connection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        opening += f"Sec-WebSocket-Protocol: viser-v{viser.__version__}\r\n\r\n"
        for content in (b"", b"GET /", b"x" * 100_000, opening.encode(), opening.encode() + b"\x81\x85\0\0\0\0hello"):
            for reset in (False, True):
                with socket.create_connection((host, int(port))) as client:
                    if reset:
                        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                    client.sendall(content)
                    time.sleep(0.05)
        page = Wire(url)
        controls = [uuid for uuid, part in page.panel.items() if "step" in part]
        assert controls
        for uuid in controls:
            page.send(type="GuiUpdateMessage", uuid=uuid, updates={"value": float("nan")})
        page.send(type="GuiUpdateMessage", uuid=[], updates=3)
        for content in (b"", b"\xc1", msgspec.msgpack.encode([1, 2]), msgspec.msgpack.encode({"type": "Nothing"})):
            other = Wire(url)
            other.socket.send(content)
            other.close()
        time.sleep(0.5)
        assert Wire(url).panel
    assert capfd.readouterr().err == ""
