"""CASPR folders: what becomes of each element, what is refused, and that hostile XML gets nowhere."""

import json
import os
import re
import time

import numpy as np
import pytest

from towline.base.errors import InputError
from towline.models import Dynamics, Robot, load
from towline.models.caspr import read_caspr
from towline.models.parsing import parse_yaml, to_yaml

from .caspr_xml import BODIES, CABLES, REAL, write
from .warm import towline as run

needs_real = pytest.mark.skipif(not REAL.is_dir(), reason=f"the CASPR robots are not there: {REAL}")


def changed(text, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def turn(axis, angle):
    """Rotation about a coordinate axis or any unit vector by Rodrigues's formula, (3, 3)."""
    x, y, z = np.eye(3)[axis] if isinstance(axis, int) else axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def towline_rotation(home):
    roll, pitch, yaw = home[3:]
    return turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)


def with_q(kind, q):
    return changed(
        BODIES, ("SPATIAL_EULER_XYZ", kind), ("0.1 0.2 0.3 0.4 0.5 0.6", " ".join(f"{value:.17g}" for value in q))
    )


def test_every_element_finds_its_place(tmp_path):
    found = read_caspr(write(tmp_path))
    robot = found.robot
    assert (found.cable_set, found.cable_sets) == ("two", ("one", "two"))
    assert robot.platform.mass == 2.5
    assert robot.platform.com == (0.1, 0.0, -0.2)
    assert robot.platform.inertia == (0.3, 0.4, 0.5, 0.01, -0.02, 0.03)
    assert [carrier.kind for carrier in robot.carriers] == ["ground"]
    left, right = robot.cables
    assert (left.anchor, left.attachment) == ((-1.0, 0.0, 2.0), (-0.5, 0.0, 0.25))
    assert (left.t_min, left.t_max, left.stiffness, left.pulley) == (1.0, 80.0, None, None)
    # Relative to the com, which is at (0.1, 0, -0.2) in the joint's frame.
    np.testing.assert_allclose(right.attachment, [0.6, 0, 0.05], atol=1e-15)
    assert (right.anchor, right.stiffness) == ((1.0, 0.0, 2.0), 13000.0)
    assert right.pulley is not None
    assert (right.pulley.radius, right.pulley.axis) == (0.045, (0.0, 0.0, 1.0))
    assert parse_yaml(to_yaml(robot), Robot, "again") == robot
    assert found.notes == []
    assert "'two'" in robot.source


def test_sets_are_chosen_by_id_and_default(tmp_path):
    write(tmp_path)
    assert read_caspr(tmp_path, "one").robot.m == 1
    assert read_caspr(tmp_path, "one").robot.name.endswith("-one")
    with pytest.raises(InputError, match=r"my_cables\.xml: cable set must be one of one, two, got 'three'"):
        read_caspr(tmp_path, "three")
    write(tmp_path, cables=changed(CABLES, (' default_cable_set="two"', "")))
    with pytest.raises(InputError, match=r"default_cable_set must be one of one, two, got none"):
        read_caspr(tmp_path)
    only = re.sub(r'<cable_set id="two">.*</cable_set>', "", CABLES, flags=re.DOTALL).replace(
        ' default_cable_set="two"', ""
    )
    assert read_caspr(write(tmp_path, cables=only)).cable_set == "one"


@pytest.mark.parametrize("seed", range(20))
def test_angles_are_turned_from_xyz_to_zyx(seed, tmp_path):
    angles = np.random.default_rng(seed).uniform(-np.pi, np.pi, 3)
    home = read_caspr(write(tmp_path, with_q("SPATIAL_EULER_XYZ", [1, 2, 3, *angles]))).robot.home
    R = turn(0, angles[0]) @ turn(1, angles[1]) @ turn(2, angles[2])
    np.testing.assert_allclose(towline_rotation(home), R, atol=1e-14)
    np.testing.assert_allclose(home[:3], [1, 2, 3])


@pytest.mark.parametrize("roll", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("sign", [1, -1])
def test_angles_at_the_singular_pitch(roll, sign, tmp_path):
    """Where roll and yaw turn about one axis, any split between them will do, as long as R is right."""
    R = turn(2, 0.3) @ turn(1, sign * np.pi / 2) @ turn(0, roll)
    # As XYZ angles: R = Rx Ry Rz has R[0] = (cy cz, -cy sz, sy) and R[:, 2] = (sy, -sx cy, cx cy).
    xyz = np.arctan2(-R[1, 2], R[2, 2]), np.arcsin(R[0, 2]), np.arctan2(-R[0, 1], R[0, 0])
    home = read_caspr(write(tmp_path, with_q("SPATIAL_EULER_XYZ", [0, 0, 0, *xyz]))).robot.home
    np.testing.assert_allclose(towline_rotation(home), R, atol=1e-12)
    assert home[4] == pytest.approx(sign * np.pi / 2)


def test_quaternions(tmp_path):
    axis, angle = np.array([2, -1, 2]) / 3, 1.1
    q = [1, 2, 3, np.cos(angle / 2), *(np.sin(angle / 2) * axis)]
    home = read_caspr(write(tmp_path, with_q("SPATIAL_QUATERNION", q))).robot.home
    np.testing.assert_allclose(towline_rotation(home), turn(axis, angle), atol=1e-14)
    with pytest.raises(InputError, match=r"joint: q_initial must have a quaternion of norm 1, got a norm of 2"):
        read_caspr(write(tmp_path, with_q("SPATIAL_QUATERNION", [0, 0, 0, 2, 0, 0, 0])))


@pytest.mark.parametrize(
    ("kind", "q", "dof", "home"),
    [
        ("PLANAR_XY", [1, 2, 0.3], ("x", "y", "yaw"), [1, 2, 5, 0, 0, 0.3]),
        ("PLANAR_XZ", [1, 2, 0.3], ("x", "z", "pitch"), [1, 0, 7, 0, 0.3, 0]),
        ("PLANAR_YZ", [1, 2, 0.3], ("y", "z", "roll"), [0, 1, 7, 0.3, 0, 0]),
        ("T_XYZ", [1, 2, 3], ("x", "y", "z"), [1, 2, 8, 0, 0, 0]),
        ("P_XZ", [1, 2], ("x", "z"), [1, 0, 7, 0, 0, 0]),
    ],
)
def test_joints_become_degrees_of_freedom(kind, q, dof, home, tmp_path):
    """The joint stands 5 m above the origin, which q does not know."""
    bodies = with_q(kind, q).replace("<num>0</num><location>0 0 0<", "<num>0</num><location>0 0 5<")
    robot = read_caspr(write(tmp_path, bodies)).robot
    assert robot.platform.dof == dof
    np.testing.assert_allclose(robot.home, home)


def test_inertia_about_the_joint_is_moved_to_the_com(tmp_path):
    """Two point masses on a line: about the com m1 m2 / (m1 + m2) d^2, about the joint the sum of m r^2."""
    ends, masses = np.array([[1.0, 2, 0], [3, 2, 0.0]]), np.array([1.5, 0.5])
    com = masses @ ends / masses.sum()
    about_joint = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, ends, strict=True))
    about_joint += 0.1 * np.eye(3)  # a line alone has no inertia about itself
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = about_joint
    numbers = dict(Ixx=xx, Iyy=yy, Izz=zz, Ixy=xy, Ixz=xz, Iyz=yz)
    bodies = changed(
        BODIES, ('ref="com"', 'ref="joint"'), ("<mass>2.5", "<mass>2"), ("0.1 0.0 -0.2", "{} {} {}".format(*com))
    )
    for key, value in numbers.items():
        bodies = re.sub(f"<{key}>.*?</{key}>", f"<{key}>{value:.17g}</{key}>", bodies)
    robot = read_caspr(write(tmp_path, bodies)).robot
    reduced = 1.5 * 0.5 / 2 * 2.0**2
    np.testing.assert_allclose(robot.inertia, np.diag([0, reduced, reduced]) + 0.1 * np.eye(3), atol=1e-14)


def test_what_is_left_out_is_noted(tmp_path):
    bodies = changed(
        BODIES,
        ("<end_location>0 0 0", "<end_location>0 0 1"),
        ('q_initial="', 'q_min="0 0 0 0 0 0" q_max="1 1 1 1 1 1" q_initial="'),
        ("<physical>", "<physical> stray words"),
    )
    cables = changed(
        CABLES,
        ("<force_min>1.0</force_min>", "<diameter>0.002</diameter>"),
        ("<force_max>80<", "<force_max>9999999999<"),
        (
            "<link>0</link><location>-1 0 2<",
            "<link>0</link><location>-1 0 0</location></attachment> and <attachment><link>0</link><location>-1 0 2<",
        ),
    )
    found = read_caspr(write(tmp_path, bodies, cables))
    assert found.notes == [
        "my_bodies.xml: text beside the elements of physical is left out",
        "my_cables.xml: text beside the elements of attachments is left out",
        "the joint's range, q_min to q_max, is left out",
        "the position of the tool, end_location, is left out",
        "force_min is missing, replaced by 0 N",
        "force_max 1e+10 N, which stands for no limit, is replaced by 1e+09 N",
        "the property diameter of cable_ideal is left out",
        "points on the ground before the last one are left out, they add a constant length",
    ]
    assert all(note in found.robot.source for note in found.notes)
    assert (found.robot.cables[0].anchor, found.robot.cables[0].t_min) == ((-1.0, 0.0, 2.0), 0.0)


def test_variable_stiffness_and_a_mass_that_cannot_turn(tmp_path):
    bodies = re.sub(r"<(I..)>[^<]*<", r"<\1>0<", with_q("T_XYZ", [0, 0, 1]))
    cables = CABLES.replace("cable_ideal", "cable_vsd_torsion_spring")
    found = read_caspr(write(tmp_path, bodies, cables))
    assert found.robot.platform.inertia is None
    assert found.notes == [
        "the inertia is left out, it is not positive definite and the platform cannot turn",
        "the variable stiffness of cable_vsd_torsion_spring is left out",
    ]


def test_a_cable_may_be_told_from_the_platform_on(tmp_path):
    there = "<attachment><link>0</link><location>-1 0 2</location></attachment>"
    back = "<attachment><link>1</link><location>-0.5 0 0.25</location></attachment>"
    swapped = CABLES.replace(there, "X").replace(back, there).replace("X", back)
    expected = read_caspr(write(tmp_path)).robot
    assert read_caspr(write(tmp_path, cables=swapped)).robot == expected


# A change to one of the files above, and what the one line must say behind the file's name.
WRONG_BODIES = {
    "two links": (
        ("</links>", BODIES[BODIES.index("<link_rigid") : BODIES.index("</links>")] + "</links>"),
        r"bodies\.xml must have one link, because towline's robots have one platform, got 2",
    ),
    "revolute": (("SPATIAL_EULER_XYZ", "R_Z"), r": link_rigid 'box': joint: type must be one of SPATI.*, got 'R_Z'"),
    "motor": (
        ('type="', 'actuated="true" type="'),
        r"joint must be a joint that only the cables move, got one with a motor",
    ),
    "soft link": (
        ("<link_rigid", "<link_soft/><link_rigid"),
        r"links: link_soft must be a link_rigid, got 'link_soft'",
    ),
    "q too short": (("0.4 0.5 0.6", "0.4"), r"joint: q_initial must be 6 finite numbers, got '0.1 0.2 0.3 0.4'"),
    "no q": (('q_initial="0.1 0.2 0.3 0.4 0.5 0.6"', ""), r"joint must have the attribute q_initial, got none"),
    "mass in words": (("2.5<", "much<"), r"physical: mass must be one finite number, got 'much'"),
    "mass NaN": (("2.5<", "NaN<"), r"mass must be one finite number, got 'NaN'"),
    "mass overflows": (("2.5<", "1e999<"), r"mass must be one finite number, got '1e999'"),
    "no mass": (("<mass>2.5</mass>", ""), r"physical must have an element mass, got none"),
    "two masses": (("<mass>", "<mass>1</mass><mass>"), r"physical must have one element mass, got 2"),
    "negative mass": (("2.5<", "-2.5<"), r"link_rigid 'box': mass must be greater than 0, got -2.5"),
    "bad inertia": (("<Ixx>0.3", "<Ixx>-0.3"), r"link_rigid 'box': inertia must be positive definite"),
    "inertia of what": (('ref="com"', 'ref="end"'), r"inertia: ref must be com or joint, got 'end'"),
    "com of two": (("0.1 0.0 -0.2", "0.1 0.0"), r"com_location must be 3 finite numbers, got '0.1 0.0'"),
    "on a link": (("<num>0<", "<num>1<"), r"parent: num must be 0, the ground, got '1'"),
    "other root": (
        ("<bodies_system>", "<bodies>"),
        r"must be a CASPR bodies_system file, got text that is not XML \(mismatched tag",
    ),
    "no links": (('<links display_range="0 1 0 1 0 1">', "<links/><links>"), r"must have one element links, got 2"),
}
WRONG_CABLES = {
    "unknown cable": (
        ('<cable_set id="two">', '<cable_set id="two"><muscle name="m"/>'),
        r"muscle 'm' must be one of cable_.*, got 'muscle'",
    ),
    "no reference": (
        (' attachment_reference="joint"', ""),
        r"cable_ideal 'left' must have the attribute attachment_reference, got none",
    ),
    "other reference": (
        ('"joint"', '"end"'),
        r"cable_ideal 'left': attachment_reference must be com or joint, got 'end'",
    ),
    "no force_max": (("<force_max>80</force_max>", ""), r"'left': properties must have an element force_max, got none"),
    "no limit": (("<force_max>80<", "<force_max>Inf<"), r"properties: force_max must be one finite number, got 'Inf'"),
    "pushes": (
        ("<force_min>1.0<", "<force_min>-1.0<"),
        r"cable_ideal 'left': t_min must be greater than or equal to 0",
    ),
    "limits crossed": (
        ("<force_min>1.0<", "<force_min>90<"),
        r"'left': t_min must not exceed t_max \(80 N\), got 90 N",
    ),
    "third link": (
        ("<link>1</link><location>-0.5", "<link>2</link><location>-0.5"),
        r"'left' must run from the ground, link 0, straight to link 1, got the links 0, 2",
    ),
    "half a link": (
        ("<link>1</link><location>-0.5", "<link>0.5</link><location>-0.5"),
        r"link must be 0 or 1, got 0.5",
    ),
    "through the platform": (
        (
            "<attachment><link>1</link><location>-0.5",
            "<attachment><link>1</link><location>0 1 0</location></attachment><attachment><link>1</link><location>-0.5",
        ),
        r"'left' must run from the ground, link 0, straight to link 1, got the links 0, 1, 1",
    ),
    "elastic over the ground": (
        ("<base_rot", "<attachment><link>0</link><location>0 1 0</location></attachment><base_rot"),
        r"cable_linear_spring 'right' must run from one anchor to link 1 if it is elastic, got several",
    ),
    "pulley without radius": (
        ("<pulley_radius>0.045</pulley_radius>", ""),
        r"base_rotating_pulley must have an element pulley_radius",
    ),
    "coincide": (
        ("<location>-1 0 2<", "<location>{}<"),
        r"cable_set 'two': cables\[0\] must have a length > 0 m at home, got",
    ),
    "same id": (('id="one"', 'id="two"'), r"cable set must be one of two, two, got 'two', which is there twice"),
    "empty set": (
        ('<cable_set id="two">', '<cable_set id="two"/><cable_set id="3">'),
        r"cable_set 'two' must have at least one cable, got none",
    ),
}


@pytest.mark.parametrize(
    "case", [*(("bodies", name) for name in WRONG_BODIES), *(("cables", name) for name in WRONG_CABLES)], ids="-".join
)
def test_wrong_files_are_one_line_with_file_and_element(case, tmp_path):
    which, name = case
    (old, new), message = (WRONG_BODIES if which == "bodies" else WRONG_CABLES)[name]
    if name == "coincide":
        write(tmp_path)
        new = new.format("{:.17g} {:.17g} {:.17g}".format(*read_caspr(tmp_path).robot.home_attachments[0]))
    files = {"bodies": BODIES, "cables": CABLES}
    files[which] = changed(files[which], (old, new))
    write(tmp_path, **files)
    with pytest.raises(InputError, match=message) as caught:
        read_caspr(tmp_path)
    line = str(caught.value)
    assert len(line.splitlines()) == 1
    file = tmp_path / f"my_{which}.xml"
    assert line.startswith((f"{file}: ", f"{file} must "))


def test_folders_that_are_none(tmp_path):
    with pytest.raises(InputError, match=r"nowhere must be a folder with one \*_bodies\.xml and one .*, got no folder"):
        read_caspr(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"one file \*_bodies\.xml, got none"):
        read_caspr(tmp_path)
    write(tmp_path)
    (tmp_path / "other_cables.xml").write_text(CABLES)
    with pytest.raises(InputError, match=r"one file \*_cables\.xml, got my_cables\.xml, other_cables\.xml"):
        read_caspr(tmp_path)


LAUGHS = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10 if i else "ha"}">' for i in range(12))
ATTACKS = {
    "billion laughs": f"<!DOCTYPE bodies_system [{LAUGHS}]><bodies_system>&a11;</bodies_system>",
    "quadratic": f'<!DOCTYPE b [<!ENTITY a "{"a" * 50_000}">]><bodies_system>{"&a;" * 5000}</bodies_system>',
    "external entity": '<!DOCTYPE b [<!ENTITY x SYSTEM "file://{secret}">]><bodies_system>&x;</bodies_system>',
    "external parameter entity": '<!DOCTYPE b [<!ENTITY % x SYSTEM "file://{secret}"> %x;]><bodies_system/>',
    "unparsed entity": '<!DOCTYPE b [<!NOTATION n SYSTEM "n"><!ENTITY x SYSTEM "{secret}" NDATA n>]><bodies_system/>',
    "DTD from the net": '<!DOCTYPE b SYSTEM "http://127.0.0.1:9/b.dtd"><bodies_system/>',
    "DTD from a file": '<!DOCTYPE b SYSTEM "file://{secret}"><bodies_system/>',
    "public DTD": '<!DOCTYPE b PUBLIC "-//X//Y//EN" "http://127.0.0.1:9/b.dtd"><bodies_system/>',
    "internal DTD": "<!DOCTYPE b [<!ELEMENT b ANY>]><bodies_system/>",
}


@pytest.mark.parametrize("which", ["bodies", "cables"])
@pytest.mark.parametrize("attack", ATTACKS)
def test_attacks_are_one_line(attack, which, tmp_path):
    secret = tmp_path / "secret.txt"
    secret.write_text("the secret")
    text = ATTACKS[attack].replace("{secret}", str(secret))
    write(tmp_path, **{which: text if which == "bodies" else text.replace("bodies_system", "cables")})
    start = time.process_time()
    with pytest.raises(
        InputError, match=rf"my_{which}\.xml must be plain XML.*, got a DTD or entities of its own"
    ) as caught:
        read_caspr(tmp_path)
    assert time.process_time() - start < 1
    assert len(str(caught.value).splitlines()) == 1
    assert "the secret" not in str(caught.value)


def test_the_dtd_beside_the_file_is_not_read(tmp_path):
    """CASPR's files name one; it may say what it likes."""
    folder = tmp_path / "robot"
    folder.mkdir()
    os.mkfifo(tmp_path / "bodies.dtd")  # reading it would never end
    (tmp_path / "cables.dtd").write_text('<!ENTITY x "boo"> nonsense')
    assert read_caspr(write(folder)).robot.m == 2


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is not XML"),
        (b"\x00\x01\x02", "is not XML"),
        (b"<?xml version='1.0' encoding='klingon'?><bodies_system/>", "must be XML in UTF-8"),
        (b"<?xml version='1.0' encoding='utf-7'?><bodies_system/>", "must be XML in UTF-8"),
        ("<bodies_system/>".encode("utf-16"), "must have an element links"),
        (b"\xef\xbb\xbf" + b"<bodies_system/>", "must have an element links"),
        (b"<a>" * 100_000 + b"</a>" * 100_000, "must have the root element bodies_system, got 'a'"),
        (b"<bodies_system>" + b" " * 2_000_000, r"must be an XML file of at most 1 MB, got 2\.0 MB"),
        (b"<" + b"a" * 900_000 + b"/>", "must have the root element bodies_system, got 'aaaa"),
    ],
    ids=["empty", "bytes", "klingon", "utf-7", "utf-16", "BOM", "deep", "large", "long"],
)
def test_files_that_are_no_robots(content, message, tmp_path):
    write(tmp_path, bodies=content)
    with pytest.raises(InputError, match=message) as caught:
        read_caspr(tmp_path)
    assert len(str(caught.value)) < 500


@needs_real
@pytest.mark.parametrize(
    "folder", sorted(path.name for path in REAL.iterdir() if path.is_dir()) if REAL.is_dir() else []
)
def test_real_robots_have_the_wrench_matrix_of_their_xml(folder):
    """Geometry read here again from the XML as it stands, at q_initial: the columns (u_i, r_i x u_i)."""
    from defusedxml import ElementTree

    cables = ElementTree.parse(next((REAL / folder).glob("*_cables.xml"))).getroot()
    link = ElementTree.parse(next((REAL / folder).glob("*_bodies.xml"))).getroot().find("links/link_rigid")

    def numbers(text):
        return np.array(text.split(), dtype=float)

    q, com = numbers(link.find("joint").get("q_initial")), numbers(link.find("physical/com_location").text)
    assert not q[3:].any()
    for cable_set in cables:
        robot = read_caspr(REAL / folder, cable_set.get("id")).robot
        columns = []
        for cable in cable_set:
            ground = cable.find("attachments")[0]
            a = numbers((ground.find("location") if ground.tag == "attachment" else ground.find("fixed_location")).text)
            arm = numbers(cable.find("attachments")[1].find("location").text)
            arm = arm - com if cable.get("attachment_reference") == "joint" else arm
            u = a - (q[:3] + com + arm)
            u /= np.linalg.norm(u)
            columns.append(np.concatenate([u, np.cross(arm, u)]))
        if any(cable.pulley for cable in robot.cables):
            continue  # the direction depends on the pulley; models/cables has its own tests
        np.testing.assert_allclose(Dynamics(robot).wrench_matrix(robot.home), np.array(columns).T, atol=1e-12)
        assert len(columns) == robot.m


def test_command_writes_a_file_that_loads(tmp_path):
    folder = tmp_path / "My Robot"
    folder.mkdir()
    write(folder, bodies=changed(BODIES, ("<end_location>0 0 0", "<end_location>0 0 1")))
    printed = run("import", "caspr", folder)
    assert parse_yaml(printed.stdout, Robot, "printed") == read_caspr(folder).robot
    assert "note: the position of the tool, end_location, is left out" in printed.stderr
    assert "note: other cable sets: one" in printed.stderr
    written = run("import", "caspr", folder, "--cable-set", "one", "--out", "mine.yaml", "--json", cwd=tmp_path)
    answer = json.loads(written.stdout)
    assert load(tmp_path / "mine.yaml") == read_caspr(folder, "one").robot
    assert (answer["name"], answer["file"], answer["cable_set"]) == ("my-robot-one", "mine.yaml", "one")
    assert answer["cable_sets"] == ["one", "two"]
    assert answer["notes"] == ["the position of the tool, end_location, is left out"]
    assert Robot.model_validate(answer["robot"]) == load(tmp_path / "mine.yaml")


def test_command_says_what_is_wrong_in_one_line(tmp_path):
    write(tmp_path)
    for arguments in ([tmp_path, "--cable-set", "no"], [tmp_path / "no"], [tmp_path, "--out", "/proc/nowhere/a.yaml"]):
        done = run("import", "caspr", *arguments, code=2)
        assert done.stdout == ""
        assert len(done.stderr.strip().splitlines()) == 1
