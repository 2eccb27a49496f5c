"""Robot files: what is read is what was written, and what is wrong is told in one line."""

import json
import re

import numpy as np
import pytest

from towline.base.errors import InputError
from towline.models import Robot, available, load
from towline.models.diagnosis import diagnose
from towline.models.library import FOLDER, contents
from towline.models.parsing import parse_yaml, to_yaml

GOOD = """\
name: crane
source: a test
platform: {mass: 1.2, inertia: [1, 1, 1, 0, 0, 0]}
carriers:
  - {name: frame, kind: ground}
  - {name: cart, kind: mobile, home: [0, 0, 3, 0, 0, 0], speed_max: 1, acceleration_max: 1,
     reach: {min: [-1, -1, 2], max: [1, 1, 4]}}
cables:
  - {carrier: frame, anchor: [0, 0, 2], attachment: [0, 0.1, 0], t_min: 0, t_max: 10}
  - {carrier: cart, anchor: [0, 0, 0], attachment: [0, 0, 0], t_min: 1, t_max: 10, stiffness: 1e4}
"""

# A change to the file above, and what the one line must name: the field, the value, what is accepted.
WRONG = {
    "missing mass": ("mass: 1.2, ", "", r"platform\.mass is missing: mass \[kg\]"),
    "no mass": ("mass: 1.2", "mass: 0", r"platform\.mass must be greater than 0, got 0"),
    "mass in words": ("mass: 1.2", "mass: heavy", r"platform\.mass must be a number, got 'heavy'"),
    "mass NaN": ("mass: 1.2", "mass: .nan", r"platform\.mass must be .*finite number, got nan"),
    "mass infinite": ("mass: 1.2", "mass: .inf", r"platform\.mass must be .*finite number, got inf"),
    "negative inertia": (
        "[1, 1, 1,",
        "[1, -1, 1,",
        r"platform\.inertia must be positive definite.*smallest moment is -1.*got",
    ),
    "indefinite inertia": ("1, 0, 0, 0]", "1, 2, 0, 0]", r"platform\.inertia must be positive definite"),
    "five inertias": ("[1, 1, 1, 0, 0, 0]", "[1, 1, 1, 0, 0]", r"platform\.inertia must be 6 numbers, got .*0\]$"),
    "limits crossed": (
        "t_min: 1, t_max: 10",
        "t_min: 20, t_max: 10",
        r"cables\[1\]\.t_min must not exceed t_max \(10 N\), got 20 N",
    ),
    "pushing cable": ("t_min: 1,", "t_min: -1,", r"cables\[1\]\.t_min must be greater than or equal to 0, got -1"),
    "unknown carrier": (
        "carrier: cart",
        "carrier: card",
        r"cables\[1\]\.carrier must be one of frame, cart, got 'card'",
    ),
    "unknown kind": ("kind: ground", "kind: grond", r"carriers\[0\]\.kind must be one of ground, .*, got 'grond'"),
    "no kind": (", kind: ground", "", r"carriers\[0\]\.kind is missing: one of ground, mobile, prescribed, quadrotor"),
    "same carrier twice": ("name: cart", "name: frame", r"carriers\[1\]\.name must be unique, got 'frame' twice"),
    "typing error": (
        "attachment: [0, 0.1, 0]",
        "atachment: [0, 0.1, 0]",
        r"cables\[0\]\.atachment is not a known key, did you mean 'attachment'\?",
    ),
    "unknown key": ("source: a test", "source: a test\nsorce: b", r"sorce is not a known key, did you mean 'source'\?"),
    "key of the platform": (
        "source: a test",
        "source: a test\nmass: 3",
        r" mass is not .*, did you mean 'platform\.mass'\?",
    ),
    "key of a carrier": ("speed_max: 1,", "speed_max: 1, speed: 1,", r"carriers\[1\]\.speed is not a known key"),
    "home out of reach": (
        "home: [0, 0, 3,",
        "home: [0, 0, 5,",
        r"carriers\[1\]\.home must lie in reach, from .* along z, got 5",
    ),
    "box inside out": (
        "min: [-1, -1, 2]",
        "min: [-1, 3, 2]",
        r"carriers\[1\]\.reach\.min must not exceed max, .* m along y, got 3 m",
    ),
    "zero length": ("anchor: [0, 0, 2]", "anchor: [0, 0.1, 0.75]", r"cables\[0\] must have a length > 0 m at home"),
    "no cables": (GOOD[GOOD.index("cables:") :], "cables: []\n", r"cables must have at least 1 item, got 0"),
    "position of two": ("attachment: [0, 0, 0]", "attachment: [0, 0]", r"attachment must be 3 numbers, got \[0, 0\]$"),
    "duplicate key": (
        "source: a test",
        "source: a test\nsource: b",
        r"is not YAML \(found duplicate key \"?source.*line",
    ),
    "alias": ("name: crane", "name: &n crane\nsource: *n", "has a YAML alias"),
    "not YAML": ("name: crane", "name: [crane", r"is not YAML \(.*line \d+\)"),
    "a tag": ("name: crane", "name: !!python/object:os.system crane", "is not YAML"),
}


# A misspelt key at every level of a robot file, what is meant, and the field that the message names.
MISSPELT = {
    "name": ("name: crane", "nmae: crane", "nmae", "name"),
    "source": ("source: a", "sorce: a", "sorce", "source"),
    "platform": ("platform:", "plattform:", "plattform", "platform"),
    "carriers": ("carriers:", "carrier:", "carrier", "carriers"),
    "cables": ("cables:", "cabels:", "cabels", "cables"),
    "mass": ("mass:", "mas:", "platform.mas", "mass"),
    "a capital": ("mass:", "Mass:", "platform.Mass", "mass"),
    "inertia": ("inertia:", "intertia:", "platform.intertia", "inertia"),
    "kind": ("kind: ground", "knd: ground", "carriers[0].knd", "kind"),
    "home": ("home:", "hone:", "carriers[1].hone", "home"),
    "speed": ("speed_max", "speed_mx", "carriers[1].speed_mx", "speed_max"),
    "reach": ("reach:", "raech:", "carriers[1].raech", "reach"),
    "corner": ("min: [", "mn: [", "carriers[1].reach.mn", "min"),
    "anchor": ("anchor: [0, 0, 2]", "ancor: [0, 0, 2]", "cables[0].ancor", "anchor"),
    "t_min": ("t_min: 1,", "tmin: 1,", "cables[1].tmin", "t_min"),
    "t-max": ("t_max: 10, stiff", "t-max: 10, stiff", "cables[1].t-max", "t_max"),
    "stiffness": ("stiffness", "stifness", "cables[1].stifness", "stiffness"),
}


@pytest.mark.parametrize("case", MISSPELT)
def test_a_misspelt_key_is_reported_before_a_missing_one(case):
    old, new, field, meant = MISSPELT[case]
    assert old in GOOD
    with pytest.raises(InputError) as caught:
        parse_yaml(GOOD.replace(old, new, 1), Robot, "my.yaml")
    assert str(caught.value).startswith(f"my.yaml: {field} is not a known key, did you mean {meant!r}?")
    assert "\n" not in str(caught.value)


def test_the_base_of_the_wrong_ones_is_right():
    robot = parse_yaml(GOOD, Robot, "good")
    assert robot.m == 2
    assert robot.cables[1].stiffness == 10_000


@pytest.mark.parametrize("case", WRONG)
def test_wrong_file_gives_one_line_with_file_field_and_value(case, tmp_path):
    old, new, message = WRONG[case]
    assert old in GOOD
    text = GOOD.replace(old, new, 1)
    if case == "zero length":
        text = text.replace("platform: {", "platform: {home: [0, 0, 0.75, 0, 0, 0], ")
    file = tmp_path / "my.yaml"
    file.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        load(file)
    line = str(caught.value)
    assert line.startswith(f"{file}: ")
    assert "\n" not in line


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "must hold a mapping with .*, got nothing"),
        (b"just words", "must hold a mapping with name, source.*, got 'just words'"),
        (b"- 1\n- 2\n", r"got \[1, 2\]"),
        (b"\xff\xfe\x00", r"must be a YAML file in UTF-8, got another text \(byte 0\)"),
        (b"a: \x00", "is not YAML"),
        (b"x" * 50_000_000, r"must be a YAML file of at most 1 MB, got 50\.0 MB"),
        (b"[" * 1_000_000, r"is not YAML \(has brackets more than 50 deep, line 1\)"),  # at once
        (b"- " * 5000, "is not YAML"),
    ],
    ids=["empty", "words", "list", "bytes", "nul", "50 MB", "brackets", "dashes"],
)
def test_files_that_are_no_mapping(content, message, tmp_path):
    file = tmp_path / "my.yaml"
    file.write_bytes(content)
    with pytest.raises(InputError, match=message):
        load(file)


def test_missing_file_and_unknown_name(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml: no such file"):
        load(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="no robot 'wang-flyng' in the library; did you mean 'wang-flying'"):
        load("wang-flyng")
    with pytest.raises(InputError, match=r"^no robot or file 'xyz'; `towline robots` lists the library$"):
        load("xyz")
    with pytest.raises(InputError, match="is a folder, not a file"):
        load(tmp_path)


@pytest.mark.parametrize("name", available())
def test_library_robots_survive_writing_and_reading(name):
    robot = load(name)
    assert robot.name == name
    assert parse_yaml(to_yaml(robot), Robot, name) == robot
    with pytest.raises(Exception, match="frozen"):
        robot.name = "other"


def test_published_schema_is_the_models():
    published = json.loads((FOLDER / "robot.schema.json").read_text())
    assert published == Robot.model_json_schema()
    for name in available():
        assert "$schema=robot.schema.json" in (FOLDER / f"{name}.yaml").read_text()


def test_the_contents_of_the_library_are_those_of_its_files():
    """`towline robots` lists them without reading each file; a new robot needs a line in contents.json."""
    rows = []
    for name in available():
        robot = load(name)
        kinds = [carrier.kind for carrier in robot.carriers]
        rows.append(
            {
                "name": name,
                "cables": robot.m,
                "carriers": {kind: kinds.count(kind) for kind in dict.fromkeys(kinds)},
                "mass": robot.platform.mass,
                "source": robot.source.strip().splitlines()[0].strip(),
            }
        )
    lines = "[\n" + ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows) + "\n]\n"
    assert (FOLDER / "contents.json").read_text(encoding="utf-8") == lines
    assert contents() == rows


def test_robot_without_a_home_gets_one_below_its_anchors():
    text = re.sub(r"  home: .*\n", "", (FOLDER / "wang-flying.yaml").read_text())
    robot = parse_yaml(text, Robot, "no home")
    np.testing.assert_allclose(robot.home, [0, 0, -0.07 - 0.52, 0, 0, 0], atol=1e-9)


def test_diagnosis_of_the_printed_pairing():
    diagnosis = diagnose(load("wang-flying-printed"))
    assert (diagnosis.rank, diagnosis.rank_level) == (3, 3)
    # The lines A_i B_i run from radius 0.52 at z = -0.07 to 0.25 at z = -0.97: they meet where the radius is zero.
    meeting = -0.97 - 0.9 * 0.25 / (0.52 - 0.25)
    assert f"meet in one point, (0, 0, {meeting:.4g}) m" in diagnosis.reason
    assert any("radius of gyration" in warning for warning in diagnosis.warnings)


def test_diagnosis_of_other_robots():
    assert diagnose(load("wang-flying")).rank == 6
    assert diagnose(load("wang-ctmrts")).reason == "3 cables span at most 3 of 6 directions"
    assert diagnose(load("nist-robocrane")).warnings == []


def test_diagnosis_names_the_free_motion():
    """Six cables that all meet the vertical axis through the CoM: nothing resists a rotation about it."""
    robot = load("nist-robocrane")
    angles = np.deg2rad([0, 60, 120, 180, 240, 300])
    heights = [3, 2.5, 3.2, 2.7, 3.4, 2.9]
    cables = [
        cable.model_copy(
            update={
                "anchor": (3 * np.cos(a), 3 * np.sin(a), h),
                "attachment": (0.5 * np.cos(a), 0.5 * np.sin(a), 0.1 * k),
            }
        )
        for k, (cable, a, h) in enumerate(zip(robot.cables, angles, heights, strict=True))
    ]
    diagnosis = diagnose(robot.model_copy(update={"cables": tuple(cables)}))
    assert diagnosis.rank == 5
    assert re.search(r"a rotation about \(-?0, -?0, -?1\) through the CoM", diagnosis.reason)


def test_diagnosis_of_impossible_inertia():
    robot = load("nist-robocrane")
    platform = robot.platform.model_copy(update={"inertia": (1.0, 1.0, 3.0, 0.0, 0.0, 0.0)})
    warnings = diagnose(robot.model_copy(update={"platform": platform})).warnings
    assert any("exceeds the sum of the other two" in warning for warning in warnings)


def test_diagnosis_counts_the_rows_that_move():
    planar, point = diagnose(load("planar-4")), diagnose(load("point-mass-3"))
    assert (planar.rank, planar.reason) == (3, "")
    assert (point.rank, point.reason) == (3, "")
    assert len(planar.singular_values) == 3


def test_a_changed_copy_keeps_nothing_computed_from_the_old_numbers():
    robot = load("cogiro")
    known = robot.length, hash(robot)
    changes = {"platform": robot.platform.model_copy(update={"com": (1.0, 1.0, 1.0)}), "cables": robot.cables[:7]}
    copy = robot.model_copy(update=changes)
    anew = Robot.model_validate(copy.model_dump())
    assert (copy, copy.length, hash(copy)) == (anew, anew.length, hash(anew))
    assert (robot.length, hash(robot)) == known != (copy.length, hash(copy))


@pytest.mark.parametrize(("height", "warned"), [(25.0, True), (10.0, False)])
def test_a_weight_that_inclined_cables_could_carry_but_do_not_is_a_warning(height, warned):
    """In the plane of its four anchors the cables pull across gravity only, so a table carries the weight."""
    data = load("planar-4").model_dump(mode="json")
    data["platform"] |= {"dof": ["x", "y", "yaw"], "home": [0, 0, 10, 0, 0, 0]}
    for cable, (x, y) in zip(data["cables"], [(45, 30), (-45, 30), (-45, -30), (45, -30)], strict=True):
        cable |= {"anchor": [x, y, height], "attachment": [x / 150, y / 150, 0]}
    warnings = diagnose(Robot.model_validate(data)).warnings
    assert any("z cannot move" in warning for warning in warnings) == warned
