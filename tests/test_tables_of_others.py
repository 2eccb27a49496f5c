"""Tables as other programs write them: times in columns of their own or as dates, commented names, lost poses."""

from itertools import pairwise

import numpy as np
import pytest

from towline import InputError
from towline.estimation.logs import read_log
from towline.estimation.logs.names import role
from towline.estimation.logs.streams import spikes

from . import user_recordings as user

T = 0.25 * np.arange(8)  # [s]
LENGTHS = np.column_stack([2 + 0.1 * np.sin(T), 3 + 0.1 * np.cos(T)])
NOON = 1_715_947_200  # [s] from 1970: noon of 17 May 2024, in UTC


def rows(first, mark=","):
    lines = [mark.join(map(str, (one, *pair))) for one, pair in zip(first, LENGTHS.tolist(), strict=True)]
    return "\n".join(lines) + "\n"


def clock(form, hours=12):
    return [form.format(f"{hours}:00:{second:09.6f}") for second in T]


FORMS = {
    "dates": "time,l0,l1\n" + rows(clock("2024-05-17T{}Z")),
    "dates of another zone": "timestamp;l0;l1\n" + rows(clock("2024-05-17 {}+02:00", 14), ";"),
    "times of day": "Date,Time,l0,l1\n" + rows(clock("17.05.2024,{}")),
    "times of day of 12 hours": "Timestamp;l0;l1\n" + rows(clock("5/17/2024 {} PM"), ";"),
    "times of day past midnight": "Datum;Uhrzeit;l0;l1\n"
    + rows((f"17.05.2024;{'23:59:59' if s < 1 else '00:00:00'}.{1000 * s % 1000:03.0f}" for s in T), ";"),
    "stamps of ROS 2": "header.stamp.sec,header.stamp.nanosec,l0,l1\n"
    + rows(f"{NOON + int(s)},{round(1e9 * (s % 1))}" for s in T),
    "stamps of ROS 1": "secs,nsecs,l0,l1\n" + rows(f"{NOON + int(s)},{round(1e9 * (s % 1))}" for s in T),
    "commented names": "# made by a program\n# t,l0,l1\n" + rows(T),
    "names between spaces": "t   l0 l1\n" + rows(T, "  "),
    "as numpy.savetxt": "# t l0 l1\n" + rows(T, " "),
    "tabs and spaces": "#t l0 l1\n" + rows(T, " \t"),
    "a timetable of MATLAB": "Time,l_1,l_2\n" + rows(f"{s:g} sec" for s in T),
    "names of PLCs": "t;PLC_PRG.arLength[1];PLC_PRG.arLength[2]\n" + rows(T, ";"),
    "names of axes": "t;gWinch[0].ActPos;gWinch[1].ActPos\n" + rows(T, ";"),
    "words for units": "Time [sec],Length 1 (millimeters),Length 2 (millimeters)\n"
    + "".join(f"{s},{1e3 * a:.12f},{1e3 * b:.12f}\n" for s, (a, b) in zip(T, LENGTHS.tolist(), strict=True)),
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_of_times_and_names(form, tmp_path):
    (tmp_path / "log.csv").write_text(FORMS[form])
    read = read_log(tmp_path / "log.csv")
    begin = 12 * 3600 if "of day" in form else 0  # from midnight, but not from 1970
    begin = 86399 if "midnight" in form else begin
    np.testing.assert_allclose(read.measurements.times, begin + T, atol=1e-6)
    np.testing.assert_allclose(read.measurements.lengths, LENGTHS, rtol=1e-9)
    if "dates" in form or "stamps" in form:
        assert read.begin == NOON


@pytest.mark.parametrize("names", ["TCP_A TCP_B TCP_C", "ox oy oz ow", "Roll Pitch Yaw Rot[0] Rot[1] Rot[2] Rot[3]"])
def test_names_of_orientations(names, tmp_path):
    names = names.split()
    values = dict(zip(names, np.eye(len(names))[3] if "ow" in names else [0.1, 0.2, 0.3, 0, 1, 0, 1], strict=False))
    text = ",".join(["t", "l0", "l1", "x", "y", "z", *names])
    lines = [",".join(map(str, (t, *pair, 1, 2, 3, *values.values()))) for t, pair in zip(T, LENGTHS, strict=True)]
    (tmp_path / "log.csv").write_text(text + "\n" + "\n".join(lines) + "\n")
    poses = read_log(tmp_path / "log.csv").measurements.poses
    np.testing.assert_allclose(poses[:, 3:], np.tile([0, 0, 0] if "ow" in names else [0.1, 0.2, 0.3], (len(T), 1)))


def test_the_body_of_a_motion_capture_without_times(tmp_path):
    """The rate stands alone above, or nowhere; the name of the body above the first of its columns, and no time."""
    place = np.column_stack([np.sin(T), np.cos(T), 1 + T])
    head = "Objects\n4\n\t\tGlobal Angle:platform\t\t\t\t\t\nFrame\tSub Frame\tRX\tRY\tRZ\tTX\tTY\tTZ\n"
    head += "\t\trad\trad\trad\tmm\tmm\tmm\n"
    body = "".join(
        f"{k}\t0\t0.1\t0.2\t{0.01 * k}\t" + "\t".join(map(repr, 1e3 * p)) + "\n" for k, p in enumerate(place)
    )
    (tmp_path / "vicon.csv").write_text(head + body.replace("np.float64(", "").replace(")", ""))
    user.write(tmp_path / "winches.csv", ["t", "l0", "l1"], np.column_stack([T, LENGTHS]))
    files = {"path": tmp_path / "winches.csv", "poses": tmp_path / "vicon.csv"}
    with pytest.raises(InputError, match="robot must be given to align the clocks"):
        read_log(**files)
    (tmp_path / "vicon.csv").write_text((tmp_path / "vicon.csv").read_text().replace("\n4\n", "\n", 1))
    with pytest.raises(InputError, match=r"must have times, got none for .*TX"):
        read_log(**files)
    (tmp_path / "map.yaml").write_text("lengths: l*\ntime: Frame [0.25 s]\n")
    with pytest.raises(InputError, match="robot must be given to align the clocks"):
        read_log(**files, fields=tmp_path / "map.yaml")
    assert role("Global Angle:platform/RX", "rad") == ("angles", "roll", "global angle:platform/r#", "")


def test_a_column_and_the_measured_one_beside_it(tmp_path):
    """Neither is taken for the other: the user has to choose."""
    names = ["t", "l0", "l1", *"xyz", "x_gt", "y_gt", "z_gt"]
    user.write(tmp_path / "log.csv", names, np.column_stack([T, LENGTHS, np.ones((8, 6))]))
    with pytest.raises(InputError, match=r"must have one candidate for position, got x \.\.\.; x_gt"):
        read_log(tmp_path / "log.csv")


def test_files_without_poses_are_no_poses(tmp_path):
    """Such a file was read as none, and parameters were fitted without poses."""
    user.write(tmp_path / "l.csv", ["t", "l0", "l1"], np.column_stack([T, LENGTHS]))
    user.write(tmp_path / "p.csv", ["t", "p0", "p1", "p2"], np.column_stack([T, np.ones((8, 3))]))
    with pytest.raises(InputError, match="poses must have columns x, y, z or an orientation, got t, p0, p1, p2; a map"):
        read_log(tmp_path / "l.csv", poses=tmp_path / "p.csv")
    user.write(tmp_path / "all.csv", ["t", "l0", "l1", "p0", "p1"], np.column_stack([T, LENGTHS, np.ones((8, 2))]))
    assert "no positions are read; fields with unknown names are p0, p1; a map (--fields) may name them" in (
        read_log(tmp_path / "all.csv").notes
    )


@pytest.mark.parametrize("lost", [0.0, -9999.0, "spike", "zero angles"])
def test_poses_of_a_platform_that_is_not_seen(lost, tmp_path):
    t = 0.02 * np.arange(200)
    place = np.column_stack([np.sin(t), np.cos(2 * t), 1 + 0.3 * np.sin(3 * t)])
    place += np.random.default_rng(0).normal(0, 3e-4, place.shape)
    q = np.column_stack([np.sin(0.1 * t), 0 * t, 0 * t, np.cos(0.1 * t)])
    turned, names = (q[:, :3], ["roll", "pitch", "yaw"]) if lost == "zero angles" else (q, ["qx", "qy", "qz", "qw"])
    gone = np.array([17, 18, 19, 60, 140, 141])
    poses = np.hstack([place, turned])
    if lost == "spike":
        poses[gone, :3] += [0.3, -0.4, 0.2]
    else:
        poses[gone] = lost if isinstance(lost, float) else 0.0
    header = ["t", "l0", "l1", *"xyz", *names]
    user.write(tmp_path / "log.csv", header, np.column_stack([t, *(2 + 0.1 * place[:, :2]).T, poses]), form="%.12g")
    read = read_log(tmp_path / "log.csv")
    known = np.isfinite(read.measurements.poses).all(axis=1)
    assert set(np.flatnonzero(~known)) == set(gone) - ({17, 18, 19} if lost == "spike" else set())
    assert sum("skipped" in note for note in read.notes) == 1


def test_positions_without_spikes():
    """Fast and slow motions, from place to place, and one by one."""
    draw = np.random.default_rng(4)
    for seed, rate in enumerate((5, 20, 100, 500)):
        t = np.arange(0, 20, 1 / rate)
        for speed in (0.2, 1, 4):
            motion = np.sin(np.outer(speed * t, [1, 1.3, 0.7]) + seed) + draw.normal(0, 3e-4, (len(t), 3))
            assert not spikes(motion).any()
        ends = draw.uniform(-1, 1, (12, 3))
        there = [np.linspace(a, b, rate) for a, b in pairwise(ends)]
        stops = np.concatenate([part for way in there for part in (way, np.repeat(way[-1:], rate, axis=0))])
        assert not spikes(stops + draw.normal(0, 1e-3, stops.shape)).any()
        assert not spikes(draw.uniform(-1, 1, (27, 3))).any()


@pytest.mark.parametrize(
    "names",
    [
        ("Length B [mm]", "Length A [mm]", "Force B", "Force A"),
        ("len_FL_mm", "len_RR_mm", "tension_FL", "tension_RR"),
        ("front_left_cable_length_mm", "front_right_cable_length_mm", "front_left_force", "front_right_force"),
    ],
)
def test_cables_named_by_letters_and_corners(names, tmp_path):
    """Letters are in the order of the alphabet, and corners in that of the columns, which is noted."""
    order, lettered = ((1, 0), True) if "A" in names[1] else ((0, 1), False)
    user.write(tmp_path / "log.csv", ["t", *names], np.column_stack([T, 1e3 * LENGTHS, 10 * LENGTHS]), form="%.12g")
    read = read_log(tmp_path / "log.csv")
    np.testing.assert_allclose(read.measurements.lengths, LENGTHS[:, order], atol=1e-9)
    np.testing.assert_allclose(read.measurements.tensions, 10 * LENGTHS[:, order], atol=1e-9)
    noted = f"in the order of the cables: {', '.join(names)}".replace(" [mm]", "")
    assert any(noted in note for note in read.notes) != lettered


def test_no_other_words_are_corners():
    """Axes of a force sensor, statistics, joints of an arm and the unit of a single length."""
    for name in ("force_x", "length_mm", "length_std", "force_ref", "/joint_states/position[left_arm]", "length_set"):
        assert role(name) is None or role(name).role not in ("lengths", "tensions")
    assert role("cable_1_length_mm").which == "1"
    assert role("/joint_states/position[winch_rear_left]").which == "rear_left"


def test_numbered_columns_of_two_meanings(tmp_path):
    """Columns such as q_1 may be lengths or a quaternion: the refusal says what a map must name."""
    names = ["q_meas_1", "q_meas_2", "q_meas_3", "q_meas_4", *"xyz", *(f"plat_q{k}" for k in range(1, 5))]
    turns = np.tile([0.6, 0.0, 0.0, 0.8], (len(T), 1))
    table = np.column_stack([T, LENGTHS, LENGTHS + 1, LENGTHS, T, turns])
    user.write(tmp_path / "log.csv", ["t", *names], table, form="%.12g")
    for text, asked in (("", "'lengths: q_meas_*'"), ("lengths: q_meas_*\n", "'orientation: [...]'")):
        (tmp_path / "map.yaml").write_text(text + "time: t\n")
        with pytest.raises(InputError, match=r"may be lengths or a quaternion: a map \(--fields\) must say") as refused:
            read_log(tmp_path / "log.csv", fields=tmp_path / "map.yaml")
        assert asked in str(refused.value)
    (tmp_path / "map.yaml").write_text("lengths: q_meas_*\norientation: [plat_q1, plat_q2, plat_q3, plat_q4]\n")
    read = read_log(tmp_path / "log.csv", fields=tmp_path / "map.yaml").measurements
    np.testing.assert_allclose(read.lengths, table[:, 1:5])
    np.testing.assert_allclose(read.poses[:, 3], 2 * np.arctan2(0.6, 0.8))
