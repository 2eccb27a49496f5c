"""Tables as instruments write them: Vicon, Qualisys, LabVIEW and TwinCAT Scope. Times and values are those written."""

import numpy as np
import pytest

from towline import InputError
from towline.estimation.logs.names import role
from towline.estimation.logs.opening import from_csv

LENGTHS = np.array([[2.0, 3.0], [2.1, 3.1], [2.3, 2.9], [2.6, 2.8]])
PLACES = np.array([[100.0, 20.0, 900.0], [110.0, 25.0, 905.0], [120.0, 30.0, 910.0]])  # [mm]
LABVIEW = """LabVIEW Measurement\t
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t,
Multi_Headings\tNo
X_Columns\t{columns}
Time_Pref\tRelative
Operator\tlab
Date\t2024/05/06
Time\t14:11:30,1234567890
***End_of_Header***\t
\t
Channels\t2\t\t
Samples\t4\t4\t
Date\t2024/05/06\t2024/05/06\t
Time\t14:11:30,123\t14:11:30,123\t
Y_Unit_Label\tMeters\tMeters\t
X_Dimension\tTime\tTime\t
X0\t0,0000000000000000E+0\t0,0000000000000000E+0\t
Delta_X\t0,020000\t0,020000\t
***End_of_Header***\t\t\t
"""


def columns(text):
    """The times of a table [s], and what else has a role, in SI units."""
    topic = from_csv(text.encode(), "table").topics[""]
    values = topic.read(list(topic.fields)).values
    found = dict(zip(topic.fields, values.T, strict=True))
    factors = {"mm": 1e-3, "ms": 1e-3, "deg": np.pi / 180}
    read = {name: factors.get(topic.fields[name], 1.0) * column for name, column in found.items() if role(name)}
    times = [column for name, column in read.items() if role(name).role == "time" and np.isfinite(column).any()]
    return times, read, topic.fields


def decimal_commas(rows):
    return "\n".join("\t".join(str(x).replace(".", ",") for x in row) for row in rows) + "\n"


@pytest.mark.parametrize("kind", ["One", "No", "Multi"])
def test_labview(kind):
    names = "X_Value\tLength 1\tLength 2\tComment\n"
    rows = [[0.02 * k if kind == "One" else "", *row] for k, row in enumerate(LENGTHS)]
    if kind == "Multi":  # the second channel began 10 ms earlier
        names = "X_Value\tLength 1\tX_Value\tLength 2\tComment\n"
        rows = [[0.02 * k, one, round(0.02 * k - 0.01, 9), two] for k, (one, two) in enumerate(LENGTHS)]
    (times,), read, _ = columns(LABVIEW.format(columns=kind) + names + decimal_commas(rows))
    np.testing.assert_allclose(times, [0, 0.02, 0.04, 0.06], atol=1e-12)
    np.testing.assert_allclose(read["Length 1"], LENGTHS[:, 0])
    second = LENGTHS[:, 1]
    expected = [*(second[:-1] + second[1:]) / 2, np.nan] if kind == "Multi" else second
    np.testing.assert_allclose(read["Length 2"], expected)


def test_twincat_scope():
    """Each channel has times of its own, here at another rate, so its values are interpolated."""
    above = [("Name", "Length1", "Length2"), ("SymbolComment", "", ""), ("Data-Type", "REAL64", "REAL64")]
    above += [("SampleTime[ms]", "10", "5"), ("Port", "851", "851"), ("Unit", "mm (Length)", "mm (Length)")]
    head = "Name\tScope Project\nFile\tC:\\log.csv\nStarttime of export\t13359\tMontag, 6. Mai 2024\t14:11:24.376\n\n\n"
    head += "".join(f"{name}\t{one}\t{name}\t{two}\n" for name, one, two in above) + "\n"
    lines = [[10 * k if k < 3 else "", 2000 + k if k < 3 else "", 5 * k, 3000 + k] for k in range(6)]
    (times,), read, units = columns(head + "\n".join("\t".join(map(str, row)) for row in lines) + "\n")
    np.testing.assert_allclose(times, [0, 0.01, 0.02])
    np.testing.assert_allclose(read["Length1"], [2.0, 2.001, 2.002])
    np.testing.assert_allclose(read["Length2"], [3.0, 3.002, 3.004])
    assert units["time"] == "ms"


def test_vicon():
    head = "Objects\n100\n,,Platform:Platform,,,,,,\nFrame,Sub Frame,RX,RY,RZ,TX,TY,TZ\n,,deg,deg,deg,mm,mm,mm\n"
    frames = (1, 2, 4)  # the third was lost
    lines = [f"{frame},0,1,2,3,{x},{y},{z}" for frame, (x, y, z) in zip(frames, PLACES, strict=True)]
    (times,), read, units = columns(head + "\n".join(lines) + "\n")
    np.testing.assert_allclose(times, [0.01, 0.02, 0.04])
    np.testing.assert_allclose(np.column_stack([read[f"Platform:Platform/T{axis}"] for axis in "XYZ"]), 1e-3 * PLACES)
    assert units["Platform:Platform/RX"] == "deg"


@pytest.mark.parametrize("end", ["", "\t"])
def test_qualisys(end):
    head = "NO_OF_FRAMES\t3\nNO_OF_CAMERAS\t8\nNO_OF_BODIES\t1\nFREQUENCY\t200\nDESCRIPTION\t--\n"
    head += "TIME_STAMP\t2024-05-06, 14:11:30.123\t12345.678\nDATA_INCLUDED\t6D\nBODY_NAMES\tplatform\n"
    head += "platform X\tY\tZ\tRoll\tPitch\tYaw\tResidual\tRot[0]\tRot[1]\n"
    lines = ["\t".join(map(str, [*place, 90, 0, 45, 0.4, 1, 0])) + end for place in PLACES]
    (times,), read, _ = columns(head + "\n".join(lines) + "\n")
    np.testing.assert_allclose(times, [0, 0.005, 0.01])
    np.testing.assert_allclose(np.column_stack([read[f"platform {axis}"] for axis in ("X", "Y", "Z")]), 1e-3 * PLACES)
    np.testing.assert_allclose(read["platform Roll"], np.pi / 2)
    np.testing.assert_allclose(read["platform Yaw"], np.pi / 4)


@pytest.mark.parametrize("text", ["0,2.1\n0.1,2.2\n", "# of today\n\n0,2.1\n0.1,2.2\n", "\n0,\n0.1,\n"])
def test_numbers_without_names(text):
    with pytest.raises(InputError, match=r"must have a header that names its columns, as in t .*, got numbers"):
        from_csv(text.encode(), "matrix.csv")
